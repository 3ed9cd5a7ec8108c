"""`hrg estimate`: the signals of windows to the wave."""

from __future__ import annotations

from typing import Any

from ..stages.estimate import estimate
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, make_command
from .one_stage import run_stage_on_files
from .options import make_flags


@make_command(
    "estimate",
    "hrg estimate periods.h5 -o wave.h5",
    flags=make_flags(estimate, "solver", "start", "carrier_phase_rad", "rate_late_s"),
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(run: Common, /, periods: OneFile = None, **flags: Any) -> None:
    """Signals to the wave: main amplitude, quadrature, wave angle and phases with standard
    deviations."""
    run_stage_on_files(run, "estimate", [periods] if periods else [], **flags)
