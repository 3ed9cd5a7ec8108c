"""Normal equations of many runs in pieces of time, and the least squares made of their sums.

A fold or a group of runs is a sum of pieces; a model is a matrix that maps its own coefficients to
the full set. Held-out fits are then small linear algebra, with no second pass over the rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..noise.increment_noise import AngleNoise, Whitener, build_covariance_bands
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
    """Normal equations of R runs × S pieces about coefficients β₀ (P,): information XᵀX (R, S, P,
    P), and of what they leave, r = y − X β₀, the vector Xᵀr (R, S, P) and square rᵀr (R, S); rows
    (R, S).

    Turns are whole radians and their noise nanoradians: Σ y² holds no digit of Σ r².
    """

    about: Array
    information: Array
    vector: Array
    square: Array
    rows: Array

    @property
    def count(self) -> int:
        """Rows of all pieces."""
        return int(self.rows.sum())

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


def number_pieces(length: int) -> Array:
    """Piece of each increment, contiguous in time.

    Parameters
    ----------
    length
        Increments of the run.

    Returns
    -------
    ndarray
        (n,): 0 to `PIECES` − 1.

    Examples
    --------
    >>> from hrg_cli.fitting.tables.normal_pieces import number_pieces
    >>> number_pieces(10).tolist()
    [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    """
    return np.arange(length) * PIECES // max(length, 1)


def accumulate(
    paths: Sequence[AnglePath],
    noises: Sequence[AngleNoise],
    layout: TableLayout,
    turns: Sequence[Array],
    previous: Array | None = None,
    about: Array | None = None,
) -> Pieces:
    """Whitened normal equations of all runs.

    Parameters
    ----------
    paths
        The runs.
    noises
        Noise of each, which whitens its rows.
    layout
        Order of the coefficients.
    turns
        m·Δθ [rad] of each run, (n,).
    previous
        Coefficients (size,) whose slopes give a monotone interpolation its weights; None: linear
        ones.
    about
        Coefficients (size,) near the answer, which keep its χ² precise; None: zero.

    Returns
    -------
    Pieces
        One a run and piece of time.

    Examples
    --------
    Four seconds with a walk of 4 rad²/s tell a drift to σ² = q/T = 1 (rad/s)²:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.increment_noise import AngleNoise
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.normal_pieces import accumulate
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> path = draw_path(0.1, blocks=5, width_s=0.0)
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 0, 0)
    >>> pieces = accumulate([path], [AngleNoise(0.0, 4.0)], layout, [np.zeros(4)])
    >>> round(float(pieces.sum()[0][0, 0]), 9)
    1.0
    """
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
        piece = number_pieces(len(path))
        whitener = Whitener(build_covariance_bands(path, noise))
        for rows in split_stretches(len(path)):
            design = build_design(path, layout, previous, rows)
            white = whitener.whiten_next(np.column_stack([design, turn[rows] - design @ about]))
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
    """Least squares in a model's space.

    Directions that the data do not see (scaled eigenvalue < `LEAST_SEEN`) stay at zero.

    Parameters
    ----------
    information, vector
        Normal equations (size, size) and (size,) with unit noise.
    model
        What of the coefficients is free.
    penalty
        (size, size), added to the information; none by default.

    Returns
    -------
    TableSolution
        In the full set of coefficients.

    Examples
    --------
    Four looks of mean 2 and σ = 1; of the second coefficient nothing is seen:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.normal_pieces import solve
    >>> from hrg_cli.fitting.tables.table_layout import Model
    >>> found = solve(np.diag([4.0, 0.0]), np.array([8.0, 0.0]), Model("both", np.eye(2)))
    >>> found.coefficients.tolist(), float(found.covariance[0, 0]), found.degrees
    ([2.0, 0.0], 0.25, 1.0)
    """
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
    # trace of the hat matrix: fewer than the coefficients where a penalty holds some of them
    return TableSolution(
        start + M @ (covariance @ b), M @ covariance @ M.T, float(np.trace(covariance @ data))
    )


def compute_held_out_chi_square(
    pieces: Pieces, folds: Array, model: Model, penalty: Array | None = None
) -> float:
    """Sum over folds of the whitened residuals squared, each fold predicted from the others.

    Parameters
    ----------
    pieces
        Of R runs and S pieces of time.
    folds
        (R, S): number of the fold that each is in.
    model
        What of the coefficients is free.
    penalty
        (size, size), as in `solve`.

    Returns
    -------
    float
        χ².

    Examples
    --------
    Of the values 1 and 3 each is predicted by the other, 2 off:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.normal_pieces import Pieces, compute_held_out_chi_square
    >>> from hrg_cli.fitting.tables.table_layout import Model
    >>> y = np.array([[1.0, 3.0]])
    >>> ones = np.ones((1, 2), int)
    >>> pieces = Pieces(np.zeros(1), np.ones((1, 2, 1, 1)), y[..., None], y**2, ones)
    >>> compute_held_out_chi_square(pieces, np.array([[0, 1]]), Model("mean", np.eye(1)))
    8.0
    """
    A, b, _ = pieces.sum()
    total = 0.0
    for f in range(int(folds.max()) + 1):
        A_f, b_f, _ = pieces.sum(folds == f)
        others = solve(A - A_f, b - b_f, model, penalty)
        total += pieces.compute_chi_square(others.coefficients, folds == f)
    return total
