"""Gaps of uneven sampling: stretches without a sample that a window's least squares cannot
bridge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray

STEPS, PERIODS, SHARE = 2.5, 0.5, 1 / 16
"""A gap is longer than so many usual steps, so many periods of the oscillation and so much of a
window. Single samples lost at random are no gap: the oscillation is seen on either side within the
same half turn, and a sixteenth lost at a window's end, where it costs most, raises the variance of
a moving envelope by 1/(1 − q)·(1 + 3q²/(1 − q)²) = 1.08."""


@dataclass
class Gaps:
    """Gaps of a run in windows of `width_s` from `begin_s` on, and how many there were so far."""

    begin_s: float
    width_s: float
    step_s: float
    frequency_hz: float
    count: int = 0
    total_s: float = 0.0
    _last_s: float = np.nan

    @property
    def shortest_s(self) -> float:
        """Length from which a stretch is a gap to short windows."""
        return max(STEPS * self.step_s, PERIODS / self.frequency_hz)

    def find_touched(self, time_s: Array, low: int, high: int) -> Array:
        """Windows that are touched by a gap.

        Parameters
        ----------
        time_s
            Of the windows' samples (n,), s.
        low, high
            Numbers of the first window and of the one behind the last.

        Returns
        -------
        ndarray
            (high − low,), bool.
        """
        self._count(time_s)
        rows = np.zeros(high - low, bool)
        # Half a step out: samples that begin or end exactly at a border leave no gap there.
        ends = (low * self.width_s - self.step_s / 2, high * self.width_s + self.step_s / 2)
        edges = np.concatenate([[self.begin_s + ends[0]], time_s, [self.begin_s + ends[1]]])
        for k in np.flatnonzero(np.diff(edges) > max(self.shortest_s, SHARE * self.width_s)):
            a, b = (int((edges[j] - self.begin_s) / self.width_s) - low for j in (k, k + 1))
            rows[max(0, a) : max(0, b) + 1] = True
        return rows

    def _count(self, time_s: Array) -> None:
        """Keep count of the stretches that are gaps to short windows, each once."""
        new = time_s if np.isnan(self._last_s) else time_s[time_s > self._last_s]
        if len(new):
            steps = np.diff(new, prepend=new[0] if np.isnan(self._last_s) else self._last_s)
            long = steps[steps > self.shortest_s]
            self.count, self.total_s = self.count + len(long), self.total_s + float(long.sum())
            self._last_s = float(new[-1])

    def find_shorter_periods(self, span_s: float, share: float) -> float | None:
        """Periods per window, fewer than there are, of which gaps touch no more than a share.

        A gap of length L touches windows of L + width on average.

        Parameters
        ----------
        span_s
            Of the run.
        share
            Of the windows.

        Returns
        -------
        float or None
            None where windows of one period are touched more often.
        """
        width = (share * span_s - self.total_s) / self.count if self.count else 0.0
        return width * self.frequency_hz if 1 / self.frequency_hz <= width < self.width_s else None
