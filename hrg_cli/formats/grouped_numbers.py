"""Numbers with thousands separators: 825.540,123 as in Germany, 825,540.123 as in the US.

A mark before exactly three digits may be of thousands or of decimals. It is of thousands beyond
doubt where the decimal mark follows it or where it stands twice; one such number in a column tells
the others of it.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

HOW = "write numbers without thousands separators"
"""What to do about them."""


def _pattern(decimal: str, form: str) -> re.Pattern[str]:
    other = {".": ",", ",": "."}[decimal]
    return re.compile(form.replace("O", re.escape(other)).replace("D", re.escape(decimal)))


_CERTAIN = {
    sign: _pattern(sign, r"[+-]?[1-9]\d{0,2}(?:(?:O\d{3})+D\d+|(?:O\d{3}){2,})") for sign in ".,"
}
_GROUPED = {sign: _pattern(sign, r"[+-]?[1-9]\d{0,2}(?:O\d{3})+(?:D\d*)?") for sign in ".,"}


_DIGITS = re.compile("[+-]?\\d[\\d.,;'’ \u00a0\u202f]*")
"""Digits and all marks that stand between them anywhere; a semicolon where commas were taken for
separators."""


def is_grouped(cell: str, decimal: str) -> bool:
    """Whether a cell is a number with thousands separators beyond doubt.

    Parameters
    ----------
    cell
        Its text.
    decimal
        "." or ",".

    Returns
    -------
    bool
        False where the only mark may be one of decimals.

    Examples
    --------
    >>> from hrg_cli.formats.grouped_numbers import is_grouped
    >>> [is_grouped(cell, ",") for cell in ("825.540,1", "1.234.567", "1.234", "82.55,4")]
    [True, True, False, False]
    """
    return bool(_CERTAIN[decimal].fullmatch(cell))


def may_be_grouped(cell: str) -> bool:
    """Whether a cell is a number with a mark before three digits, whichever mark it is.

    Parameters
    ----------
    cell
        Its text.

    Returns
    -------
    bool
        True also for the numbers of `is_grouped`.

    Examples
    --------
    >>> from hrg_cli.formats.grouped_numbers import may_be_grouped
    >>> [may_be_grouped(cell) for cell in ("1.234", "1,234.5", "1.23", "OVL")]
    [True, True, False, False]
    """
    return any(pattern.fullmatch(cell) for pattern in _GROUPED.values())


def describe_unread(name: str, cell: str) -> str:
    """Why a column of digits is no column of numbers.

    Parameters
    ----------
    name
        The column's title.
    cell
        One of its cells.

    Returns
    -------
    str
        The end of a sentence, with what to do; empty where the cell holds words.

    Examples
    --------
    >>> from hrg_cli.formats.grouped_numbers import describe_unread
    >>> describe_unread("C", "1.234"), describe_unread("note", "ok")
    ("; 'C' holds '1.234', no number: write numbers without thousands ...", '')
    """
    if not _DIGITS.fullmatch(cell):
        return ""
    return f"; {name!r} holds {cell[:40]!r}, no number: {HOW}, or give separator and decimal"


def ungroup(cell: str, decimal: str) -> str:
    """A number's text with a decimal point and without thousands separators.

    Parameters
    ----------
    cell
        A number, with thousands separators or without.
    decimal
        "." or ",".

    Returns
    -------
    str
        Where the cell is no grouped number, its decimal comma is a point.

    Examples
    --------
    >>> from hrg_cli.formats.grouped_numbers import ungroup
    >>> ungroup("825.540,1", ","), ungroup("0,5", ",")
    ('825540.1', '0.5')
    """
    if is_grouped(cell, decimal):
        cell = cell.replace({".": ",", ",": "."}[decimal], "")
    return cell.replace(",", ".")


def parse_grouped(texts: Any, decimal: str) -> np.ndarray | None:
    """A column of numbers of which some have thousands separators.

    Parameters
    ----------
    texts
        pandas.Series of the cells (n,), NaN where there is none.
    decimal
        "." or ",".

    Returns
    -------
    ndarray or None
        Numbers (n,); None where a cell is no number, or none of the column tells for certain that
        its marks are of thousands.

    Examples
    --------
    >>> import pandas as pd
    >>> from hrg_cli.formats.grouped_numbers import parse_grouped
    >>> parse_grouped(pd.Series(["1.234,5", "2.500", "0,5"]), ",").tolist()
    [1234.5, 2500.0, 0.5]
    >>> parse_grouped(pd.Series(["2.500", "0,5"]), ",") is None
    True
    """
    import pandas as pd

    other = {".": ",", ",": "."}[decimal]
    texts = texts.str.strip()
    marked = texts.str.contains(other, regex=False, na=False)
    if marked.any():
        grouped = texts[marked]
        if not grouped.str.fullmatch(_CERTAIN[decimal]).any():
            return None
        if not grouped.str.fullmatch(_GROUPED[decimal]).all():
            return None
    plain = texts.str.replace(other, "", regex=False).str.replace(",", ".", regex=False)
    try:
        return pd.to_numeric(plain).to_numpy(float)
    except (ValueError, TypeError):
        return None
