"""The bodies of the commands that only answer: `hrg effects`, `hrg info`."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .. import store
from ..reporting import answer_text, console, tables
from ..reporting.answer import answer
from .frame import Common, existing

RESULTS = ("diagnosis", "resonator", "calibration")
"""Kinds that have an answer; of the others the figures are told."""
Shown = tuple[dict[str, Any], Callable[[], None]]
"""A command's JSON, and what shows it to a person."""


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
            {
                "name": e.name,
                "family": e.family,
                "parameters": [p.name for p in e.parameters],
                "title": e.page.splitlines()[0],
            }
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
    found = (
        answer([store.read_any(path)], (), {record.kind: path.name})
        if record.kind in RESULTS
        else None
    )
    provenance = record.provenance
    report = {
        "kind": record.kind,
        "status": record.status,
        "status_reasons": list(record.status_reasons),
        "elapsed_s": round(time.monotonic() - started, 3),
        "facts": facts,
        "answer": found.json() if found else None,
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
        if found is not None:
            answer_text.show(found)
        console.print_table("", ("figure", "value"), list(facts.items()))
        for line in provenance.history:
            console.say(line)

    return run.kept(report), show
