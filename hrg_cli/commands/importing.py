"""The body of `hrg import`: a foreign log (or standard input) to a recording file."""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .. import pipeline, store
from ..formats import import_log, second_file
from ..records import Recording
from ..reporting.console import print_table
from .frame import Common, command_line, existing


def import_file(log: Path | None, run: Common, flags: Mapping[str, Any]) -> dict[str, Any]:
    """Read `log`, write the recording, return the command's JSON: what was taken, from where, what was left out."""
    started = time.monotonic()
    values = run.settings(import_log, "import", **flags)
    log = existing([log] if log else [], "a log, or - for standard input")[0]
    output = run.need_output("recording.h5")
    with _on_disk(log) as path:
        sources = [path] if values["s_file"] is None else [path, second_file(path, values["s_file"])]
        record = pipeline.write_first(
            output, import_log(path, **values), values, "import", sources, force=run.force, command_line=command_line()
        )
    with store.open_record(output, Recording) as whole:
        facts = {
            "run_id": whole.run_id,
            "samples": len(whole),
            "duration_s": float(whole.times(len(whole) - 1)[-1]),
            "sample_rate_hz": whole.sample_rate_hz,
            **{key: value for key, value in json.loads(whole.details).items() if key not in ("samples", "duration_s", "sample_rate_hz")},
        }
    return pipeline.report(record, output, started, facts)


def show(report: Mapping[str, Any]) -> None:
    """What was taken of the log, as a table for a person."""
    columns = report.get("columns") or {}
    rows: list[tuple[Any, ...]] = [(role, f"column {c['column']} ({c['name']})", c["units"] or "–") for role, c in columns.items()]
    if rows:
        print_table("", ("taken as", "of the log", "unit"), rows)
    names = {"samples": "samples", "rows": "rows", "sample_rate_hz": "rate, Hz", "duration_s": "length, s", "least_count": "least count"}
    facts: list[tuple[str, Any]] = [(text, report[key]) for key, text in names.items() if report.get(key) is not None]
    gaps, cut = report.get("gaps") or {}, report.get("cut")
    if gaps.get("count"):
        facts.append(("gaps", f"{gaps['count']}, the longest {gaps['longest_s']:.4g} s, the first before {gaps['first'][0]['before']}"))
    if cut:
        facts.append(("part taken, s of the log", f"{cut['first_s']:.6g} to {cut['last_s']:.6g}"))
    for part in report.get("left_out") or []:
        facts.append(("left out", f"lines {part['first_line']} to {part['last_line']} ({part['rows']} rows): {part['why']}"))
    print_table("", ("figure", "value"), facts)


@contextmanager
def _on_disk(log: Path) -> Iterator[Path]:
    """The log as a file: standard input is copied to a temporary one."""
    if str(log) != "-":
        yield log
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "standard-input"
        with open(path, "wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        yield path
