"""A gauge study by variance components: what differs between gyros, between stations, and between
repeats, estimated by restricted maximum likelihood.

    x = μ + gyro_i + station_j + gyro·station_ij + repeat,   repeat ~ N(0, σ_own² + σ_r²)

σ_own, the standard deviation that each result states of itself, is known row by row and separates
the gauge from the gyro where a gyro was measured once. σ_r is what repeats scatter beyond it. The
likelihood: Patterson & Thompson, Biometrika 58 (1971) 545; intervals: its profile, χ² with one
degree of freedom.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import optimize, stats

Array = np.ndarray
FEWEST_GYROS = 3
CONFIDENCE = 0.95
NAMES = ("gyro", "interaction", "station", "repeat")
"""The components that are estimated."""
LEAST, LARGEST = 1e-8, 1e2
"""A component is looked for between so many times the spread of all values."""
STEP = 1e-5
"""Difference of a component's logarithm from which the likelihood's slope is taken."""


@dataclass(frozen=True)
class Component:
    """A standard deviation with its interval; None where these data cannot tell it."""

    std: float
    low: float
    high: float


@dataclass(frozen=True)
class GaugeStudy:
    """n results of so many gyros on so many stations.

    components: by name (`NAMES`), those the data can tell. own_std: rms of the stated σ. gauge_std:
    everything but the gyros (own, repeat, station, interaction). scatter_over_own: repeats of one
    gyro on one station over their stated σ, with its interval; None without repeats.
    """

    results: int
    gyros: int
    stations: int
    repeats: int
    mean: float
    components: dict[str, Component]
    own_std: float
    gauge_std: float
    scatter_over_own: tuple[float, float, float] | None

    @property
    def gyro_std(self) -> float:
        """Spread of the gyros themselves."""
        return self.components["gyro"].std

    @property
    def share_of_variance(self) -> float:
        """Gauge variance over that of all results."""
        total = self.gauge_std**2 + self.gyro_std**2
        return self.gauge_std**2 / total if total > 0 else math.nan

    @property
    def categories(self) -> float:
        """Groups of gyros that the gauge tells apart, 1.41 σ_gyro/σ_gauge (AIAG, Measurement
        Systems Analysis, ndc)."""
        return math.sqrt(2) * self.gyro_std / self.gauge_std if self.gauge_std > 0 else math.inf


@dataclass(frozen=True)
class _Design:
    """Rows in the order of their cells (a gyro on a station), gyro by gyro: values, stated
    variances, station; where each cell and each gyro begins, and which each row belongs to."""

    values: Array
    own: Array
    station: Array
    cell: Array
    gyro: Array

    @cached_property
    def stations(self) -> int:
        return int(self.station.max()) + 1

    @cached_property
    def columns(self) -> Array:
        """Values, ones, and a column a station that is 1 in its rows: (n, 2 + stations)."""
        shown = np.arange(self.stations) == self.station[:, None]
        return np.column_stack([self.values, np.ones(len(self.values)), shown])

    @cached_property
    def levels(self) -> tuple[tuple[str, Array, Array], ...]:
        """The nested components, finest first: the group of each row of the level below, and each
        group's first row there."""
        first = np.flatnonzero(np.diff(self.cell, prepend=-1))
        above = self.gyro[first]
        return (
            ("interaction", self.cell, first),
            ("gyro", above, np.flatnonzero(np.diff(above, prepend=-1))),
        )


def study_gauge(
    values: Array,
    own_std: Array,
    gyros: Sequence[str],
    stations: Sequence[str],
    confidence: float = CONFIDENCE,
) -> GaugeStudy | None:
    """What differs between gyros, between stations, and between repeats, by restricted maximum
    likelihood.

    x = μ + gyro + station + gyro·station + repeat (Patterson and Thompson, 1971).

    Parameters
    ----------
    values
        Of a figure (n,), one a result.
    own_std
        What each states as its standard deviation (n,); 0: not known.
    gyros, stations
        Of each result.
    confidence
        Of the intervals.

    Returns
    -------
    GaugeStudy or None
        None for fewer than 3 gyros, or where all values are the same.

    Examples
    --------
    Gyros that differ by far more than stations and repeats:

    >>> import numpy as np
    >>> from hrg_cli.ledger.gauge import study_gauge
    >>> gyro = np.repeat(np.arange(12), 4)
    >>> random = np.random.default_rng(1)
    >>> x = 10 * random.standard_normal(12)[gyro] + random.standard_normal(48)
    >>> found = study_gauge(x, np.zeros(48), [str(k) for k in gyro], ["north", "south"] * 24)
    >>> found.gyros, found.stations, found.gyro_std > 5 * found.gauge_std, found.categories > 5
    (12, 2, True, True)
    """
    x, own = np.asarray(values, float), np.asarray(own_std, float)
    middle, scale = float(x.mean()), float(np.std(x))
    if len(set(gyros)) < FEWEST_GYROS or not scale > 0:
        return None
    design = _design((x - middle) / scale, (own / scale) ** 2, gyros, stations)
    cells, gyro_count = int(design.cell[-1]) + 1, int(design.gyro[-1]) + 1
    names = _separable_components(design, gyro_count, cells)
    best, level = _most_likely(design, names)
    wanted = level - float(stats.chi2.ppf(confidence, 1)) / 2
    components = {}
    for name in names:
        low, high = _interval(design, names, name, best, wanted)
        components[name] = Component(best[name] * scale, low * scale, high * scale)
    stated = math.sqrt(float((own**2).mean()))
    return GaugeStudy(
        results=len(x),
        gyros=gyro_count,
        stations=design.stations,
        repeats=len(x) - cells,
        mean=middle + scale * _terms(design, best)[1],
        components=components,
        own_std=stated,
        gauge_std=math.hypot(stated, *(components[n].std for n in names if n != "gyro")),
        scatter_over_own=_scatter(design, cells, confidence),
    )


def _design(x: Array, own: Array, gyros: Sequence[str], stations: Sequence[str]) -> _Design:
    gyro = np.unique(np.array(gyros, dtype=str), return_inverse=True)[1].ravel()
    station = np.unique(np.array(stations, dtype=str), return_inverse=True)[1].ravel()
    pair = gyro * (int(station.max()) + 1) + station
    order = np.argsort(pair, kind="stable")
    cell = np.unique(pair[order], return_inverse=True)[1].ravel()
    return _Design(x[order], own[order], station[order], cell, gyro[order])


def _separable_components(design: _Design, gyros: int, cells: int) -> list[str]:
    """The components these data tell apart: repeats by a gyro measured twice on a station, stations
    by a gyro on two of them (else their difference may be the gyros'), the interaction by both."""
    repeats = len(design.values) - cells
    crossed = cells - gyros
    beyond_stations = crossed - (design.stations - 1)
    names = ["gyro"]
    if beyond_stations > 0 and repeats > 0:
        names.append("interaction")
    if crossed > 0:
        names.append("station")
    if repeats > 0 or beyond_stations > 0:
        names.append("repeat")
    return names


def _log_likelihood(design: _Design, std: dict[str, float]) -> float:
    """Restricted log-likelihood of the values at given standard deviations, up to a constant."""
    return _terms(design, std)[0]


def _terms(design: _Design, std: dict[str, float]) -> tuple[float, float]:
    """(restricted log-likelihood, the mean μ) by generalized least squares."""
    level, mean = compute_likelihoods(
        design, {name: np.array([value]) for name, value in std.items()}
    )
    return float(level[0]), float(mean[0])


def compute_likelihoods(design: _Design, std: dict[str, Array]) -> tuple[Array, Array]:
    """Restricted log-likelihoods of a gauge study, and the means that go with them, at p points.

    Rows become cells and cells gyros by weighted means: what lies within a group has the level's
    weights, its mean the variance 1/Σw + σ². This loses no digits where gyros differ far more than
    repeats, and the work grows with n for any number of gyros.

    Parameters
    ----------
    design
        The results.
    std
        Component -> its standard deviations (p,).

    Returns
    -------
    tuple of ndarray
        Log-likelihood up to a constant, and μ, (p,) each.

    Examples
    --------
    Values that scatter by 1 are likelier by a spread of 1 between gyros than by one of 10:

    >>> import numpy as np
    >>> from hrg_cli.ledger.gauge import _design
    >>> from hrg_cli.ledger.gauge import compute_likelihoods
    >>> design = _design(np.array([-1.0, 0.0, 1.0]), np.full(3, 1e-4), list("abc"), ["north"] * 3)
    >>> level, mean = compute_likelihoods(design, {"gyro": np.array([1.0, 10.0])})
    >>> bool(level[0] > level[1]), np.abs(mean).round(9).tolist()
    (True, [0.0, 0.0])
    """
    points = max(map(np.size, std.values()), default=1)
    power = {name: np.broadcast_to(std.get(name, 0.0), points) ** 2 for name in NAMES}
    variance = np.maximum(design.own + power["repeat"][:, None], LEAST**2)
    logarithm = np.log(variance).sum(axis=1)
    (_, cell, of_cell), (_, gyro, of_gyro) = design.levels
    values = np.broadcast_to(design.values, variance.shape)[..., None]
    means, within, weight, more = _gather_groups(
        values, 1 / variance, cell, of_cell, power["interaction"]
    )
    logarithm += more
    # within a cell only the values differ: ones and stations are the same in its rows
    rows = np.array(np.broadcast_to(design.columns[of_cell], (*weight.shape, 2 + design.stations)))
    rows[..., :1] = means
    rows, gram, weight, more = _gather_groups(rows, weight, gyro, of_gyro, power["gyro"])
    logarithm += more
    gram += rows.swapaxes(1, 2) @ (rows * weight[..., None])
    gram[:, 0, 0] += within[:, 0, 0]
    gram, more = _with_stations(gram, power["station"])
    mean = gram[:, 0, 1] / gram[:, 1, 1]
    rest = gram[:, 0, 0] - mean * gram[:, 0, 1]
    return -0.5 * (logarithm + more + np.log(gram[:, 1, 1]) + rest), mean


def _gather_groups(
    rows: Array, weight: Array, group: Array, first: Array, power: Array
) -> tuple[Array, Array, Array, Array]:
    """Rows (p, n, c) of weights (p, n) as the means of their groups: those, the products (p, c, c)
    of what is left within the groups, the means' weights with the groups' own variance, and what
    that adds to log |V|."""
    whole = np.add.reduceat(weight, first, axis=1)
    means = np.add.reduceat(rows * weight[..., None], first, axis=1) / whole[..., None]
    left = rows - means[:, group]
    within = left.swapaxes(1, 2) @ (left * weight[..., None])
    more = np.log1p(power[:, None] * whole).sum(axis=1)
    return means, within, 1 / (1 / whole + power[:, None]), more


def _with_stations(gram: Array, power: Array) -> tuple[Array, Array]:
    """(products (p, 2, 2) of values and ones with V⁻¹, what the stations add to log |V| (p,)), by
    Woodbury's formula, in a basis of the stations whose first direction is their sum: that one,
    which is also the ones', keeps its digits beside the others, which may be far larger."""
    count = gram.shape[1] - 2
    first = np.eye(count)
    first[:, 0] = 1.0
    basis = np.linalg.qr(first)[0] * -1.0
    inner = basis.T @ gram[:, 2:, 2:] @ basis
    inner[:, 0] = inner[:, :, 0] = gram[:, 1, 2:] @ basis / math.sqrt(count)
    inner = np.eye(count) + power[:, None, None] * inner
    across = gram[:, :2, 2:] @ basis
    scale = 1 / np.sqrt(np.diagonal(inner, axis1=1, axis2=2))
    even = inner * scale[:, None] * scale[:, :, None]
    scaled = across * scale[:, None]
    taken = scaled @ np.linalg.solve(even, scaled.swapaxes(1, 2))
    logarithm = np.linalg.slogdet(even)[1] - 2 * np.log(scale).sum(axis=1)
    return gram[:, :2, :2] - power[:, None, None] * taken, logarithm


def _climb(design: _Design, names: Sequence[str], start: Array, fixed: dict[str, float]) -> Any:
    """The largest likelihood over the logarithms of the named components, the others fixed; its
    slopes by differences, all points at once."""
    shifts = STEP * np.vstack([np.zeros(len(names)), np.eye(len(names))])
    held = {name: np.array([value]) for name, value in fixed.items()}

    def falling(logarithms: Array) -> tuple[float, Array]:
        free = dict(zip(names, np.exp(logarithms + shifts).T))
        level, _ = compute_likelihoods(design, {**held, **free})
        return -float(level[0]), (level[0] - level[1:]) / STEP

    bounds = [(math.log(LEAST), math.log(LARGEST))] * len(names)
    inside = np.clip(start, *bounds[0])
    return optimize.minimize(falling, inside, jac=True, bounds=bounds, method="L-BFGS-B")


def _most_likely(design: _Design, names: Sequence[str]) -> tuple[dict[str, float], float]:
    """Standard deviations at the largest restricted likelihood, from several beginnings; those that
    are as likely 0 are."""
    within = design.values - _means(design.values, design.gyro)[design.gyro]
    rest = max(float(np.std(within)), LEAST)
    starts = [
        np.log([gyro, *[max(part * rest, LEAST)] * (len(names) - 1)])
        for gyro in (1.0, 0.1)
        for part in (1.0, 0.1)
    ]
    best = min((_climb(design, names, s, {}) for s in starts), key=lambda f: float(f.fun))
    found, level = dict(zip(names, map(float, np.exp(best.x)))), -float(best.fun)
    for name in names:
        without = _log_likelihood(design, {**found, name: 0.0})
        if without >= level - 1e-6:
            found, level = {**found, name: 0.0}, without
    return found, level


def _means(values: Array, group: Array) -> Array:
    return np.asarray(np.bincount(group, values) / np.bincount(group))


def _interval(
    design: _Design, names: Sequence[str], name: str, best: dict[str, float], wanted: float
) -> tuple[float, float]:
    """Where the profile of one component falls to the wanted likelihood; 0 where it does not fall
    so far at 0."""
    others = [n for n in names if n != name]
    floor = 0.3 * min((best[n] for n in names if best[n] > 0), default=0.1)
    start = np.log([max(best[n], floor) for n in others]) if others else np.zeros(0)

    @functools.cache
    def short_of(value: float) -> float:
        if not others:
            return _log_likelihood(design, {name: value}) - wanted
        return -float(_climb(design, others, start, {name: value}).fun) - wanted

    def edge(outside: float, factor: float) -> float:
        """From the best value outwards to one that falls short, then back to where it does."""
        inside = middle
        while short_of(outside) >= 0:
            if not LEAST < outside < LARGEST:
                return outside
            inside, outside, factor = outside, outside * factor, factor**2
        ends = math.log(inside), math.log(outside)
        if short_of(inside) <= 0:
            return outside
        return math.exp(optimize.brentq(lambda u: short_of(math.exp(u)), *ends, xtol=5e-3))

    middle = max(best[name], LEAST)
    high = edge(1.5 * middle if best[name] > 0 else floor, 2.0)
    high = high if high < LARGEST else math.inf
    if best[name] <= 0 or short_of(0.0) >= 0:
        return 0.0, high
    return max(edge(middle / 1.5, 0.5), LEAST), high


def _scatter(design: _Design, cells: int, confidence: float) -> tuple[float, float, float] | None:
    """Repeats within a cell over their stated σ, √(χ²/dof) with its interval; None without repeats
    or without σ."""
    degrees = len(design.values) - cells
    if degrees < 1 or not design.own.min() > 0:
        return None
    weight = 1 / design.own
    mean = np.bincount(design.cell, weight * design.values) / np.bincount(design.cell, weight)
    chi2 = float((weight * (design.values - mean[design.cell]) ** 2).sum())
    low, high = (
        math.sqrt(chi2 / float(stats.chi2.ppf(p, degrees)))
        for p in ((1 + confidence) / 2, (1 - confidence) / 2)
    )
    return math.sqrt(chi2 / degrees), low, high
