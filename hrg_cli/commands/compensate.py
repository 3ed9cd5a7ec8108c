"""`hrg compensate`: a run's rate and angle after the tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import UsageError
from ..stages import earth_rate
from ..stages.compensate import compensate
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, make_command
from .one_stage import run_stage_on_files
from .options import make_flags


@make_command(
    "compensate",
    "hrg compensate wave.h5 --calibration calibration.h5 -o compensated.h5",
    flags=make_flags(compensate, "windows_per_increment", *earth_rate.OPTIONS),
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(
    run: Common,
    /,
    wave: OneFile = None,
    calibration: Annotated[
        Path | None, typer.Option(help="The tables to apply.", show_default=False)
    ] = None,
    **flags: Any,
) -> None:
    """Rate and angle of a run after the tables."""
    if calibration is None and not run.show_config:
        raise UsageError("no tables are named; add --calibration calibration.h5")
    run_stage_on_files(
        run, "compensate", [wave] if wave else [], beside={"calibration": calibration}, **flags
    )
