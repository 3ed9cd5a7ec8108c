"""`hrg ledger`: results of every gyro over time, and what a production line asks of them."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
import typer.core

from .frame import NO_DRAWS, ONE_PROCESS, Common, Files, command


class Kind(StrEnum):
    """Kinds of file that the ledger keeps."""

    resonator = "resonator"
    calibration = "calibration"
    diagnosis = "diagnosis"


class By(StrEnum):
    """What a gauge study and a golden unit compare."""

    station = "station"
    operator = "operator"
    fixture = "fixture"
    firmware = "firmware"


Ledger = Annotated[
    Path,
    typer.Option("--ledger", envvar="HRG_LEDGER", help="The ledger, an SQLite file."),
]
DEFAULT = Path("ledger.sqlite")
Limits = Annotated[
    Path | None,
    typer.Option(help="TOML file with limits, as for hrg check.", show_default=False),
]
Figures = Annotated[
    list[str] | None,
    typer.Option(
        "--figure",
        metavar="NAME",
        help="A figure to tell of; may be repeated (default: those with limits, else with a σ).",
        show_default=False,
    ),
]
OfKind = Annotated[
    Kind | None, typer.Option("--kind", help="Results of one kind alone.", show_default=False)
]
Guard = Annotated[
    float, typer.Option(min=0.0, help="Guard band inside every limit, in σ of measurement.")
]
Compared = Annotated[By, typer.Option("--by", help="What the gauge study compares.")]
Since = Annotated[
    str | None,
    typer.Option(
        metavar="TIME",
        help="Results processed since then alone, e.g. 2026-05-01.",
        show_default=False,
    ),
]
ASKING = {
    "output": "File for the report (.json) or the results themselves (.jsonl, .csv, .parquet).",
    "config": "TOML file with more limits, over those of --limits.",
    "assignments": "Change one limit, e.g. resonator.scale_factor.minimum=0.5; may be repeated.",
    "show_config": "Print the limits as TOML and leave.",
    "strict": "A chart out of control, too, ends with status 3.",
}


@command(
    "add",
    "hrg ledger add results/*.h5 --station 2 --operator ann",
    idle=NO_DRAWS | ONE_PROCESS | {"strict": "a result is entered whatever its status"},
    says={
        "output": "File to write the JSON report into.",
        "config": "TOML file whose table [ledger] says station, operator and so on.",
        "force": "Replace an existing report (a ledger is only ever added to).",
    },
)
def add(
    run: Common,
    /,
    files: Files = None,
    ledger: Ledger = DEFAULT,
    station: Annotated[
        str | None, typer.Option(help="Test station that measured.", show_default=False)
    ] = None,
    operator: Annotated[str | None, typer.Option(help="Who measured.", show_default=False)] = None,
    fixture: Annotated[
        str | None, typer.Option(help="Fixture that held the gyro.", show_default=False)
    ] = None,
    firmware: Annotated[
        str | None, typer.Option(help="Firmware of the gyro or station.", show_default=False)
    ] = None,
    order: Annotated[
        str | None, typer.Option(help="Work order (default: the lot).", show_default=False)
    ] = None,
    gyro_id: Annotated[
        str | None,
        typer.Option(help="Serial number where the files name none.", show_default=False),
    ] = None,
) -> None:
    """Enter resonator, calibration and diagnosis files, all or none; a file that is known by its
    SHA-256 is not entered again."""
    from .ledgering import add_files

    given = {
        "station": station,
        "operator": operator,
        "fixture": fixture,
        "firmware": firmware,
        "order": order,
        "gyro_id": gyro_id,
    }
    run.finish(*add_files(files or [], run, ledger, given))


@command(
    "show",
    "hrg ledger show --limits configs/limits.toml --golden SN-001",
    idle=NO_DRAWS | ONE_PROCESS,
    says=ASKING,
)
def show(
    run: Common,
    /,
    ledger: Ledger = DEFAULT,
    limits: Limits = None,
    kind: OfKind = None,
    figure: Figures = None,
    golden: Annotated[
        str | None,
        typer.Option(metavar="SN", help="Serial number of the golden unit.", show_default=False),
    ] = None,
    guard_sigma: Guard = 0.0,
    by: Compared = By.station,
    since: Since = None,
) -> None:
    """Every gyro's standing, and of every figure: control chart, capability Cp and Cpk, gauge
    study, risk of its limits; the golden unit's drift a station."""
    from .ledgering import show_ledger

    chosen = (kind.value if kind else None, figure or [], since)
    run.finish(*show_ledger(run, ledger, limits, chosen, golden, guard_sigma, by.value))


@command(
    "history",
    "hrg ledger history SN-017 --limits configs/limits.toml",
    idle=NO_DRAWS | ONE_PROCESS,
    says=ASKING,
)
def history(
    run: Common,
    /,
    gyro: Annotated[str | None, typer.Argument(metavar="SN", show_default=False)] = None,
    ledger: Ledger = DEFAULT,
    limits: Limits = None,
    kind: OfKind = None,
    figure: Figures = None,
    guard_sigma: Guard = 0.0,
    by: Compared = By.station,
    since: Since = None,
) -> None:
    """Every result of one gyro, and how each figure moved: in σ, in shares of its limit, a day."""
    from .ledgering import show_history

    chosen = (kind.value if kind else None, figure or [], since)
    run.finish(*show_history(run, gyro, ledger, limits, chosen, guard_sigma, by.value))


main = typer.core.TyperGroup(
    name="ledger",
    commands={"add": add, "show": show, "history": history},
    help="Every result of every gyro over time: drift, charts, capability, gauge study.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
