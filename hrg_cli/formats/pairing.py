"""Two channels in two files (a scope's CH1 and CH2, a lock-in's demodulators): one log of both,
their times held against each other."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import HrgError
from .log import ONE_DEMODULATOR, Array, Blocks, Log
from .log_columns import Roles, find_roles
from .unit_spellings import find_time_factor, is_time

Asked = dict[str, str | int | None]
STEPS = 1e-3
"""Difference of the two files' times, in sampling steps, that is still called none."""


def find_second_file(path: Path, s_file: str) -> Path:
    """The file of channel S of a log that keeps each channel in a file of its own.

    Parameters
    ----------
    path
        The log, which holds channel C.
    s_file
        A name beside the log (or from here), or OLD=NEW put into the log's own name.

    Returns
    -------
    Path
        A file that exists.

    Raises
    ------
    HrgError
        No such file, a rule that does not fit the log's name, or the log itself.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.formats.pairing import find_second_file
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     logs = [Path(folder) / f"run7_CH{k}.csv" for k in (1, 2)]
    ...     for log in logs:
    ...         log.touch()
    ...     find_second_file(logs[0], "CH1=CH2").name
    'run7_CH2.csv'
    """
    beside = path.parent / s_file
    named = beside if beside.exists() else Path(s_file)
    if not named.exists() and "=" in s_file:
        old, _, new = s_file.partition("=")
        if not old or old not in path.name:
            raise HrgError(
                f"{path}: s_file is {s_file!r}, but {old!r} is not part of its name; name the file"
                " of channel S"
            )
        named = path.with_name(path.name.replace(old, new))
    if not named.is_file():
        raise HrgError(f"{path}: there is no file {named} with its channel S; name it with s_file")
    if named.exists() and path.exists() and named.samefile(path):
        raise HrgError(
            f"{path}: s_file names the log itself; name the file of channel S, or the column with s"
        )
    return named


def find_partners(logs: Sequence[Path], s_file_of: Callable[[Path], str | None]) -> set[Path]:
    """Those of some logs that are the second file of another one of them.

    Parameters
    ----------
    logs
        All that were named.
    s_file_of
        A log -> its setting of `s_file`; None: it holds both channels.

    Returns
    -------
    set of Path
        The logs that are no runs of their own.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.formats.pairing import find_partners
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     logs = [Path(folder) / f"run7_CH{k}.csv" for k in (1, 2)]
    ...     for log in logs:
    ...         log.touch()
    ...     [log.name for log in find_partners(logs, lambda log: "CH1=CH2")]
    ['run7_CH2.csv']
    """
    found: set[Path] = set()
    for log in logs:
        s_file = s_file_of(log)
        if s_file is not None:
            with contextlib.suppress(HrgError):
                found.add(find_second_file(log, s_file).absolute())
    return {log for log in logs if log.absolute() in found}


def pair_logs(
    path: Path, log: Log, other_path: Path, other: Log, asked: Asked
) -> tuple[Log, Asked]:
    """Two logs of one channel each as one log, their times held against each other as they are
    read.

    Parameters
    ----------
    path
        Of the log of channel C.
    log
        As it was opened.
    other_path
        Of the log of channel S.
    other
        As it was opened.
    asked
        Role -> title or number (from 1) of its column.

    Returns
    -------
    tuple
        The log with the other's channel as its last column, and the columns by number.

    Raises
    ------
    HrgError
        One of them has times or both have different rates or starts; as they are read: times that
        differ by more than a thousandth of a step and their rounding, or one log that goes on.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli.formats.log import make_log
    >>> from hrg_cli.formats.pairing import pair_logs
    >>> one = make_log("bench", {"volt": np.ones(4)}, sample_rate_hz=1e4)
    >>> two = make_log("bench", {"volt": np.zeros(4)}, sample_rate_hz=1e4)
    >>> asked = dict.fromkeys(("time", "c", "s"))
    >>> log, found = pair_logs(Path("CH1.csv"), one, Path("CH2.csv"), two, asked)
    >>> [channel.name for channel in log.channels], found["c"], found["s"]
    (['volt', 'volt of CH2.csv'], 1, 2)
    """
    mine = find_roles(log, str(path), {**asked, "s": "none"})
    theirs = find_roles(other, str(other_path), _column_of_second(other, asked))
    _same_clock(path, log, mine, other_path, other, theirs)
    channel = other.channels[theirs.c]
    last = len(log.channels)

    def read(indexes: Sequence[int]) -> Blocks:
        if last not in indexes:
            yield from log.read(indexes)
            return
        own = [i for i in indexes if i != last]
        clocks = [] if mine.time is None else [mine.time]
        left = log.read([*own, *clocks])
        right = other.read([theirs.c, *([] if theirs.time is None else [theirs.time])])
        compare = _times_compared(path, log, mine, other_path, other, theirs)
        row = 0
        for a, b in _read_together(path, left, other_path, right):
            if clocks:
                compare(row, a[-1], b[1])
            row += len(b[0])
            columns = dict(zip(own, a))
            yield [b[0] if i == last else columns[i] for i in indexes]

    name = f"{channel.name} of {other_path.name}"
    joined = replace(
        log,
        channels=(*log.channels, replace(channel, name=name, rising=False)),
        read=read,
        reasons=tuple(r for r in log.reasons if r != ONE_DEMODULATOR),
    )
    time = asked["time"] if mine.time is None else mine.time + 1
    return joined, {**asked, "c": mine.c + 1, "s": last + 1, "time": time}


def _column_of_second(other: Log, asked: Asked) -> Asked:
    """What to look for in the second file: the column asked for as S, or the one that bears the
    name asked for as C."""
    names = {channel.name.lower() for channel in other.channels}
    c = asked["c"]
    alike = (
        c
        if (isinstance(c, int) and c <= len(names)) or (isinstance(c, str) and c.lower() in names)
        else None
    )
    wanted: Asked = dict.fromkeys(asked, "none")
    return wanted | {"c": asked["s"] if asked["s"] is not None else alike, "time": asked["time"]}


def _same_clock(
    path: Path, log: Log, mine: Roles, other_path: Path, other: Log, theirs: Roles
) -> None:
    """Both files have times, or both one and the same rate. HrgError otherwise."""
    if (mine.time is None) != (theirs.time is None):
        with_times, without = (other_path, path) if mine.time is None else (path, other_path)
        raise HrgError(
            f"{without}: has no times, {with_times} has; save both channels alike, or give time ="
            ' "none" and sample_rate_hz'
        )
    rates = (log.sample_rate_hz, other.sample_rate_hz)
    if mine.time is None and None not in rates and rates[0] != rates[1]:
        raise HrgError(
            f"{other_path}: is sampled at {rates[1]:g} Hz, {path} at {rates[0]:g} Hz; both channels"
            " of one recording were expected"
        )
    if log.start_time and other.start_time and log.start_time != other.start_time:
        raise HrgError(
            f"{other_path}: begins at {other.start_time}, {path} at {log.start_time}; both channels"
            " of one recording were expected"
        )


def _times_compared(path: Path, log: Log, mine: Roles, other_path: Path, other: Log, theirs: Roles):  # type: ignore[no-untyped-def]
    """A function that holds a block of one file's times against the other's."""
    if mine.time is None or theirs.time is None:
        return lambda row, ours, others: None
    factors = [
        _seconds(one, roles.time)
        for one, roles in ((log, mine), (other, theirs))
        if roles.time is not None
    ]
    rounding = max(log.quantum(mine.time) * factors[0], other.quantum(theirs.time) * factors[1])

    def compare(row: int, ours: Array, others: Array) -> None:
        a, b = np.asarray(ours, float) * factors[0], np.asarray(others, float) * factors[1]
        step = abs(a[-1] - a[0]) / max(1, len(a) - 1)
        apart = ~(
            np.abs(a - b) <= max(STEPS * step, 1.01 * rounding, 4 * np.spacing(np.abs(a[-1])))
        ) & ~(np.isnan(a) & np.isnan(b))
        if apart.any():
            at = int(np.argmax(apart))
            raise HrgError(
                f"{other_path}: {other.where(row + at)}: its time is {b[at]:.12g} s, that of {path}"
                f" is {a[at]:.12g} s; both channels of one recording were expected: save them from"
                " the same acquisition"
            )

    return compare


def _seconds(log: Log, index: int) -> float:
    """Seconds a unit of a time column, as far as it is told (the same for both files otherwise)."""
    channel = log.channels[index]
    known = channel.kind == "number" and is_time(channel.units)
    return channel.scale_factor * (find_time_factor(channel.units) if known else 1.0)


def _read_together(
    path: Path, left: Blocks, other_path: Path, right: Blocks
) -> Iterator[tuple[list[Array], list[Array]]]:
    """Blocks of both with the same rows, however each file is cut. HrgError: one ends before the
    other."""
    a: list[Array] | None = None
    b: list[Array] | None = None
    rows = 0
    while True:
        a = a if a is not None and len(a[0]) else next(left, None)
        b = b if b is not None and len(b[0]) else next(right, None)
        if a is None and b is None:
            return
        if a is None or b is None:
            short, longer = (path, other_path) if a is None else (other_path, path)
            raise HrgError(
                f"{short}: ends after {rows} samples, {longer} goes on; both channels of one"
                " recording were expected: save them again"
            )
        count = min(len(a[0]), len(b[0]))
        if count:
            yield [values[:count] for values in a], [values[:count] for values in b]
        rows += count
        a, b = [values[count:] for values in a], [values[count:] for values in b]
