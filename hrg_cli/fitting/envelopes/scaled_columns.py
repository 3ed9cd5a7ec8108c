"""Least squares whose columns are brought to one length first.

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
