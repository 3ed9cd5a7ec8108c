"""The body of `hrg study NAME`: run a study, write its figures as JSON and its pictures as PNG into a folder."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

from ..errors import UsageError
from ..reporting import console
from ..store import atomic_path, check_output
from .frame import Common

STUDIES = {
    "gauss-newton": "gauss_newton",
    "redundancy": "redundancy",
    "identification": "identification",
    "diagnosis": "diagnosis",
}
"""Name on the command line -> module in `studies`: its function NAME_study gives plain figures, `figure` a picture of them."""


def run_study(name: str | None, run: Common) -> tuple[dict[str, Any], Callable[[], None]]:
    """Run the study; its JSON report and the function that shows its table."""
    if name not in STUDIES:
        raise UsageError(f"no study is called {name!r}; there are {', '.join(STUDIES)}")
    started = time.monotonic()
    module = import_module(f"hrg_cli.studies.{STUDIES[name]}")
    study = getattr(module, f"{STUDIES[name]}_study")
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
        "result": result,
    }
    if folder is not None:
        with atomic_path(folder / f"{name}.png", run.force) as temporary:
            module.figure(result).savefig(temporary, format="png", dpi=120)
        with atomic_path(folder / f"{name}.json", run.force) as temporary:
            temporary.write_text(json.dumps(console.clean(report), indent=1, ensure_ascii=False), encoding="utf-8")
    return report, lambda: console.print_table("", *(module.table(result) if hasattr(module, "table") else _flat(result)))


def _flat(result: dict[str, Any], prefix: str = "") -> tuple[tuple[str, str], list[tuple[str, Any]]]:
    """The plain figures of a result, nested names joined by dots."""
    rows: list[tuple[str, Any]] = []
    for key, value in result.items():
        if isinstance(value, dict):
            rows += _flat(value, f"{prefix}{key}.")[1]
        elif not isinstance(value, list):
            rows.append((f"{prefix}{key}", value))
    return ("figure", "value"), rows
