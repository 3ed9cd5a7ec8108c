"""Least squares whose columns are brought to one length first, solved by the design or by its normal
equations.

Amplitudes, phases, rates and frequencies stand beside each other in one design and differ by orders
of magnitude. A singular value means something only against the others of its matrix: with columns
of one length a cut of singular values (rcond) tells a column that repeats others from one that is
merely given in a small unit.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def measure_columns(design: Array) -> Array:
    """Lengths (k,) of the columns of a design (n, k); 1 for a column of zeros, which is left as it
    is."""
    length = np.linalg.norm(design, axis=0)
    length[length == 0] = 1.0
    return np.asarray(length)


def invert_scaled(design: Array, rcond: float = 1e-12) -> Array:
    """The pseudo-inverse (k, n) of a design (n, k), its rank judged on columns of one length.

    With design = U·diag(length) it is diag(1/length)·U⁺: the directions that `rcond` drops get
    nothing from the data, whatever their units.
    """
    length = measure_columns(design)
    return np.asarray(np.linalg.pinv(design / length, rcond=rcond) / length[:, None])


def invert_information(information: Array, rcond: float = 1e-12) -> Array:
    """The pseudo-inverse (k, k) of a symmetric information matrix, its rank judged on a diagonal of
    ones; rows of zeros, of which the data know nothing, get nothing."""
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    size[size == 0] = 1.0
    scale = np.outer(size, size)
    return np.asarray(np.linalg.pinv(information / scale, rcond=rcond, hermitian=True) / scale)


def solve(design: Array, target: Array, tolerance: float = 1e-9) -> tuple[Array, Array]:
    """Answer (k,) and covariance (k, k) of a whitened problem with design (n, k) and target (n,);
    directions that the data do not show stay at 0."""
    inverse = invert_scaled(design, tolerance)
    return inverse @ target, inverse @ inverse.T
