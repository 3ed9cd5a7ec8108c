"""`hrg estimate`: the signals of windows to the wave."""

from __future__ import annotations

from typing import Any

from ..stages.estimate import estimate
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, command
from .one_stage import run_stage_on_files
from .options import flags_of


@command(
    "estimate",
    "hrg estimate periods.h5 -o wave.h5",
    flags=flags_of(estimate, "solver", "start", "carrier_phase_rad"),
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(run: Common, /, periods: OneFile = None, **flags: Any) -> None:
    """Signals to the wave: main amplitude, quadrature, wave angle and phases with standard
    deviations."""
    run_stage_on_files(run, "estimate", [periods] if periods else [], **flags)
