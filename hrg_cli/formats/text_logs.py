"""Text logs: CSV of any separator, of oscilloscopes and of lock-in amplifiers, streamed by blocks
with flat memory.

Every block is cut at a line end, its separators are counted line by line (a broken line is named by
its number), and pandas' C parser turns it into columns. Nothing is guessed after the first part of
the file: a later cell of another kind is an error.
"""

from __future__ import annotations

import codecs
import io
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import HrgError
from .clock import Clock, find_floating_quantum, find_quantum
from .closing_lines import count_closing_lines, describe_closing
from .cut_row import describe_cut, is_cut_short
from .dialect import HEAD_BYTES, Dialect, find_cell_kind, is_text, sniff, split_line
from .grouped_numbers import HOW, may_be_grouped, parse_grouped, ungroup
from .instruments import find_layout
from .log import Array, Blocks, Channel, Log, Reader
from .unpacked import open_unpacked, read_ends

BLOCK_BYTES = 8 << 20
LONGEST_LINE = 1 << 20
TAIL_BYTES = 4096
"""Where the last row and what closes a log is looked for."""


def _recognises(path: Path, head: bytes) -> bool:
    """Anything without control bytes is tried as text; this reader is the last one asked."""
    return is_text(head)


def _open_text(path: Path, separator: str | None = None, decimal: str | None = None) -> Log:
    """The log of a text file. HrgError: no numbers in it, or a line longer than any log has."""
    head, tail, size = read_ends(path, HEAD_BYTES, TAIL_BYTES)
    dialect = sniff(path, head, separator, decimal)
    _need_one_decimal(path, dialect)
    last = _last_lines(head, tail, dialect)
    dialect = _end_before_closing(path, dialect, last)
    if dialect.end_line is None and not tail.endswith((b"\n", b"\r", b"\n\0", b"\r\0")):
        dialect = _end_before_cut(path, dialect, last)
    rising = _rising(dialect)
    channels = tuple(
        Channel(
            name,
            unit,
            kind={"date": "clock"}.get(kind, kind),  # type: ignore[arg-type]
            rising=rising[i],
            example=dialect.sample[0][i] if dialect.sample else "",
        )
        for i, (name, unit, kind) in enumerate(zip(dialect.names, dialect.units, dialect.kinds))
    )
    layout = find_layout(path, dialect, channels)
    start = next(
        (
            Clock("date", row[i], str(path)).format_start_time()
            for row in dialect.sample[:1]
            for i, k in enumerate(dialect.kinds)
            if k == "date"
        ),
        "",
    )
    row_bytes = max(1, len(head) // max(1, head.count(b"\n")))
    return Log(
        format="text",
        channels=layout.channels,
        read=lambda indexes: _read(path, dialect, tuple(indexes)),
        rows=size // row_bytes,
        sample_rate_hz=layout.sample_rate_hz,
        start_time=start,
        header=dialect.header,
        quantum=lambda index: _quantum(dialect, last[-2:], index),
        where=lambda row: f"line {dialect.first_line + row + 1}",
        reasons=layout.reasons,
        left_out=dialect.left_out,
    )


def _need_one_decimal(path: Path, dialect: Dialect) -> None:
    """HrgError: a column of text is of numbers with the other decimal sign, so that the marks of
    all others may be of thousands. A label is the same in every row."""
    other = {".": ",", ",": "."}[dialect.decimal]
    for index, kind in enumerate(dialect.kinds):
        cells = {row[index] for row in dialect.sample}
        if kind != "text" or len(cells) < 2:
            continue
        if all(find_cell_kind(cell, other) == "number" for cell in cells):
            raise HrgError(
                f"{path}: {dialect.sample[0][index]!r} in column {index + 1}"
                f" ({dialect.names[index]}) has another decimal sign than the numbers beside it;"
                f" {HOW}, all in one way"
            )


def _last_lines(head: bytes, tail: bytes, dialect: Dialect) -> list[str]:
    """The lines that the last bytes hold whole, as text."""
    encoding = dialect.encoding
    if encoding == "utf-16":  # its order of bytes stands at the beginning of the file alone
        encoding = "utf-16-le" if head.startswith(codecs.BOM_UTF16_LE) else "utf-16-be"
    text = tail.decode(encoding, "replace").replace("\r\n", "\n")
    # a line ends where `_lines` ends it: letters of other encodings are no line ends
    lines = (text if "\n" in text else text.replace("\r", "\n")).removesuffix("\n").split("\n")
    return lines[1:] if len(tail) == TAIL_BYTES else lines


def _end_before_closing(path: Path, dialect: Dialect, last: Sequence[str]) -> Dialect:
    """The dialect with its end at the last row, where words close the log."""

    def is_value(cell: str) -> bool:
        return any(find_cell_kind(cell, sign) not in ("text", "") for sign in ".,")

    def cells_of(line: str) -> list[str]:
        comment = dialect.comment and line.lstrip().startswith(dialect.comment)
        return [] if comment else split_line(line, dialect.separator)

    closing = count_closing_lines(last, dialect.kinds, cells_of, is_value)
    if not closing:
        return dialect
    lines = _count_lines(path, dialect)
    told = describe_closing(last[-closing:], lines - closing + 1)
    return replace(dialect, left_out=(*dialect.left_out, told), end_line=lines - closing)


def _end_before_cut(path: Path, dialect: Dialect, last: Sequence[str]) -> Dialect:
    """The dialect with its end above the last line, where the file ends within a number of it."""
    rows = [split_line(line, dialect.separator) for line in last]
    whole = [row for row in rows if len(row) == len(dialect.kinds)]
    if not whole or whole[-1] is not rows[-1] or dialect.kinds[-1] == "text":
        return dialect
    if not is_cut_short(whole[-1][-1], [row[-1] for row in whole[:-1]]):
        return dialect
    lines = _count_lines(path, dialect)
    told = describe_cut(last[-1], lines)
    return replace(dialect, left_out=(*dialect.left_out, told), end_line=lines - 1)


def _count_lines(path: Path, dialect: Dialect) -> int:
    """Lines of the file, the last one whole or not."""
    lines = 0
    for number, block in _lines(path, dialect):
        lines = number + block.count(b"\n") + (not block.endswith(b"\n"))
    return lines


def _rising(dialect: Dialect) -> list[bool]:
    """Which number columns rise from row to row in the first rows."""
    rising = []
    for index, kind in enumerate(dialect.kinds):
        values = []
        if kind == "number":
            for row in dialect.sample:
                try:
                    values.append(float(ungroup(row[index], dialect.decimal)))
                except ValueError:
                    values.append(np.nan)
        rising.append(
            len(values) > 2 and bool(np.all(np.diff(values) >= 0)) and values[-1] > values[0]
        )
    return rising


def _quantum(dialect: Dialect, last: list[str], index: int) -> float:
    texts = [ungroup(row[index], dialect.decimal) for row in dialect.sample]
    texts += [
        ungroup(cells[index], dialect.decimal)
        for line in last
        if len(cells := split_line(line, dialect.separator)) == len(dialect.kinds)
    ]
    if dialect.kinds[index] != "number":
        return min((find_quantum(text) for text in texts if text), default=0.0)
    if any("e" in text.lower() for text in texts):
        return find_floating_quantum(texts)
    return min((step for text in texts if (step := find_quantum(text)) > 0), default=0.0)


def _lines(path: Path, dialect: Dialect) -> Iterator[tuple[int, bytes]]:
    """Blocks of whole lines (line number of the first, bytes in UTF-8 or Latin-1), from the first
    data line on to the last."""
    with open_unpacked(path) as file:
        decoder = (
            codecs.getincrementaldecoder("utf-16")("replace")
            if dialect.encoding == "utf-16"
            else None
        )
        left, number, started, first = b"", 0, False, True
        while True:
            chunk = file.read(BLOCK_BYTES)
            block = decoder.decode(chunk, final=not chunk).encode() if decoder else chunk
            if b"\r" in block and b"\n" not in block:
                block = block.replace(b"\r", b"\n")
            if first:
                block, first = block.removeprefix(codecs.BOM_UTF8), False
            block = left + block
            cut = block.rfind(b"\n") + 1
            if not chunk:
                cut = len(block)
            elif cut == 0 and len(block) > max(LONGEST_LINE, BLOCK_BYTES):
                raise HrgError(
                    f"{path}: line {number + 1} is longer than {LONGEST_LINE} bytes; a log has a"
                    " row a sample"
                )
            whole, left = block[:cut], block[cut:]
            if not started and whole:
                parts = whole.split(b"\n", dialect.first_line)
                whole, number, started = parts[-1], dialect.first_line, True
            lines = whole.count(b"\n")
            if dialect.end_line is not None and number + lines >= dialect.end_line:
                kept = max(0, dialect.end_line - number)
                whole = b"".join(line + b"\n" for line in whole.split(b"\n", kept)[:kept])
            if whole:
                yield number, whole
                number += lines
            if not chunk:
                return


def _read(path: Path, dialect: Dialect, indexes: tuple[int, ...]) -> Blocks:
    clocks: dict[int, Clock] = {}
    for number, block in _lines(path, dialect):
        _check_shape(path, dialect, number, block)
        frame = _parsed(path, dialect, indexes, number, block)
        if frame is None:
            continue
        columns: list[Array] = []
        for index in indexes:
            values = frame[index]
            if dialect.kinds[index] in ("clock", "date"):
                clock = clocks.get(index)
                if clock is None:
                    first = str(values.iloc[0])
                    clock = clocks[index] = Clock(
                        dialect.kinds[index], first, f"{path}: line {number + 1}"
                    )
                columns.append(clock.parse_seconds(values.to_numpy(object)))
            else:
                columns.append(values.to_numpy(float))
        yield columns


def _check_shape(path: Path, dialect: Dialect, number: int, block: bytes) -> None:
    """Every line has as many cells as the first rows; blank lines and comments may stand
    between."""
    if dialect.separator == " " or dialect.quoted:
        _check_shape_slowly(path, dialect, number, block)
        return
    raw = np.frombuffer(block, dtype=np.uint8)
    ends = np.flatnonzero(raw == 10)
    if len(raw) and (len(ends) == 0 or ends[-1] != len(raw) - 1):
        ends = np.append(ends, len(raw))
    places = np.flatnonzero(raw == ord(dialect.separator))
    counts = np.diff(np.searchsorted(places, ends), prepend=0)
    for row in np.flatnonzero(counts != len(dialect.kinds) - 1):
        start = ends[row - 1] + 1 if row else 0
        _judge_line(path, dialect, number + int(row), block[start : ends[row]])


def _check_shape_slowly(path: Path, dialect: Dialect, number: int, block: bytes) -> None:
    for row, line in enumerate(block.split(b"\n")):
        _judge_line(path, dialect, number + row, line)


def _judge_line(path: Path, dialect: Dialect, number: int, line: bytes) -> None:
    text = line.decode("latin-1").strip("\r\n")
    if not text.strip() or (dialect.comment and text.lstrip().startswith(dialect.comment)):
        return
    cells = split_line(text, dialect.separator)
    if len(cells) != len(dialect.kinds):
        raise HrgError(
            f"{path}: line {number + 1} has {len(cells)} cells ({text[:40]!r}), the lines above"
            f" have {len(dialect.kinds)}; the log is broken there: cut it before that line or"
            " record it again"
        )


def _parsed(path: Path, dialect: Dialect, indexes: tuple[int, ...], number: int, block: bytes):  # type: ignore[no-untyped-def]
    import pandas as pd

    numbers = {i: "float64" for i in indexes if dialect.kinds[i] == "number"}
    texts = {i: "str" for i in indexes if dialect.kinds[i] != "number"}
    options: dict = {  # type: ignore[type-arg]
        "sep": r"\s+" if dialect.separator == " " else dialect.separator,
        "header": None,
        "names": list(range(len(dialect.kinds))),
        "usecols": sorted(set(indexes)),
        "index_col": False,
        "decimal": dialect.decimal,
        "comment": dialect.comment,
        "na_values": ["NAN", "Nan", "NaN "],
        "engine": "c",
        "encoding": "latin-1",
        "skipinitialspace": True,
    }
    try:
        return pd.read_csv(io.BytesIO(block), dtype=numbers | texts, **options)
    except pd.errors.EmptyDataError:
        return None
    except (ValueError, OverflowError, pd.errors.ParserError) as error:
        grouped = _parsed_grouped(options, numbers, texts, block)
        if grouped is not None:
            return grouped
        _name_bad_cell(path, dialect, indexes, number, block)
        raise HrgError(
            f"{path}: after line {number + 1}: cannot be read as columns of numbers"
            f" ({str(error)[:100]})"
        ) from error


def _parsed_grouped(options: dict, numbers: dict, texts: dict, block: bytes):  # type: ignore[no-untyped-def, type-arg]
    """The block with numbers that have thousands separators; None where it holds others, too."""
    import pandas as pd

    try:
        kinds = dict.fromkeys(numbers, "str") | texts
        frame = pd.read_csv(io.BytesIO(block), dtype=kinds, **options)
    except (ValueError, OverflowError, pd.errors.ParserError):
        return None
    for index in numbers:
        values = parse_grouped(frame[index], options["decimal"])
        if values is None:
            return None
        frame[index] = values
    return frame


def _name_bad_cell(
    path: Path, dialect: Dialect, indexes: Sequence[int], number: int, block: bytes
) -> None:
    for row, line in enumerate(block.split(b"\n")):
        text = line.decode("latin-1").strip("\r\n")
        if not text.strip() or (dialect.comment and text.lstrip().startswith(dialect.comment)):
            continue
        cells = split_line(text, dialect.separator)
        for index in indexes:
            if (
                index < len(cells)
                and dialect.kinds[index] == "number"
                and find_cell_kind(cells[index], dialect.decimal) not in ("number", "")
            ):
                two = may_be_grouped(cells[index])
                found = "may be with thousands separators or without" if two else "is not a number"
                raise HrgError(
                    f"{path}: line {number + row + 1}: {cells[index][:40]!r} in column {index + 1}"
                    f" ({dialect.names[index]}) {found};"
                    f" {HOW if two else 'correct the line'}, or give separator and decimal"
                )


READER = Reader("text", _recognises, _open_text)
