"""`hrg info`: what a file holds."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import store
from ..reporting import answer_text, console, figures_in_words, tables
from ..reporting.answer import answer
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, make_command, need_inputs, refuse_settings

LINES_OF_HISTORY = 3
"""Lines of the history that are told without --full: the last ones made this file."""
RESULTS = ("diagnosis", "resonator", "calibration")
"""Kinds that have an answer; of the others the figures are told."""


@make_command(
    "info",
    "hrg info wave.h5 --json",
    idle=NO_DRAWS
    | ONE_PROCESS
    | refuse_settings("a file is told as it is")
    | {"strict": "the status is told, not judged"},
    says={"output": "File to write the JSON report into."},
)
def main(
    run: Common,
    /,
    file: OneFile = None,
    full: Annotated[bool, typer.Option("--full", help="Print the whole history.")] = False,
) -> None:
    """What a file holds: kind, validity, history, sources, figures."""
    run.finish(*_tell_file(file, run, full), judged=False)


def _tell_file(
    file: Path | None, run: Common, full: bool = False
) -> tuple[dict[str, Any], Callable[[], None]]:
    """What a file holds. Its status is told, not judged: the command ends with 0 whatever it is."""
    started = time.monotonic()
    path = need_inputs([file] if file else [], "an hrg file")[0]
    with store.open_record(path, store.find_kind(path)) as record:
        facts = tables.list_facts(record)
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
        "answer": found.to_json() if found else None,
        "history": list(provenance.history),
        "created": provenance.created,
        "generated_by": provenance.generated_by,
        "sources": [vars(source) for source in provenance.sources],
    }

    def show() -> None:
        made = f"{provenance.generated_by or 'unknown'} {provenance.created}"
        console.say(f"{path}: {record.kind}, {record.status}, made by {made}")
        reasons = [f"{record.status}: {reason}" for reason in record.status_reasons]
        for reason in answer_text.list_untold(reasons, found.why if found is not None else ()):
            console.say(f"  {reason}")
        if found is not None:
            answer_text.show(found, path.parent)
        shown = {p.name for p in found.parameters} if found is not None else set()
        left = {name: value for name, value in facts.items() if name not in shown}
        console.print_table("", ("figure", "value"), figures_in_words.list_told(left))
        history = provenance.history
        told = history if full else history[-LINES_OF_HISTORY:]
        if len(told) < len(history):
            console.say(
                f"history: {len(history)} commands, the last {len(told)} of them (--full: all)"
            )
        for line in told:
            console.say(line)

    return run.write_report(report), show
