"""Least squares: linear ones whose columns are brought to one length first, and Gauss–Newton's loop
over them.

Amplitudes, phases, rates and frequencies stand beside each other in one design and differ by orders
of magnitude. A singular value means something only against the others of its matrix: with columns
of one length a cut of singular values (rcond) tells a column that repeats others from one that is
merely given in a small unit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, Literal, Protocol, TypeVar

import numpy as np

Array = np.ndarray
SHORTEST = 2.0**-10
"""Part of a step that is tried last."""
ROUNDING = 1e-12
"""Part of χ² that is the rounding of its sum of squares."""
NEAR_ZERO = 1e-9
"""The same where a fit leaves next to nothing of χ²."""


def measure_columns(design: Array) -> Array:
    """Lengths of the columns of a design.

    Parameters
    ----------
    design
        (n, k).

    Returns
    -------
    ndarray
        (k,); 1 for a column of zeros, which is left as it is.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.least_squares import measure_columns
    >>> measure_columns(np.array([[3.0, 0.0], [4.0, 0.0]])).tolist()
    [5.0, 1.0]
    """
    length = np.linalg.norm(design, axis=0)
    length[length == 0] = 1.0
    return np.asarray(length)


def invert_scaled(design: Array, rcond: float = 1e-12) -> Array:
    """The pseudo-inverse of a design, its rank judged on columns of one length.

    With design = U·diag(length) it is diag(1/length)·U⁺: the directions that `rcond` drops get
    nothing from the data, whatever their units.

    Parameters
    ----------
    design
        (n, k).
    rcond
        Part of the largest singular value below which a direction is dropped.

    Returns
    -------
    ndarray
        (k, n).

    Examples
    --------
    A column in a tiny unit counts as any other:

    >>> import numpy as np
    >>> from hrg_cli.fitting.least_squares import invert_scaled
    >>> np.diag(invert_scaled(np.diag([1.0, 1e-20]))).tolist()
    [1.0, 1e+20]
    """
    length = measure_columns(design)
    return np.asarray(np.linalg.pinv(design / length, rcond=rcond) / length[:, None])


def invert_information(
    information: Array, rcond: float = 1e-12, units: Array | None = None
) -> Array:
    """The pseudo-inverse of a symmetric information or covariance matrix, its rank judged on a
    diagonal of ones, or in units that are given.

    Parameters
    ----------
    information
        (k, k).
    rcond
        Part of the largest eigenvalue below which a direction is dropped.
    units
        Roots (k,) of what counts as one of the matrix's diagonal; None: those of the diagonal
        itself. Numbers of one unit that turn into each other, as an anisotropy's components do,
        need a common one: a direction of them that is not known would turn with units of their own.

    Returns
    -------
    ndarray
        (k, k); rows of zeros, of which the data know nothing, get nothing.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.least_squares import invert_information
    >>> np.diag(invert_information(np.diag([4.0, 2.0**-60, 0.0]))).tolist()
    [0.25, 1.152921504606847e+18, 0.0]
    """
    if units is None:
        units = np.sqrt(np.maximum(np.diag(information), 0.0))
        units[units == 0] = 1.0
    scale = np.outer(units, units)
    return np.asarray(np.linalg.pinv(information / scale, rcond=rcond, hermitian=True) / scale)


def invert_definite(matrix: Array) -> Array:
    """The inverse of a symmetric positive definite matrix, itself symmetric to the last digit.

    C = (L⁻¹)ᵀ L⁻¹ of the Cholesky factor L, on a diagonal of ones: a general inverse of a nearly
    singular matrix differs from its own transpose by as much as from the truth.

    Parameters
    ----------
    matrix
        (k, k).

    Returns
    -------
    ndarray
        (k, k).

    Raises
    ------
    numpy.linalg.LinAlgError
        Not positive definite.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.least_squares import invert_definite
    >>> steps = np.vander(np.linspace(0.0, 1.0, 50), 8) * 10.0 ** np.arange(8)
    >>> A = steps.T @ steps
    >>> C, general = invert_definite(A), np.linalg.inv(A)
    >>> bool(np.all(C == C.T)), bool(np.all(general == general.T))
    (True, False)
    """
    from scipy.linalg import solve_triangular

    size = np.sqrt(np.diag(matrix))
    scale = np.outer(size, size)
    factor = np.linalg.cholesky(matrix / scale)
    inverse = solve_triangular(factor, np.eye(len(size)), lower=True)
    return np.asarray(inverse.T @ inverse / scale)


def whiten_covariance(covariance: Array, rcond: float = 1e-12) -> tuple[Array, Array]:
    """What makes numbers of a covariance C independent of unit variance, the symmetric root of C⁺
    on a diagonal of ones: of all such matrices that which mixes them least.

    Parameters
    ----------
    covariance
        (k, k); numbers that the data cannot tell apart may leave it singular.
    rcond
        Part of the largest eigenvalue below which a direction is dropped.

    Returns
    -------
    tuple of ndarray
        W (k, k), and the projection (k, k) onto the directions that are left: W C Wᵀ.

    Examples
    --------
    Two numbers of which only the sum is known, to 0.2, and one that is known to 5:

    >>> import numpy as np
    >>> from hrg_cli.fitting.least_squares import whiten_covariance
    >>> C = np.array([[0.01, 0.01, 0.0], [0.01, 0.01, 0.0], [0.0, 0.0, 25.0]])
    >>> W, P = whiten_covariance(C)
    >>> P.round(9).tolist()
    [[0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [0.0, 0.0, 1.0]]
    >>> bool(np.allclose(W @ C @ W.T, P))
    True
    """
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    std[std == 0] = 1.0
    size, turned = np.linalg.eigh(covariance / np.outer(std, std))
    kept = size > rcond * max(float(size[-1]), 0.0)
    known = turned[:, kept]
    return (known / np.sqrt(size[kept])) @ known.T / std, known @ known.T


def square_over_covariance(offset: Array, covariance: Array, rcond: float = 1e-12) -> float:
    """An offset's square in standard deviations, aᵀ C⁺ a (Wald 1943; Mahalanobis's distance
    squared).

    Parameters
    ----------
    offset
        (k,).
    covariance
        (k, k); numbers that the data cannot tell apart may leave it singular.
    rcond
        As in `invert_information`.

    Returns
    -------
    float
        χ² of k numbers, where the offset is noise.

    Examples
    --------
    Three and four standard deviations, of two numbers in very different units:

    >>> import numpy as np
    >>> from hrg_cli.fitting.least_squares import square_over_covariance
    >>> round(square_over_covariance(np.array([3e-9, 400.0]), np.diag([1e-18, 1e4])), 9)
    25.0
    """
    return float(offset @ invert_information(covariance, rcond) @ offset)


def fit_columns(design: Array, target: Array, rcond: float = 1e-12) -> Array:
    """Least-squares answer; directions that the data do not show stay at 0.

    The design itself is decomposed, not its normal equations, whose condition is the square of its.

    Parameters
    ----------
    design
        (n, k).
    target
        (n,) or (n, m), real or complex.
    rcond
        Part of the largest singular value below which a direction is dropped.

    Returns
    -------
    ndarray
        (k,) or (k, m).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.least_squares import fit_columns
    >>> t = np.array([0.0, 1.0, 2.0])
    >>> fit_columns(np.column_stack([np.ones(3), t]), 1 + 2 * t).round(9).tolist()
    [1.0, 2.0]
    """
    length = measure_columns(design)
    found = np.linalg.lstsq(design / length, target, rcond=rcond)[0]
    return np.asarray((found.T / length).T)


def take_off_columns(target: Array, design: Array, rcond: float = 1e-12) -> Array:
    """What a design leaves of a target, (1 − J J⁺) y: the part perpendicular to its columns.

    Parameters
    ----------
    target
        (n,) or (n, m).
    design
        (n, k).
    rcond
        As in `fit_columns`.

    Returns
    -------
    ndarray
        As the target.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.least_squares import take_off_columns
    >>> take_off_columns(np.array([1.0, 2.0, 6.0]), np.ones((3, 1))).round(9).tolist()
    [-2.0, -1.0, 3.0]
    """
    return np.asarray(target - design @ fit_columns(design, target, rcond))


def solve(design: Array, target: Array, tolerance: float = 1e-9) -> tuple[Array, Array]:
    """Answer and covariance of a whitened problem; directions that the data do not show stay at 0.

    Parameters
    ----------
    design
        (n, k), every row over its standard deviation.
    target
        (n,), likewise.
    tolerance
        Part of the largest singular value below which a direction is dropped.

    Returns
    -------
    tuple of ndarray
        Answer (k,) and covariance (k, k).

    Examples
    --------
    The mean of four readings of σ = 1:

    >>> import numpy as np
    >>> from hrg_cli.fitting.least_squares import solve
    >>> mean, variance = solve(np.ones((4, 1)), np.array([1.0, 2.0, 3.0, 4.0]))
    >>> mean.round(9).tolist(), variance.round(9).tolist()
    ([2.5], [[0.25]])
    """
    inverse = invert_scaled(design, tolerance)
    return inverse @ target, inverse @ inverse.T


class Costed(Protocol):
    """A point of a descent with what is minimised there: χ² and what priors add to it."""

    @property
    def cost(self) -> float:
        """χ² with the priors' part; no number where the model has none."""
        ...


PointT = TypeVar("PointT", bound=Costed)
StepT = TypeVar("StepT")


@dataclass(frozen=True)
class StepTaken:
    """What came of a step: the part that was taken (0: no part lowers the cost) and the cost before
    and after it."""

    size: float
    before: float
    after: float

    @property
    def fall(self) -> float:
        """By how much the cost fell."""
        return self.before - self.after


class Problem(Protocol[PointT, StepT]):
    """A model to be fitted: its linear form at a point, the points along a step, and when a step is
    too small to matter."""

    def linearise(self, point: PointT) -> StepT | None:
        """Gauss–Newton's step from the residual and Jacobian at a point; None where they are no
        numbers."""
        ...

    def move(self, point: PointT, step: StepT, size: float) -> PointT:
        """The point a part of the step further."""
        ...

    def is_settled(self, step: StepT, taken: StepTaken) -> bool:
        """Whether what is left to gain after a step does not matter, in standard deviations of what
        is fitted or in units of χ²/dof."""
        ...


@dataclass(frozen=True)
class Optimum(Generic[PointT, StepT]):
    """Where a descent ended, the step that led there or was tried last (None: there was none), how
    many were tried, and why it ended."""

    point: PointT
    step: StepT | None
    steps: int
    reason: Literal["settled", "no part of the step lowers χ²", "no numbers", "too many steps"]

    @property
    def converged(self) -> bool:
        """Whether the point is the optimum as nearly as the problem asks."""
        return self.reason == "settled"


def descend(
    problem: Problem[PointT, StepT], start: PointT, most_steps: int, rounding: float = ROUNDING
) -> Optimum[PointT, StepT]:
    """Gauss–Newton with step halving: the one loop of every fit whose unknowns are few.

    Each step minimises |r + Jx|² of the model linearised where the last one ended; far from the
    optimum the linear form says too much, and the first of the step, its half, its quarter … that
    does not raise the cost is taken (Björck 1996, Numerical Methods for Least Squares Problems,
    §9.2.1). A step of which no part lowers the cost ends the descent: at the optimum, if the
    problem says that so small a step is settled, and nowhere else.

    Parameters
    ----------
    problem
        The model: its steps, its points, and what is small.
    start
        The first point.
    most_steps
        Steps after which the descent is given up.
    rounding
        Relative rise of the cost that is rounding.

    Returns
    -------
    Optimum
        The last point, and whether and why it is the optimum.

    Examples
    --------
    The rate ν of a decay e^{−νt} seen without noise:

    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> from hrg_cli.fitting.least_squares import descend, solve
    >>> t = np.linspace(0.0, 3.0, 30)
    >>> @dataclass(frozen=True)
    ... class At:
    ...     nu: float
    ...     def left(self):
    ...         return np.exp(-0.7 * t) - np.exp(-self.nu * t)
    ...     @property
    ...     def cost(self):
    ...         return float(np.sum(self.left() ** 2))
    >>> class Decay:
    ...     def linearise(self, at):
    ...         return solve((-t * np.exp(-at.nu * t))[:, None], at.left())[0]
    ...     def move(self, at, step, size):
    ...         return At(at.nu + size * float(step[0]))
    ...     def is_settled(self, step, taken):
    ...         return abs(float(step[0])) < 1e-9
    >>> found = descend(Decay(), At(2.0), 20)
    >>> found.converged, round(found.point.nu, 6)
    (True, 0.7)
    """
    here, step = start, None
    for count in range(1, most_steps + 1):
        new = problem.linearise(here)
        if new is None:
            return Optimum(here, step, count, "no numbers")
        step = new
        lower, size = _shorten(problem, here, step, rounding)
        taken = StepTaken(size, here.cost, lower.cost)
        here = lower
        if problem.is_settled(step, taken):
            return Optimum(here, step, count, "settled")
        if size == 0.0:
            return Optimum(here, step, count, "no part of the step lowers χ²")
    return Optimum(here, step, most_steps, "too many steps")


def _shorten(
    problem: Problem[PointT, StepT], here: PointT, step: StepT, rounding: float
) -> tuple[PointT, float]:
    """The first point along the step, its half, its quarter … whose cost is not higher, and the
    part taken; where there is none, (here, 0)."""
    size, limit = 1.0, here.cost * (1 + rounding) + NEAR_ZERO
    while size >= SHORTEST:
        trial = problem.move(here, step, size)
        if trial.cost <= limit:  # written so that a cost that is no number is never lower
            return trial, size
        size /= 2
    return here, 0.0
