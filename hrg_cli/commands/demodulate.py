"""`hrg demodulate`: a recording's samples to signals per window."""

from __future__ import annotations

from typing import Any

from ..allocation import keep_freed
from ..stages.demodulate import demodulate
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, make_command
from .one_stage import run_stage_on_files
from .options import make_flags


@make_command(
    "demodulate",
    "hrg demodulate run.h5 -o periods.h5 --periods-per-window 50",
    flags=make_flags(demodulate, "periods_per_window", "nominal_frequency_hz", "from_s", "to_s"),
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(run: Common, /, recording: OneFile = None, **flags: Any) -> None:
    """Samples to signals per window: least squares at the oscillation frequency, which is found and
    followed."""
    keep_freed()
    run_stage_on_files(run, "demodulate", [recording] if recording else [], **flags)
