"""Random effects: the common value of many gyros' estimates, the spread between the gyros beyond
their σ, and how sure it is that the common value is not nought.

x_i = μ + b_i + e_i, b_i ~ N(0, τ²), e_i ~ N(0, σ_i²). τ² solves Σ (x_i − μ)²/(σ_i² + τ²) = n − 1
(Paule and Mandel, J. Res. NBS 87 (1982) 377), μ is the mean with weights 1/(σ_i² + τ²).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

Array = np.ndarray
FEWEST = 5
"""Gyros from which they have a common value."""
MODEL_EXACT = 0.1
"""Part of one gyro's σ to which the model itself is exact. What it misses is the same in every
gyro, so that no number of gyros makes a common value surer than this."""
ESTIMATED_SIGMA = 2.0
"""σ by which the spread between gyros is taken larger where its own uncertainty counts."""
MAD = 1.4826
"""σ of a normal distribution over its median absolute deviation."""
STEPS = 80


@dataclass(frozen=True)
class Pooled:
    """Of M parameters (M,): common value with σ, spread between gyros with its own σ, signed
    equivalent |z|, degrees of freedom, gyros used; NaN where too few know it."""

    value: Array
    std: Array
    spread: Array
    spread_std: Array
    z: Array
    dof: Array
    count: Array
    used: Array
    """(n, M): the gyros that were not left out as standing alone."""


def pool_estimates(x: Array, std: Array, exact: float = MODEL_EXACT) -> Pooled:
    """The common value of estimates of many gyros, without those that stand alone.

    σ² of the value is 1/Σw + (`exact`·median σ)². Its distribution is Student's with (n − 2)/s
    degrees of freedom, s the part of the variance that had to be estimated, τ²/(σ² + τ²), with τ²
    taken two of its own σ larger than it came out: normal where the gyros agree, and of so many
    gyros where they do not. It is given as the |z| of a normal variable as improbable.

    Parameters
    ----------
    x
        Estimates (n, M) of n gyros; NaN where a gyro has none.
    std
        Their standard deviations (n, M).
    exact
        Part of a gyro's σ to which the model is known to be exact.

    Returns
    -------
    Pooled
        A value each of M; NaN of too few gyros.

    Examples
    --------
    Gyros that agree tell as much as their errors say, and one that is far off is left out:

    >>> import numpy as np
    >>> from hrg_cli.lots.pooling import pool_estimates
    >>> x = np.random.default_rng(1).standard_normal((40, 1)) + 5.0
    >>> x[7] = 100.0
    >>> found = pool_estimates(x, np.ones((40, 1)), exact=0.0)
    >>> bool(abs(found.value[0] - 5.0) < 4 * found.std[0]), bool(found.used[7, 0])
    (True, False)
    """
    used = np.isfinite(x) & np.isfinite(std) & (std > 0)
    used &= ~find_outliers(x, std, used)
    count = used.sum(axis=0)
    x, variance = np.where(used, x, 0.0), np.where(used, std, 1.0) ** 2
    t2, w, mean = _estimate_between(x, variance, used)
    with np.errstate(all="ignore"):
        total = w.sum(axis=0)
        t2_std = np.sqrt(2 / np.sum(w**2, axis=0))
        at_most = t2 + ESTIMATED_SIGMA * t2_std
        known = np.where(used, variance, 0.0).sum(axis=0) / count
        dof = (count - 2) * (known + at_most) / at_most
        typical = _compute_medians(np.where(used, std, np.nan))
        error = np.sqrt(1 / total + (exact * typical) ** 2)
        z = np.sign(mean) * compute_equivalent_z(np.abs(mean) / error, dof)
        spread = np.sqrt(t2)
        spread_std = np.where(
            t2 > 0, t2_std / np.maximum(2 * spread, np.sqrt(t2_std)), np.sqrt(t2_std)
        )
    few = count < FEWEST
    hidden = np.where(few, np.nan, 1.0)
    return Pooled(
        value=mean * hidden,
        std=error * hidden,
        spread=spread * hidden,
        spread_std=spread_std * hidden,
        z=z * hidden,
        dof=dof * hidden,
        count=count,
        used=used,
    )


def _estimate_between(x: Array, variance: Array, used: Array) -> tuple[Array, Array, Array]:
    """τ² (M,), weights (n, M) and means (M,): Newton's steps from τ² = 0, where the sum falls and
    is convex, so that they never overshoot."""
    t2 = np.zeros(x.shape[1])
    wanted = used.sum(axis=0) - 1
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            w = np.where(used, 1 / (variance + t2), 0.0)
            mean = (w * x).sum(axis=0) / w.sum(axis=0)
            squares = w * np.where(used, x - mean, 0.0) ** 2
            excess, slope = squares.sum(axis=0) - wanted, (w * squares).sum(axis=0)
            step = np.where((excess > 0) & (slope > 0), excess / slope, 0.0)
            t2 = t2 + step
            if np.all(step <= 1e-6 * t2):
                break
    return t2, np.where(used, 1 / (variance + t2), 0.0), mean


def find_outliers(x: Array, std: Array, used: Array) -> Array:
    """Gyros that stand so far from the median of the others that they do not belong to their
    distribution.

    They have causes of their own, which a common value is not to be made of.

    Parameters
    ----------
    x, std
        Estimates (n, M) and their standard deviations.
    used
        (n, M) bool: which there are.

    Returns
    -------
    ndarray
        (n, M) bool; none of too few gyros.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.lots.pooling import find_outliers
    >>> x = np.random.default_rng(1).standard_normal((40, 1))
    >>> x[7] = 50.0
    >>> np.flatnonzero(find_outliers(x, np.full((40, 1), 0.1), np.ones((40, 1), bool))).tolist()
    [7]
    """
    out = np.zeros(x.shape, bool)
    if len(x) < FEWEST:
        return out
    with np.errstate(all="ignore"):
        known = np.where(used, x, np.nan)
        known_std = np.where(used, std, np.nan)
        enough = used.sum(axis=0) >= FEWEST
        known, known_std = known[:, enough], known_std[:, enough]
        if not known.shape[1]:
            return out
        off = np.abs(known - _compute_medians(known))
        robust = MAD * _compute_medians(off)
        between = np.maximum(robust**2 - _compute_medians(known_std) ** 2, 0.0)
        limits = np.array([compute_far_limit(int(n), 0.05) for n in used.sum(axis=0)[enough]])
        out[:, enough] = off / np.sqrt(known_std**2 + between) > limits
    return out


def _compute_medians(x: Array) -> Array:
    """Medians (M,) of columns (n, M) without their NaN."""
    if not len(x):
        return np.full(x.shape[1], np.nan)
    ordered, count = np.sort(x, axis=0), np.isfinite(x).sum(axis=0)
    places = np.stack([np.maximum(count - 1, 0) // 2, np.minimum(count // 2, len(x) - 1)])
    return np.take_along_axis(ordered, places, axis=0).mean(axis=0)


@lru_cache(maxsize=4096)
def compute_far_limit(count: int, rate: float) -> float:
    """Robust distance |x − median|/(1.4826 MAD) that chance seldom exceeds.

    1.4826 MAD is as sure as a standard deviation of 0.37 (n − 1) degrees of freedom (its
    efficiency, Rousseeuw and Croux, J. Am. Stat. Assoc. 88 (1993) 1273) and short by n/(n − 0.8):
    the quantile is Student's with these.

    Parameters
    ----------
    count
        Normal values, of which one or more exceed it …
    rate
        … with this probability.

    Returns
    -------
    float
        In standard deviations.

    Examples
    --------
    Of few values the scale itself is unsure, so that the limit is far:

    >>> from hrg_cli.lots.pooling import compute_far_limit
    >>> compute_far_limit(6, 0.05) > compute_far_limit(1000, 0.05) > 4
    True
    """
    from scipy.special import stdtrit

    dof = max(0.37 * (count - 1), 1.0)
    return float(-stdtrit(dof, rate / (2 * count)) * count / (count - 0.8))


def compute_equivalent_z(t: Array, dof: Array) -> Array:
    """|z| of a normal variable as improbable as Student's |t|.

    By the approximation of Wallace, Ann. Math. Stat. 30 (1959) 1121: good to a hundredth from
    thirty degrees of freedom; with few it is too small, which is the safe side.

    Parameters
    ----------
    t
        Student's, any shape.
    dof
        Degrees of freedom.

    Returns
    -------
    ndarray
        |z|.

    Examples
    --------
    Student's t that chance exceeds in 5 %, of 10 degrees of freedom and of 1, where z is 1.96:

    >>> import numpy as np
    >>> from hrg_cli.lots.pooling import compute_equivalent_z
    >>> compute_equivalent_z(np.array([2.228, 12.706]), np.array([10.0, 1.0])).round(2).tolist()
    [1.96, 1.85]
    """
    return (8 * dof + 1) / (8 * dof + 3) * np.sqrt(dof * np.log1p(t**2 / dof))


def compute_improbability(z: Array | float) -> Array:
    """Two-sided probability that a normal variable is as large as |z|.

    Parameters
    ----------
    z
        Any shape.

    Returns
    -------
    ndarray
        0 to 1.

    Examples
    --------
    >>> from hrg_cli.lots.pooling import compute_improbability
    >>> round(float(compute_improbability(-1.96)), 3)
    0.05
    """
    from scipy.special import ndtr

    return 2 * ndtr(-np.abs(z))
