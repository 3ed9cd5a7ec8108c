"""Lines that stand twice in a row in a text log: the second one is left out."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .even_times import RepeatedTimeError
from .left_out import LeftOut
from .log import Array, Blocks, Log
from .log_columns import Roles
from .readers import guard_reading
from .taken import FEW_ROWS, FEW_SHARE
from .timing import Timing, get_timing

WHY = "the same as the line above"


def time_rows(
    log: Log,
    roles: Roles,
    path: Path,
    time_units: str | None,
    clock_hz: float | None,
    given: float | None,
    tolerance: float,
) -> tuple[Log, Timing]:
    """The log without doubled lines, and how its rows become times.

    Parameters
    ----------
    log, roles, path, time_units, clock_hz, given, tolerance
        As `get_timing` takes them.

    Returns
    -------
    tuple
        The log as it was where no time is repeated, and the timing.

    Raises
    ------
    HrgError
        As `get_timing` does: also where rows of one time hold other values, or are many.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.formats.doubled_rows import time_rows
    >>> from hrg_cli.formats.log_columns import find_roles
    >>> from hrg_cli.formats.readers import open_log
    >>> lines = ("time,c,s", "0.0,1,2", "0.1,3,4", "0.1,3,4", "0.2,5,6")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "bench.csv"
    ...     with path.open("w") as file:
    ...         print(*lines, sep=chr(10), file=file)
    ...     log = open_log(path)
    ...     log, timing = time_rows(log, find_roles(log, "", {}), path, None, None, None, 1e-3)
    >>> log.left_out[0].describe(), timing.sample_rate_hz
    ("line 4 (1 row): the same as the line above ('time 0.1')", 10.0)
    """
    told = (time_units, clock_hz, given, tolerance)
    try:
        return log, get_timing(log, roles, path, *told)
    except RepeatedTimeError:
        assert roles.time is not None
        doubled = _find_doubled(log, roles.time, path) if log.format == "text" else []
        if not doubled:
            raise
    log = _leave_out(log, doubled)
    return log, get_timing(log, roles, path, *told)


def _find_doubled(log: Log, time: int, path: Path) -> list[tuple[int, float]]:
    """Row and time of every line that repeats the one above; none where a repeated time has other
    values, or where they are so many that the times rather are too coarse."""
    beside = [i for i, c in enumerate(log.channels) if c.kind != "text" and i != time]
    found: list[tuple[int, float]] = []
    last, row = np.full((1 + len(beside), 1), np.nan), 0
    with guard_reading(path, log.format):
        for columns in log.read([time, *beside]):
            rows = np.hstack([last, np.asarray(columns, float)])
            now, before = rows[:, 1:], rows[:, :-1]
            repeated = now[0] == before[0]
            same = ((now == before) | (np.isnan(now) & np.isnan(before))).all(axis=0)
            if (repeated & ~same).any():
                return []
            found += [(row + int(k), float(now[0, k])) for k in np.flatnonzero(repeated)]
            last, row = rows[:, -1:], row + now.shape[1]
    return found if len(found) <= max(FEW_ROWS, FEW_SHARE * row) else []


def _leave_out(log: Log, doubled: Sequence[tuple[int, float]]) -> Log:
    """The log without these rows."""
    gone = np.array([row for row, _ in doubled])
    above = gone - np.arange(len(gone))

    def read(indexes: Sequence[int]) -> Blocks:
        row = 0
        for columns in log.read(indexes):
            here = gone[(gone >= row) & (gone < row + len(columns[0]))] - row
            row += len(columns[0])
            yield [_without(column, here) for column in columns]

    def where(row: int) -> str:
        return log.where(row + int(np.searchsorted(above, row, "right")))

    lines = [(int(log.where(row).rpartition(" ")[2]), f"time {time:.10g}") for row, time in doubled]
    told = [LeftOut(line, line, 1, WHY, example, samples=False) for line, example in lines]
    return dataclasses.replace(log, read=read, where=where, left_out=(*log.left_out, *told))


def _without(column: Array, rows: Array) -> Array:
    return np.delete(column, rows) if len(rows) else column
