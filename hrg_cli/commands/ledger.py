"""`hrg ledger`: results of every gyro over time, and what a production line asks of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
import typer.core

from .. import store
from ..errors import UsageError
from ..ledger import database
from ..ledger.entering import enter
from ..ledger.entry import Entry
from ..ledger.exporting import FORMATS
from ..ledger.history import History
from ..ledger.history import tell_history as history_of
from ..ledger.overview import Overview, make_overview
from ..ledger.report import describe_entry, describe_history, describe_overview
from ..records.time_origin import parse_time
from ..reporting import console, ledger_tables
from .check import resolve_limits
from .frame import NO_DRAWS, ONE_PROCESS, Common, Files, make_command, need_inputs

Shown = tuple[dict[str, Any], Callable[[], None]]
Chosen = tuple[str | None, Sequence[str], str | None]
"""What is told of: kind, figures, since when."""


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
PAGE = ".html"
"""Suffix of an output that is a page for people."""
Limits = Annotated[
    Path | None,
    typer.Option(help="TOML file with limits, as for hrg check.", show_default=False),
]
Figures = Annotated[
    list[str] | None,
    typer.Option(
        "--figure",
        metavar="NAME",
        help="A figure to tell of, by its name in the JSON; may be repeated (default: those with"
        " limits, else with a σ).",
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
    "output": "File for the page (.html), the report (.json) or the results themselves (.jsonl,"
    " .csv, .parquet).",
    "config": "TOML file with more limits, over those of --limits.",
    "assignments": "Change one limit, e.g. resonator.scale_factor.minimum=0.5; may be repeated.",
    "show_config": "Print the limits as TOML and leave.",
    "strict": "A chart out of control or a gyro that left its history, too, ends with status 3.",
}


@make_command(
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
    given = {
        "station": station,
        "operator": operator,
        "fixture": fixture,
        "firmware": firmware,
        "order": order,
        "gyro_id": gyro_id,
    }
    run.finish(*_add_files(files or [], run, ledger, given))


@make_command(
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
    chosen = (kind.value if kind else None, figure or [], since)
    run.finish(*_show_ledger(run, ledger, limits, chosen, golden, guard_sigma, by.value))


@make_command(
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
    """Every result of one gyro, and how each figure moved: in σ, in shares of its limit, per
    day."""
    chosen = (kind.value if kind else None, figure or [], since)
    run.finish(*_show_history(run, gyro, ledger, limits, chosen, guard_sigma, by.value))


def _add_files(
    files: Sequence[Path], run: Common, ledger: Path, given: Mapping[str, str | None]
) -> Shown:
    """Enter files; the command's JSON."""
    started = time.monotonic()
    values = run.resolve_settings(enter, "ledger", **given)
    paths = need_inputs(files, "result files (resonator, calibration, diagnosis)")
    done = enter(ledger, paths, **values)
    report = {
        "kind": "ledger",
        "status": "valid",
        "status_reasons": [],
        "elapsed_s": round(time.monotonic() - started, 3),
        "ledger": str(ledger),
        "added": sum(new for _, new in done),
        "known": sum(not new for _, new in done),
        "files": [{**describe_entry(entry), "new": new} for entry, new in done],
    }

    def show() -> None:
        for path, (entry, new) in zip(paths, done, strict=True):
            said = "entered" if new else "known already by its SHA-256, not entered again"
            console.say(f"{path.name}: {entry.kind} of {entry.gyro_id}, {entry.status}: {said}")
        console.say(f"{ledger}: {report['added']} added, {report['known']} known")

    return run.write_report(report), show


def _show_ledger(
    run: Common,
    ledger: Path,
    limits: Path | None,
    chosen: Chosen,
    golden: str | None,
    guard_sigma: float,
    by: str,
) -> Shown:
    """Tell of all gyros; the command's JSON and its tables."""
    started = time.monotonic()
    wanted = _parse_wanted(run, limits)
    entries = _choose_entries(database.read_entries(ledger), chosen)
    found = make_overview(
        entries, limits=wanted, golden=golden, names=chosen[1], guard_sigma=guard_sigma, by=by
    )
    report = _judge_overview(found, started, ledger) | describe_overview(found)

    def page() -> str:
        from ..reporting.ledger_page import make_overview_page

        return make_overview_page(found, report["status"])

    return _hand_over(run, report, entries, page), lambda: ledger_tables.show_overview(found)


def _show_history(
    run: Common,
    gyro: str | None,
    ledger: Path,
    limits: Path | None,
    chosen: Chosen,
    guard_sigma: float,
    by: str,
) -> Shown:
    """Tell of one gyro; the command's JSON and its tables."""
    started = time.monotonic()
    wanted = _parse_wanted(run, limits)
    if gyro is None:
        raise UsageError("no gyro is named; name its serial number")
    entries = _choose_entries(database.read_entries(ledger), chosen)
    found = history_of(
        entries, gyro, limits=wanted, names=chosen[1], guard_sigma=guard_sigma, by=by
    )
    report = _judge_overview(found, started, ledger) | describe_history(found)

    def page() -> str:
        from ..reporting.ledger_page import make_history_page

        return make_history_page(found, report["status"])

    return _hand_over(run, report, found.entries, page), lambda: ledger_tables.show_history(found)


def _parse_wanted(run: Common, limits: Path | None) -> dict[str, Any]:
    wanted = resolve_limits(run, limits)
    if run.show_config:
        run.leave_with_settings(wanted)
    return wanted


def _choose_entries(entries: Sequence[Entry], chosen: Chosen) -> list[Entry]:
    """The results that are told of. UsageError: a time that is none."""
    kind, _, since = chosen
    try:
        first = parse_time(since) if since is not None else float("-inf")
    except ValueError as error:
        raise UsageError(
            f"--since {since!r}: a time such as 2026-05-01 or 2026-05-01T12:00:00Z was expected"
        ) from error
    return [e for e in entries if kind in (None, e.kind) and parse_time(e.processed) >= first]


def _judge_overview(found: Overview | History, started: float, ledger: Path) -> dict[str, Any]:
    """Refused where a gyro misses its limits, suspect where a chart is out of control or a gyro has
    left its own history."""
    status = "refused" if found.missed else "suspect" if found.doubts else "valid"
    return {
        "kind": "ledger",
        "status": status,
        "status_reasons": [*found.missed, *found.doubts],
        "elapsed_s": round(time.monotonic() - started, 3),
        "ledger": str(ledger),
    }


def _hand_over(
    run: Common,
    report: Mapping[str, Any],
    entries: Sequence[Entry],
    page: Callable[[], str],
) -> dict[str, Any]:
    """The report with its output: by the suffix the page, the results for other programs, else the
    report itself."""
    output = run.output
    if output is None or output.suffix not in (*FORMATS, PAGE):
        return run.write_report(report)
    content = page().encode() if output.suffix == PAGE else FORMATS[output.suffix](entries)
    with store.write_whole(output, run.force) as temporary:
        temporary.write_bytes(content)
    return {**report, "output": str(output)}


main = typer.core.TyperGroup(
    name="ledger",
    commands={"add": add, "show": show, "history": history},
    help="Every result of every gyro over time: drift, charts, capability, gauge study.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
