"""Data that were not fitted, predicted fold by fold from one fit to all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..least_squares import solve
from .designs import orthonormalise

Array = np.ndarray


@dataclass(frozen=True)
class HeldOut:
    """Prediction of data that were not fitted: mean squared whitened residual per held-out fold
    with and without the extension."""

    before: Array
    after: Array

    @property
    def ratio(self) -> float:
        """rms before over rms after."""
        return float(np.sqrt(self.before.mean() / max(self.after.mean(), 1e-300)))

    @property
    def std(self) -> float:
        """Standard deviation of the ratio, from the scatter over the folds."""
        # folds scatter by factors; σ of a ratio is the ratio times σ of its logarithm
        logs = 0.5 * np.log(np.maximum(self.before, 1e-300) / np.maximum(self.after, 1e-300))
        return (
            float(self.ratio * logs.std(ddof=1) / np.sqrt(len(logs)))
            if len(logs) > 1
            else float("inf")
        )


def predict_folds(
    residual: Array,
    shared: Array,
    own: Mapping[int, Array],
    folds: Sequence[Array],
    prior: Array | None = None,
    least_information: float = 0.0,
) -> Array:
    """What every fold shows beside a fit to the other folds, linearised at the optimum of all.

    The joint optimum is moved to the optimum without the fold by one exact linear step. No fold is
    judged by a model that has seen it.

    Parameters
    ----------
    residual
        (N,), at the joint optimum, over σ.
    shared
        (N, k): columns of what is fitted on the other folds.
    own
        Fold -> (N_f, q): columns that belong to it alone, and are fitted on it in both cases.
    folds
        The rows of each, as places.
    prior
        (h, k): rows that pull the shared numbers, over their σ; None for none.
    least_information
        Part of all information on a combination of numbers that the other folds must hold; one of
        which they hold less stays where it is.

    Returns
    -------
    ndarray
        (N,): what is left of every row, over σ.

    Examples
    --------
    Two folds of a mean. Each is predicted by the other, which misses it by their difference:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.left_out_folds import predict_folds
    >>> readings = np.array([0.0, 0.0, 1.0, 1.0])
    >>> folds = [np.array([0, 1]), np.array([2, 3])]
    >>> none = {0: np.zeros((2, 0)), 1: np.zeros((2, 0))}
    >>> left = predict_folds(readings - 0.5, np.ones((4, 1)), none, folds)
    >>> left.round(9).tolist()
    [-1.0, -1.0, 1.0, 1.0]
    """
    out = residual.copy()
    bases = _bases(own, folds)
    parts, pull, size = _condense(residual, shared, bases, folds, prior)
    for number, (fold, basis) in enumerate(zip(folds, bases, strict=True)):
        step = _step(_leave_out(parts, pull, number), size, least_information)
        left = residual[fold] - shared[fold] @ step
        # what belongs to this fold alone no other fold tells: it is fitted to the fold itself
        out[fold] = left - basis @ (basis.T @ left)
    return out


def score_folds(
    residual: Array,
    shared: Array,
    own: Mapping[int, Array],
    folds: Sequence[Array],
    prior: Array | None,
    least_information: float,
) -> float:
    """−2 ln of the density that the other folds give to each fold, summed, less a constant.

    A fold's error e is weighed by all that is not known of it, C = 1 + X P Xᵀ with P the covariance
    of the others' numbers: eᵀC⁻¹e + ln|C| = χ² − χ²₋f + ln|A| − ln|A₋f|, with the smallest χ² and
    the information A of all folds and of all but one (Gelman et al. 2013, Bayesian Data Analysis,
    §7.2). A plain sum of e² is ruled by what the others hardly tell: a start, a number of one fold.

    Parameters
    ----------
    residual, shared, own, folds, prior
        As in `predict_folds`.
    least_information
        Part of all information on a combination of numbers that counts as known without the fold.

    Returns
    -------
    float
        The score: of two models of the same rows the one with the lower predicts better.

    Examples
    --------
    A slope that is there predicts what was left out, a column of chance does not:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.left_out_folds import score_folds
    >>> draw = np.random.default_rng(5)
    >>> t, chance = np.linspace(-1, 1, 400), draw.standard_normal(400)
    >>> y, folds = t + draw.standard_normal(400), np.split(np.arange(400), 5)
    >>> def score(*columns):
    ...     X = np.column_stack([np.ones(400), *columns])
    ...     left = y - X @ np.linalg.lstsq(X, y)[0]
    ...     none = dict.fromkeys(range(5), np.zeros((80, 0)))
    ...     return score_folds(left, X, none, folds, None, 1e-4)
    >>> score(t) < score(t, chance) < score()
    True
    """
    parts, pull, size = _condense(residual, shared, _bases(own, folds), folds, prior)
    least, known = _least(np.concatenate(parts + pull), size, least_information)
    # p(fold | others) = p(all)/p(others); −2 ln of either, its numbers integrated out, is the least
    # χ² and ln of the information's determinant
    total = 0.0
    for number in range(len(parts)):
        without, left = _least(_leave_out(parts, pull, number), size, least_information)
        total += least - without + known - left
    return total


def _least(equations: Array, size: Array, least_information: float) -> tuple[float, float]:
    """(Smallest χ², ln of the determinant of the information) of equations (n, k + 1); size (k,):
    of the columns in all folds."""
    along, power, _ = _seen(equations, size, least_information)
    # what is not seen counts with the least information: all folds and all but one then have
    # determinants of as many factors
    least = np.full(len(size) - len(power), least_information)
    chi2 = float(equations[:, -1] @ equations[:, -1] - along @ along)
    return chi2, float(np.sum(np.log(np.concatenate([power, least]))))


def _seen(equations: Array, size: Array, least_information: float) -> tuple[Array, Array, Array]:
    """(Right side, information, combinations of numbers over `size`) of equations (n, k + 1) along
    the combinations that they hold enough information on."""
    U, s, Vt = np.linalg.svd(equations[:, :-1] / size, full_matrices=False)
    keep = s**2 >= least_information
    return U[:, keep].T @ equations[:, -1], s[keep] ** 2, Vt[keep]


def _leave_out(parts: Sequence[Array], pull: Sequence[Array], number: int) -> Array:
    """Equations (n, k + 1) of all folds but one, and of the prior."""
    none = np.zeros((0, parts[number].shape[1]))
    return np.concatenate([none, *parts[:number], *parts[number + 1 :], *pull])


def _bases(own: Mapping[int, Array], folds: Sequence[Array]) -> list[Array]:
    """Orthonormal columns of what belongs to each fold alone."""
    return [
        orthonormalise(own[f]) if own[f].shape[1] else np.zeros((len(rows), 0))
        for f, rows in enumerate(folds)
    ]


def _condense(
    residual: Array,
    shared: Array,
    bases: Sequence[Array],
    folds: Sequence[Array],
    prior: Array | None,
) -> tuple[list[Array], list[Array], Array]:
    """(Columns and residual of every fold less what belongs to it alone, condensed to few rows; the
    prior's rows; length of the columns in all of them)."""
    # R of a QR has the normal equations of the rows themselves: a fold of thousands becomes k + 1
    both = np.column_stack([shared, residual])
    parts = [
        np.asarray(np.linalg.qr(both[rows] - basis @ (basis.T @ both[rows]), mode="r"))
        for rows, basis in zip(folds, bases, strict=True)
    ]
    pull = [] if prior is None else [np.column_stack([prior, np.zeros(len(prior))])]
    size = np.linalg.norm(np.concatenate(parts + pull)[:, :-1], axis=0)
    size[size == 0] = 1.0
    return parts, pull, size


def _step(equations: Array, size: Array, least_information: float) -> Array:
    """Least-squares step (k,) by some folds alone, equations (n, k + 1); size (k,): of the columns
    in all folds."""
    if not len(equations):
        return np.zeros(len(size))
    if not least_information:
        return solve(equations[:, :-1], equations[:, -1])[0]
    along, power, combinations = _seen(equations, size, least_information)
    return np.asarray(combinations.T @ (along / np.sqrt(power)) / size)
