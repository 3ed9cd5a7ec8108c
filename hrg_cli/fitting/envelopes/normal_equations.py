"""Normal equations that add up over runs and sides, with constants of each group taken out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce

import numpy as np

from ..least_squares import invert_information

Array = np.ndarray


@dataclass(frozen=True)
class Normal:
    """Least squares of (δω cos, δω sin, νδμ cos, νδμ sin): information (4, 4), its product with the
    answer (4,), Σ of weighted targets², rows less constants."""

    information: Array
    product: Array
    square: float
    freedom: int

    def __add__(self, other: Normal) -> Normal:
        return Normal(
            self.information + other.information,
            self.product + other.product,
            self.square + other.square,
            self.freedom + other.freedom,
        )

    def solve(self) -> tuple[Array, Array]:
        """(answer (4,), covariance (4, 4)) at the stated noise."""
        covariance = invert_information(self.information)
        return covariance @ self.product, covariance

    def compute_misfit(self, answer: Array) -> float:
        """χ² of an answer (4,)."""
        return float(self.square - 2 * answer @ self.product + answer @ self.information @ answer)


def add_normals(parts: Iterable[Normal]) -> Normal:
    """All normal equations of the same unknowns together.

    Parameters
    ----------
    parts
        Of each run or side, at least one.

    Returns
    -------
    Normal
        Their sum.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.normal_equations import Normal, add_normals
    >>> one = Normal(np.eye(4), np.ones(4), 4.0, 3)
    >>> add_normals([one, one]).freedom
    6
    """
    return reduce(Normal.__add__, parts)


def build_normal(columns: Array, target: Array, std: Array, group: Array, own: int = 0) -> Normal:
    """Normal equations of a target by columns, each group of rows with a constant of its own.

    Parameters
    ----------
    columns
        (n, own + 4).
    target, std
        (n,), the standard deviation in the target's unit.
    group
        Which constant a row has, (n,).
    own
        The first unknowns, which are nobody else's and are eliminated.

    Returns
    -------
    Normal
        Of the four common unknowns.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.normal_equations import build_normal
    >>> rows = np.random.default_rng(1).standard_normal((50, 4))
    >>> found = build_normal(rows, rows @ [1.0, 2.0, 3.0, 4.0] + 7.0, np.ones(50), np.zeros(50))
    >>> found.solve()[0].round(9).tolist(), found.freedom
    ([1.0, 2.0, 3.0, 4.0], 49)
    """
    joined = take_means_off(np.column_stack([columns, target]), std, group)
    basis = np.linalg.qr(joined[:, :own])[0]
    joined = (joined - basis @ (basis.T @ joined))[:, own:]
    x, y = joined[:, :-1], joined[:, -1]
    return Normal(x.T @ x, x.T @ y, float(y @ y), len(y) - len(np.unique(group)) - own)


def take_means_off(columns: Array, std: Array, group: Array) -> Array:
    """Columns over their standard deviation, less the weighted mean of each group.

    Parameters
    ----------
    columns
        (n, k).
    std, group
        (n,).

    Returns
    -------
    ndarray
        (n, k).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.normal_equations import take_means_off
    >>> take_means_off(np.array([[1.0], [3.0], [5.0]]), np.ones(3), np.array([0, 0, 1])).tolist()
    [[-1.0], [1.0], [0.0]]
    """
    index = np.unique(group, return_inverse=True)[1]
    weight = 1 / std**2
    total = np.bincount(index, weight)
    mean = np.stack([np.bincount(index, weight * c) for c in columns.T], axis=1) / total[:, None]
    return np.asarray((columns - mean[index]) / std[:, None])
