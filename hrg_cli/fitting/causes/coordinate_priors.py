"""Gaussian priors on the coordinates and on the runs' frequencies, as rows beside the design."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..envelopes.coordinates import COORDINATES
from .design_columns import FitColumns
from .fit_point import Point
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

    def hold(self, name: str, value: float) -> CoordinatePriors:
        """The same with one coordinate held at a value."""
        mean, std = self.mean.copy(), self.std.copy()
        mean[COORDINATES.index(name)], std[COORDINATES.index(name)] = value, 0.0
        return replace(self, mean=mean, std=std)

    def build_offset_rows(self, series: MeasuredRuns) -> Array:
        """Rows (R, R) of the runs' offsets that this prior pulls to zero; none where they are
        free."""
        if not np.isfinite(self.offset_std):
            return np.zeros((0, len(series.names)))
        forced = series.forced[:, 0] > 0
        alike = forced[:, None] == forced
        # off the mean of their kind: a frequency that all share is nobody's wander
        return (np.eye(len(forced)) - alike / alike.sum(axis=1)) / self.offset_std


def list_pulled(freedom: CoordinatePriors) -> Array:
    """Coordinates with a prior that is neither absent nor a value held.

    Parameters
    ----------
    freedom
        The priors.

    Returns
    -------
    ndarray
        Their places.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors, list_pulled
    >>> std = np.array([np.inf, 0.1, 0.1, np.inf, np.inf, 0.0, 0.0])
    >>> list_pulled(CoordinatePriors(np.zeros(7), std)).tolist()
    [1, 2]
    """
    return np.flatnonzero(np.isfinite(freedom.std) & (freedom.std > 0))


def build_coordinate_rows(freedom: CoordinatePriors, layout: FitColumns) -> Array:
    """Rows of the coordinates' priors over all columns of a fit.

    Parameters
    ----------
    freedom
        The priors.
    layout
        Which column is which coordinate.

    Returns
    -------
    ndarray
        (m, columns): 1/σ in the column of each coordinate with a prior.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors, build_coordinate_rows
    >>> from hrg_cli.fitting.causes.design_columns import FitColumns
    >>> free = CoordinatePriors(np.zeros(7), np.array([np.inf, 0.1, 0.5, 0, 0, 0, 0]))
    >>> build_coordinate_rows(free, FitColumns((0, 1, 2), 0)).tolist()
    [[0.0, 10.0, 0.0], [0.0, 0.0, 2.0]]
    """
    own = list_pulled(freedom)
    return layout.spread_rows(
        [layout.coordinates.index(k) for k in own], np.diag(1 / freedom.std[own])
    )


def build_prior_rows(freedom: CoordinatePriors, layout: FitColumns, series: MeasuredRuns) -> Array:
    """Rows that pull the coordinates and the runs' offsets to their priors.

    Parameters
    ----------
    freedom
        The priors.
    layout
        Which column is which number.
    series
        The runs, R of them.

    Returns
    -------
    ndarray
        (m, columns): the coordinates first, then R rows of the offsets where these have a prior.

    Examples
    --------
    Two free runs whose frequencies wander by 0.5 rad/s about their mean: what both share is
    nobody's.

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors, build_prior_rows
    >>> from hrg_cli.fitting.causes.design_columns import FitColumns
    >>> free = CoordinatePriors(np.zeros(7), np.full(7, np.inf), offset_std=0.5)
    >>> series, layout = SimpleNamespace(forced=np.zeros((2, 3)), names="ab"), FitColumns((), 2)
    >>> build_prior_rows(free, layout, series)[:, [4, 9]].tolist()
    [[1.0, -1.0], [-1.0, 1.0]]
    """
    strays = freedom.build_offset_rows(series)
    offsets = layout.spread_rows([layout.frequency(k) for k in range(layout.runs)], strays)
    return np.concatenate([build_coordinate_rows(freedom, layout), offsets])


def compute_prior_residual(freedom: CoordinatePriors, point: Point, series: MeasuredRuns) -> Array:
    """How far a point is from the priors, in the order of `build_prior_rows`.

    Parameters
    ----------
    freedom
        The priors.
    point
        Coordinates and offsets.
    series
        The runs, R of them.

    Returns
    -------
    ndarray
        (m,): what the rows times a step to the priors' means are.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.coordinate_priors import (
    ...     CoordinatePriors,
    ...     compute_prior_residual,
    ... )
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> free = CoordinatePriors(np.full(7, 0.2), np.array([0.1, *[np.inf] * 6]), offset_std=0.5)
    >>> series = SimpleNamespace(forced=np.zeros((2, 3)), names="ab")
    >>> point = Point(np.full(7, 0.5), None, np.array([1.0, 3.0]))
    >>> compute_prior_residual(free, point, series).round(9) + 0
    array([-3.,  2., -2.])
    """
    k = list_pulled(freedom)
    return np.concatenate(
        [
            (freedom.mean[k] - point.p[k]) / freedom.std[k],
            -(freedom.build_offset_rows(series) @ point.offset_rad_s),
        ]
    )
