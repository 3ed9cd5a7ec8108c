"""Rows above the first readable row of a text log: which of them are samples that cannot be read,
and which are titles or keys."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from .unit_spellings import is_unit

Class = Literal["otherwise", "broken", "shape", "words", ""]
Line = tuple[int, str]

NO_VALUE = (
    "overload",
    "overflow",
    "ovl",
    "ovf",
    "ol",
    "ovrflw",
    "err",
    "error",
    "invalid",
    "bad",
    "fault",
    "none",
    "void",
    "n/a",
    "?",
)
"""Words that instruments write where there is no value."""

FEWEST_OTHERWISE = 3
"""Rows of numbers written in another way from which the log is refused: they are samples, not an
instrument's own lines."""


@dataclass(frozen=True)
class LeftOut:
    """Rows of a log that were not taken: their first and last line (from 1), how many, why, and the
    first of them."""

    first_line: int
    last_line: int
    rows: int
    why: str
    example: str
    otherwise: bool = False
    """Whole rows of numbers, but with another separator or decimal sign."""
    samples: bool = True
    """Rows of samples that cannot be read, rather than words that an instrument closes a log
    with."""

    def describe(self) -> str:
        """What was left out, for a person."""
        lines = (
            f"line {self.first_line}"
            if self.rows == 1
            else f"lines {self.first_line} to {self.last_line}"
        )
        return (
            f"{lines} ({self.rows} {'row' if self.rows == 1 else 'rows'}): {self.why}"
            f" ({self.example!r})"
        )


def find_unread_rows(
    above: Sequence[Line],
    kinds: Sequence[str],
    cells_of: Callable[[str], list[str]],
    is_value: Callable[[str], bool],
    numbers_otherwise: Callable[[str], bool],
    beside_titles: Callable[[str], bool],
) -> list[tuple[Line, Class]]:
    """The lines straight above the first readable row of a log that are rows of samples.

    A row of titles may hold numbers, a row of units "1", and an instrument's keys stand with
    theirs: none of these is a sample.

    Parameters
    ----------
    above
        Number (from 0) and text of the lines, in the order of the file.
    kinds
        Of the columns: "text" or of values.
    cells_of
        Splits a line as the log's own rows are.
    is_value
        Whether a cell is a number or a time in any decimal sign.
    numbers_otherwise
        Whether a line is a whole row of numbers, written in another way.
    beside_titles
        Whether a cell names a key.

    Returns
    -------
    list of tuple
        The lines with their class, in the order of the file.

    Examples
    --------
    A lock-in that overloads at first writes a word where a sample was:

    >>> from hrg_cli.formats.left_out import find_unread_rows
    >>> above = [(0, "time,c,s"), (1, "0.0,OVL,0.5"), (2, "0.1,OVL,0.4")]
    >>> cells = lambda line: line.split(",")
    >>> value = lambda cell: cell.replace(".", "").isdigit()
    >>> no = lambda text: False
    >>> [number for (number, _), _ in find_unread_rows(above, ["number"] * 3, cells, value, no, no)]
    [1, 2]
    """
    found: list[tuple[Line, Class]] = []
    title = False
    for number, line in reversed(above):
        cells = cells_of(line)
        kind = _class(cells, len(kinds), is_value, numbers_otherwise(line))
        if kind == "broken" and (
            any(map(beside_titles, cells)) or all(not cell or is_unit(cell) for cell in cells)
        ):
            kind = ""
        if not kind:
            title = len(cells) == len(kinds) and all(cells) and not any(map(is_value, cells))
            break
        found.append(((number, line), kind))
    found.reverse()
    if sum(kind == "shape" for _, kind in found) < FEWEST_OTHERWISE:
        found = [item for item in found if item[1] != "shape"]
    if title:
        return found
    firsts = [cells_of(line)[0] for (_, line), _ in found]
    return [
        item
        for item, first in zip(found, firsts, strict=True)
        if item[1] != "broken" or not _is_key(first, firsts, is_value)
    ]


def _class(cells: list[str], count: int, is_value: Callable[[str], bool], otherwise: bool) -> Class:
    if otherwise:
        return "otherwise"
    if len(cells) != count:
        return "shape" if len(cells) > 1 and all(map(is_value, cells)) else ""
    if any(map(is_value, cells)):
        return "broken"
    return (
        "words"
        if all(
            not any(map(str.isalnum, cell)) or cell.lower().strip("#*<>-") in NO_VALUE
            for cell in cells
        )
        else ""
    )


def _is_key(first: str, firsts: list[str], is_value: Callable[[str], bool]) -> bool:
    """A word that stands once at the beginning of a line: a key with its value, or a title."""
    return bool(first) and not is_value(first) and firsts.count(first) == 1


def group_lines(found: Sequence[tuple[Line, Class]]) -> tuple[LeftOut, ...]:
    """What was left out, neighbouring lines of one class as one entry.

    Parameters
    ----------
    found
        Number (from 0) and text of each line, with its class.

    Returns
    -------
    tuple of LeftOut
        Lines are numbered from 1.

    Examples
    --------
    >>> from hrg_cli.formats.left_out import group_lines
    >>> lines = [((1, "0.0,OVL,0.5"), "broken"), ((2, "0.1,OVL,0.4"), "broken")]
    >>> [part.describe() for part in group_lines(lines)]
    ["lines 2 to 3 (2 rows): a cell is no number ('0.0,OVL,0.5')"]
    """
    why = {
        "otherwise": "rows of numbers, written in another way than the rows below",
        "broken": "a cell is no number",
        "shape": "another number of cells than in the rows below",
        "words": "no numbers",
    }
    groups: list[list[tuple[Line, Class]]] = []
    for item in found:
        if groups and groups[-1][-1][1] == item[1]:
            groups[-1].append(item)
        else:
            groups.append([item])
    return tuple(
        LeftOut(
            group[0][0][0] + 1,
            group[-1][0][0] + 1,
            len(group),
            why[group[0][1]],
            group[0][0][1].strip()[:40],
            group[0][1] == "otherwise",
        )
        for group in groups
    )
