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
    """Slope a day with its σ, and how far the values lie from the line over their own σ, √(χ²/dof)
    (None without σ or degrees of freedom); a value above 1 has widened the slope's σ."""

    slope_per_day: float
    slope_std: float
    scatter_over_own: float | None

    @property
    def sigma(self) -> float:
        """The slope in its σ."""
        return self.slope_per_day / self.slope_std if self.slope_std > 0 else 0.0


def move(series: FigureSeries, old: int = -2, new: int = -1) -> Move | None:
    """From one measurement to another; None where there is only one."""
    if len(series) < 2:
        return None
    change = float(series.values[new] - series.values[old])
    both = math.hypot(series.stds[new], series.stds[old])
    return Move(change, change / both if both > 0 else None)


def trend(series: FigureSeries) -> Trend | None:
    """The line by least squares with weights 1/σ² (equal ones where a σ is not known); None for
    fewer than three measurements, or for all of one time.

    σ of the slope is widened by √(χ²/dof) where that exceeds 1 (Birge, Phys. Rev. 40 (1932) 207),
    and taken from it alone where no σ is known.
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


def mean_of(series: FigureSeries) -> tuple[float, float]:
    """Weighted mean of a series and its σ, widened by the scatter where that exceeds the own σ."""
    known = bool(np.all(series.stds > 0))
    weight = 1 / series.stds**2 if known else np.ones(len(series))
    mean = float(np.average(series.values, weights=weight))
    if len(series) < 2:
        return mean, float(series.stds[0]) if known else math.nan
    chi2 = float((weight * (series.values - mean) ** 2).sum()) / (len(series) - 1)
    factor = max(1.0, chi2) if known else chi2
    return mean, math.sqrt(factor / float(weight.sum()))


def repeats_p(series: FigureSeries) -> float | None:
    """Probability that repeats of one gyro scatter so far by their own σ alone (χ²); None without
    σ."""
    if len(series) < 2 or not np.all(series.stds > 0):
        return None
    weight = 1 / series.stds**2
    mean = np.average(series.values, weights=weight)
    chi2 = float((weight * (series.values - mean) ** 2).sum())
    return float(stats.chi2.sf(chi2, len(series) - 1))


def days_to_limit(
    value: float, found: Trend, minimum: float | None, maximum: float | None
) -> float | None:
    """Days until the line reaches a limit; None where its slope is not significant, or the limit it
    runs to is none."""
    limit = maximum if found.slope_per_day > 0 else minimum
    if abs(found.sigma) < SIGNIFICANT or limit is None:
        return None
    return max(0.0, (limit - value) / found.slope_per_day)
