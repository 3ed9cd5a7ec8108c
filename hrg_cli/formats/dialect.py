"""How a text log is written: encoding, separator, decimal sign, where its data begin, its column
titles and units."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import HrgError
from .clock import find_clock_kind
from .decimal_commas import need_one_meaning
from .grouped_numbers import is_grouped
from .left_out import FEWEST_OTHERWISE, LeftOut, find_unread_rows, group_lines
from .unit_spellings import is_unit, split_name

HEAD_BYTES = 1 << 18
CANDIDATES = (
    (",", "."),
    (";", "."),
    ("\t", "."),
    (";", ","),
    ("\t", ","),
    (",", ","),
    ("|", "."),
    (" ", "."),
    (" ", ","),
)
"""(separator, decimal sign) in the order of preference; a blank stands for any run of blanks."""
LOOKED_AT = 400
"""So many of the last lines of what is looked at tell the dialect."""
COMMENTS = ("#", "%", "!", "//", "*")
_NUMBER = re.compile(r"^[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?$")
_BESIDE_TITLES = re.compile(r"^(sequence|increment|t0\s*=.*|tinc\s*=.*)$", re.IGNORECASE)
"""Words by which a line of titles is known that is longer than the rows below it."""
_WORDS = ("nan", "inf", "infinity", "+inf", "-inf", "-nan", "na", "n/a", "null")


@dataclass(frozen=True)
class Dialect:
    """What was found in the first part of a text log."""

    encoding: str
    separator: str
    decimal: str
    first_line: int
    kinds: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    header: bool
    preamble: tuple[str, ...]
    comment: str | None
    quoted: bool
    sample: tuple[tuple[str, ...], ...]
    """The first rows as text."""
    left_out: tuple[LeftOut, ...] = ()
    """Rows above the first readable one that hold samples, and words below the last one."""
    end_line: int | None = None
    """The line (from 0) behind the last row, where words close the log."""


def find_encoding(head: bytes) -> str:
    """Encoding of a text log.

    Parameters
    ----------
    head
        Its first bytes; the last four may be half a character.

    Returns
    -------
    str
        By the byte-order mark; otherwise UTF-8, or Latin-1 where it is not UTF-8.

    Examples
    --------
    >>> from hrg_cli.formats.dialect import find_encoding
    >>> find_encoding("Zeit [µs];C".encode("latin-1")), find_encoding("Zeit;C".encode("utf-16"))
    ('latin-1', 'utf-16')
    """
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if head.startswith(b"\xef\xbb\xbf"):
        return "utf-8-sig"
    try:
        head[: max(0, len(head) - 4)].decode("utf-8")
        return "utf-8"
    except UnicodeDecodeError:
        return "latin-1"


def is_text(head: bytes) -> bool:
    """Whether a file can be a text log: no control bytes beside line ends and tabs.

    Parameters
    ----------
    head
        Its first bytes.

    Returns
    -------
    bool
        True for UTF-16 with its mark as well, whose every second byte is 0.

    Examples
    --------
    >>> from hrg_cli.formats.dialect import is_text
    >>> is_text(b"1.0,2.0"), is_text(bytes([137, 72, 68, 70, 0, 1]))
    (True, False)
    """
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return True
    control = sum(byte < 9 or 13 < byte < 32 for byte in head[:4096])
    return control == 0


def find_cell_kind(cell: str, decimal: str) -> str:
    """What a cell of a log holds.

    Parameters
    ----------
    cell
        Its text.
    decimal
        "." or ",".

    Returns
    -------
    str
        "number", "clock" or "date" as `find_clock_kind` has them, "" (empty) or "text"; NaN and
        infinity in words are numbers.

    Examples
    --------
    >>> from hrg_cli.formats.dialect import find_cell_kind
    >>> [find_cell_kind(cell, ",") for cell in ("1,5e-3", "1.5", "14:03:22,5", "nan", "")]
    ['number', 'text', 'clock', 'number', '']
    """
    if not cell:
        return ""
    if is_grouped(cell, decimal):
        return "number"
    text = cell
    if decimal == ",":
        if "." in cell or cell.endswith(",") or cell.count(",") > 1:
            return find_clock_kind(cell) or "text"
        text = cell.replace(",", ".")
    if _NUMBER.match(text) or text.lower() in _WORDS:
        return "number"
    return find_clock_kind(cell) or "text"


def split_line(line: str, separator: str) -> list[str]:
    """Cells of one line, quotes respected, blanks around them removed.

    Parameters
    ----------
    line
        Without its end.
    separator
        One character; a blank stands for any run of blanks.

    Returns
    -------
    list of str
        The cells.

    Examples
    --------
    >>> from hrg_cli.formats.dialect import split_line
    >>> split_line('0.1, "C, raw" ,2', ","), split_line("0.1   2", " ")
    (['0.1', 'C, raw', '2'], ['0.1', '2'])
    """
    if separator == " ":
        return line.split()
    if '"' in line:
        try:
            return [
                cell.strip()
                for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))
            ]
        except (csv.Error, StopIteration):
            pass
    return [cell.strip() for cell in line.split(separator)]


def sniff(
    path: Path, head: bytes, separator: str | None = None, decimal: str | None = None
) -> Dialect:
    r"""How a text log is written, from its first bytes.

    Each pair of separator and decimal sign is tried on the lines; the one by which most cells of
    equally long rows are numbers or times wins.

    Parameters
    ----------
    path
        The log, for messages.
    head
        Its first bytes, of which whole lines are looked at.
    separator, decimal
        As told; None: found.

    Returns
    -------
    Dialect
        Encoding, signs, titles, units, kinds of the columns, and where the rows begin.

    Raises
    ------
    HrgError
        It is empty, or holds no numbers.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.formats.dialect import sniff
    >>> head = b"t [ms];C [V];S [V]\n" + b"0,1;1,25;0,5\n0,2;1,20;0,4\n"
    >>> found = sniff(Path("bench.csv"), head)
    >>> found.separator, found.decimal, found.names, found.units
    (';', ',', ('t', 'C', 'S'), ('ms', 'V', 'V'))
    """
    encoding = find_encoding(head)
    text = head.decode(encoding, "replace")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if len(head) >= HEAD_BYTES and len(lines) > 1:
        lines = lines[:-1]
    shown = [
        (number, line)
        for number, line in enumerate(lines)
        if line.strip() and not _comment_of(line)
    ]
    if not any(line.strip() for line in lines):
        raise HrgError(f"{path}: is empty; a log with columns of numbers was expected")
    best: tuple[tuple[int, int], str, str, list[str]] | None = None
    rows = [line for _, line in shown][-LOOKED_AT:]
    for rank, (sep, dec) in enumerate(CANDIDATES):
        if (separator is not None and sep != separator) or (decimal is not None and dec != decimal):
            continue
        kinds, score = _columns(rows, sep, dec)
        if best is None or (score, -rank) > best[0]:
            best = ((score, -rank), sep, dec, kinds)
    if best is None and separator is not None:
        decimal = decimal or "."
        kinds, score = _columns(rows, separator, decimal)
        best = ((score, 0), separator, decimal, kinds)
    assert best is not None
    _, sep, dec, kinds = best
    if "number" not in kinds:
        raise _explain_no_numbers(path, shown)
    return _described(path, encoding, lines, shown, sep, dec, kinds)


def _explain_no_numbers(path: Path, shown: list[tuple[int, str]]) -> HrgError:
    """Why no dialect was found: nowhere a row, or many lines of words below the last one."""
    rows = [k for k, (_, line) in enumerate(shown) if _is_row(line)]
    if not rows or rows[-1] == len(shown) - 1:
        return HrgError(
            f"{path}: no line of numbers was found in it; a log with a row a sample was expected"
            " (a header alone is not enough)"
        )
    last, (number, line) = shown[rows[-1]][0], shown[rows[-1] + 1]
    return HrgError(
        f"{path}: its last row of numbers is line {last + 1}, and {len(shown) - rows[-1] - 1} lines"
        f" of words follow (line {number + 1}: {line.strip()[:30]!r}); cut it there or record it"
        " again"
    )


def _is_row(line: str) -> bool:
    """Whether a line is several numbers or times in any way of writing, and nothing else."""
    for separator, decimal in CANDIDATES:
        cells = split_line(line, separator)
        kinds = {find_cell_kind(cell, decimal) for cell in cells}
        if len(cells) > 1 and "number" in kinds and not kinds & {"text", ""}:
            return True
    return False


def _comment_of(line: str) -> str:
    line = line.lstrip()
    return next((mark for mark in COMMENTS if line.startswith(mark)), "")


def _columns(rows: list[str], separator: str, decimal: str) -> tuple[list[str], int]:
    """Kind of each column of the usual row, and how well the candidate explains the rows."""
    cells = [split_line(line, separator) for line in rows]
    if not cells:
        return [], -1
    kinds_of = [[find_cell_kind(cell, decimal) for cell in row] for row in cells]
    weight: Counter[int] = Counter()
    for row in kinds_of:
        weight[len(row)] += 1 + 4 * sum(kind in ("number", "clock", "date") for kind in row)
    count = max(weight, key=lambda n: (weight[n], n))
    matching = [row for row in kinds_of if len(row) == count]
    late = matching[len(matching) // 2 :]
    kinds = []
    for column in range(count):
        tally = Counter(row[column] for row in late if row[column])
        kinds.append(max(tally, key=lambda k: (tally[k], k != "text")) if tally else "")
    score = sum(
        (kind in ("number", "clock", "date")) - (kind == "text") for row in matching for kind in row
    )
    return kinds, score


def _first_line(shown: list[tuple[int, str]], sep: str, dec: str, kinds: list[str]) -> int:
    """The first line whose cells are of their columns' kinds: there the data begin."""
    for number, line in shown:
        cells = split_line(line, sep)
        if len(cells) == len(kinds) and all(
            kind not in ("number", "clock", "date") or find_cell_kind(cell, dec) in (kind, "")
            for cell, kind in zip(cells, kinds)
        ):
            return number
    raise AssertionError("the kinds were told by lines of data")


def _need_one_way(path: Path, left_out: Sequence[LeftOut], first: int, line: str) -> None:
    """HrgError: many rows before the data are numbers written in another way."""
    for rows in left_out:
        if rows.otherwise and rows.rows >= FEWEST_OTHERWISE:
            raise HrgError(
                f"{path}: its numbers are written in two ways: {rows.example!r} in line"
                f" {rows.first_line}, {line.strip()[:40]!r} in line {first + 1}; write all in one"
                f" way, or cut the log after line {rows.last_line}"
            )


def _described(
    path: Path,
    encoding: str,
    lines: list[str],
    shown: list[tuple[int, str]],
    sep: str,
    dec: str,
    kinds: list[str],
) -> Dialect:
    count = len(kinds)
    first = _first_line(shown, sep, dec, kinds)
    above = [(number, line) for number, line in enumerate(lines[:first]) if line.strip()]
    unread = find_unread_rows(
        [(number, line) for number, line in above if not _comment_of(line)],
        kinds,
        lambda line: split_line(line, sep),
        lambda cell: any(
            find_cell_kind(cell, sign) in ("number", "clock", "date") and cell.lower() not in _WORDS
            for sign in ".,"
        ),
        lambda line: _numbers_otherwise(line, sep, dec, count),
        lambda cell: bool(_BESIDE_TITLES.match(cell)),
    )
    left_out = group_lines(unread)
    _need_one_way(path, left_out, first, lines[first])
    unread_lines = {number for (number, _), _ in unread}
    titled = [item for item in above if item[0] not in unread_lines]
    names, units, header = _titles(titled, sep, dec, count)
    sample = tuple(
        tuple(cells)
        for _, line in shown
        if _ >= first and len(cells := split_line(line, sep)) == count
    )[:200]
    if sep == ",":
        need_one_meaning(path, _titles_of(titled, sep, dec), sample)
    inside = [_comment_of(line) for line in lines[first:] if line.strip() and _comment_of(line)]
    data = "\n".join(lines[first : first + 200])
    kinds = ["number" if kind == "" else kind for kind in kinds]
    return Dialect(
        encoding=encoding,
        separator=sep,
        decimal=dec,
        first_line=first,
        kinds=tuple(kinds),
        names=names,
        units=units,
        header=header,
        preamble=tuple(line for _, line in above),
        comment=inside[0][:1] if inside else None,
        quoted='"' in data,
        sample=sample,
        left_out=left_out,
    )


def _numbers_otherwise(line: str, separator: str, decimal: str, count: int) -> bool:
    """Whether a line is a row of numbers only, with another separator or decimal sign than the
    log's rows."""
    for sep, dec in CANDIDATES:
        if (sep, dec) != (separator, decimal):
            cells = split_line(line, sep)
            if len(cells) == count > 1 and all(
                find_cell_kind(cell, dec) in ("number", "clock", "date") for cell in cells
            ):
                own = split_line(line, separator)
                return len(own) != count or not all(
                    find_cell_kind(cell, decimal) in ("number", "clock", "date") for cell in own
                )
    own = split_line(line, separator)
    return (
        separator == ","
        and len(own) == 2 * count > 2
        and all(find_cell_kind(cell, ".") == "number" for cell in own)
    )


def _titles_of(above: list[tuple[int, str]], separator: str, decimal: str) -> int:
    """How many titles the last line above the data holds; 0 where it holds none."""
    line = above[-1][1] if above else ""
    cells = split_line(line.lstrip()[len(_comment_of(line)) :].strip(), separator)
    return len(cells) if any(find_cell_kind(cell, decimal) == "text" for cell in cells) else 0


def _titles(
    above: list[tuple[int, str]], sep: str, dec: str, count: int
) -> tuple[tuple[str, ...], tuple[str, ...], bool]:
    """Names and units of the columns from the lines above the data, nearest first; a row of units
    needs a row of names above it."""
    rows: list[list[str]] = []
    for _, line in reversed(above[-6:]):
        mark = _comment_of(line)
        cells = [
            cell.strip().strip('"')
            for cell in split_line(line.lstrip()[len(mark) :].strip() if mark else line, sep)
        ]
        while len(cells) > count and not cells[-1]:
            cells.pop()
        if len(cells) == count - 1 and count > 1:
            cells.append("")
        if len(cells) > count and any(_BESIDE_TITLES.match(cell) for cell in cells):
            cells = cells[:count]
        if len(cells) == count and any(find_cell_kind(cell, dec) == "text" for cell in cells):
            rows.append(cells)
        elif not mark:
            break
    if not rows:
        return tuple(f"column {i + 1}" for i in range(count)), ("",) * count, False
    sequence = rows[0][0].lower() == "sequence"
    if len(rows) > 1 and (sequence or all(is_unit(cell) or not cell for cell in rows[0])):
        units = [cell.strip("()[] ") if is_unit(cell) else "" for cell in rows[0]]
        rows = rows[1:]
    else:
        units = [""] * count
    names, own = zip(*(split_name(cell) for cell in rows[0]))
    return tuple(names), tuple(u or o for u, o in zip(units, own)), True
