"""From a time column to an even rate, or to times that are kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import HrgError
from .column_units import find_column_unit
from .even_times import TimeJudge
from .log import Log
from .log_columns import Roles, list_columns
from .readers import guard_reading
from .serial_days import are_days, describe_days, doubt_seconds
from .unit_spellings import find_time_factor


@dataclass(frozen=True)
class Timing:
    """How rows become times: an even rate, or the column's own times × factor."""

    sample_rate_hz: float | None
    factor: float
    first: float = 0.0
    reasons: tuple[str, ...] = ()


def get_timing(
    log: Log,
    roles: Roles,
    path: Path,
    time_units: str | None,
    clock_hz: float | None,
    given: float | None,
    tolerance: float,
) -> Timing:
    """How rows become times: by an even rate, or by times of their own.

    Times that are even within their own rounding and the tolerance become a rate, so that nothing
    has to be resampled where nothing is uneven.

    Parameters
    ----------
    log
        As it was opened.
    roles
        Which of its columns is what.
    path
        Of the log, for messages.
    time_units
        Of the time column; None: the log's own.
    clock_hz
        Rate of the clock whose ticks the column counts; None: the log's own.
    given
        Sampling rate [Hz] that was given; it goes before the log's times, which are only held
        against it.
    tolerance
        Part of a step by which even times may be off.

    Returns
    -------
    Timing
        With the reason why a given rate is doubtful.

    Raises
    ------
    HrgError
        Neither times nor a rate, times that do not rise, one row, or ticks of an unknown clock.

    Examples
    --------
    Even times become a rate; where a row is missing, the times are kept:

    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli.formats.log import make_log
    >>> from hrg_cli.formats.log_columns import find_roles
    >>> from hrg_cli.formats.timing import get_timing
    >>> def look(times):
    ...     rows = np.zeros(len(times))
    ...     log = make_log("bench", {"t": times, "c": rows, "s": rows}, {"t": "ms"})
    ...     roles = find_roles(log, "bench", {})
    ...     return get_timing(log, roles, Path("bench"), None, None, None, 1e-3)
    >>> even = np.arange(100) * 0.1
    >>> look(even).sample_rate_hz, look(np.delete(even, 50)).sample_rate_hz
    (10000.0, None)
    """
    if roles.time is None:
        rate = given or log.sample_rate_hz
        if rate is None:
            raise HrgError(
                f"{path}: neither a time column nor a sampling rate was found (columns:"
                f" {list_columns(log)}); give time or sample_rate_hz"
            )
        return Timing(float(rate), 1.0)
    channel = log.channels[roles.time]
    factor = _seconds_per_unit(log, roles.time, path, time_units, clock_hz)
    if given is not None:
        return _given(log, roles, path, factor, given)
    clocked = channel.kind == "clock" or clock_hz or log.clock_hz
    named = bool(time_units or channel.units or clocked)
    judge, spacing = _judge_times(log, roles.time, path, factor, named)
    rounding = log.quantum(roles.time) * (1.0 if channel.kind == "clock" else factor)
    # digits beyond those of a double say nothing: it tells a spreadsheet's days to 6e-7 s
    rounding = max(rounding, spacing)
    step, departure = judge.find_even_step(min(rounding, 0.5 * judge.mean_step))
    reasons = () if named else _doubt_seconds(path, judge.first, 1 / step)
    own = 2 * np.spacing(abs(judge.last))
    allowed = max(tolerance * step, min(rounding, 0.5 * step) * 0.51 + own, 2 * own)
    if departure <= allowed:
        rate = float(_nice(1 / step, step, judge.rows, rounding))
        return Timing(rate, factor, judge.first, reasons)
    return Timing(None, factor, judge.first, reasons)


def _judge_times(
    log: Log, column: int, path: Path, factor: float, named: bool
) -> tuple[TimeJudge, float]:
    """All times, judged, and the spacing of the floating-point numbers that hold them [s]."""
    scale, kind = log.channels[column].scale_factor, np.dtype(float)
    judge = TimeJudge(str(path), log.where, named)
    with guard_reading(path, log.format):
        for (times,) in log.read((column,)):
            kind = times.dtype if times.dtype == np.float32 else kind
            judge.add(np.asarray(times, float) * factor * scale)
    if judge.rows == 0:
        raise HrgError(f"{path}: holds no rows of numbers; record again")
    if judge.rows == 1:
        raise HrgError(
            f"{path}: holds one sample only; a sampling rate cannot be found: give sample_rate_hz"
        )
    largest = max(abs(judge.first), abs(judge.last))
    return judge, float(np.spacing(kind.type(largest)))


def _doubt_seconds(path: Path, first: float, rate_hz: float) -> tuple[str, ...]:
    """What speaks against times without a unit being seconds. HrgError: they are days."""
    doubts = tuple(doubt_seconds(rate_hz))
    if doubts and are_days(first):
        raise HrgError(f"{path}: {describe_days(first, f'a rate of {rate_hz:.4g} Hz')}")
    return doubts


def doubt_rate(timing: Timing, nominal_frequency_hz: float | None, readout: str) -> list[str]:
    """Whether samples come too seldom for the oscillation that is said to be in them, as they do
    where times in ms are taken for s.

    Parameters
    ----------
    timing
        Of the rows.
    nominal_frequency_hz
        Of the oscillation; None: nothing is said.
    readout
        Of a read-out by carrier nothing can be said.

    Returns
    -------
    list of str
        One sentence, or none.

    Examples
    --------
    >>> from hrg_cli.formats.timing import Timing, doubt_rate
    >>> [len(doubt_rate(Timing(hz, 1.0), 203.7, "direct")) for hz in (2000.0, 2.0)]
    [0, 1]
    """
    rate = timing.sample_rate_hz
    if rate is None or nominal_frequency_hz is None or readout != "direct":
        return []
    if rate > 2 * nominal_frequency_hz:
        return []
    return [
        f"by its times the samples come at {rate:g} Hz, too seldom for an oscillation at"
        f" {nominal_frequency_hz:g} Hz: give time_units, where they are not in s, or sample_rate_hz"
    ]


def _seconds_per_unit(
    log: Log, column: int, path: Path, time_units: str | None, clock_hz: float | None
) -> float:
    """Seconds in a unit of the time column. HrgError: it counts ticks of an unknown clock."""
    channel = log.channels[column]
    if channel.kind == "clock":
        return 1.0
    if clock_hz or (log.clock_hz and time_units is None):
        return 1.0 / (clock_hz or log.clock_hz or 1.0)
    if channel.units.lower() in ("ticks", "tick"):
        raise HrgError(
            f"{path}: its time column counts ticks of the instrument's clock; give clock_hz (ticks"
            " a second; 60e6 for an MFLI)"
        )
    return find_time_factor(find_column_unit(str(path), "time", column, channel, time_units))


def _nice(rate: float, step: float, rows: int, rounding: float) -> float:
    """The rate with the fewest digits within what the printed times can tell (10000, not
    9999.9999)."""
    error = rate * max(rounding / (step * max(rows - 1, 1)), 4e-16 * rows**0.5)
    for digits in range(1, 16):
        short = float(f"{rate:.{digits}g}")
        if abs(short - rate) <= error:
            return short
    return rate


def _given(log: Log, roles: Roles, path: Path, factor: float, given: float) -> Timing:
    """A given rate beats the log's times; where they disagree by more than their rounding and two
    steps, the recording is suspect."""
    assert roles.time is not None
    first = last = np.nan
    rows = 0
    with guard_reading(path, log.format):
        for (times,) in log.read((roles.time,)):
            finite = np.asarray(times[np.isfinite(times)], float)
            if len(finite):
                first = finite[0] if np.isnan(first) else first
                last = finite[-1]
            rows += len(times)
    span, expected = (last - first) * factor, (rows - 1) / given
    rounding = 2 * log.quantum(roles.time) * factor
    if rows < 2 or not abs(span - expected) > 2 / given + rounding + 1e-4 * expected:
        return Timing(given, factor, first * factor)
    reason = (
        f"the log's times span {span:.6g} s, {rows} samples at the given {given:g} Hz span"
        f" {expected:.6g} s: samples are missing, the rate is wrong, or the times are in another"
        " unit (time_units)"
    )
    return Timing(given, factor, first * factor, (reason,))
