"""One variant of the drift model solved on all runs and without each fold: by least squares, with
harmonics in doubt averaged over, or with coefficients from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...fitting.least_squares import invert_definite
from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import LEAST_SEEN, TableSolution, solve
from ...fitting.tables.shrinkage import (
    DRIFT_SIZES,
    FEWER_SWEEPS,
    SWEEPS,
    Doubtful,
    average_over_doubt,
    find_doubtful_harmonics,
)
from ...fitting.tables.table_layout import Model, TableLayout
from .drift_models import WHOLE_DRIFT, build_variant
from .frequency_split import KnownCoefficients
from .guards import VariantSolution
from .resonators import ResonatorCoefficients

Array = np.ndarray
MEASURED = {
    "quadrature": "quadrature_course",
    "combined": "quadrature_course",
    "phase": "mean_frequency",
}
"""Variant -> the factor of its measured part."""
DEPARTURE_ODDS = 4.0
"""Odds before the data that a drift's measured part is what the frequency says: two faults, as a
second harmonic takes."""
SUREST = 1e-3
"""Least error of what the frequency tells, over that of the drift alone: it counts as exact, and
less would leave rounding."""


@dataclass(frozen=True)
class Wanted:
    """What the user fixed: band limits (None: by data left out), and the seed of the average over
    harmonics in doubt."""

    harmonics: int | None
    scale_factor_harmonics: int | None
    seed: int
    average: bool = True
    """Whether harmonics in doubt are averaged over; a programme that gives no table has nothing to
    average."""

    @property
    def in_doubt(self) -> list[str]:
        """Tables whose band limit is open."""
        if not self.average:
            return []
        return [
            kind
            for kind, given in (("drift", self.harmonics), ("scale", self.scale_factor_harmonics))
            if given is None
        ]


def find_widest_limits(
    layout: TableLayout, wanted: Wanted, limits: tuple[int, int]
) -> tuple[int, int]:
    """Band limits of the tables that are stored.

    Parameters
    ----------
    layout
        Of the tables.
    wanted
        What was fixed.
    limits
        That were chosen, of drift and scale factor.

    Returns
    -------
    tuple of int
        All harmonics where their number was left open, the limits otherwise.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.variant_solutions import Wanted, find_widest_limits
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 6, 4)
    >>> find_widest_limits(layout, Wanted(2, None, seed=0), (2, 1))
    (2, 4)
    """
    return (
        layout.drift_harmonics if "drift" in wanted.in_doubt else limits[0],
        layout.scale_harmonics if "scale" in wanted.in_doubt else limits[1],
    )


def solve_linear(
    fitted: Fitted, folds: Array, model: Model, penalty: Array | None = None
) -> VariantSolution:
    """A variant by least squares, on all runs and without each fold.

    Parameters
    ----------
    fitted
        The runs.
    folds
        Fold of each piece (R, S), from 0.
    model
        What of the coefficients is free.
    penalty
        (size, size), added to the information; None: none.

    Returns
    -------
    VariantSolution
        Not averaged over harmonics in doubt.

    Examples
    --------
    A mean of 1 and 3, and without each of them:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.normal_pieces import Pieces
    >>> from hrg_cli.fitting.tables.table_layout import Model
    >>> from hrg_cli.stages.calibration.variant_solutions import solve_linear
    >>> y, ones = np.array([[1.0, 3.0]]), np.ones((1, 2), int)
    >>> pieces = Pieces(np.zeros(1), np.ones((1, 2, 1, 1)), y[..., None], y**2, ones)
    >>> found = solve_linear(Told(pieces=pieces), np.array([[0, 1]]), Model("mean", np.eye(1)))
    >>> found.solution.coefficients.tolist(), [one.coefficients.tolist() for one in found.held]
    ([2.0], [[3.0], [1.0]])
    """
    A, b, _ = fitted.pieces.sum()
    held = []
    for f in range(int(folds.max()) + 1):
        A_f, b_f, _ = fitted.pieces.sum(folds == f)
        held.append(solve(A - A_f, b - b_f, model, penalty))
    return VariantSolution(model, solve(A, b, model, penalty), tuple(held))


def solve_averaged(
    fitted: Fitted,
    folds: Array,
    model: Model,
    wanted: Wanted,
    limits: tuple[int, int],
    in_frequency: Mapping[str, KnownCoefficients] | None = None,
) -> VariantSolution:
    """A variant with the harmonics in doubt averaged over how large each may be, and what the
    frequency tells of its measured part.

    Parameters
    ----------
    fitted
        The runs.
    folds
        Fold of each piece (R, S), from 0.
    model
        A variant that is fitted to the runs.
    wanted
        What was fixed, and the seed of the average.
    limits
        Harmonics of 2mθ that were chosen.
    in_frequency
        Of factors, what the runs' frequency tells; None: nothing.

    Returns
    -------
    VariantSolution
        On all runs and without each fold; by least squares where nothing is in doubt.

    Examples
    --------
    A drift of 0 is found to be 0, within errors that allow for harmonics that are not there:

    >>> from hrg_cli.stages.calibration.variant_solutions import Wanted
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.variant_solutions import solve_averaged
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> model = Model("table", np.eye(layout.size))
    >>> found = solve_averaged(fitted, folds, model, Wanted(None, None, seed=0), (1, 0)).solution
    >>> bool(np.all(np.abs(found.coefficients[:3]) < 5 * np.sqrt(np.diag(found.covariance)[:3])))
    True
    """
    A, b, _ = fitted.pieces.sum()
    averaged = _list_averaged(model.name, wanted)
    doubt = _put_in_doubt(fitted.layout, model, averaged, wanted, limits, A, b)
    doubt = doubt.take_in(fitted.layout, in_frequency or {}, A)
    if not doubt.harmonics:
        return solve_linear(fitted, folds, model)
    held = []
    for f in range(int(folds.max()) + 1):
        A_f, b_f, _ = fitted.pieces.sum(folds == f)
        held.append(doubt.average(A - A_f, b - b_f, FEWER_SWEEPS))
    return VariantSolution(model, doubt.average(A, b, SWEEPS), tuple(held), averaged=averaged)


def _list_averaged(name: str, wanted: Wanted) -> tuple[str, ...]:
    """The tables of a variant that it averages over: every variant has a scale factor of open band
    limit, the drift of some is the first harmonic alone."""
    return tuple(kind for kind in wanted.in_doubt if kind == "scale" or name in WHOLE_DRIFT)


@dataclass(frozen=True)
class _InDoubt:
    """A model whose harmonics are averaged over how large each may be; of its last columns
    something may be known beforehand."""

    model: Model
    harmonics: tuple[Doubtful, ...]
    seed: int
    known: KnownCoefficients | None = None

    def take_in(
        self, layout: TableLayout, in_frequency: Mapping[str, KnownCoefficients], A: Array
    ) -> _InDoubt:
        """The same with what the frequency tells of its measured part, from which the drift may
        depart: as phase errors of the loops, or a quadrature off in scale, make it."""
        name = MEASURED.get(self.model.name, "")
        if name not in in_frequency:
            return self
        places = np.arange(layout.size)[layout.factor(name)]
        departure = Doubtful(
            places.reshape(len(layout.nodes), -1), DEPARTURE_ODDS, np.array(DRIFT_SIZES), True
        )
        told = np.diag(A)[places]
        known = in_frequency[name]
        least = SUREST**2 / np.maximum(told, LEAST_SEEN * told.max())
        columns = np.concatenate([self.model.matrix, layout.build_factor_map(name)], axis=1)
        return _InDoubt(
            replace(self.model, matrix=columns),
            (*self.harmonics, departure),
            self.seed,
            replace(known, covariance=known.covariance + np.diag(least)),
        )

    def average(self, A: Array, b: Array, sweeps: int) -> TableSolution:
        """Coefficients in the full set, of runs whose normal equations are these."""
        M, start = self.model.matrix, self.model.start
        own = [replace(one, places=self.model.find_columns(one.places)) for one in self.harmonics]
        start = np.zeros(len(b)) if start is None else start
        data = M.T @ A @ M
        information, vector = data.copy(), M.T @ (b - A @ start)
        if self.known is not None:
            last = slice(len(vector) - len(self.known.values), None)
            precision = invert_definite(self.known.covariance)
            information[last, last] += precision
            vector[last] += precision @ self.known.values
        found = average_over_doubt(information, vector, own, self.seed, sweeps)
        return TableSolution(
            start + M @ found.coefficients,
            M @ found.covariance @ M.T,
            float(np.trace(found.covariance @ data)),
        )


def _put_in_doubt(
    layout: TableLayout,
    model: Model,
    averaged: Sequence[str],
    wanted: Wanted,
    limits: tuple[int, int],
    A: Array,
    b: Array,
) -> _InDoubt:
    """A variant with all harmonics of the tables whose limit is open, each in doubt."""
    scale_factor = layout.compute_mean_scale_factor(solve(A, b, model).coefficients)
    widest = build_variant(model.name, layout, *find_widest_limits(layout, wanted, limits))
    in_doubt = find_doubtful_harmonics(layout, averaged, scale_factor)
    return _InDoubt(widest, tuple(in_doubt), wanted.seed)


def solve_foreign(
    layout: TableLayout, model: Model, coefficients: ResonatorCoefficients, folds: int
) -> VariantSolution:
    """The resonators' coefficients as a variant: nothing of it is fitted to the runs.

    Parameters
    ----------
    layout
        Of the tables.
    model
        Whose start holds the coefficients.
    coefficients
        Of the resonators, with their covariance.
    folds
        How many.

    Returns
    -------
    VariantSolution
        The same without any fold.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import Model
    >>> from hrg_cli.stages.calibration.variant_solutions import solve_foreign
    >>> known = Told(
    ...     build_node_map=lambda layout: np.eye(1),
    ...     interpolate_at_nodes=lambda layout: (np.array([0.55]), np.array([[1e-6]])),
    ... )
    >>> found = solve_foreign(None, Model("physical", np.zeros((1, 0)), np.array([0.55])), known, 2)
    >>> found.foreign, len(found.held), float(found.solution.covariance[0, 0])
    (True, 2, 1e-06)
    """
    assert model.start is not None
    spread = coefficients.build_node_map(layout)
    solution = TableSolution(
        model.start, spread @ coefficients.interpolate_at_nodes(layout)[1] @ spread.T, 0.0
    )
    return VariantSolution(model, solution, (solution,) * folds, foreign=True)


def score_held_out(fitted: Fitted, folds: Array, tried: VariantSolution) -> float:
    """χ² of data left out: whitened residuals squared, each fold predicted without itself.

    Parameters
    ----------
    fitted
        The runs.
    folds
        Fold of each piece (R, S), from 0.
    tried
        Solved without each fold.

    Returns
    -------
    float
        The sum over folds.

    Examples
    --------
    A mean of 1 and 3: each is predicted by the other, and misses by 2.

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.normal_pieces import Pieces
    >>> from hrg_cli.fitting.tables.table_layout import Model
    >>> from hrg_cli.stages.calibration.variant_solutions import score_held_out, solve_linear
    >>> y, ones = np.array([[1.0, 3.0]]), np.ones((1, 2), int)
    >>> pieces = Pieces(np.zeros(1), np.ones((1, 2, 1, 1)), y[..., None], y**2, ones)
    >>> fitted, folds = Told(pieces=pieces), np.array([[0, 1]])
    >>> score_held_out(fitted, folds, solve_linear(fitted, folds, Model("mean", np.eye(1))))
    8.0
    """
    return sum(
        fitted.pieces.compute_chi_square(solution.coefficients, folds == f)
        for f, solution in enumerate(tried.held)
    )


def add_doubt(
    fitted: Fitted, tried: VariantSolution, wanted: Wanted, limits: tuple[int, int]
) -> VariantSolution:
    """A solution with the error that what its model leaves out may make: no 0 ± 0.

    Of a model that holds the first harmonic alone: the error to which a constant drift was seen to
    be absent, and what harmonics in doubt beyond its own may be, as `average_over_doubt` tells,
    with what that does to the others.

    Parameters
    ----------
    fitted
        The runs.
    tried
        The solution.
    wanted
        What was fixed.
    limits
        Harmonics of 2mθ that the model holds.

    Returns
    -------
    VariantSolution
        A table's, which holds every harmonic, as it is.

    Examples
    --------
    A drift without a constant part is not known to have none exactly:

    >>> from hrg_cli.stages.calibration.variant_solutions import Wanted, solve_linear
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.variant_solutions import add_doubt
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> tried = solve_linear(fitted, folds, Model("parametric", np.eye(layout.size)[:, 1:]))
    >>> sure = add_doubt(fitted, tried, Wanted(1, 0, seed=0), (1, 0))
    >>> float(tried.solution.covariance[0, 0]), bool(sure.solution.covariance[0, 0] > 0)
    (0.0, True)
    """
    layout = fitted.layout
    constant = layout.build_part_map("drift", 0)
    if tried.model.name in WHOLE_DRIFT:
        return tried
    if not tried.foreign:
        tried = _with_harmonics_in_doubt(fitted, tried, wanted, limits)
    A, b, _ = fitted.pieces.sum()
    beside = Model("", np.concatenate([tried.model.matrix, constant], axis=1), tried.model.start)
    places = np.flatnonzero(constant.any(axis=1))
    covariance = tried.solution.covariance.copy()
    covariance[np.ix_(places, places)] += solve(A, b, beside).covariance[np.ix_(places, places)]
    return replace(tried, solution=replace(tried.solution, covariance=covariance))


def _with_harmonics_in_doubt(
    fitted: Fitted, tried: VariantSolution, wanted: Wanted, limits: tuple[int, int]
) -> VariantSolution:
    """The solution with what harmonics c above the limits add to its error, E[(Gc)(Gc)ᵀ].

    Least squares without them gives C A P c too much, C its covariance, A the normal matrix, P
    their places, and lacks P c itself: G = C A P − P. E[c cᵀ] is that of c averaged over how large
    each may be, beside the model's own coefficients.
    """
    layout, model = fitted.layout, tried.model
    C, found = tried.solution.covariance, tried.solution.coefficients
    scale_factor = layout.compute_mean_scale_factor(found)
    beyond = dict(zip(("drift", "scale"), limits))
    kinds = [kind for kind in wanted.in_doubt if kind not in tried.averaged]
    left_out = find_doubtful_harmonics(layout, kinds, scale_factor, beyond)
    if not left_out:
        return tried
    A, b, _ = fitted.pieces.sum()
    places = np.concatenate([harmonic.places.ravel() for harmonic in left_out])
    P = np.eye(layout.size)[:, places]
    beside = Model(model.name, np.concatenate([model.matrix, P], axis=1), model.start)
    size = _InDoubt(beside, tuple(left_out), wanted.seed).average(A, b, FEWER_SWEEPS)
    c, spread = size.coefficients[places], size.covariance[np.ix_(places, places)]
    G = C @ A @ P - P
    more = G @ (spread + np.outer(c, c)) @ G.T
    return replace(tried, solution=replace(tried.solution, covariance=C + more))
