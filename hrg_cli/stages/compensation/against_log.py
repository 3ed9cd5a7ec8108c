"""The compensated angle against a run's own rate log: errors of a slow drift, or of tables that
have aged, are lost in the noise of every single rate and add up in the angle."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...fitting.checks import CHANCE, Check, check_at_most

Array = np.ndarray
SPIKE = 1.5
"""Times what chance makes of the largest of all rates' errors that one may be off."""
CLEARLY = 4.0
"""Of its own standard deviations, by which the rates must scatter more than they state for the rest
to be the log's noise."""


class AngleAgainstLog:
    """The sum of the rates' errors over one run so far, taken in piece by piece, and where it was
    furthest off in its standard deviations."""

    def __init__(self) -> None:
        self.error_rad = 0.0
        self.ratios2, self.rows, self.variance = 0.0, 0, 0.0
        self.furthest, self.off_rad, self.at_s = 0.0, 0.0, 0.0
        self.spike, self.spike_at_s = 0.0, 0.0

    def add(self, time_s: Array, step_s: Array, error: Array, std: Array, of_angle: Array) -> None:
        """Take in increments (n,): their middles and lengths, the rates' errors against the log
        (NaN where there is none) with σ, and σ of the angle there."""
        known = np.isfinite(error) & np.isfinite(std) & (std > 0)
        self._look_for_spikes(time_s, np.where(known, error, 0.0) / np.where(known, std, 1.0))
        turned = np.where(np.isfinite(error), error * step_s, 0.0)
        course = self.error_rad + np.cumsum(turned) - turned / 2
        self.error_rad += float(turned.sum())
        self.rows += int(known.sum())
        self.ratios2 += float(np.sum((error[known] / std[known]) ** 2))
        self.variance += float(np.sum((std[known] * step_s[known]) ** 2))
        over = np.abs(course) / np.sqrt(of_angle**2 + self._of_log())
        over = np.where(known & np.isfinite(over), over, 0.0)
        if len(over) and over.max() > self.furthest:
            k = int(np.argmax(over))
            self.furthest, self.off_rad = float(over[k]), float(course[k])
            self.at_s = float(time_s[k])

    def _look_for_spikes(self, time_s: Array, ratio: Array) -> None:
        """The rate furthest off its log, by what most rates of the piece scatter, at least σ."""
        size = np.abs(ratio)
        usual = max(1.0, 1.4826 * float(np.median(size))) if len(size) else 1.0
        if len(size) and size.max() / usual > self.spike:
            k = int(np.argmax(size))
            self.spike, self.spike_at_s = float(size[k]) / usual, float(time_s[k])

    def _of_log(self) -> float:
        """Variance of the angle by the log's own noise: what the rates scatter beyond their σ,
        where they clearly do, white from one to the next."""
        if not self.rows:
            return 0.0
        beyond = self.ratios2 / self.rows - 1 - CLEARLY * np.sqrt(2 / self.rows)
        return float(max(beyond, 0.0) * self.variance)

    def compute_figures(self) -> dict[str, Any]:
        """For the JSON; empty where no increment has a log and a standard deviation."""
        if not self.rows:
            return {}
        return {
            "angle_against_log": {
                "largest_over_std": self.furthest,
                "error_rad": self.off_rad,
                "time_s": self.at_s,
            }
        }

    def list_checks(self) -> list[Check]:
        """Whether angle and rates stay within what is stated of them."""
        # of n normal numbers one is beyond x with a chance below n e^(−x²/2)
        limit = float(np.sqrt(2 * np.log(max(self.rows, 1) / CHANCE)))
        return [
            check_at_most(
                "angle_follows_the_log",
                self.furthest,
                limit,
                f"at {self.at_s:.6g} s the compensated angle is {abs(self.off_rad):.2g} rad off the"
                f" run's rate log, {self.furthest:.3g} of its standard deviations: tables that have"
                " aged (hrg update), or a log that is off",
            ),
            check_at_most(
                "rates_follow_the_log",
                self.spike,
                SPIKE * limit,
                f"at {self.spike_at_s:.6g} s the rate is {self.spike:.3g} times as far off the"
                " run's log as most rates are: it changes within a window there, as a table's step"
                " does (shorter windows), or the log is off",
            ),
        ]
