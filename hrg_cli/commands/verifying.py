"""The body of `hrg verify`: files and folders held against what was written."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from ..reporting import console
from .answering import Shown
from .frame import Common, existing


def verify_files(files: Sequence[Path], run: Common) -> Shown:
    """Verify; the command's JSON and its table."""
    from ..verification import report, verify

    started = time.monotonic()
    verdicts = verify(existing(files, "hrg files or their folder"))
    told = {**report(verdicts), "elapsed_s": round(time.monotonic() - started, 3)}

    def show() -> None:
        rows = [(v.name, v.kind, v.result, "; ".join([*v.findings, *v.notes])) for v in verdicts]
        console.print_table("", ("file", "kind", "result", "what"), rows)

    return run.kept(told), show
