"""The bodies of `hrg ledger add`, `show` and `history`."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from .. import store
from ..errors import UsageError
from ..ledger import database
from ..ledger.entering import enter
from ..ledger.entry import Entry
from ..ledger.exporting import FORMATS
from ..ledger.history import History, history
from ..ledger.overview import Overview, overview
from ..ledger.report import head, of_history, of_overview
from ..ledger.times import moment
from ..reporting import ledger_tables
from .check import limits_of
from .frame import Common, existing

Shown = tuple[dict[str, Any], Callable[[], None]]
Chosen = tuple[str | None, Sequence[str], str | None]
"""What is told of: kind, figures, since when."""


def add_files(
    files: Sequence[Path], run: Common, ledger: Path, given: Mapping[str, str | None]
) -> Shown:
    """Enter files; the command's JSON."""
    started = time.monotonic()
    values = run.settings(enter, "ledger", **given)
    paths = existing(files, "result files (resonator, calibration, diagnosis)")
    done = enter(ledger, paths, **values)
    report = {
        "kind": "ledger",
        "status": "valid",
        "status_reasons": [],
        "elapsed_s": round(time.monotonic() - started, 3),
        "ledger": str(ledger),
        "added": sum(new for _, new in done),
        "known": sum(not new for _, new in done),
        "files": [{**head(entry), "new": new} for entry, new in done],
    }

    def show() -> None:
        for path, (entry, new) in zip(paths, done, strict=True):
            said = "entered" if new else "known already by its SHA-256, not entered again"
            print(f"{path.name}: {entry.kind} of {entry.gyro_id}, {entry.status}: {said}")
        print(f"{ledger}: {report['added']} added, {report['known']} known")

    return run.kept(report), show


def show_ledger(
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
    wanted = _wanted(run, limits)
    entries = _chosen(database.read(ledger), chosen)
    found = overview(
        entries, limits=wanted, golden=golden, names=chosen[1], guard_sigma=guard_sigma, by=by
    )
    report = _judged(found, started, ledger) | of_overview(found)
    return _handed(run, report, entries), lambda: ledger_tables.show_overview(found)


def show_history(
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
    wanted = _wanted(run, limits)
    if gyro is None:
        raise UsageError("no gyro is named; name its serial number")
    entries = _chosen(database.read(ledger), chosen)
    found = history(entries, gyro, limits=wanted, names=chosen[1], guard_sigma=guard_sigma, by=by)
    report = _judged(found, started, ledger) | of_history(found)
    return _handed(run, report, found.entries), lambda: ledger_tables.show_history(found)


def _wanted(run: Common, limits: Path | None) -> dict[str, Any]:
    wanted = limits_of(run, limits)
    if run.show_config:
        run.leave_with_settings(wanted)
    return wanted


def _chosen(entries: Sequence[Entry], chosen: Chosen) -> list[Entry]:
    """The results that are told of. UsageError: a time that is none."""
    kind, _, since = chosen
    try:
        first = moment(since) if since is not None else float("-inf")
    except ValueError as error:
        raise UsageError(
            f"--since {since!r}: a time such as 2026-05-01 or 2026-05-01T12:00:00Z was expected"
        ) from error
    return [e for e in entries if kind in (None, e.kind) and moment(e.processed) >= first]


def _judged(found: Overview | History, started: float, ledger: Path) -> dict[str, Any]:
    """Refused where a gyro misses its limits, suspect where a chart is out of control."""
    status = "refused" if found.missed else "suspect" if found.doubts else "valid"
    return {
        "kind": "ledger",
        "status": status,
        "status_reasons": [*found.missed, *found.doubts],
        "elapsed_s": round(time.monotonic() - started, 3),
        "ledger": str(ledger),
    }


def _handed(run: Common, report: Mapping[str, Any], entries: Sequence[Entry]) -> dict[str, Any]:
    """The report with its output: the results for other programs by the suffix, else the report
    itself."""
    output = run.output
    if output is None or output.suffix not in FORMATS:
        return run.kept(report)
    content = FORMATS[output.suffix](entries)
    with store.atomic_path(output, run.force) as temporary:
        temporary.write_bytes(content)
    return {**report, "output": str(output)}
