"""Spikes among few rows, each held against what the others say of it: extreme studentised
deviates."""

from __future__ import annotations

import numpy as np
from scipy.stats import t as students_t

from ..least_squares import invert_scaled

Array = np.ndarray
LEAST_OWN = 1e-6
"""Part of a row that the curve of the others must leave free for the row to be judged by them."""
LEAST_LEFT = 3
"""Rows beyond the coefficients that must remain for their scatter to be told."""


def find_deviating_rows(
    y: Array, X: Array, most: int, chance: float, limit: float, least_spread: float
) -> Array:
    """Rows that lie further from the curve of the others than chance puts them.

    A row that a curve of few others follows pulls it, and swells the scatter by which it is judged:
    it is held against the fit without it, t = r/(s√(1 − h)) with residual r and leverage h, and s
    of the fit in which the row has a shift of its own. The row of the largest |t| is left out, up
    to `most` times; the last at which |t| is beyond chance settles how many deviate, so that two do
    not hide each other (generalised extreme studentised deviates; Rosner, Technometrics 25, 1983).

    Parameters
    ----------
    y
        Values (n,).
    X
        Columns (n, p) of the curve.
    most
        Rows that may deviate, at most; one more is looked at.
    chance
        Of a row by chance, for all n together.
    limit
        Least |t|.
    least_spread
        What the rows scatter by at least: of the values' rounding.

    Returns
    -------
    ndarray
        (m,) places of the rows, the furthest first; m ≤ most + 1.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.dwell_spikes import find_deviating_rows
    >>> x = np.arange(10.0)
    >>> y = x + 0.1 * np.random.default_rng(0).standard_normal(10)
    >>> y[4] += 5.0
    >>> X = np.stack([np.ones(10), x], axis=1)
    >>> find_deviating_rows(y, X, 2, 1e-3, 6.0, 0.0).tolist()
    [4]
    """
    n = len(y)
    own = np.eye(n) - X @ invert_scaled(X)
    rest, left = own @ y, n - int(np.linalg.matrix_rank(X))
    order: list[int] = []
    count = 0
    # a row left out needs LEAST_LEFT others beside it that tell the scatter
    while len(order) <= most and left - 1 >= LEAST_LEFT:
        free = np.diag(own)
        judged = free > LEAST_OWN
        judged[order] = False
        if not judged.any():
            break
        fall = np.where(judged, rest**2 / np.where(judged, free, 1.0), 0.0)
        spread = np.maximum((rest @ rest - fall) / (left - 1), least_spread**2)
        deviate = np.where(judged, np.sqrt(fall / np.maximum(spread, np.finfo(float).tiny)), 0.0)
        worst = int(np.argmax(deviate))
        order.append(worst)
        tail = chance / (2 * (n - len(order) + 1))
        if deviate[worst] > max(limit, students_t.isf(tail, left - 1)):
            count = len(order)
        rest = rest - own[:, worst] * (rest[worst] / free[worst])
        own = own - np.outer(own[:, worst], own[worst]) / free[worst]
        left -= 1
    return np.array(order[:count], int)
