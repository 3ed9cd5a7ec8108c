"""`hrg rate`: the rate that a run shows, the resonator as reference model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import UsageError
from ..stages import earth_rate
from ..stages.rate import rate
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, make_command
from .one_stage import run_stage_on_files
from .options import make_flags

FLAGS = (
    *("nodes", *earth_rate.OPTIONS),
    *("main_phase_error_rad", "quadrature_phase_error_rad", "loop_delay_s"),
)


@make_command(
    "rate",
    "hrg rate wave.h5 --resonator resonator.h5 -o rate.h5",
    flags=make_flags(rate, *FLAGS),
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(
    run: Common,
    /,
    wave: OneFile = None,
    resonator: Annotated[
        Path | None, typer.Option(help="The identified resonator, held.", show_default=False)
    ] = None,
    calibration: Annotated[
        Path | None,
        typer.Option(help="Tables of the gyro, whose rate is given beside.", show_default=False),
    ] = None,
    **flags: Any,
) -> None:
    """The rate a free or driven run shows, with the identified resonator as reference model."""
    if resonator is None and not run.show_config:
        raise UsageError("no resonator is named; add --resonator resonator.h5")
    run_stage_on_files(
        run,
        "rate",
        [wave] if wave else [],
        beside={"resonator": resonator, "calibration": calibration},
        **flags,
    )
