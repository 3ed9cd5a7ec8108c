"""Groups of a lot whose gyros' parameters differ from those of all others: a station's scale
factor, a damping that is lower since a day.

Of a group and the rest of the lot the common values are pooled each for itself with its own spread
between gyros; their difference over √(σ₁² + σ₂²) is judged with the fewer degrees of freedom. The
parameters' own population (mean and spread) is no fault and is not tested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .common_causes import MOST, WORTH
from .groups import Group, Origin, count_tests, list_groups
from .pooling import Pooled, compute_equivalent_z, compute_improbability, pool_estimates

Array = np.ndarray
Measured = Mapping[str, tuple[float, float]]
"""Parameter -> value, σ (NaN: not known)."""


@dataclass(frozen=True)
class Shift:
    """A parameter that stands off in a group: difference ± σ from the others, |z|, p with all that
    was looked at."""

    name: str
    group: Group
    value: float
    std: float
    spread: float
    z: float
    p_value: float
    gyros: int


@dataclass(frozen=True)
class Population:
    """A parameter in the whole lot: mean ± σ, spread of the gyros themselves ± σ (measurement taken
    off), σ of one gyro's measurement, gyros that are in it."""

    name: str
    mean: float
    mean_std: float
    spread: float
    spread_std: float
    measured_std: float
    gyros: int


def _stack_gyros(gyros: Sequence[Measured]) -> tuple[list[str], Array, Array]:
    """Names (M), values and σ (n, M); a parameter without σ counts as exact beside the spread."""
    names = list(dict.fromkeys(name for one in gyros for name in one))
    pairs = np.array(
        [[one.get(name, (np.nan, np.nan)) for name in names] for one in gyros], float
    ).reshape(len(gyros), len(names), 2)
    value, std = pairs[..., 0], pairs[..., 1]
    with np.errstate(all="ignore"):
        least = 1e-9 * np.nanmax(np.abs(np.where(np.isfinite(value), value, 0)), axis=0, initial=0)
    floor = np.broadcast_to(np.where(least > 0, least, 1e-300), value.shape)
    return names, value, np.where(np.isfinite(std) & (std > floor), std, floor)


def estimate_populations(gyros: Sequence[Measured]) -> list[Population]:
    """The population of every parameter in a lot: mean and spread of the gyros themselves.

    Parameters
    ----------
    gyros
        Of each gyro, parameter -> value and σ.

    Returns
    -------
    list of Population
        In each parameter's own unit.

    Examples
    --------
    A spread of 1 that is measured to 0.5:

    >>> import numpy as np
    >>> from hrg_cli.lots.shifts import estimate_populations
    >>> random = np.random.default_rng(1)
    >>> values = random.standard_normal(400) + 0.5 * random.standard_normal(400)
    >>> (one,) = estimate_populations([{"x": (value, 0.5)} for value in values])
    >>> one.gyros, bool(abs(one.mean) < 4 * one.mean_std), bool(abs(one.spread - 1) < 0.15)
    (400, True, True)
    """
    names, value, std = _stack_gyros(gyros)
    if not names:
        return []
    whole = pool_estimates(value, std, 0.0)
    known = np.where(np.isfinite(value), std, np.nan)
    return [
        Population(
            name,
            float(whole.value[k]),
            float(whole.std[k]),
            float(whole.spread[k]),
            float(whole.spread_std[k]),
            float(np.nanmedian(known[:, k])),
            int(whole.count[k]),
        )
        for k, name in enumerate(names)
        if np.isfinite(whole.value[k])
    ]


def find_shifts(
    gyros: Sequence[Measured], origins: Sequence[Origin], rate: float = 0.01
) -> tuple[tuple[Shift, ...], int]:
    """What stands off in which group of a lot, surest first.

    Parameters
    ----------
    gyros
        Of each gyro, parameter -> value and σ.
    origins
        Where each gyro's runs come from.
    rate
        Chance that a lot of one population is given anything.

    Returns
    -------
    tuple
        The shifts, and how many pairs of parameter and group were looked at.

    Examples
    --------
    Station 2 reads 5 spreads more than station 1:

    >>> import numpy as np
    >>> from hrg_cli.lots.groups import Origin
    >>> from hrg_cli.lots.shifts import find_shifts
    >>> x = np.random.default_rng(1).standard_normal(40) + np.resize([0.0, 5.0], 40)
    >>> origins = [Origin({"station": "12"[k % 2]}) for k in range(40)]
    >>> (one,), _ = find_shifts([{"x": (value, 0.1)} for value in x], origins)
    >>> one.group.describe(), abs(one.value) > 4
    ('all gyros of station 1', True)
    """
    names, value, std = _stack_gyros(gyros)
    groups = [g for g in list_groups(origins) if g.depth and len(g.members) < len(gyros)]
    if not names or not groups:
        return (), 0
    others = [sorted(set(range(len(gyros))) - set(group.members)) for group in groups]
    value = value.copy()
    found: list[Shift] = []
    price: Array | None = None
    while len(found) < MOST:
        tables = [
            _compare_with_others(value, std, group, rest) for group, rest in zip(groups, others)
        ]
        known = [np.isfinite(z) for _, _, z, _ in tables]
        price = count_tests(known, groups) if price is None else price
        best: tuple[float, int, int] | None = None
        for place, (_, _, z, _) in enumerate(tables):
            sure = known[place] & (compute_improbability(np.nan_to_num(z)) * price[place] < rate)
            for k in map(int, np.flatnonzero(sure)):
                worth = float(z[k] ** 2) - WORTH * groups[place].depth
                if best is None or worth > best[0]:
                    best = (worth, k, place)
        if best is None:
            break
        _, k, place = best
        difference, error, z, inside = tables[place]
        group = groups[place]
        found.append(
            Shift(
                names[k],
                group,
                float(difference[k]),
                float(error[k]),
                float(inside.spread[k]),
                float(z[k]),
                min(1.0, float(compute_improbability(z[k])) * float(price[place])),
                int(inside.count[k]),
            )
        )
        value[list(group.members), k] -= difference[k]
    tested = int(np.sum([np.isfinite(z) for _, _, z, _ in tables]))
    return tuple(sorted(found, key=lambda one: -abs(one.z))), tested


def _compare_with_others(
    value: Array, std: Array, group: Group, others: Sequence[int]
) -> tuple[Array, Array, Array, Pooled]:
    """Difference, its σ, signed equivalent |z| (M,), and the group's own values."""
    inside, outside = (
        pool_estimates(value[list(group.members)], std[list(group.members)]),
        pool_estimates(value[list(others)], std[list(others)]),
    )
    with np.errstate(all="ignore"):
        difference = inside.value - outside.value
        error = np.hypot(inside.std, outside.std)
        dof = np.fmin(inside.dof, outside.dof)
        z = np.sign(difference) * compute_equivalent_z(np.abs(difference) / error, dof)
    return difference, error, z, inside
