"""Noise coefficients fitted to an Allan variance, with intervals
(IEEE Std 952 annex C, IEEE Std 1431).

    σ²(τ) = 3Q²/τ² + N²/τ + B²·2 ln 2/π + K²τ/3
quantization Q, angle random walk N, bias instability B, rate random walk K. The values at different
averaging times come from one record and are strongly correlated: with the two-sided density S(f) of
the terms found and the filter of n samples

    |H|² = 2 sin⁴(πfnτ₀)/(n sin πfτ₀)²,   cov(σ²_i, σ²_j) = (1/T)∫(2S)²|H_i|²|H_j|² df.

The squares of the coefficients, not negative, are fitted by generalised least squares with it,
iterated; the interval of a coefficient is that of its square. A term that is not told from zero is
left out; its upper limit is that of a record which holds as much, and the others' intervals hold
what they would be beside it at that limit. So of a flicker and a random walk neither is told where
either would do.

Rates that are differences of angles averaged over windows of width w hold the noise of the rate
through a further box, sinc²(πfw) in S: white rate noise leaves N²/τ·(1 − w/2τ), half of N²/τ where
a window fills the interval. Windows that stand for their middle (`curvatures` of the demodulation)
pass more of what is quick: their gain comes beside the box; left out, N would come out 3 % high.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...records import Array
from ..least_squares import fit_columns, invert_information
from ..samples.envelope_motion import compute_gain_at_middle
from .allan import compute_allan_deviation

NAMES = ("quantization", "angle_random_walk", "bias_instability", "rate_random_walk")
POINTS = 18
LONGEST = 0.125
"""Part of the record up to which averaging times are fitted: beyond, a variance of two or three
differences is far from normal."""
ROUNDS = 5
FREQUENCIES = 20_000
SLOWEST, QUICKEST = 1e-4, 1e2
"""Frequencies times τ between which a spectrum through a box is integrated; beyond them the filter
leaves less than 1e-4."""
SEEN = 2.0
"""Standard deviations of a squared coefficient from which it is told from zero."""
NORMAL_95 = 1.96
ONE_SIDED_95 = 1.645
LIMIT_ROUNDS = 3


@dataclass(frozen=True)
class Coefficient:
    """A coefficient in SI units: value (0 where it is not told from zero), standard deviation, and
    95 % interval."""

    value: float
    std: float
    low: float
    high: float

    @property
    def seen(self) -> bool:
        """Whether it is told from zero."""
        return self.low > 0


@dataclass(frozen=True)
class AllanTerms:
    """Averaging times [s], Allan deviations, what the terms make of them, the coefficients by name,
    and χ² per degree of freedom."""

    time_s: Array
    deviation: Array
    model: Array
    coefficients: dict[str, Coefficient]
    chi2: float
    dof: int


def fit_allan_terms(
    rate: Array, interval_s: float, window_s: float = 0.0, bend_off_s: float = 0.0
) -> AllanTerms:
    """Fit the four terms to the overlapping Allan variance of a rate.

    σ²(τ) = 3Q²/τ² + N²/τ + B²·2 ln 2/π + K²τ/3 (IEEE Std 952, annex C), by generalised least
    squares with the covariance that the terms found give the values at different averaging times.

    Parameters
    ----------
    rate
        (n,) [rad/s], evenly sampled, at least 30 values.
    interval_s
        Their spacing.
    window_s
        Width of the even average behind the angles whose differences the rates are.
    bend_off_s
        Length of the windows in it that stand for their middle, 0: for their mean.

    Returns
    -------
    AllanTerms
        The coefficients in SI units with their intervals, beside the deviations they were fitted
        to.

    Examples
    --------
    White noise of 1 rad/s at 1 Hz is an angle random walk of 1 rad/√s and nothing else.

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.allan_terms import fit_allan_terms
    >>> found = fit_allan_terms(np.random.default_rng(0).standard_normal(4000), 1.0).coefficients
    >>> [name for name, one in found.items() if one.seen]
    ['angle_random_walk']
    >>> found["angle_random_walk"].low < 1.0 < found["angle_random_walk"].high
    True
    """
    rate = np.asarray(rate, float)
    time, deviation, relative = compute_allan_deviation(rate, interval_s, POINTS)
    known = time <= LONGEST * len(rate) * interval_s
    time, deviation, relative = time[known], deviation[known], relative[known]
    variance = deviation**2
    terms = np.stack(
        [3 / time**2, 1 / time, np.full(len(time), 2 * np.log(2) / np.pi), time / 3], axis=1
    )
    terms[:, 1:] *= compute_kept_part(time, window_s, bend_off_s)
    # columns of length one over the measured variances: the squares span twenty decades
    unit = 1 / np.linalg.norm(terms / np.maximum(variance, 1e-300)[:, None], axis=0)
    design = terms * unit
    covariance = np.diag((2 * variance * relative) ** 2)
    weights = _filters(time, interval_s, len(rate))
    problem = _Problem(
        design,
        variance,
        lambda found: _covariance(found * unit, weights, interval_s, window_s, bend_off_s),
    )
    # the covariance is that of the terms found, which it weighs: a fixed point, reached in few
    for _ in range(ROUNDS):
        covariance = problem.covariance_of(problem.solve(covariance, range(len(NAMES)))[0])
    kept, squares, stds = _drop_unseen(problem, covariance)

    limits = _limits(problem, kept, squares)
    least = _find_least_squares(problem, covariance, kept, squares, limits)
    model = design @ squares
    chi2 = float(np.sum((_root(covariance) @ (variance - model)) ** 2))
    found = {k: _unseen(limit * unit[k]) for k, limit in limits.items()}
    for k in kept:
        found[k] = _coefficient(squares[k] * unit[k], stds[k] * unit[k], least[k] * unit[k])
    return AllanTerms(
        time,
        deviation,
        np.sqrt(model),
        {name: found[k] for k, name in enumerate(NAMES)},
        chi2,
        len(time) - len(kept),
    )


@dataclass(frozen=True)
class _Problem:
    """Terms (points, 4), their columns of length one, the variances (points,) that they add up to,
    and the covariance of these that given terms have."""

    design: Array
    variance: Array
    covariance_of: Callable[[Array], Array]

    def solve(self, covariance: Array, kept: Sequence[int]) -> tuple[Array, Array]:
        """Squares (4,) of some of the terms, not negative, and their standard deviations."""
        from scipy.optimize import nnls

        root, own = _root(covariance), list(kept)
        white = root @ self.design[:, own]
        squares, stds = np.zeros(len(NAMES)), np.zeros(len(NAMES))
        squares[own] = nnls(white, root @ self.variance)[0]
        spread = invert_information(white.T @ white)
        stds[own] = np.sqrt(np.maximum(np.diag(spread), 1e-300))
        return squares, stds


def _drop_unseen(problem: _Problem, covariance: Array) -> tuple[list[int], Array, Array]:
    """The terms that are told from zero, their squares and standard deviations (4,): what is not
    must not pull at the others."""
    kept = list(range(len(NAMES)))
    while kept:
        squares, stds = problem.solve(covariance, kept)
        weakest = min(kept, key=lambda k: squares[k] / stds[k])
        if squares[weakest] > SEEN * stds[weakest]:
            return kept, squares, stds
        kept.remove(weakest)
    return kept, np.zeros(len(NAMES)), np.zeros(len(NAMES))


def _limits(problem: _Problem, kept: Sequence[int], squares: Array) -> dict[int, float]:
    """95 % upper limits of the squares that were dropped, each beside those that are kept. The
    record scatters as it would with the term at its limit, by more than without it."""
    limits = {}
    for k in sorted(set(range(len(NAMES))) - set(kept)):
        supposed, high = squares.copy(), 0.0
        for _ in range(LIMIT_ROUNDS):
            supposed[k] = high
            found, stds = problem.solve(problem.covariance_of(supposed), [*kept, k])
            high = float(found[k] + ONE_SIDED_95 * stds[k])
        limits[k] = high
    return limits


def _find_least_squares(
    problem: _Problem,
    covariance: Array,
    kept: Sequence[int],
    squares: Array,
    limits: dict[int, float],
) -> Array:
    """Squares (4,) of the kept terms with that dropped term at its limit that takes most off them:
    a flicker and a random walk of one run are hard to tell apart."""
    least = squares.copy()
    if kept:
        root, own = _root(covariance), list(kept)
        for k, limit in limits.items():
            taken = fit_columns(root @ problem.design[:, own], root @ problem.design[:, k] * limit)
            least[own] = np.minimum(least[own], squares[own] - taken)
    return least


def compute_kept_part(time_s: Array, window_s: float, bend_off_s: float = 0.0) -> Array:
    """Part of the variance of rate noise that angles averaged over windows keep.

    ∫f^−p sin⁴(πfτ)/(πfτ)² sinc²(πfw) g²(fh) df over the same without the box, p = 0, 1, 2 for
    white, flicker and random-walk rate noise; g of windows h that stand for their middle
    (`compute_gain_at_middle`), else 1.

    Parameters
    ----------
    time_s
        Averaging times (points,).
    window_s
        Width w of the windows, 0: none.
    bend_off_s
        Length h of the windows that stand for their middle, 0: for their mean.

    Returns
    -------
    ndarray
        (points, 3), at most 1.

    Examples
    --------
    A window that fills the interval takes half of the white noise, next to none of a random walk:

    >>> from hrg_cli.fitting.tables.allan_terms import compute_kept_part
    >>> white, _, walk = compute_kept_part([1.0], 1.0)[0]
    >>> round(float(white), 6), bool(white < walk < 1)
    (0.5, True)
    """
    if window_s <= 0:
        return np.ones((len(time_s), 3))
    time = np.asarray(time_s, float)
    x = np.geomspace(SLOWEST, QUICKEST, FREQUENCIES)
    f = x / time[:, None]
    box, middle = np.sinc(f * window_s) ** 2, compute_gain_at_middle(f * bend_off_s) ** 2
    white = np.sin(np.pi * x) ** 4 / x**2
    # of white noise the box keeps 1 − w/2τ of the filter's π²/4, in closed form
    more = np.trapezoid(white * box * (middle - 1), x, axis=1) * 4 / np.pi**2
    parts: list[Array] = [1 - window_s / (2 * time) + more]
    for power in (1, 2):
        whole = np.trapezoid(white / x**power, x)
        parts.append(np.asarray(np.trapezoid(white / x**power * box * middle, x, axis=1) / whole))
    return np.stack(parts, axis=1)


def _coefficient(square: float, std: float, least: float) -> Coefficient:
    """Of a square that is told from zero, unless what else may be there leaves only `least` of it.

    An estimate of a variance is about as far from the truth in its logarithm.
    """
    value, factor = float(np.sqrt(square)), np.exp(NORMAL_95 * std / square / 2)
    if least <= SEEN * std:
        return _unseen((value * factor) ** 2)
    low = min(value / factor, float(np.sqrt(least) * np.exp(-std / least / 2)))
    return Coefficient(value, float(std / (2 * value)), low, float(value * factor))


def _unseen(limit: float) -> Coefficient:
    """Of a term that is not told from zero, with the upper limit of its square."""
    high = float(np.sqrt(limit))
    return Coefficient(0.0, high / ONE_SIDED_95, 0.0, high)


def _root(covariance: Array) -> Array:
    """W with WᵀW = covariance⁻¹; directions known better than 1e-6 of the variances are taken as so
    known."""
    scale = np.sqrt(np.diag(covariance))
    value, vector = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray((vector / np.sqrt(np.maximum(value, 1e-6))).T / scale)


def _filters(time_s: Array, interval_s: float, count: int) -> tuple[Array, Array, Array]:
    """Frequencies (k,), their widths over the record's length, and |H|² (points, k)."""
    span = count * interval_s
    f = np.geomspace(0.5 / span, 0.5 / interval_s, FREQUENCIES)
    width = np.gradient(f) / span
    n = np.round(time_s / interval_s)[:, None]
    x = np.pi * f * interval_s
    return f, width, 2 * np.sin(n * x) ** 4 / (n * np.sin(x)) ** 2


def _covariance(
    squares: Array,
    filters: tuple[Array, Array, Array],
    interval_s: float,
    window_s: float = 0.0,
    bend_off_s: float = 0.0,
) -> Array:
    f, width, h2 = filters
    q, n, b, k = squares
    half = np.sin(np.pi * f * interval_s)
    of_rate = n + b / (2 * np.pi * f) + k / (2 * np.pi * f) ** 2
    # of white noise, aliases included: the sum of sinc² of interval and window over them
    seen = 1 - min(window_s / interval_s, 1.0) * 2 / 3 * half**2
    seen = (
        seen * compute_gain_at_middle(f * bend_off_s) ** 2
    )  # that of the aliases where windows adjoin
    two_sided = q * interval_s * (2 * half / interval_s) ** 2 + of_rate * seen
    weighted = h2 * (2 * two_sided) * np.sqrt(width)
    return np.asarray(weighted @ weighted.T)
