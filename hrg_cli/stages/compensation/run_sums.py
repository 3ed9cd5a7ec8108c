"""What is summed up over one compensated run, piece by piece: the angle, the range of the rates,
and their errors and deviations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...fitting.checks import Check, check_at_most
from ...fitting.tables.increments import AnglePath
from ...records import Calibration
from ..calibration.residual_errors import CELLS_A_PERIOD
from .against_log import AngleAgainstLog
from .angle_spread import AngleSpread
from .middles import FIRST, Middles
from .run_errors import MOST_RATES, RateSpread, Totals

Array = np.ndarray
TRUNCATED = 1.0
"""Of its standard deviation, by which four blocks may tell the angle otherwise than six."""


@dataclass(frozen=True)
class IncrementRates:
    """Rates (n,) by the tables, against the stars: their σ by the windows' noise and by the tables'
    own errors, and σ of the angle at the increments' middles."""

    rate_rad_s: Array
    noise_std: Array
    tables_std: Array
    angle_std: Array

    @property
    def std(self) -> Array:
        """σ (n,) of the rates."""
        return np.asarray(np.hypot(self.noise_std, self.tables_std))


@dataclass(frozen=True)
class RateErrors:
    """Errors (n,) against the rate log with a constant scale factor alone and with the tables; NaN
    where nothing was logged."""

    before_rad_s: Array
    after_rad_s: Array


class RunSums:
    """Sums over the run so far; `logged`: it has a rate log to be held against."""

    def __init__(self, calibration: Calibration, increments: int, logged: bool) -> None:
        together = max(1, -(-increments // MOST_RATES))
        self.totals = Totals(np.zeros((3, CELLS_A_PERIOD)), together) if logged else None
        self.spread, self.against = RateSpread(), AngleAgainstLog()
        self.angles = AngleSpread(calibration)
        self.angle_rad: float | None = None
        self.truncated = 0.0
        self.slowest_rad_s, self.fastest_rad_s = np.inf, -np.inf

    def turn_on(
        self, rate_rad_s: Array, path: AnglePath, middles: Middles, rows: slice, std: Array
    ) -> Array:
        """The angle in the middles of the increments `rows` of a piece, turned on from that of the
        last, from 0 in the middle of the run's first block; rates (n,) of all its increments, and
        σ of those angles."""
        angle_rad = np.concatenate([[0.0], np.cumsum(rate_rad_s * path.interval_s)])
        if self.angle_rad is None:
            self.angle_rad = float(angle_rad[rows.start]) - middles.interpolate_begin(angle_rad)
        angle_rad += self.angle_rad - angle_rad[rows.start]
        self.angle_rad = float(angle_rad[rows.stop])
        found = middles.interpolate(angle_rad)[rows]
        # what a longer polynomial would still change is less than what six blocks do
        coarser = Middles.from_path(path, FIRST).interpolate(angle_rad)[rows]
        over = (found - coarser) / std
        over = over[np.isfinite(over)]
        if len(over):
            self.truncated = max(self.truncated, float(np.sqrt(np.mean(over**2))))
        return found

    def check_truncation(self) -> Check:
        """Whether increments are short enough for the bend of the angle between their ends."""
        return check_at_most(
            "angle_between_blocks",
            self.truncated,
            TRUNCATED,
            "the rate changes so fast that between the ends of increments the angle is known to"
            f" {self.truncated:.2g} of its standard deviations only; give fewer"
            " windows_per_increment, or shorter windows",
        )

    def widen(self, rates_rad_s: Array) -> None:
        """Take in the range of a piece's rates."""
        self.slowest_rad_s = min(self.slowest_rad_s, float(rates_rad_s.min()))
        self.fastest_rad_s = max(self.fastest_rad_s, float(rates_rad_s.max()))

    def add(self, path: AnglePath, found: IncrementRates, errors: RateErrors | None) -> None:
        """Take in a piece's rates, and their errors where the run has a log."""
        after = None if errors is None else errors.after_rad_s
        if self.totals is not None and errors is not None:
            self.totals.add(path, errors.before_rad_s, errors.after_rad_s)
            middles = path.average_neighbours(path.time_s)
            self.against.add(
                middles, path.interval_s, errors.after_rad_s, found.std, found.angle_std
            )
        self.spread.add(found.noise_std, found.tables_std, after)

    def compute_figures(self) -> dict[str, Any]:
        """Figures of all pieces so far: the last piece has those of the run."""
        of_log = {} if self.totals is None else self.totals.compute_figures()
        return of_log | self.spread.compute_figures() | self.against.compute_figures()
