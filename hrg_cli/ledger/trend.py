"""How a figure moves: against the measurement before, and along a straight line over time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats

from .series import FigureSeries

Array = np.ndarray
SIGNIFICANT = 3.0
"""Slopes over their σ from which a line is extrapolated to a limit."""


@dataclass(frozen=True)
class Move:
    """new − old; in σ of both (None where none is known)."""

    change: float
    sigma: float | None


@dataclass(frozen=True)
class Trend:
    """Slope per day with its σ, and how far the values lie from the line over their own σ,
    √(χ²/dof) (None without σ or degrees of freedom); a value above 1 has widened the slope's σ."""

    slope_per_day: float
    slope_std: float
    scatter_over_own: float | None

    @property
    def sigma(self) -> float:
        """The slope in its σ."""
        return self.slope_per_day / self.slope_std if self.slope_std > 0 else 0.0


def find_move(series: FigureSeries, old: int = -2, new: int = -1) -> Move | None:
    """How a figure moved from one measurement to another.

    Parameters
    ----------
    series
        In the order of time.
    old, new
        Places of both.

    Returns
    -------
    Move or None
        The change, and what it is in σ of both; None where there is only one measurement.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.ledger.series import FigureSeries
    >>> from hrg_cli.ledger.trend import find_move
    >>> series = FigureSeries("", "1", np.array([1.0, 2.0]), np.array([0.3, 0.4]), np.zeros(2), ())
    >>> find_move(series)
    Move(change=1.0, sigma=2.0)
    """
    if len(series) < 2:
        return None
    change = float(series.values[new] - series.values[old])
    both = math.hypot(series.stds[new], series.stds[old])
    return Move(change, change / both if both > 0 else None)


def fit_trend(series: FigureSeries) -> Trend | None:
    """The straight line of a figure over time, by least squares with weights 1/σ².

    σ of the slope is widened by √(χ²/dof) where that exceeds 1 (Birge, Phys. Rev. 40 (1932) 207),
    and taken from it alone where no σ is known.

    Parameters
    ----------
    series
        In the order of time.

    Returns
    -------
    Trend or None
        None for fewer than three measurements, or for all of one time.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.ledger.series import DAY_S, FigureSeries
    >>> from hrg_cli.ledger.trend import fit_trend
    >>> days = np.array([0.0, 1.0, 2.0])
    >>> series = FigureSeries("", "1", 0.5 * days, np.full(3, 0.1), days * DAY_S, ())
    >>> found = fit_trend(series)
    >>> round(found.slope_per_day, 9), round(found.sigma, 2)
    (0.5, 7.07)
    """
    days = series.days
    if len(series) < 3 or not np.ptp(days) > 0:
        return None
    known = bool(np.all(series.stds > 0))
    weight = 1 / series.stds**2 if known else np.ones(len(series))
    middle = np.average(days, weights=weight)
    away = days - middle
    power = float((weight * away**2).sum())
    slope = float((weight * away * series.values).sum()) / power
    left = series.values - np.average(series.values, weights=weight) - slope * away
    scatter = math.sqrt(float((weight * left**2).sum()) / (len(series) - 2))
    std = (max(1.0, scatter) if known else scatter) / math.sqrt(power)
    return Trend(slope, std, scatter if known else None)


def compute_mean(series: FigureSeries) -> tuple[float, float]:
    """Weighted mean of a series with its standard deviation.

    Parameters
    ----------
    series
        At least one measurement.

    Returns
    -------
    tuple of float
        The mean, and its σ, widened by the scatter where that exceeds the own σ; NaN where nothing
        tells it.

    Examples
    --------
    Two measurements that are 10 of their own σ apart tell by their scatter how well they are known:

    >>> import numpy as np
    >>> from hrg_cli.ledger.series import FigureSeries
    >>> from hrg_cli.ledger.trend import compute_mean
    >>> series = FigureSeries("", "1", np.array([0.0, 1.0]), np.full(2, 0.1), np.zeros(2), ())
    >>> [round(found, 9) for found in compute_mean(series)]
    [0.5, 0.5]
    """
    known = bool(np.all(series.stds > 0))
    weight = 1 / series.stds**2 if known else np.ones(len(series))
    mean = float(np.average(series.values, weights=weight))
    if len(series) < 2:
        return mean, float(series.stds[0]) if known else math.nan
    chi2 = float((weight * (series.values - mean) ** 2).sum()) / (len(series) - 1)
    factor = max(1.0, chi2) if known else chi2
    return mean, math.sqrt(factor / float(weight.sum()))


def compute_repeats_p(series: FigureSeries) -> float | None:
    """Probability that repeats of one gyro scatter so far by their own standard deviations alone
    (χ²).

    Parameters
    ----------
    series
        Of one gyro.

    Returns
    -------
    float or None
        None where a σ is not known, or there is one measurement.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.ledger.series import FigureSeries
    >>> from hrg_cli.ledger.trend import compute_repeats_p
    >>> series = FigureSeries("", "1", np.array([0.0, 1.0]), np.full(2, 0.1), np.zeros(2), ())
    >>> compute_repeats_p(series) < 1e-9
    True
    """
    if len(series) < 2 or not np.all(series.stds > 0):
        return None
    weight = 1 / series.stds**2
    mean = np.average(series.values, weights=weight)
    chi2 = float((weight * (series.values - mean) ** 2).sum())
    return float(stats.chi2.sf(chi2, len(series) - 1))


def compute_days_to_limit(
    value: float, found: Trend, minimum: float | None, maximum: float | None
) -> float | None:
    """Days until the line of a figure reaches a limit.

    Parameters
    ----------
    value
        The last one.
    found
        The line.
    minimum, maximum
        The limits; None: there is no such limit.

    Returns
    -------
    float or None
        None where the slope is less than 3 of its σ, or there is no limit where it runs to.

    Examples
    --------
    >>> from hrg_cli.ledger.trend import Trend, compute_days_to_limit
    >>> compute_days_to_limit(0.8, Trend(0.01, 0.001, None), None, 1.0)
    19.99...
    >>> compute_days_to_limit(0.8, Trend(0.01, 0.01, None), None, 1.0) is None
    True
    """
    limit = maximum if found.slope_per_day > 0 else minimum
    if abs(found.sigma) < SIGNIFICANT or limit is None:
        return None
    return max(0.0, (limit - value) / found.slope_per_day)
