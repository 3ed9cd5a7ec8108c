"""Whether the times of a log are even, judged in one pass with flat memory."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import HrgError
from .serial_days import are_days, describe_days

GROUP = 256


class RepeatedTimeError(HrgError):
    """A row has the time of the row before."""


@dataclass
class TimeJudge:
    """Collects blocks of times: they must rise from row to row; keeps their departure from an even
    grid a group of rows.

    The grid's step is known only at the end, so the departure from a provisional grid (mean step of
    the first block) is kept as (first row, smallest, largest) for every 256 rows and corrected
    afterwards.
    """

    path: str
    where: object
    unit_named: bool = True
    first: float = np.nan
    last: float = np.nan
    rows: int = 0
    step: float = np.nan
    groups: list[np.ndarray] = field(default_factory=list)
    largest_step: float = 0.0

    def add(self, times: np.ndarray) -> None:
        """Take the next block. HrgError: a time that is no number, repeated, or smaller than the
        one before."""
        if len(times) == 0:
            return
        bad = np.flatnonzero(~np.isfinite(times))
        if len(bad):
            raise HrgError(
                f"{self.path}: {self._row(bad[0])}: its time is not a number; correct or cut"
                " that row"
            )
        steps = np.diff(times, prepend=times[0] - 1 if self.rows == 0 else self.last)
        if self.rows == 0:
            self.first = float(times[0])
            self.step = float(times[-1] - times[0]) / max(1, len(times) - 1) or 1.0
        wrong = np.flatnonzero(steps <= 0)
        if len(wrong):
            self._complain(int(wrong[0]), float(steps[wrong[0]]), len(wrong))
        self.largest_step = max(
            self.largest_step, float(steps[1 if self.rows == 0 else 0 :].max(initial=0.0))
        )
        rows = np.arange(self.rows, self.rows + len(times))
        departure = times - self.first - rows * self.step
        starts = np.arange(0, len(times), GROUP)
        self.groups.append(
            np.stack(
                [
                    rows[starts],
                    np.minimum.reduceat(departure, starts),
                    np.maximum.reduceat(departure, starts),
                ]
            )
        )
        self.rows += len(times)
        self.last = float(times[-1])

    def _row(self, index: int) -> str:
        return str(self.where(self.rows + int(index)))  # type: ignore[operator]

    def _complain(self, row: int, step: float, count: int) -> None:
        if step == 0 and not self.unit_named and are_days(self.first):
            told = describe_days(self.first, f"{self._row(row)} repeats the time before")
            raise HrgError(f"{self.path}: {told}")
        if step == 0:
            raise RepeatedTimeError(
                f"{self.path}: {self._row(row)} repeats the time of the row before ({count}"
                " nearby), times must rise; give sample_rate_hz"
                " if they are rounded, or keep one row of each time"
            )
        raise HrgError(
            f"{self.path}: {self._row(row)}: the time goes back by {-step:.6g} s; times must rise"
            " from row to row: sort the log, name another time column, or give sample_rate_hz"
        )

    @property
    def mean_step(self) -> float:
        """Seconds a row from the first time to the last."""
        return (self.last - self.first) / (self.rows - 1)

    def find_even_step(self, rounding: float = 0.0) -> tuple[float, float]:
        """Step of the best even grid through times of this rounding and the largest departure from
        it, seconds."""
        if self.rows < 2:
            return np.nan, np.inf
        step = self.mean_step
        departure = self.measure_departure(step)
        if not 0.5 * rounding < departure <= 1.5 * rounding:
            return step, departure
        from scipy.optimize import minimize_scalar

        # the ends are rounded too: the departure is convex in the step, its least is the grid's
        near = 2 * rounding / (self.rows - 1)
        best = minimize_scalar(
            self.measure_departure,
            bounds=(step - near, step + near),
            method="bounded",
            options={"xatol": 1e-4 * near},
        )
        return (best.x, best.fun) if best.fun < departure else (step, departure)

    def measure_departure(self, step: float) -> float:
        """Largest departure [s] of the times from an even grid of this step, its constant fitted
        (half the range)."""
        first, low, high = np.concatenate(self.groups, axis=1)
        slope = self.step - step
        ends = np.minimum(first + GROUP, self.rows) - 1
        shift_a, shift_b = first * slope, ends * slope
        lowest = np.min(low + np.minimum(shift_a, shift_b))
        highest = np.max(high + np.maximum(shift_a, shift_b))
        return float(highest - lowest) / 2
