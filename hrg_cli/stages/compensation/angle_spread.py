"""Standard deviation of the angle that a compensated rate sums up to.

The noise of the wave angle does not grow: of all increments' it leaves that of the first block and
of those about the place. The gyro's own walk grows as N√t. The tables' errors are the same
whenever the wave comes by, and are summed up as what they are, through the coefficients' whole
covariance C: with g = Σ ∂Ω/∂c Δt their variance is gᵀCg, which grows as t where the wave stands and
cancels where it turns.
"""

from __future__ import annotations

import numpy as np

from ...fitting.tables.increments import AnglePath
from ...records import Calibration
from ..calibration.interpolation import (
    build_coefficient_rows,
    interpolate_doubt,
    read_angle_random_walk,
)
from .middles import Middles

Array = np.ndarray
ROWS = 2048
"""Increments whose sums over all coefficients are held at a time."""


class AngleSpread:
    """Sums over the increments of one run so far, taken in piece by piece."""

    def __init__(self, calibration: Calibration) -> None:
        self.calibration = calibration
        self.covariance = np.asarray(calibration.covariance, float)
        self.walk = read_angle_random_walk(calibration) ** 2
        self.gained = np.zeros(len(self.covariance))
        self.doubted = np.zeros(2)
        self.begin: tuple[float, float, float] | None = None
        """Time of the first block, variance of the angle in its middle, and its width."""

    def compute_std(
        self,
        path: AnglePath,
        middles: Middles,
        rows: slice,
        blocks: Array,
        rate: Array,
        scale: Array,
    ) -> Array:
        """σ of the angle in the middles of the increments `rows` of a piece, NaN where the angle's
        own is not stated.

        blocks (b,): temperature or frequency of the piece's blocks; rate and scale (n,): Ω and K
        of its increments. The others of its increments lie in the pieces beside it.
        """
        noise = self._of_noise(path, middles, rows) * (path.mode_number / scale[rows]) ** 2
        starts = range(rows.start, rows.stop, ROWS)
        parts = [
            self._of_tables(path, blocks, rate, scale, slice(k, min(k + ROWS, rows.stop)))
            for k in starts
        ]
        return np.sqrt(noise + self._of_walk(path, rows) + np.concatenate(parts))

    def _of_noise(self, path: AnglePath, middles: Middles, rows: slice) -> Array:
        """Variance of θ by the windows' noise, over that of the run's begin."""
        variance = np.where(path.angle_variance > 0, path.angle_variance, np.nan)
        before = None if self.begin is None else self.begin[1]
        if self.begin is None:
            of_begin = middles.compute_begin_variance(variance)
            self.begin = float(path.time_s[0]), of_begin, float(path.width_s[0])
        return middles.compute_variance(variance, before)[rows]

    def _of_walk(self, path: AnglePath, rows: slice) -> Array:
        """Variance by the walk, N²(t_i − t_0 + (Δt − w)/4) with t_i the start of the increment; of
        the run's first increment it is half of its own change that counts."""
        assert self.begin is not None
        begin_s, _, width = self.begin
        start_s, step_s = path.time_s[:-1], path.interval_s
        walked = start_s - begin_s + (step_s - width) / 4
        walked = np.where(start_s == begin_s, (step_s - width / 3) / 4, walked)
        return np.asarray(self.walk * walked[rows])

    def _of_tables(
        self, path: AnglePath, blocks: Array, rate: Array, scale: Array, some: slice
    ) -> Array:
        """Variance (n,) by the coefficients and by what is unknown between nodes, of some of the
        increments, which are then summed up."""
        x, angle = (
            path.average_neighbours(blocks)[some],
            path.average_neighbours(path.angle_rad)[some],
        )
        time, rate, scale = path.interval_s[some], rate[some], scale[some]
        weight = np.stack([time / scale, -rate * time / scale])
        summed = np.cumsum(build_coefficient_rows(self.calibration, x, angle, weight), axis=0)
        doubts = np.cumsum(weight.T * interpolate_doubt(self.calibration, x), axis=0)
        middle, between = (
            total + sums - np.diff(sums, axis=0, prepend=0.0) / 2
            for total, sums in ((self.gained, summed), (self.doubted, doubts))
        )
        self.gained = self.gained + summed[-1]
        self.doubted = self.doubted + doubts[-1]
        return np.asarray(
            np.sum((middle @ self.covariance) * middle, axis=1) + np.sum(between**2, axis=1)
        )
