"""The bodies of the commands that only answer: `hrg check`, `hrg effects`, `hrg info`."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .. import settings, store
from ..errors import UsageError
from ..reporting import console, tables
from .frame import Common, existing

Shown = tuple[dict[str, Any], Callable[[], None]]
"""A command's JSON, and what shows it to a person."""


def check_file(file: Path | None, limits: Path | None, run: Common) -> Shown:
    """Hold a file against limits: those of --limits, tables of --config over them, --set over both."""
    from ..limits import check

    started = time.monotonic()
    files = [path for path in (limits, run.config) if path is not None]
    if not files:
        raise UsageError("no limits are named; add --limits limits.toml")
    wanted: dict[str, Any] = {}
    for path in files:
        settings.merge(wanted, settings.load_toml(path))
    for text in run.assignments:
        settings.assign(wanted, *settings.parse_assignment(text))
    if run.show_config:
        run.leave_with_settings(wanted)
    rows = check(store.read_any(existing([file] if file else [], "an hrg file")[0]), wanted)
    passed = all(row.passed for row in rows)
    report = {
        "kind": "check",
        "status": "valid" if passed else "refused",
        "status_reasons": [row.sentence() for row in rows if not row.passed],
        "elapsed_s": round(time.monotonic() - started, 3),
        "passed": passed,
        "rows": [vars(row) for row in rows],
    }
    told = [(r.words[0], None, r.words[1]) if r.words else (r.value, r.minimum, r.maximum) for r in rows]
    lines = [(r.name, *figures, "yes" if r.passed else "NO") for r, figures in zip(rows, told)]
    return run.kept(report), lambda: console.print_table("", ("figure", "value", "minimum", "maximum", "passed"), lines)


def effects_page(name: str | None, run: Common) -> Shown:
    """The catalogue of effects, or one effect's page."""
    from ..effects import EFFECTS, page

    started = time.monotonic()
    report: dict[str, Any] = {"kind": "effects", "status": "valid", "status_reasons": []}
    if name is not None:
        text = page(name)
        report |= {"name": name, "page": text}
    else:
        listed = [
            {"name": e.name, "family": e.family, "parameters": [p.name for p in e.parameters], "title": e.page.splitlines()[0]}
            for e in EFFECTS
        ]
        text = "\n".join(f"{e['name']:30}{e['family']:12}{e['title']}" for e in listed)
        report |= {"effects": listed}
    report["elapsed_s"] = round(time.monotonic() - started, 3)
    return run.kept(report), lambda: print(text)


def info_file(file: Path | None, run: Common) -> Shown:
    """What a file holds. Its status is told, not judged: the command ends with 0 whatever it is."""
    started = time.monotonic()
    path = existing([file] if file else [], "an hrg file")[0]
    with store.open_record(path, store.kind_of(path)) as record:
        facts = tables.facts(record)
    provenance = record.provenance
    report = {
        "kind": record.kind,
        "status": record.status,
        "status_reasons": list(record.status_reasons),
        "elapsed_s": round(time.monotonic() - started, 3),
        "facts": facts,
        "history": list(provenance.history),
        "created": provenance.created,
        "generated_by": provenance.generated_by,
        "sources": [vars(source) for source in provenance.sources],
    }

    def show() -> None:
        made = f"{provenance.generated_by or 'unknown'} {provenance.created}"
        console.say(f"{path}: {record.kind}, {record.status}, made by {made}")
        for reason in record.status_reasons:
            console.say(f"  {record.status}: {reason}")
        console.print_table("", ("figure", "value"), list(facts.items()))
        for line in provenance.history:
            console.say(line)

    return run.kept(report), show
