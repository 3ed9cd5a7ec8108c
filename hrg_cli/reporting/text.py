"""Text and numbers, safe to show on a page or a terminal."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from numbers import Real
from typing import Any

UNREADABLE = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ufffe\uffff\ud800-\udfff]"
)
"""Control characters (also those that move a terminal's cursor) and those that turn the direction
of text."""

FORMULA = ("=", "+", "-", "@", "＝", "＋", "－", "＠")
"""Signs that begin a formula in a spreadsheet."""
LONGEST_COMMENT = 300
"""Characters of a foreign text in a comment."""

LONGEST_PATH, LONGEST_WORD, LONGEST_LINE = 1024, 80, 400
"""Characters of a file's path, of any other word, of the words beside the paths."""


def clean_text(value: Any) -> str:
    """Text in which unreadable characters are a replacement mark.

    Parameters
    ----------
    value
        Anything that has a text.

    Returns
    -------
    str
        Without control characters, and without those that turn the direction of text.

    Examples
    --------
    >>> from hrg_cli.reporting.text import clean_text
    >>> clean_text("gyro" + chr(27) + "[2J"), clean_text(7)
    ('gyro�[2J', '7')
    """
    return UNREADABLE.sub("\ufffd", str(value))


def shorten(text: str, most: int) -> str:
    """Text of so many characters at most, without its middle where it is longer.

    Parameters
    ----------
    text
        Any.
    most
        Characters.

    Returns
    -------
    str
        Two parts of three from its beginning: a file's suffix, and what is to be done, stand at the
        end.

    Examples
    --------
    >>> from hrg_cli.reporting.text import shorten
    >>> shorten("a_long_name_of_a_recording.h5", 16)
    'a_long_nam…ng.h5'
    """
    head, tail = -(-most * 2 // 3) - 1, most // 3
    return text if len(text) <= most else f"{text[:head]}…{text[-tail:]}"


def fold_line(text: str) -> str:
    """A message as one line.

    Parameters
    ----------
    text
        Of any length and lines.

    Returns
    -------
    str
        A foreign word (a key of a damaged file) that would fill it is shown by its ends, and so is
        what is too long for a message; paths stay whole.

    Examples
    --------
    >>> from hrg_cli.reporting.text import fold_line
    >>> fold_line("the key " + 200 * "x" + chr(10) + "is unknown")[-20:]
    'xxxxxxxxx is unknown'
    """
    most = [LONGEST_PATH if os.sep in word else LONGEST_WORD for word in text.split()]
    words = [shorten(word, room) for word, room in zip(text.split(), most, strict=True)]
    paths = sum(len(word) for word in words if os.sep in word)
    return clean_text(shorten(" ".join(words), LONGEST_LINE + paths))


def take_first_paragraph(text: str | None) -> str:
    """What a docstring or a help text says first, in one line.

    Parameters
    ----------
    text
        None: there is none.

    Returns
    -------
    str
        Up to the first empty line.

    Examples
    --------
    >>> from hrg_cli.reporting.text import fold_line, take_first_paragraph
    >>> take_first_paragraph(fold_line.__doc__)
    'A message as one line.'
    """
    return " ".join((text or "").strip().split("\n\n")[0].split())


def escape_for_spreadsheet(value: Any) -> Any:
    """A cell that a spreadsheet shows and does not compute.

    Parameters
    ----------
    value
        Text, or a number, which stays one.

    Returns
    -------
    Any
        Text that would be taken for a formula has an apostrophe before it.

    Examples
    --------
    >>> from hrg_cli.reporting.text import escape_for_spreadsheet
    >>> (
    ...     escape_for_spreadsheet("=HYPERLINK(A1)"),
    ...     escape_for_spreadsheet("SN-1"),
    ...     escape_for_spreadsheet(-2),
    ... )
    ("'=HYPERLINK(A1)", 'SN-1', -2)
    """
    if not isinstance(value, str):
        return value
    text = clean_text(value)
    return f"'{text}" if text.lstrip()[:1] in FORMULA or text[:1] in ("\t", "\r", "\n") else text


def escape_c_comment(value: Any) -> str:
    """Text that stays inside a C comment.

    Parameters
    ----------
    value
        Anything that has a text.

    Returns
    -------
    str
        One line of ASCII, `LONGEST_COMMENT` characters at most, that neither ends the comment nor
        opens another.

    Examples
    --------
    >>> from hrg_cli.reporting.text import escape_c_comment
    >>> escape_c_comment("SN-1 */ int x; /*")
    'SN-1 * / int x; / *'
    """
    text = " ".join(clean_text(value).split())[:LONGEST_COMMENT]
    text = re.sub(r"/(?=\*)", "/ ", text)
    text = text.replace("\\", "/ ").encode("ascii", "replace").decode().replace("*/", "* /")
    return re.sub(r"\?(?=\?)", "? ", text)  # two in a row begin a trigraph


def drop_empty_columns(
    head: Sequence[str], rows: Sequence[Sequence[Any]]
) -> tuple[list[str], list[list[Any]]]:
    """A table without the columns in which nothing stands.

    Parameters
    ----------
    head
        Titles (k,).
    rows
        Rows of k cells; None, "" and a dash are nothing.

    Returns
    -------
    tuple
        Titles and rows of the columns that are left.

    Examples
    --------
    >>> from hrg_cli.reporting.text import drop_empty_columns
    >>> drop_empty_columns(["gyro", "lot", "K"], [["SN-1", "", 0.55], ["SN-2", None, "–"]])
    (['gyro', 'K'], [['SN-1', 0.55], ['SN-2', '–']])
    """
    kept = [k for k in range(len(head)) if any(row[k] not in (None, "", "–") for row in rows)]
    return [head[k] for k in kept], [[row[k] for k in kept] for row in rows]


def format_signed(value: Any, digits: int = 3) -> str:
    """A number as a person reads it, with its sign, plus too.

    Parameters
    ----------
    value
        As in `format_number`.
    digits
        Significant ones.

    Returns
    -------
    str
        0 has no sign.

    Examples
    --------
    >>> from hrg_cli.reporting.text import format_signed
    >>> format_signed(2.5), format_signed(-2.5), format_signed(0.0), format_signed(None)
    ('+2.5', '−2.5', '0', '–')
    """
    text = format_number(value, digits)
    return text if text[0] in "–−0" and not text.startswith("0.") else f"+{text}"


def format_hundredths(value: float) -> str:
    """A number of the size of one with two decimals.

    Parameters
    ----------
    value
        Finite.

    Returns
    -------
    str
        With a minus sign, not a hyphen.

    Examples
    --------
    >>> from hrg_cli.reporting.text import format_hundredths
    >>> format_hundredths(-0.5)
    '−0.50'
    """
    return f"{value:.2f}".replace("-", "−")


def format_number(value: Any, digits: int = 4) -> str:
    """A number as a person reads it.

    Parameters
    ----------
    value
        A number, or what is shown as a dash.
    digits
        Significant ones; zeros at the end are left out.

    Returns
    -------
    str
        Plain from 1e-4 up to 1e7, else times a power of ten; a dash for what is no finite number.

    Examples
    --------
    >>> from hrg_cli.reporting.text import format_number
    >>> format_number(0.000123456), format_number(-1.5e9), format_number(float("nan"))
    ('0.0001235', '−1.5×10⁹', '–')
    """
    if not isinstance(value, Real) or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = int(exponent)
    if -5 < power < 7:
        text = f"{float(f'{mantissa}e{power}'):.{max(digits - 1 - power, 0)}f}"
        text = text.rstrip("0").rstrip(".") if "." in text else text
    else:
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        text = f"{mantissa}×{format_power_of_ten(power)}"
    return text.replace("-", "−")


def format_power_of_ten(power: int) -> str:
    """Ten to a whole power, with raised digits.

    Parameters
    ----------
    power
        Any sign.

    Returns
    -------
    str
        For instance 10⁻⁶.

    Examples
    --------
    >>> from hrg_cli.reporting.text import format_power_of_ten
    >>> format_power_of_ten(-12)
    '10⁻¹²'
    """
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
