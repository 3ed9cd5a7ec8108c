"""Guard bands: acceptance limits inside the tolerance, and the risk of a wrong decision
(JCGM 106:2012).

A gyro is accepted where its measured figure keeps k·u from the limit, u the standard deviation of
the measurement. The true values of the population are N(μ, σ_g²), the measured ones those plus
N(0, u²).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats

Array = np.ndarray
NODES = 64
"""Points of Gauss's rule on each piece of the integral over the true values."""
REACH = 9.0
"""Standard deviations on either side that the integral covers."""
LEAST_SPREAD = 1e-6
"""A population narrower than so many measurement σ is taken as so wide."""


@dataclass(frozen=True)
class Risks:
    """Of a gyro drawn from the population: accepted though outside (the consumer's risk), rejected
    though inside (the producer's), and of an accepted one, outside."""

    false_acceptance: float
    false_rejection: float
    outside_if_accepted: float


def compute_guard_limits(
    minimum: float | None, maximum: float | None, measurement_std: float, k: float
) -> tuple[float | None, float | None]:
    """Acceptance limits: the tolerance less k standard deviations of measurement on each side.

    Parameters
    ----------
    minimum, maximum
        The tolerance; None: there is no such limit.
    measurement_std
        u.
    k
        Width of the guard band in u.

    Returns
    -------
    tuple
        Lower and upper limit; None as in the tolerance.

    Examples
    --------
    >>> from hrg_cli.ledger.guard_bands import compute_guard_limits
    >>> compute_guard_limits(-1.0, 1.0, 0.1, 2.0), compute_guard_limits(None, 1.0, 0.1, 2.0)
    ((-0.8, 0.8), (None, 0.8))
    """
    band = k * measurement_std
    return (
        None if minimum is None else minimum + band,
        None if maximum is None else maximum - band,
    )


def compute_probability_outside(
    value: float,
    measurement_std: float,
    minimum: float | None,
    maximum: float | None,
    population: tuple[float, float] | None = None,
) -> float:
    """Probability that the true figure of one gyro is outside, given its measured value.

    With the population known before the measurement, or else from the measurement alone (JCGM
    106:2012, 7.2 to 7.4).

    Parameters
    ----------
    value
        As measured.
    measurement_std
        u.
    minimum, maximum
        The tolerance; None: there is no such limit.
    population
        Mean and standard deviation of the gyros; None: not known.

    Returns
    -------
    float
        0 to 1.

    Examples
    --------
    A value at the limit is outside as likely as not, unless gyros are seldom that far out:

    >>> from hrg_cli.ledger.guard_bands import compute_probability_outside
    >>> compute_probability_outside(1.0, 0.1, None, 1.0)
    0.5
    >>> round(compute_probability_outside(1.0, 0.1, None, 1.0, (0.0, 0.1)), 6)
    0.0
    """
    mean, std = value, measurement_std
    if population is not None and measurement_std > 0:
        prior, spread = population
        weight = spread**2 / (spread**2 + measurement_std**2)
        mean = prior + weight * (value - prior)
        std = measurement_std * math.sqrt(weight)
    if not std > 0:
        inside = (minimum is None or mean >= minimum) and (maximum is None or mean <= maximum)
        return 0.0 if inside else 1.0
    below = 0.0 if minimum is None else float(stats.norm.cdf((minimum - mean) / std))
    above = 0.0 if maximum is None else float(stats.norm.sf((maximum - mean) / std))
    return min(1.0, below + above)


def compute_risks(
    population: tuple[float, float],
    measurement_std: float,
    minimum: float | None,
    maximum: float | None,
    k: float,
) -> Risks:
    """The risks of a decision with guard bands of k·u, by integration over the true values.

    ∫ N(η; μ, σ_g²) P(accepted | η) dη outside the limits, and its like (JCGM 106:2012, 9.5).

    Parameters
    ----------
    population
        Mean μ and standard deviation σ_g of the gyros.
    measurement_std
        u, above 0.
    minimum, maximum
        The tolerance; None: there is no such limit.
    k
        Width of the guard band in u.

    Returns
    -------
    Risks
        Of accepting wrongly and of rejecting wrongly.

    Examples
    --------
    A guard band buys less false acceptance with more false rejection:

    >>> from hrg_cli.ledger.guard_bands import compute_risks
    >>> bare, guarded = (compute_risks((0.0, 0.5), 0.1, -1.0, 1.0, k) for k in (0.0, 2.0))
    >>> guarded.false_acceptance < bare.false_acceptance
    True
    >>> guarded.false_rejection > bare.false_rejection
    True
    """
    mean, spread = population[0], max(population[1], LEAST_SPREAD * measurement_std)
    low, high = compute_guard_limits(minimum, maximum, measurement_std, k)
    true, weight = _nodes(mean, spread, measurement_std, [minimum, maximum], [low, high])
    density = weight * stats.norm.pdf(true, mean, spread)
    passed = np.ones_like(true)
    if low is not None:
        passed -= stats.norm.cdf((low - true) / measurement_std)
    if high is not None:
        passed -= stats.norm.sf((high - true) / measurement_std)
    passed = np.maximum(passed, 0.0)
    inside = np.ones(true.shape, bool)
    inside &= minimum is None or true >= minimum
    inside &= maximum is None or true <= maximum
    accepted = float(density @ passed)
    bad = float(density[~inside] @ passed[~inside])
    good_rejected = float(density[inside] @ (1 - passed[inside]))
    return Risks(bad, good_rejected, bad / accepted if accepted > 0 else 0.0)


def _nodes(
    mean: float,
    spread: float,
    measurement_std: float,
    limits: list[float | None],
    accepted: list[float | None],
) -> tuple[Array, Array]:
    """Nodes and weights of Gauss's rule on pieces that end at the limits and follow the steep part
    of P(accepted | η)."""
    first, last = mean - REACH * spread, mean + REACH * spread
    cuts = {mean + part * spread for part in (-REACH, -3.0, 0.0, 3.0, REACH)}
    cuts |= {x for x in limits if x is not None}
    cuts |= {
        x + part * measurement_std
        for x in accepted
        if x is not None
        for part in (-REACH, -3.0, 0.0, 3.0, REACH)
    }
    ends = np.array(sorted(min(max(cut, first), last) for cut in cuts))
    node, weight = np.polynomial.legendre.leggauss(NODES)
    half, middle = np.diff(ends)[:, None] / 2, ((ends[1:] + ends[:-1]) / 2)[:, None]
    return (middle + half * node).ravel(), (half * weight).ravel()
