"""`hrg update`: a calibration brought up to date by a resonator found later."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import UsageError
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, make_command
from .one_stage import run_stage_on_files


@make_command(
    "update",
    "hrg update calibration.h5 --resonator resonator.h5 -o updated.h5",
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(
    run: Common,
    /,
    calibration: OneFile = None,
    resonator: Annotated[
        Path | None,
        typer.Option(
            help="The resonator as it is now, of free windows in operation for instance.",
            show_default=False,
        ),
    ] = None,
    reference: Annotated[
        Path | None,
        typer.Option(
            help="The resonator when the tables were made: then only its change moves the tables.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """A calibration whose coefficients moved, brought up to date by a resonator found later; what
    moved is told in σ."""
    if resonator is None and not run.show_config:
        raise UsageError("no resonator is named; add --resonator resonator.h5")
    run_stage_on_files(
        run,
        "update",
        [calibration] if calibration else [],
        beside={"resonator": resonator, "reference": reference},
    )
