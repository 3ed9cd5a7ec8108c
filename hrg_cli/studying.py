"""The body of `hrg study NAME`: run a study, write its figures as JSON and its pictures as PNG into a folder."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from .command import Common
from .errors import UsageError
from .reporting import console
from .store import atomic_path, check_output

STUDIES = {
    "gauss-newton": "gauss_newton",
    "redundancy": "redundancy",
    "identification": "identification",
    "diagnosis": "diagnosis",
}
"""Name on the command line -> module in `studies`, whose function NAME_study returns a result with `table`, `json` and `figures`."""


def run_study(name: str | None, run: Common) -> tuple[dict[str, Any], Callable[[], None]]:
    """Run the study; its JSON report and the function that shows its table."""
    if name not in STUDIES:
        raise UsageError(f"no study is called {name!r}; there are {', '.join(STUDIES)}")
    started = time.monotonic()
    module = STUDIES[name]
    study = getattr(import_module(f"hrg_cli.studies.{module}"), f"{module}_study")
    values = run.settings(study)
    folder = run.output
    if folder is not None:
        check_output(folder / "x", True) if folder.is_dir() else check_output(folder)
        folder.mkdir(exist_ok=True)
        check_output(folder / f"{name}.json", run.force)
    result = study(**values)
    report = {
        "kind": "study",
        "status": "valid",
        "status_reasons": [],
        "output": None if folder is None else str(folder),
        "elapsed_s": round(time.monotonic() - started, 3),
        "name": name,
        "settings": values,
        "result": result.json(),
    }
    if folder is not None:
        _write(folder, name, report, result.figures(), run.force)
    return report, lambda: _show(result)


def _write(folder: Path, name: str, report: dict[str, Any], figures: dict[str, Any], force: bool) -> None:
    for title, figure in figures.items():
        with atomic_path(folder / f"{name}-{title}.png", force) as temporary:
            figure.savefig(temporary, format="png", dpi=120)
    with atomic_path(folder / f"{name}.json", force) as temporary:
        temporary.write_text(json.dumps(console.clean(report), indent=1, ensure_ascii=False), encoding="utf-8")


def _show(result: Any) -> None:
    head, rows = result.table()
    console.print_table("", head, rows)
