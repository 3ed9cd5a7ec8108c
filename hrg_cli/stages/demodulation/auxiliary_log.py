"""The auxiliary log beside a stream of windows: temperature and rate at a window's centre, commands
as their means over the window, which move the wave. A rate that is logged more often than there are
windows turns the wave by its integral: the centres get what has the log's means over the
windows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import HrgError
from ...fitting.medians import find_median
from ...fitting.samples.course import (
    Course,
    Impulse,
    average_over_windows,
    build_course,
    build_from_means,
    estimate_means,
    integrate_means,
)
from ...fitting.samples.rate_log import NO_FINITE_VALUE
from ...records import Array, Recording

COMMANDS = ("drive_main", "drive_quadrature")
RATE = "rate_rad_s"
AUXILIARY = ("temperature_degc", RATE, *COMMANDS)
WORDS = {
    "temperature_degc": "the temperature log",
    RATE: "the rate log",
    "drive_main": "the log of the main drive",
    "drive_quadrature": "the log of the quadrature drive",
}
FINER = 4
"""Windows a step of the log up to which the rate is found by its means; over a longer step it is as
good as straight within a window, but where it turns a corner."""
BESIDE = 8
"""Windows on either side of a block from which its centres' rates are found, so that they do not
depend on where blocks begin."""


class WindowLog:
    """The log of one recording, read at the windows of its stream. HrgError: its times do not
    increase."""

    def __init__(self, recording: Recording, name: str) -> None:
        self.rows_outside = 0
        """Windows so far that lie outside the log."""
        self.columns: dict[str, _Column] = {}
        time = recording.auxiliary_time_s
        if time is None or not len(time):
            return
        self.time_s = np.asarray(time, float)
        if not (np.diff(self.time_s) > 0).all():
            raise HrgError(
                f"{name}: the times of its auxiliary log do not increase; strictly increasing times"
                " were expected"
            )
        self.step_s = _find_step(self.time_s)
        """Median step of the log."""
        for key in AUXILIARY:
            values = getattr(recording, key)
            if values is not None:
                self.columns[key] = _Column.from_rows(key, self.time_s, np.asarray(values, float))

    def read_at(self, times: Array, window_s: float) -> dict[str, Any]:
        """The log at the centres `times` (n,) of windows of that length; up to one of its steps
        beyond its ends the end value, farther out NaN."""
        if not self.columns:
            return {}
        log, reach = self.time_s, self.step_s
        outside = (times < log[0] - reach) | (times > log[-1] + reach)
        self.rows_outside += int(outside.sum())
        values = {name: column.read_at(times, window_s) for name, column in self.columns.items()}
        if outside.any():
            for series in values.values():
                series[outside] = np.nan
        return values

    def list_notes(self) -> list[str]:
        """Sentences on what its columns lack."""
        return [column.note for column in self.columns.values() if column.note]


@dataclass(frozen=True)
class _Column:
    """One quantity of the log: the times of its finite rows (n,), their median step, the course
    through them (None: no row is finite), and what to say of the others."""

    name: str
    time_s: Array
    step_s: float
    course: Course | Impulse | None
    note: str

    @classmethod
    def from_rows(cls, name: str, time_s: Array, values: Array) -> _Column:
        """The column without the rows that are not finite, which a logger of several instruments
        writes where one of them has nothing to say."""
        known = np.isfinite(values)
        lost, words = int(np.count_nonzero(~known)), WORDS[name]
        if not known.any():
            rows = "its one row is" if len(values) == 1 else f"all of its {lost} rows are"
            note = f"{words} {NO_FINITE_VALUE}: {rows} NaN or infinite; log it, or leave it out"
            return cls(name, time_s[:0], np.inf, None, note)
        t, value = time_s[known], values[known]
        course: Course | Impulse = (
            integrate_means(t, estimate_means(t, value))
            if name in COMMANDS
            else build_course(t, value)
        )
        note = (
            f"{words} holds {lost} of {len(values)} values that are not finite; they are left out,"
            " and it is read from the others"
        )
        # of one row that is left the log's own step says how far it holds
        step = _find_step(t if len(t) > 1 else time_s)
        return cls(name, t, step, course, note if lost else "")

    def read_at(self, times: Array, window_s: float) -> Array:
        """Its values at the centres of evenly spaced windows; of a log with rows that are not
        finite NaN farther than a step from the others."""
        if self.course is None:
            return np.full(len(times), np.nan)
        value = _read(self.name, self.course, self.step_s, times, window_s)
        if self.note:
            after = np.searchsorted(self.time_s, times)
            nearest = np.minimum(
                np.abs(times - self.time_s[np.maximum(after - 1, 0)]),
                np.abs(times - self.time_s[np.minimum(after, len(self.time_s) - 1)]),
            )
            value = np.where(nearest > self.step_s, np.nan, value)
        return value


def _find_step(time_s: Array) -> float:
    return float(find_median(np.diff(time_s))) if len(time_s) > 1 else np.inf


def _read(
    name: str, series: Course | Impulse, step_s: float, times: Array, window_s: float
) -> Array:
    """One quantity of the log, of that step, at the centres of evenly spaced windows."""
    if isinstance(series, Impulse):
        return average_over_windows(series, times, window_s)
    if name != RATE or step_s >= FINER * window_s:
        return series.interpolate(times)
    more = window_s * np.arange(1, BESIDE + 1)
    wider = np.concatenate([times[0] - more[::-1], times, times[-1] + more])
    # a window that reaches beyond the log has no mean there
    begin, end = series.domain
    half = window_s / 2
    known = (wider - half >= begin) & (wider + half <= end)
    value = series.interpolate(wider)
    if known.any():
        within = wider[known]
        borders = np.append(within, within[-1] + window_s) - half
        means = np.diff(series.integrate_to(borders)) / window_s
        value[known] = build_from_means(within, means, window_s).value
    return value[BESIDE:-BESIDE]
