"""Lines below the last row of a text log with which an instrument closes it: words, no samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from .left_out import NO_VALUE, LeftOut

WHY = "words below the last row"


def count_closing_lines(
    lines: Sequence[str],
    kinds: Sequence[str],
    cells_of: Callable[[str], list[str]],
    is_value: Callable[[str], bool],
) -> int:
    """How many of the last lines of a log close it, blank ones between them too.

    A line closes a log whose first cell is a word, as of a key with its value, unless it is a row:
    its columns of numbers hold values, or numbers alone follow the word. A cut row, and a row whose
    cell an instrument filled with a word for "no value", are samples: they are not passed over
    here.

    Parameters
    ----------
    lines
        The last lines of the log; where all of them close it, the last row is not among them and
        none is counted.
    kinds
        Of the columns: "text" or of values.
    cells_of
        Splits a line as the log's own rows are.
    is_value
        Whether a cell is a number or a time.

    Returns
    -------
    int
        Lines from the end on.

    Examples
    --------
    >>> from hrg_cli.formats.closing_lines import count_closing_lines
    >>> lines = ["0.1,2,3", "0.2,3,4", "", "stopped by hand"]
    >>> count_closing_lines(lines, ["number"] * 3, lambda line: line.split(","), str.isnumeric)
    1
    """
    closing = 0
    for count, line in enumerate(reversed(lines), start=1):
        whole = cells_of(line)
        cells = [cell for cell in whole if cell]
        if not cells:
            continue
        measured = [
            cell for cell, kind in zip(whole, kinds, strict=False) if kind != "text" and cell
        ]
        row = len(whole) == len(kinds) and bool(measured) and all(map(is_value, measured))
        broken_row = len(cells) > 2 and all(map(is_value, cells[1:]))
        if row or broken_row or is_value(cells[0]) or not _is_word(cells[0]):
            return closing
        closing = count
    return 0


def _is_word(cell: str) -> bool:
    return any(map(str.isalpha, cell)) and cell.lower().strip("#*<>-") not in NO_VALUE


def describe_closing(lines: Sequence[str], first_line: int) -> LeftOut:
    """The entry of what was left out for the lines that close a log.

    Parameters
    ----------
    lines
        The closing lines, of which at least one is not blank.
    first_line
        Number of the first of them, from 1.

    Returns
    -------
    LeftOut
        With the first words as its example; it counts as no lost samples.

    Examples
    --------
    >>> from hrg_cli.formats.closing_lines import describe_closing
    >>> told = describe_closing(["", "stopped by hand"], 120)
    >>> told.describe(), told.samples
    ("lines 120 to 121 (2 rows): words below the last row ('stopped by hand')", False)
    """
    told = next(line.strip() for line in lines if line.strip())
    return LeftOut(
        first_line, first_line + len(lines) - 1, len(lines), WHY, told[:40], samples=False
    )
