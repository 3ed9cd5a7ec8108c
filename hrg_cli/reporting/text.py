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
    """Text in which unreadable characters are a replacement mark."""
    return UNREADABLE.sub("\ufffd", str(value))


def shorten(text: str, most: int) -> str:
    """Text of so many characters at most, without its middle where it is longer: a file's suffix
    and what is to be done stand at the end."""
    head, tail = -(-most * 2 // 3) - 1, most // 3
    return text if len(text) <= most else f"{text[:head]}…{text[-tail:]}"


def fold_line(text: str) -> str:
    """A message as one line; a foreign word (a key of a damaged file) that would fill it is shown
    by its ends, and so is what is too long for a message."""
    most = [LONGEST_PATH if os.sep in word else LONGEST_WORD for word in text.split()]
    words = [shorten(word, room) for word, room in zip(text.split(), most, strict=True)]
    paths = sum(len(word) for word in words if os.sep in word)
    return clean_text(shorten(" ".join(words), LONGEST_LINE + paths))


def take_first_paragraph(text: str | None) -> str:
    """What a docstring or a help text says first, in one line."""
    return " ".join((text or "").strip().split("\n\n")[0].split())


def escape_for_spreadsheet(value: Any) -> Any:
    """A cell for a spreadsheet: text that it would take for a formula gets an apostrophe before it,
    which shows it as text."""
    if not isinstance(value, str):
        return value
    text = clean_text(value)
    return f"'{text}" if text.lstrip()[:1] in FORMULA or text[:1] in ("\t", "\r", "\n") else text


def escape_c_comment(value: Any) -> str:
    """Text that stays inside a C comment: one line of ASCII that neither ends the comment nor opens
    another."""
    text = " ".join(clean_text(value).split())[:LONGEST_COMMENT]
    text = re.sub(r"/(?=\*)", "/ ", text)
    text = text.replace("\\", "/ ").encode("ascii", "replace").decode().replace("*/", "* /")
    return re.sub(r"\?(?=\?)", "? ", text)  # two in a row begin a trigraph


def drop_empty_columns(
    head: Sequence[str], rows: Sequence[Sequence[Any]]
) -> tuple[list[str], list[list[Any]]]:
    """Heading and rows of a table without the columns in which nothing stands."""
    kept = [k for k in range(len(head)) if any(row[k] not in (None, "", "–") for row in rows)]
    return [head[k] for k in kept], [[row[k] for k in kept] for row in rows]


def format_signed(value: Any, digits: int = 3) -> str:
    """`format_number` with its sign, plus too."""
    text = format_number(value, digits)
    return text if text[0] in "–−0" and not text.startswith("0.") else f"+{text}"


def format_hundredths(value: float) -> str:
    """A number of the size of one with two decimals."""
    return f"{value:.2f}".replace("-", "−")


def format_number(value: Any, digits: int = 4) -> str:
    """A number as a person reads it: plain between 1e-4 and 1e7, else as a power of ten; a dash for
    anything else."""
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
    """10 to a whole power, with raised digits."""
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
