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
    """Residual (N,) of every fold when the shared columns are fitted on the other folds, linearised
    at the optimum.

    residual (N,) at the joint optimum; shared (N, k); own[f] (N_f, q) columns that belong to fold f
    alone (fitted on it in both cases); folds: index arrays. The joint optimum is moved to the
    optimum without the fold by one exact linear step. least_information: part of all information on
    a combination of numbers that the other folds must hold; one of which they hold less stays where
    it is.
    """
    out = residual.copy()
    both = np.column_stack([shared, residual])
    bases = [
        orthonormalise(own[f]) if own[f].shape[1] else np.zeros((len(rows), 0))
        for f, rows in enumerate(folds)
    ]
    parts = [
        both[rows] - basis @ (basis.T @ both[rows])
        for rows, basis in zip(folds, bases, strict=True)
    ]
    parts = [np.linalg.qr(part, mode="r") for part in parts]
    pull = [] if prior is None else [np.column_stack([prior, np.zeros(len(prior))])]
    size = np.linalg.norm(np.concatenate(parts + pull)[:, :-1], axis=0)
    size[size == 0] = 1.0
    for number, (fold, basis) in enumerate(zip(folds, bases, strict=True)):
        others = [parts[k] for k in range(len(folds)) if k != number]
        equations = np.concatenate(others + pull) if others else np.zeros((0, both.shape[1]))
        step = _step(equations[:, :-1], equations[:, -1], size, least_information)
        left = residual[fold] - shared[fold] @ step
        out[fold] = left - basis @ (basis.T @ left)
    return out


def _step(columns: Array, residual: Array, size: Array, least_information: float) -> Array:
    """Least-squares step (k,) by some folds alone; size (k,): of the columns in all folds."""
    if not len(columns):
        return np.zeros(columns.shape[1])
    if not least_information:
        return solve(columns, residual)[0]
    U, s, Vt = np.linalg.svd(columns / size, full_matrices=False)
    keep = s**2 >= least_information
    return np.asarray(Vt[keep].T @ (U[:, keep].T @ residual / s[keep]) / size)
