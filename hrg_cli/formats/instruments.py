"""What instruments write around their columns: layouts of oscilloscopes and lock-ins that say more
than a line of titles does.

A layout is told by its own words, never by a file's name alone; what is not known is read as plain
columns.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import HrgError
from .dialect import Dialect, split_line
from .log import ONE_DEMODULATOR, Channel
from .unit_spellings import find_time_factor

HEADER_BYTES = 1 << 16
_NUMBER = r"([+-]?\d[\d.]*(?:[eE][+-]?\d+)?)"


@dataclass(frozen=True)
class LogLayout:
    """The columns as the instrument meant them, its sampling rate where it is written, why the
    result may be doubted."""

    channels: tuple[Channel, ...]
    sample_rate_hz: float | None = None
    reasons: tuple[str, ...] = ()


def find_layout(path: Path, dialect: Dialect, channels: tuple[Channel, ...]) -> LogLayout:
    """The columns of a log as its instrument meant them.

    Parameters
    ----------
    path
        The log; a header file may lie beside it.
    dialect
        How it is written.
    channels
        The columns by their titles.

    Returns
    -------
    LogLayout
        The first known layout whose words are there; otherwise the columns as they are, with the
        rate and the units of the lines above them.

    Examples
    --------
    A time stamp of LabOne counts ticks of the instrument's clock:

    >>> from pathlib import Path
    >>> from hrg_cli.formats.dialect import sniff
    >>> from hrg_cli.formats.instruments import find_layout
    >>> from hrg_cli.formats.log import Channel
    >>> rows = ["chunk;timestamp;x;y", "0;100;1.5;0.5", "0;200;1.4;0.6", "0;300;1.3;0.7"]
    >>> dialect = sniff(Path("dev.csv"), chr(10).join(rows).encode())
    >>> found = find_layout(Path("dev.csv"), dialect, tuple(map(Channel, dialect.names)))
    >>> [(column.name, column.kind, column.units) for column in found.channels[:2]]
    [('chunk', 'text', ''), ('timestamp', 'number', 'ticks')]
    """
    nameless = tuple(
        replace(c, kind="text") if not c.name and not any(row[i] for row in dialect.sample) else c
        for i, c in enumerate(channels)
    )
    found = next(
        (layout for known in LAYOUTS if (layout := known(path, dialect, nameless)) is not None),
        None,
    )
    return found or LogLayout(_with_units(dialect, nameless), _preamble_rate(dialect))


def _columns_beside(
    path: Path, dialect: Dialect, channels: tuple[Channel, ...]
) -> LogLayout | None:
    """Tektronix TDS: key, value, blank, time, value in every row; the keys stand beside the first
    samples, one channel a file."""
    told = {row[0].lower(): row[1] for row in dialect.sample if len(row) > 4 and row[0]}
    if not {"record length", "sample interval"} <= set(told):
        return None
    full = [i for i in range(2, len(channels)) if all(row[i] for row in dialect.sample)]
    if len(full) != 2:
        return None
    named = {
        full[0]: Channel("time", told.get("horizontal units", "s"), rising=True, role="time"),
        full[1]: Channel(told.get("source", "channel"), told.get("vertical units", "")),
    }
    return LogLayout(tuple(named.get(i, replace(c, kind="text")) for i, c in enumerate(channels)))


def _sequence(path: Path, dialect: Dialect, channels: tuple[Channel, ...]) -> LogLayout | None:
    """Rigol DS1000Z: samples are numbered, start and increment stand beside the titles
    (X,CH1,CH2,Start,Increment)."""
    above = [
        [cell.lower() for cell in split_line(line, dialect.separator)] for line in dialect.preamble
    ]
    column = next((cells.index("increment") for cells in above if "increment" in cells), None)
    if column is None:
        return None
    steps = [
        step
        for cells in above
        if len(cells) > column and (step := _positive(cells[column].replace(",", ".")))
    ]
    if not steps:
        return None
    numbers = channels[0].name.lower() == "x"
    idle = [
        i
        for i, c in enumerate(channels)
        if c.name.lower() in ("start", "increment", "") or (numbers and i == 0)
    ]
    kept = (Channel(c.name, kind="text") if i in idle else c for i, c in enumerate(channels))
    return LogLayout(tuple(kept), 1 / steps[-1])


def _increment_in_title(
    path: Path, dialect: Dialect, channels: tuple[Channel, ...]
) -> LogLayout | None:
    """Rigol MSO5000: CH1(V),CH2(V),t0 = -1e-3, tInc = 1e-6 above rows without times."""
    found = next(
        (m for line in dialect.preamble if (m := re.search(rf"\btInc\s*=\s*{_NUMBER}", line))), None
    )
    step = None if found is None else _positive(found[1])
    if step is None:
        return None
    idle = re.compile(r"^(t0|tinc)\b", re.IGNORECASE)
    return LogLayout(
        tuple(replace(c, kind="text") if idle.match(c.name) else c for c in channels), 1 / step
    )


def _positive(text: str) -> float | None:
    """A number above zero whose inverse is a number too; None otherwise."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if 0 < value < math.inf and 1 / value < math.inf else None


def _data_below(path: Path, dialect: Dialect, channels: tuple[Channel, ...]) -> LogLayout | None:
    """Keysight Infiniium: a list of keys (XInc, XUnits, YUnits …) and the word Data: above times
    and values."""
    told = {
        cells[0].rstrip(":").lower(): cells[1:]
        for line in dialect.preamble
        if (cells := split_line(line, dialect.separator))
    }
    if "xinc" not in told or "data" not in told:
        return None
    first = 1 if channels[0].rising else 0
    units = {"volt": "V", "ampere": "A"}.get(next(iter(told.get("yunits", [])), "").lower(), "")
    named = [
        Channel(f"channel {i - first + 1}", units, kind=c.kind) for i, c in enumerate(channels)
    ]
    if first:
        named[0] = Channel(
            "time", next(iter(told.get("xunits", [])), "s"), rising=True, role="time"
        )
    return LogLayout(tuple(named), _preamble_rate(dialect))


def _header_file(path: Path, dialect: Dialect, channels: tuple[Channel, ...]) -> LogLayout | None:
    """Rohde & Schwarz RTO and RTE: NAME.Wfm.csv holds the values, NAME.csv beside it the keys
    (Resolution:1e-9:)."""
    beside = _find_header(path)
    if dialect.header or beside is None:
        return None
    with open(beside, encoding="latin-1") as file:
        told = {
            cells[0].lower(): cells[1:]
            for line in file.read(HEADER_BYTES).splitlines()
            if len(cells := line.strip().split(":")) > 1
        }
    step = _positive(next(iter(told.get("resolution", [])), ""))
    if step is None:
        return None
    sources = [name for name in told.get("multichannelsource", told.get("source", [])) if name]
    timed = len(channels) == len(sources) + 1 or channels[0].rising
    values = channels[1:] if timed else channels
    named = tuple(
        replace(c, name=sources[i] if i < len(sources) else c.name) for i, c in enumerate(values)
    )
    return LogLayout(
        (replace(channels[0], name="time", units="s", role="time"), *named) if timed else named,
        None if timed else 1 / step,
    )


def _find_header(path: Path) -> Path | None:
    """The header file of NAME.Wfm.csv; None where the name is another or there is none."""
    found = re.match(r"^(.*)\.wfm(\.csv)$", path.name, re.IGNORECASE)
    beside = None if found is None else path.with_name(f"{found[1]}{found[2]}")
    return beside if beside is not None and beside.is_file() else None


def _labone(path: Path, dialect: Dialect, channels: tuple[Channel, ...]) -> LogLayout | None:
    """Zurich Instruments LabOne: chunk;timestamp;… with time stamps in ticks of the instrument's
    clock."""
    names = [channel.name.lower() for channel in channels]
    if names[:2] != ["chunk", "timestamp"]:
        return None
    whole = all(row[1].isdigit() for row in dialect.sample)
    stamp = replace(channels[1], units="ticks" if whole else channels[1].units, role="time")
    reasons = (ONE_DEMODULATOR,) if "x" in names and "y" in names else ()
    return LogLayout((replace(channels[0], kind="text"), stamp, *channels[2:]), None, reasons)


LAYOUTS: tuple[Callable[[Path, Dialect, tuple[Channel, ...]], LogLayout | None], ...] = (
    _columns_beside,
    _sequence,
    _increment_in_title,
    _data_below,
    _header_file,
    _labone,
)


def _read_told(dialect: Dialect) -> Iterator[tuple[str, list[str]]]:
    """Key and values of every line above the data."""
    for line in dialect.preamble:
        cells = [
            cell.strip() for cell in re.split(r"[,;:=\t]", line.lstrip("#%!/* ")) if cell.strip()
        ]
        if len(cells) > 1:
            yield cells[0].lower(), cells[1:]


def _with_units(dialect: Dialect, channels: tuple[Channel, ...]) -> tuple[Channel, ...]:
    """Units that stand in a line of their own above (Tektronix: Vertical Units,V,V), where the
    titles have none."""
    told = next((values for key, values in _read_told(dialect) if key == "vertical units"), [])
    bare = [
        i
        for i, c in enumerate(channels)
        if c.kind == "number" and not c.units and c.name.lower() not in ("time", "")
    ]
    if not told or len(told) != len(bare):
        return channels
    units = dict(zip(bare, told))
    return tuple(replace(c, units=units.get(i, c.units)) for i, c in enumerate(channels))


def _preamble_rate(dialect: Dialect) -> float | None:
    """The sampling rate an instrument wrote above the data, where it did."""
    for key, values in _read_told(dialect):
        value = re.match(rf"^\s*{_NUMBER}\s*([a-zA-Zµ/]*)", values[0])
        if value is None:
            continue
        number = _positive(value[1])
        if number is None:
            continue
        unit = value[2] or next((c.strip("()[] ") for c in values[1:2]), "")
        if re.search(
            r"sampl\w*[ _]?(interval|period|time)|\bx?increment|\bxinc\b|\bdelta[ _]?[xt]|\bdt\b",
            key,
        ):
            try:
                return 1 / (number * find_time_factor(unit or "s"))
            except HrgError:
                return 1 / number
        if re.search(r"sampl\w*[ _]?(rate|frequency)|\bfs\b", key):
            factor = {"k": 1e3, "m": 1e6, "g": 1e9}.get(
                unit[:1].lower() if unit.lower() not in ("hz", "s/s") else "", 1.0
            )
            return number * factor
    return None
