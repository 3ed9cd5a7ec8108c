"""Gaussian priors on the coordinates and on the runs' frequencies, as rows beside the design."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..envelopes.coordinates import COORDINATES
from .fit_point import Point
from .layout import FitColumns
from .measured_runs import MeasuredRuns

Array = np.ndarray


@dataclass(frozen=True)
class CoordinatePriors:
    """Gaussian priors on the coordinates: mean (7,), std (7,); inf: none, 0: held."""

    mean: Array
    std: Array
    offset_std: float = np.inf
    """Wander of the runs' frequencies about the mean of their kind (free, forced), rad/s; inf:
    every run has a frequency of its own."""
    passive: bool = True
    """The fit stays where a resonator without a supply can be: the damping is nowhere negative, ν ≥
    |νδμ|."""
    loose: CoordinatePriors | None = None
    """What takes its place once the misfit is no longer gross enough to bend what is weakly known;
    None: the same."""

    def holding(self, name: str, value: float) -> CoordinatePriors:
        """The same with one coordinate held at a value."""
        mean, std = self.mean.copy(), self.std.copy()
        mean[COORDINATES.index(name)], std[COORDINATES.index(name)] = value, 0.0
        return replace(self, mean=mean, std=std)

    def strays(self, series: MeasuredRuns) -> Array:
        """Rows (R, R) of the runs' offsets that this prior pulls to zero; none where they are
        free."""
        if not np.isfinite(self.offset_std):
            return np.zeros((0, len(series.names)))
        forced = series.forced[:, 0] > 0
        alike = forced[:, None] == forced
        # off the mean of their kind: a frequency that all share is nobody's wander
        return (np.eye(len(forced)) - alike / alike.sum(axis=1)) / self.offset_std


def list_pulled(freedom: CoordinatePriors) -> Array:
    """Coordinates with a prior that is neither absent nor a value held."""
    return np.flatnonzero(np.isfinite(freedom.std) & (freedom.std > 0))


def coordinate_rows(freedom: CoordinatePriors, layout: FitColumns) -> Array:
    """Rows (m, k) of the coordinates' priors over all columns."""
    own = list_pulled(freedom)
    return layout.beside([layout.coordinates.index(k) for k in own], np.diag(1 / freedom.std[own]))


def prior_rows(freedom: CoordinatePriors, layout: FitColumns, series: MeasuredRuns) -> Array:
    """Rows (m, k) that pull the coordinates and the runs' offsets to their priors."""
    strays = freedom.strays(series)
    offsets = layout.beside([layout.frequency(k) for k in range(layout.runs)], strays)
    return np.concatenate([coordinate_rows(freedom, layout), offsets])


def prior_residual(freedom: CoordinatePriors, point: Point, series: MeasuredRuns) -> Array:
    """How far the point is from the priors, (m,) in the order of `prior_rows`."""
    k = list_pulled(freedom)
    return np.concatenate(
        [
            (freedom.mean[k] - point.p[k]) / freedom.std[k],
            -(freedom.strays(series) @ point.offset_rad_s),
        ]
    )
