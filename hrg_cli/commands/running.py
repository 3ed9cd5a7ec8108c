"""The body of `hrg run`: the chain on one gyro's recordings into a folder, and a page about it."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .. import settings, store
from ..chain import run_chain
from ..errors import HrgError
from ..pipeline import STAGES
from ..reporting import console
from ..reporting.page import build_report
from .frame import Common, command_line, existing


def run_files(recordings: Sequence[Path], run: Common, part: Mapping[str, float | None]) -> dict[str, Any]:
    """Run the chain; the command's JSON. --config gives each stage's table, --set takes stage.key=value; `part`: where demodulate cuts."""
    started = time.monotonic()
    tables: dict[str, Any] = settings.load_toml(run.config) if run.config else {}
    for text in run.assignments:
        settings.assign(tables, *settings.parse_assignment(text))
    for key, value in part.items():
        if value is not None:
            settings.assign(tables, f"demodulate.{key}", value)
    for name, stage in STAGES.items():
        if run.seed is not None and settings.accepts(stage.function(), "seed"):
            settings.assign(tables, f"{name}.seed", run.seed)
    unknown = sorted(set(tables) - {*STAGES, "import"})
    if unknown:
        raise HrgError(f"{run.config or '--set'}: there is no stage {unknown[0]}; tables are {', '.join(['import', *STAGES])}")
    if run.show_config:
        whole = {name: settings.checked(stage.function(), tables.get(name, {})) for name, stage in STAGES.items()}
        run.leave_with_settings(whole)
    paths = existing(recordings, "the recordings of one gyro")
    folder = run.need_output("results/")
    if not folder.is_dir():
        store.check_output(folder)
        folder.mkdir()
    say = (lambda text: None) if run.quiet or run.json else console.message
    steps = run_chain(paths, folder, tables, force=run.force, command_line=command_line(), say=say, jobs=run.jobs)
    made = [folder / step.output for step in steps if step.status not in ("failed", "skipped")]
    page = folder / "report.html"
    if made:
        text = build_report([*(p for p in paths if p.suffix == ".h5"), *made])
        with store.atomic_path(page, run.force) as temporary:
            temporary.write_text(text, encoding="utf-8")
    failed = [step for step in steps if step.status == "failed"]
    if failed and not any(step.name in ("identify", "calibrate") and step.status != "failed" for step in steps):
        raise HrgError(failed[0].reasons[0])
    worst = "refused" if failed else max((s.status for s in steps if s.status != "skipped"), key=["valid", "suspect", "refused"].index)
    return {
        "kind": "run",
        "status": worst,
        "status_reasons": [f"{step.output}: {reason}" for step in steps for reason in step.reasons],
        "output": str(folder),
        "elapsed_s": round(time.monotonic() - started, 3),
        "steps": [dataclasses.asdict(step) for step in steps],
        "report": str(page) if made else None,
    }
