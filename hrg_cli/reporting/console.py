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
    """One line on standard error, where progress and messages go.

    Parameters
    ----------
    text
        Folded to one line.

    Examples
    --------
    >>> import contextlib, io
    >>> from hrg_cli.reporting.console import tell
    >>> with contextlib.redirect_stderr(io.StringIO()) as shown:
    ...     tell("half done")
    >>> shown.getvalue().rstrip()
    'half done'
    """
    print(fold_line(text), file=sys.stderr, flush=True)


def say(text: str) -> None:
    """A line on standard output, without what would steer the terminal.

    Parameters
    ----------
    text
        Which a file may have brought.

    Examples
    --------
    >>> from hrg_cli.reporting.console import say
    >>> say("gyro " + chr(27) + "[31mred")
    gyro ...[31mred
    """
    print(clean_text(text))


def print_json(report: Mapping[str, Any]) -> None:
    """One JSON object on standard output; NaN and infinity become null.

    Parameters
    ----------
    report
        NumPy's numbers and arrays in it, too.

    Examples
    --------
    >>> from hrg_cli.reporting.console import print_json
    >>> print_json({"rate_rad_s": float("nan"), "runs": 2})
    {"rate_rad_s": null, "runs": 2}
    """
    print(json.dumps(clean(report), ensure_ascii=False, allow_nan=False))


def clean(value: Any) -> Any:
    """What JSON can hold of a value.

    Parameters
    ----------
    value
        Numbers and arrays of NumPy, mappings, lists.

    Returns
    -------
    object
        Python's own values; numbers that are not finite are None.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.reporting.console import clean
    >>> clean({"values": np.array([1.0, np.inf]), "count": np.int64(3)})
    {'values': [1.0, None], 'count': 3}
    """
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
    """A table on standard output; plain text where the output is not a terminal.

    Parameters
    ----------
    title
        Above it; empty: none.
    head
        Of the columns.
    rows
        Cells; columns of numbers stand to the right.

    Examples
    --------
    >>> import contextlib, io
    >>> from hrg_cli.reporting.console import print_table
    >>> with contextlib.redirect_stdout(io.StringIO()) as shown:
    ...     print_table("", ("parameter", "value"), [("K", 0.55), ("ν", None)])
    >>> [line.split() for line in shown.getvalue().splitlines()]
    [['parameter', 'value'], ['K', '0.55'], ['ν', '–']]
    """
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
    """A bar on a terminal, a plain line a tenth otherwise, nothing when quiet.

    Parameters
    ----------
    title
        What goes on.
    quiet
        Whether nothing is shown.

    Returns
    -------
    context manager
        Of a function that takes the share done, from 0 to 1; None: not known.

    Examples
    --------
    >>> import contextlib, io
    >>> from hrg_cli.reporting.console import show_progress
    >>> with contextlib.redirect_stderr(io.StringIO()) as shown:
    ...     with show_progress("simulate", quiet=False) as done:
    ...         done(0.05), done(0.31)
    (None, None)
    >>> shown.getvalue().rstrip()
    'simulate: 30 %'
    """
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
