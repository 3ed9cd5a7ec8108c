"""What a matrix must be to be a covariance."""

from __future__ import annotations

import numpy as np

Array = np.ndarray
ROUNDING = 1e-6
"""Of the deviations: by how much rounding may break the symmetry, or carry a correlation past 1."""


def find_covariance_problem(matrix: Array) -> str | None:
    """Why a matrix is no covariance.

    Variances are not negative, the matrix is symmetric, and no correlation is beyond ±1
    (Cauchy and Schwarz: c_ij² ≤ c_ii c_jj).

    Parameters
    ----------
    matrix
        (k, k).

    Returns
    -------
    str or None
        In words; None where it may be one.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.store.covariance_checks import find_covariance_problem
    >>> find_covariance_problem(np.eye(2))
    >>> find_covariance_problem(np.array([[1.0, 2.0], [2.0, 1.0]]))
    'has a correlation of 2 in row 1, column 2, from -1 to 1 was expected'
    """
    matrix = np.asarray(matrix, float)
    variances = np.diag(matrix)
    if np.any(variances < 0):
        first = int(np.argmax(variances < 0))
        return f"holds a negative variance, {variances[first]:.9g} in row {first + 1}"
    deviations = np.sqrt(variances)
    largest = deviations[:, None] * deviations
    with np.errstate(divide="ignore", invalid="ignore"):
        correlations = np.where(matrix == 0, 0.0, matrix / largest)
    row, other = np.unravel_index(int(np.argmax(np.abs(correlations))), matrix.shape)
    worst, where = correlations[row, other], f"in row {row + 1}, column {other + 1}"
    if abs(worst) > 1 + ROUNDING:
        return f"has a correlation of {worst:.3g} {where}, from -1 to 1 was expected"
    uneven = np.abs(correlations - correlations.T) > ROUNDING
    if np.any(uneven):
        row, other = np.argwhere(uneven)[0]
        return f"is not symmetric in row {row + 1}, column {other + 1}, as a covariance is"
    return None
