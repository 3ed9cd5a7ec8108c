"""The auxiliary log beside a stream of windows: temperature and rate at a window's centre, commands
as their means over the window, which move the wave. A rate that is logged more often than there are
windows turns the wave by its integral: the centres get what has the log's means over the
windows."""

from __future__ import annotations

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
from ...records import Array, Recording

COMMANDS = ("drive_main", "drive_quadrature")
RATE = "rate_rad_s"
AUXILIARY = ("temperature_degc", RATE, *COMMANDS)
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
        self.courses: dict[str, Course | Impulse] = {}
        time = recording.auxiliary_time_s
        if time is None or not len(time):
            return
        self.time_s = np.asarray(time, float)
        self.step_s = float(find_median(np.diff(self.time_s))) if len(self.time_s) > 1 else np.inf
        """Median step of the log."""
        if (np.diff(self.time_s) <= 0).any():
            raise HrgError(
                f"{name}: the times of its auxiliary log do not increase; strictly increasing times"
                " were expected"
            )
        for key in AUXILIARY:
            values = getattr(recording, key)
            if values is not None:
                self.courses[key] = (
                    integrate_means(self.time_s, estimate_means(self.time_s, values))
                    if key in COMMANDS
                    else build_course(self.time_s, values)
                )

    def read_at(self, times: Array, window_s: float) -> dict[str, Any]:
        """The log at the centres `times` (n,) of windows of that length; up to one of its steps
        beyond its ends the end value, farther out NaN."""
        if not self.courses:
            return {}
        log = self.time_s
        reach = self.step_s
        outside = (times < log[0] - reach) | (times > log[-1] + reach)
        self.rows_outside += int(outside.sum())
        values = {
            name: self._read(name, series, times, window_s) for name, series in self.courses.items()
        }
        if outside.any():
            for series in values.values():
                series[outside] = np.nan
        return values

    def _read(self, name: str, series: Course | Impulse, times: Array, window_s: float) -> Array:
        """One quantity of the log at the centres of evenly spaced windows."""
        if isinstance(series, Impulse):
            return average_over_windows(series, times, window_s)
        if name != RATE or self.step_s >= FINER * window_s:
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
