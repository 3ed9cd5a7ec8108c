"""A log whose last line was cut within its last number: a row with all its cells, and one wrong."""

from __future__ import annotations

from collections.abc import Sequence

from .left_out import LeftOut

FEWEST_OTHERS = 8
"""Rows above the last from which the digits of a log's numbers are known."""
SPARED = 1
"""Digits by which a number written without trailing zeros may be shorter than all others: one of a
hundred is by two."""


def is_cut_short(last: str, others: Sequence[str]) -> bool:
    """Whether the last number of a file that ends within a line has lost digits.

    Parameters
    ----------
    last
        It.
    others
        The numbers above it in its column.

    Returns
    -------
    bool
        Where all others have the same digits after the sign one less is enough.

    Examples
    --------
    >>> from hrg_cli.formats.cut_row import is_cut_short
    >>> others = [f"-0.31609{k}" for k in range(100, 120)]
    >>> is_cut_short("-0.3", others), is_cut_short("-0.3160911", others)
    (True, True)
    >>> is_cut_short("-0.31609117", others)
    False
    """
    if len(others) < FEWEST_OTHERS:
        return False
    lengths = [_count_digits(cell) for cell in others]
    spared = 0 if len(set(lengths)) == 1 else SPARED
    return _count_digits(last) < min(lengths) - spared


def _count_digits(cell: str) -> int:
    """Characters but the sign: a cut exponent is shorter, too."""
    return len(cell.strip().lstrip("+-"))


def describe_cut(line: str, number: int) -> LeftOut:
    """The entry of what was left out for the cut line.

    Parameters
    ----------
    line
        The line.
    number
        Of the line, from 1.

    Returns
    -------
    LeftOut
        Of one row.

    Examples
    --------
    >>> from hrg_cli.formats.cut_row import describe_cut
    >>> describe_cut("0.4,1.2533,-0.3", 401).describe()
    "line 401 (1 row): the file ends within its last number ('0.4,1.2533,-0.3')"
    """
    return LeftOut(number, number, 1, "the file ends within its last number", line)
