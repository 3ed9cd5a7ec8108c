"""Normal equations of many runs in pieces of time, and the least squares made of their sums.

A fold or a group of runs is a sum of pieces; a model is a matrix that maps its own coefficients to
the full set. Held-out fits are then small linear algebra, with no second pass over the rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .increment_noise import AngleNoise, Whitener, build_covariance_bands
from .increments import AnglePath
from .table_design import build_design, split_stretches
from .table_layout import Model, TableLayout

Array = np.ndarray
PIECES = 5
"""Pieces of time a run is cut into."""


LEAST_SEEN = 1e-10
"""Eigenvalue of the scaled normal matrix below which the data do not see a direction."""


@dataclass
class Pieces:
    """Normal equations of R runs × S pieces about coefficients β₀ (P,): information XᵀX (R, S, P, P),
    and of what they leave, r = y − X β₀, the vector Xᵀr (R, S, P) and square rᵀr (R, S); rows (R, S).

    Turns are whole radians and their noise nanoradians: Σ y² holds no digit of Σ r².
    """

    about: Array
    information: Array
    vector: Array
    square: Array
    rows: Array

    def sum(self, where: Array | None = None) -> tuple[Array, Array, int]:
        """(XᵀX, Xᵀy, n) of the chosen pieces (R, S) bool or weights; all by default."""
        w = self._weights(where)
        information = np.tensordot(w, self.information, axes=2)
        vector = np.tensordot(w, self.vector, axes=2) + information @ self.about
        return information, vector, int((w * self.rows).sum())

    def compute_chi_square(self, coefficients: Array, where: Array | None = None) -> float:
        """Σ of whitened residuals squared of the chosen pieces, for given coefficients."""
        w, off = self._weights(where), coefficients - self.about
        information = np.tensordot(w, self.information, axes=2)
        vector = np.tensordot(w, self.vector, axes=2)
        return float((w * self.square).sum() - 2 * vector @ off + off @ information @ off)

    def _weights(self, where: Array | None) -> Array:
        return np.ones(self.square.shape) if where is None else np.asarray(where, float)


def piece_of(length: int) -> Array:
    """Piece of each increment (n,), contiguous in time."""
    return np.arange(length) * PIECES // max(length, 1)


def accumulate(
    paths: Sequence[AnglePath],
    noises: Sequence[AngleNoise],
    layout: TableLayout,
    turns: Sequence[Array],
    previous: Array | None = None,
    about: Array | None = None,
) -> Pieces:
    """Whitened normal equations of all runs. turns: m·Δθ of each run; previous: coefficients whose
    weights of the nodes count; about: coefficients near the answer (default: none, zero)."""
    shape = (len(paths), PIECES)
    about = np.zeros(layout.size) if about is None else about
    pieces = Pieces(
        about,
        np.zeros((*shape, layout.size, layout.size)),
        np.zeros((*shape, layout.size)),
        np.zeros(shape),
        np.zeros(shape, int),
    )
    for r, (path, noise, turn) in enumerate(zip(paths, noises, turns)):
        piece = piece_of(len(path))
        whitener = Whitener(build_covariance_bands(path, noise))
        for rows in split_stretches(len(path)):
            design = build_design(path, layout, previous, rows)
            white = whitener.next(np.column_stack([design, turn[rows] - design @ about]))
            for s in np.unique(piece[rows]):
                own = white[piece[rows] == s]
                X, left = own[:, :-1], own[:, -1]
                pieces.information[r, s] += X.T @ X
                pieces.vector[r, s] += X.T @ left
                pieces.square[r, s] += left @ left
                pieces.rows[r, s] += len(left)
    return pieces


@dataclass(frozen=True)
class TableSolution:
    """Coefficients in the full set, their covariance and the effective number of coefficients."""

    coefficients: Array
    covariance: Array
    degrees: float


def solve(
    information: Array, vector: Array, model: Model, penalty: Array | None = None
) -> TableSolution:
    """Least squares in a model's space; directions the data do not see (scaled eigenvalue <
    `LEAST_SEEN`) stay at zero."""
    M = model.matrix
    start = np.zeros(len(vector)) if model.start is None else model.start
    A, b = M.T @ information @ M, M.T @ (vector - information @ start)
    data = A
    if penalty is not None:
        A = A + M.T @ penalty @ M
        b = b - M.T @ penalty @ start
    # D in rad/s and K without unit: a rank is judged on a matrix with a diagonal of ones.
    scale = np.sqrt(np.maximum(np.diag(A), 0))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(A / np.outer(scale, scale))
    seen = values > LEAST_SEEN
    inverse = np.where(seen, 1 / np.where(seen, values, 1.0), 0.0)
    covariance = (vectors * inverse) @ vectors.T / np.outer(scale, scale)
    return TableSolution(
        start + M @ (covariance @ b), M @ covariance @ M.T, float(np.trace(covariance @ data))
    )


def compute_held_out_chi_square(
    pieces: Pieces, folds: Array, model: Model, penalty: Array | None = None
) -> float:
    """Σ over folds of the whitened residuals squared, each fold predicted from the others."""
    A, b, _ = pieces.sum()
    total = 0.0
    for f in range(int(folds.max()) + 1):
        A_f, b_f, _ = pieces.sum(folds == f)
        others = solve(A - A_f, b - b_f, model, penalty)
        total += pieces.compute_chi_square(others.coefficients, folds == f)
    return total
