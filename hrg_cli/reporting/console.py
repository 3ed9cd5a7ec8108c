"""What a person sees in the shell: results on standard output, progress and messages on standard
error."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from ..pipeline import Progress
from .text import clean_text, fold_line

NUMERAL = re.compile(r"(?:[−+-]?\d[\d.]*(?:\(\d+\))?(?:×10[⁻⁰¹²³⁴-⁹]+)?|–)?")
"""A number as `text.number` and `quantities.round_with_std` write it, a dash, or nothing."""


def tell(text: str) -> None:
    """One line on standard error."""
    print(fold_line(text), file=sys.stderr, flush=True)


def say(text: str) -> None:
    """A line on standard output, without what would steer the terminal."""
    print(clean_text(text))


def print_json(report: Mapping[str, Any]) -> None:
    """One JSON object on standard output; NaN and infinity become null."""
    print(json.dumps(clean(report), ensure_ascii=False, allow_nan=False))


def clean(value: Any) -> Any:
    """JSON-able: NumPy scalars and arrays as Python values, non-finite numbers as null."""
    if isinstance(value, Mapping):
        return {str(k): clean(v) for k, v in value.items()}
    if hasattr(value, "tolist"):
        return clean(value.tolist())
    if isinstance(value, list | tuple):
        return [clean(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def print_table(title: str, head: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """A table on standard output; plain text where the output is not a terminal."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for i, name in enumerate(head):
        words = i == 0 or any(
            isinstance(row[i], str) and not NUMERAL.fullmatch(row[i]) for row in rows
        )
        table.add_column(name, justify="left" if words else "right", overflow="fold")
    for row in rows:
        table.add_row(*(_format_cell(v) for v in row))
    console = Console(
        markup=False, highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 160
    )
    try:
        console.print(table)
    except SystemExit:  # rich's answer to a reader that left
        raise BrokenPipeError from None


def _format_cell(value: Any) -> str:
    """A number with as many digits as a person reads, anything else as text."""
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else "–"
    return clean_text(value)


@contextmanager
def show_progress(title: str, quiet: bool) -> Iterator[Progress]:
    """A bar on a terminal, a plain line a tenth otherwise, nothing when quiet."""
    if quiet:
        yield lambda share: None
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import Progress as Bar

        with Bar(console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(title, total=1.0)
            yield lambda share: bar.update(task, completed=share)
    else:
        said = [0]

        def line(share: float | None) -> None:
            tenth = 0 if share is None else int(share * 10)
            if tenth > said[0] and tenth < 10:
                said[0] = tenth
                tell(f"{title}: {tenth * 10} %")

        yield line
