"""Capability Cp, Cpk of a population against limits, with confidence intervals that hold for a
normal one.

Cp = (U − L)/6s: (n−1)s²/σ² is χ² with n − 1 degrees of freedom, exactly. Of one limit, 3√n·Cpu =
√n(U − x̄)/s is noncentral t with n − 1 degrees and noncentrality 3√n·Cpu of the population, exactly
(Kane, J. Quality Technology 18 (1986) 41). Cpk is the lesser of two: the lesser of their lower
bounds holds at the same level, the lesser of their upper bounds at half the error each. s is that
of all gyros, not within groups (some standards write Pp, Ppk then).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special, stats

Array = np.ndarray
FEWEST_GYROS = 5
CONFIDENCE = 0.95
NODES = 120
"""Points of Gauss's rule in the noncentral t distribution."""
NORMAL_P = 0.01
"""Shapiro and Wilk's p-value below which a population is not called normal."""

Interval = tuple[float, float]


@dataclass(frozen=True)
class Capability:
    """Of n gyros: mean, standard deviation, Cp (None with one limit) and Cpk with intervals, and
    the p-value of their being normal (None where it cannot be told)."""

    gyros: int
    mean: float
    std: float
    cp: float | None
    cp_interval: Interval | None
    cpk: float
    cpk_interval: Interval
    normal_p: float | None

    @property
    def is_normal(self) -> bool:
        """Whether nothing speaks against the normal distribution that the intervals are for."""
        return self.normal_p is None or self.normal_p >= NORMAL_P


def compute_capability(
    values: Array, minimum: float | None, maximum: float | None, confidence: float = CONFIDENCE
) -> Capability | None:
    """Capability Cp and Cpk of a population against limits, with confidence intervals.

    Parameters
    ----------
    values
        One a gyro (n,).
    minimum, maximum
        The limits; None: there is none.
    confidence
        Of the intervals.

    Returns
    -------
    Capability or None
        None for fewer than 5 gyros, without limits, or where all are the same.

    Examples
    --------
    Values that fill a tenth of the tolerance on either side of its middle:

    >>> import numpy as np
    >>> from hrg_cli.ledger.capability import compute_capability
    >>> values = np.array([-1.0, -0.5, 0.0, 0.0, 0.5, 1.0])
    >>> found = compute_capability(values, -10.0, 10.0)
    >>> round(found.cp * 6 * found.std, 9), found.cpk == found.cp, found.cpk_interval[0] < found.cpk
    (20.0, True, True)
    """
    x = np.asarray(values, float)
    if len(x) < FEWEST_GYROS or (minimum is None and maximum is None):
        return None
    mean, std = float(x.mean()), float(x.std(ddof=1))
    if not std > 0:
        return None
    n, error = len(x), 1 - confidence
    cp, cp_interval = None, None
    if minimum is not None and maximum is not None:
        cp = (maximum - minimum) / (6 * std)
        low, high = (
            cp * math.sqrt(stats.chi2.ppf(p, n - 1) / (n - 1)) for p in (error / 2, 1 - error / 2)
        )
        cp_interval = (low, high)
    sides = [(mean - minimum) / (3 * std)] if minimum is not None else []
    sides += [(maximum - mean) / (3 * std)] if maximum is not None else []
    above = error / 2 / len(sides)
    lower = min(_one_sided_bound(side, n, 1 - error / 2) for side in sides)
    upper = min(_one_sided_bound(side, n, above) for side in sides)
    normal_p = float(stats.shapiro(x).pvalue) if n <= 5000 else None
    return Capability(n, mean, std, cp, cp_interval, min(sides), (lower, upper), normal_p)


def _one_sided_bound(found: float, n: int, probability: float) -> float:
    """The Cpu (or Cpl) of a population in which a sample of n exceeds `found` with 1 − probability:
    a lower bound for probability near 1, an upper one near 0."""
    statistic = 3 * math.sqrt(n) * found
    width = 10 * math.sqrt(1 + statistic**2 / (2 * (n - 1)))

    def beyond(noncentrality: float) -> float:
        return compute_noncentral_t(statistic, n - 1, noncentrality) - probability

    root = optimize.brentq(beyond, statistic - width, statistic + width)
    return float(root) / (3 * math.sqrt(n))


def compute_noncentral_t(t: float, degrees: int, noncentrality: float) -> float:
    """Distribution function of the noncentral t, (Z + δ)/√(χ²/ν).

    ∫ Φ(t·s − δ) f(s) ds over s = √(χ²/ν).

    Parameters
    ----------
    t
        Where.
    degrees
        ν.
    noncentrality
        δ.

    Returns
    -------
    float
        Probability of no more than t.

    Examples
    --------
    Without noncentrality it is Student's, symmetric about 0:

    >>> from hrg_cli.ledger.capability import compute_noncentral_t
    >>> round(compute_noncentral_t(0.0, 5, 0.0), 9), round(compute_noncentral_t(2.015, 5, 0.0), 4)
    (0.5, 0.95)
    """
    s, weight = _chi_nodes(degrees)
    return float(weight @ special.ndtr(t * s - noncentrality))


@functools.cache
def _chi_nodes(degrees: int) -> tuple[Array, Array]:
    """Nodes and weights of √(χ²/ν), by Gauss's rule over all of it but 10⁻¹⁴ on either side."""
    low = math.sqrt(stats.chi2.ppf(1e-14, degrees) / degrees)
    high = math.sqrt(stats.chi2.isf(1e-14, degrees) / degrees)
    node, weight = np.polynomial.legendre.leggauss(NODES)
    s = (low + high) / 2 + (high - low) / 2 * node
    density = stats.chi2.pdf(degrees * s**2, degrees) * 2 * degrees * s
    part = (high - low) / 2 * weight * density
    return s, part / part.sum()
