"""Logs in which a comma both separates the cells and marks the decimals: each number falls apart
into two cells that read as integers, and nothing tells for certain which belong together."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ..errors import HrgError

_WHOLE, _DIGITS = re.compile(r"[+-]?\d+"), re.compile(r"\d{3,}")
ROWS = 200
"""Rows looked at."""


def need_one_meaning(path: Path, titles: int, rows: Sequence[Sequence[str]]) -> None:
    """Refuse a log whose commas both separate cells and mark decimals.

    Each of its numbers falls apart into two cells of whole numbers. It is known by twice as many
    cells as titles, or by every second cell being written as the digits behind a decimal mark are:
    of one length, zeros in front.

    Parameters
    ----------
    path
        The log, for messages.
    titles
        How many titles it has.
    rows
        Its first rows, each the cells between commas.

    Raises
    ------
    HrgError
        The commas have two meanings; the sentence says how to write the log.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.errors import HrgError
    >>> from hrg_cli.formats.decimal_commas import need_one_meaning
    >>> need_one_meaning(Path("bench.csv"), 2, [["1", "25"], ["1", "20"]])
    >>> try:
    ...     need_one_meaning(Path("bench.csv"), 2, [["0", "125", "1", "250"]])
    ... except HrgError as error:
    ...     print(error)
    bench.csv: its commas both separate cells and mark decimals ('0,125,1,250' is 4 cells, ...
    """
    rows = rows[:ROWS]
    count = len(rows[0]) if rows else 0
    if count < 4 or count % 2 or not all(_WHOLE.fullmatch(cell) for row in rows for cell in row):
        return
    if 2 * titles != count and not _are_decimals(rows):
        return
    said = ",".join(rows[0])
    raise HrgError(
        f"{path}: its commas both separate cells and mark decimals ({said[:60]!r} is {count}"
        f" cells, or {count // 2} numbers); write decimals with points, or cells with semicolons"
    )


def _are_decimals(rows: Sequence[Sequence[str]]) -> bool:
    """Whether every second cell is the digits behind a decimal mark, in at least two columns beyond
    doubt: whole numbers have no zeros in front, and there is no −0."""
    whole, digits = (list(zip(*(row[first::2] for row in rows))) for first in (0, 1))
    if not all(len({len(c) for c in column}) == 1 for column in digits):
        return False
    if not all(_DIGITS.fullmatch(cell) for column in digits for cell in column):
        return False
    zeros = sum(any(cell.startswith("0") for cell in column) for column in digits)
    return zeros >= 2 or any("-0" in column for column in whole)
