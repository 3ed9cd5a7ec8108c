"""A foreign log as every reader hands it over: named channels of equal length, read block by
block."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import HrgError
from ..extras import tell_how_to_install
from .left_out import LeftOut

Array = np.ndarray
Blocks = Iterator[list[Array]]

ONE_DEMODULATOR = (
    "x and y of one demodulator are taken as the two channels; if they are the two phases of one"
    " pick-off, name the columns of both pick-offs with c and s"
)
"""Why a lock-in log of one demodulator is suspect."""

BLOCK_ROWS = 1 << 18
"""Rows read at once where the format lets us choose."""


@dataclass(frozen=True)
class Channel:
    """One column of a log: `number` values as they are, or `clock` times, which the reader hands
    over in seconds."""

    name: str
    units: str = ""
    kind: Literal["number", "clock", "text"] = "number"
    scale_factor: float = 1.0
    add_offset: float = 0.0
    rising: bool = False
    length: int | None = None
    sample_rate_hz: float | None = None
    """Its own rate, where a slow channel has one."""
    role: str = ""
    """What it is, where the format itself tells."""
    example: str = ""
    """Its first cell, of a log of text."""


@dataclass(frozen=True)
class Log:
    """An opened foreign log.

    read(indexes) yields blocks, each a list with one array a channel asked for. Channels that
    differ in length may be listed (`Channel.length`); asking for two of different length is an
    error the caller reports. `quantum` is the rounding step of a time column where the format shows
    it (text), in the column's own unit; `where` names a row for a person.
    """

    format: str
    channels: tuple[Channel, ...]
    read: Callable[[Sequence[int]], Blocks]
    rows: int | None = None
    sample_rate_hz: float | None = None
    clock_hz: float | None = None
    start_time: str = ""
    header: bool = True
    quantum: Callable[[int], float] = field(default=lambda index: 0.0)
    where: Callable[[int], str] = field(default=lambda row: f"row {row + 1}")
    reasons: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    """Rows of samples that cannot be read and are not handed over."""


@dataclass(frozen=True)
class Reader:
    """One foreign format: `recognises` looks at the first bytes (never at the suffix), `open` gives
    the log."""

    name: str
    recognises: Callable[[Path, bytes], bool]
    open: Callable[..., Log]


def make_log(
    format: str, arrays: Mapping[str, Array], units: Mapping[str, str] | None = None, **more: object
) -> Log:
    """A log over one-dimensional arrays, in memory or lazily sliced (h5py datasets).

    Parameters
    ----------
    format
        Its name.
    arrays
        Title -> values (n,) of a channel; lengths may differ.
    units
        Title -> unit, of those that have one.
    more
        Other fields of `Log`.

    Returns
    -------
    Log
        Its channels in the order of the arrays.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.log import make_log
    >>> log = make_log("bench", {"t": np.arange(4.0), "c": np.ones(4)}, {"t": "s"})
    >>> [(channel.name, channel.units, channel.rising) for channel in log.channels]
    [('t', 's', True), ('c', '', False)]
    >>> [[column.tolist() for column in block] for block in log.read([1, 0])]
    [[[1.0, 1.0, 1.0, 1.0], [0.0, 1.0, 2.0, 3.0]]]
    """
    units = units or {}
    values = list(arrays.values())
    channels = tuple(
        Channel(name, units.get(name, ""), rising=is_rising(value), length=len(value))
        for name, value in arrays.items()
    )

    def read(indexes: Sequence[int]) -> Blocks:
        chosen = [values[i] for i in indexes]
        for start in range(0, len(chosen[0]), BLOCK_ROWS):
            yield [np.asarray(v[start : start + BLOCK_ROWS]) for v in chosen]

    return Log(
        format=format,
        channels=channels,
        read=read,
        rows=max((len(v) for v in values), default=0),
        **more,  # type: ignore[arg-type]
    )


def is_rising(values: Array) -> bool:
    """Whether a column rises from row to row, as times do.

    Parameters
    ----------
    values
        (n,); the first 200 are looked at.

    Returns
    -------
    bool
        False for fewer than three rows, which tell nothing.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.log import is_rising
    >>> is_rising(np.array([0.0, 0.1, 0.3])), is_rising(np.array([0.0, 0.1, 0.1]))
    (True, False)
    """
    head = np.asarray(values[:200], dtype=float)
    return len(head) > 2 and bool(np.all(np.diff(head) > 0))


def need_library(name: str, path: Path) -> HrgError:
    """The error for an optional library that is not installed.

    Parameters
    ----------
    name
        Of the library.
    path
        The file that needs it.

    Returns
    -------
    HrgError
        Which says how to install it.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.formats.log import need_library
    >>> print(need_library("npTDMS", Path("run.tdms")))
    run.tdms: reading it needs npTDMS...
    """
    return HrgError(f"{path}: reading it needs {tell_how_to_install(name)}")
