"""Times that count from 1970: of a log that names no unit, their size tells it, and the first one
is the run's start."""

from __future__ import annotations

import dataclasses
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from .clock import DAY
from .log import Log
from .log_columns import Roles, TimingTold
from .readers import guard_reading
from .unit_spellings import find_time_factor, is_time

FIRST_S = datetime(1990, 1, 1, tzinfo=UTC).timestamp()
LAST_S = datetime(2100, 1, 1, tzinfo=UTC).timestamp()
"""Between these a time is one of a recording; 20 years of a clock that began with the run is
none."""
UNITS = ("s", "ms", "us", "ns")
"""That Unix times are counted in; the ranges of two do not meet."""


def find_unix_unit(time: float) -> str:
    """The unit in which a time since 1970 lies within those of recordings.

    Parameters
    ----------
    time
        A number of a log's time column.

    Returns
    -------
    str
        "s", "ms", "us" or "ns"; "" where it is no such time.

    Examples
    --------
    >>> from hrg_cli.formats.unix_time import find_unix_unit
    >>> find_unix_unit(1.76e9), find_unix_unit(1.76e12), find_unix_unit(12.5)
    ('s', 'ms', '')
    """
    return next((unit for unit in UNITS if _is_of_a_recording(time * find_time_factor(unit))), "")


def _is_of_a_recording(since_1970_s: float) -> bool:
    return FIRST_S <= since_1970_s < LAST_S


def recognise_unix_time(log: Log, roles: Roles, path: Path, told: TimingTold) -> Log:
    """The log with what its times since 1970 tell: the unit where none is named, the run's start
    where it has none.

    Parameters
    ----------
    log
        As it was opened.
    roles
        Which of its columns is what.
    path
        Of the log, for messages.
    told
        What was said of the times: a unit goes before the log's own, ticks of a clock begin
        anywhere.

    Returns
    -------
    Log
        As it was where its times begin elsewhere.

    Examples
    --------
    Milliseconds since 1970:

    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli.formats.log import make_log
    >>> from hrg_cli.formats.log_columns import TimingTold, find_roles
    >>> from hrg_cli.formats.unix_time import recognise_unix_time
    >>> times, rows = 1.76e12 + np.arange(9.0), np.zeros(9)
    >>> log = make_log("bench", {"t": times, "c": rows, "s": rows})
    >>> told = recognise_unix_time(log, find_roles(log, "bench", {}), Path("bench"), TimingTold())
    >>> told.channels[0].units, told.start_time
    ('ms', '2025-10-09T08:53:20Z')
    """
    if told.clock or (log.clock_hz and told.units is None):
        return log
    channels, start = list(log.channels), log.start_time
    for index in (roles.time, roles.auxiliary_time):
        if index is None or channels[index].kind != "number":
            continue
        channel = channels[index]
        if (told.units or channel.units) and (start or index != roles.time):
            continue  # unit and start are known
        first = _read_first(log, index, path) * channel.scale_factor
        unit = told.units or channel.units or find_unix_unit(first)
        if not is_time(unit) or find_time_factor(unit) >= DAY:
            continue  # days count from 1900 more often than from 1970
        if not _is_of_a_recording(first * find_time_factor(unit)):
            continue
        if unit != "s":  # which a column without a unit is read in anyway
            channels[index] = dataclasses.replace(channel, units=channel.units or unit)
        if index == roles.time:
            start = start or _format(first * find_time_factor(unit))
    return dataclasses.replace(log, channels=tuple(channels), start_time=start)


def _read_first(log: Log, index: int, path: Path) -> float:
    """A column's first number; NaN where it has none."""
    with guard_reading(path, log.format):
        for (times,) in log.read((index,)):
            numbers = np.asarray(times, float)
            numbers = numbers[np.isfinite(numbers)]
            if len(numbers):
                return float(numbers[0])
    return float("nan")


def _format(since_1970_s: float) -> str:
    """ISO 8601 text, to a microsecond."""
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=since_1970_s)
    return moment.isoformat().replace("+00:00", "Z")
