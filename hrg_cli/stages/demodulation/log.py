"""The auxiliary log beside a stream of windows: temperature and rate at a window's centre, commands
as their means over the window, which move the wave."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import HrgError
from ...fitting.samples.course import Course, Impulse, course, impulse, mean_of, means_of_values
from ...records import Array, Recording

COMMANDS = ("drive_main", "drive_quadrature")
AUXILIARY = ("temperature_degc", "rate_rad_s", *COMMANDS)


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
        if (np.diff(self.time_s) <= 0).any():
            raise HrgError(
                f"{name}: the times of its auxiliary log do not increase; strictly increasing times"
                " were expected"
            )
        for key in AUXILIARY:
            values = getattr(recording, key)
            if values is not None:
                self.courses[key] = (
                    impulse(self.time_s, means_of_values(self.time_s, values))
                    if key in COMMANDS
                    else course(self.time_s, values)
                )

    def read_at(self, times: Array, window_s: float) -> dict[str, Any]:
        """The log at the centres `times` (n,) of windows of that length; up to one of its steps
        beyond its ends the end value, farther out NaN."""
        if not self.courses:
            return {}
        log = self.time_s
        reach = float(np.median(np.diff(log))) if len(log) > 1 else np.inf
        outside = (times < log[0] - reach) | (times > log[-1] + reach)
        self.rows_outside += int(outside.sum())
        values = {
            name: mean_of(series, times, window_s)
            if isinstance(series, Impulse)
            else series.at(times)
            for name, series in self.courses.items()
        }
        if outside.any():
            for series in values.values():
                series[outside] = np.nan
        return values
