"""`hrg identify`: free run-downs to the resonator."""

from __future__ import annotations

from typing import Any

from ..stages import earth_rate
from ..stages.identify import identify
from .common import Common
from .frame import JOBS_OF_REHEARSAL, Files, Rehearsals, make_command
from .one_stage import run_stage_on_files
from .options import make_flags

FLAGS = (
    *("method", "rate_rad_s", "fit_rate", "scale_factor", "damping_axis_rad"),
    *("stiffness_axis_rad", "most_different", "bootstrap", "window", "profile", "eliminate_rate"),
    *earth_rate.OPTIONS,
)


@make_command(
    "identify",
    "hrg identify wave-*.h5 -o resonator.h5 --method all",
    flags=make_flags(identify, *FLAGS),
    says=JOBS_OF_REHEARSAL,
)
def main(run: Common, /, waves: Files = None, rehearse: Rehearsals = None, **flags: Any) -> None:
    """Resonator parameters from free run-downs: damping and frequency split, their axes, scale
    factor."""
    run_stage_on_files(run, "identify", waves or [], rehearse=rehearse, **flags)
