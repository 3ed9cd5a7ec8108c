"""Causes that many gyros have in common, of a size that no single one of them need show.

Every gyro's diagnosis holds one-step estimates x ± σ of all causes beside its own final fit, and
how alike they are, ρ (`stages/diagnosis/report/scores.py`). They are pooled over every group of
gyros (`pooling`, `groups`); the surest pair of cause and group is taken in, the other causes of
these gyros are then told beside it, z_b → (z_b − ρ z_a)/√(1 − ρ²), and the next is looked for. The
chance that a lot without a common cause is given one is `rate` at most: p is multiplied by the
number of pairs looked at (Bonferroni).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .groups import Group, Origin, count_tests, list_groups
from .pooling import Pooled, compute_improbability, pool_estimates

Array = np.ndarray
WORTH = 10.0
"""χ² by which a smaller group must say more than a larger one, and by which a cause must beat
another to be told from it (as in a diagnosis)."""
SAME = 0.03
"""√(1 − ρ²) below which two causes are one to a gyro's runs."""
MOST = 12
"""Common causes looked for."""


@dataclass(frozen=True)
class Estimates:
    """Of n gyros and M parameters: z = x/σ and 1/σ (n, M), NaN and 0 where a gyro has none;
    correlations (n, M, M)."""

    names: tuple[str, ...]
    units: Mapping[str, str]
    z: Array
    per_sigma: Array
    alike: Array

    @property
    def value(self) -> Array:
        """x, (n, M)."""
        with np.errstate(all="ignore"):
            return self.z / self.per_sigma

    @property
    def std(self) -> Array:
        """σ, (n, M)."""
        with np.errstate(all="ignore"):
            return np.where(self.per_sigma > 0, 1 / self.per_sigma, np.nan)


@dataclass(frozen=True)
class CommonCause:
    """A cause ("effect.parameter") that a group of gyros has in common: value ± σ, spread between
    the gyros, |z|, p with all that was looked at, causes it cannot be told from, gyros that stand
    alone in it."""

    name: str
    units: str
    group: Group
    value: float
    std: float
    spread: float
    z: float
    p_value: float
    gyros: int
    rivals: tuple[str, ...] = ()
    alone: tuple[int, ...] = ()
    estimates: tuple[tuple[int, float, float], ...] = field(default=(), repr=False)
    """(gyro, x, σ) of every gyro of the lot that knows it, beside the other common causes."""


@dataclass(frozen=True)
class CommonCauses:
    """The common causes, surest first, and how many pairs of cause and group were looked at."""

    causes: tuple[CommonCause, ...]
    tested: int
    groups: int
    rate: float


def gather_estimates(scores: Sequence[Mapping[str, Any] | None]) -> Estimates:
    """The gyros' scores side by side.

    Parameters
    ----------
    scores
        Of each gyro `names`, `units`, `value`, `std` and the lower triangle of `correlation`; None:
        it was not diagnosed.

    Returns
    -------
    Estimates
        Of all parameters that any gyro has.

    Examples
    --------
    >>> from hrg_cli.lots.common_causes import gather_estimates
    >>> one = {"names": ["gain_mismatch.gain"], "units": ["1"], "value": [6e-4], "std": [3e-4]}
    >>> found = gather_estimates([one | {"correlation": [[]]}, None])
    >>> found.names, found.z.tolist()
    (('gain_mismatch.gain',), [[2.0], [nan]])
    """
    names = list(dict.fromkeys(name for one in scores if one for name in one["names"]))
    place = {name: k for k, name in enumerate(names)}
    units: dict[str, str] = {}
    z = np.full((len(scores), len(names)), np.nan)
    per_sigma = np.zeros(z.shape)
    alike = np.zeros((*z.shape, len(names)))
    for gyro, one in enumerate(scores):
        if not one or not one["names"]:
            continue
        own = [place[name] for name in one["names"]]
        units |= dict(zip(one["names"], one["units"], strict=True))
        std = np.array(one["std"], float)
        z[gyro, own], per_sigma[gyro, own] = np.array(one["value"], float) / std, 1 / std
        for k, row in enumerate(one["correlation"]):
            alike[gyro, own[k], own[: len(row)]] = alike[gyro, own[: len(row)], own[k]] = row
    return Estimates(tuple(names), units, z, per_sigma, alike)


def estimate_beside(estimates: Estimates, cause: int, members: Sequence[int]) -> Estimates:
    """The estimates of all other causes beside one that is free in some gyros.

    z_b → (z_b − ρ z_a)/√(1 − ρ²); what does the same there is no longer known.

    Parameters
    ----------
    estimates
        Of n gyros and M parameters.
    cause
        Place of the one that is free.
    members
        Places of the gyros in which it is.

    Returns
    -------
    Estimates
        The others' are wider by 1/√(1 − ρ²); its own stay.

    Examples
    --------
    Half of what is seen of the second is the first's, ρ = 0.6:

    >>> import numpy as np
    >>> from hrg_cli.lots.common_causes import Estimates, estimate_beside
    >>> alike = np.array([[[0.0, 0.6], [0.6, 0.0]]])
    >>> both = Estimates(("a.x", "b.x"), {}, np.array([[5.0, 6.0]]), np.ones((1, 2)), alike)
    >>> beside = estimate_beside(both, 0, [0])
    >>> beside.z.round(9).tolist(), beside.std.round(9).tolist()
    ([[5.0, 3.75]], [[1.0, 1.25]])
    """
    z, per_sigma, alike = estimates.z.copy(), estimates.per_sigma.copy(), estimates.alike.copy()
    own = [k for k in members if np.isfinite(z[k, cause])]
    if not own:
        return estimates
    rho = alike[own, cause, :].copy()
    rho[:, cause] = 0.0
    left = np.sqrt(np.maximum(1 - rho**2, 0.0))
    gone = left < SAME
    safe = np.where(gone, 1.0, left)
    z[own] = np.where(gone, np.nan, (z[own] - rho * z[own, cause][:, None]) / safe)
    per_sigma[own] = np.where(gone, 0.0, per_sigma[own] * left)
    changed = alike[own] - rho[:, :, None] * rho[:, None, :]
    changed /= safe[:, :, None] * safe[:, None, :]
    changed[:, cause, :] = changed[:, :, cause] = 0.0
    alike[own] = np.where(gone[:, :, None] | gone[:, None, :], 0.0, changed)
    return Estimates(estimates.names, estimates.units, z, per_sigma, alike)


def find_common_causes(
    scores: Sequence[Mapping[str, Any] | None],
    origins: Sequence[Origin],
    rate: float = 0.01,
) -> CommonCauses:
    """What groups of a lot's gyros have in common, of a size that no single one of them need show.

    Parameters
    ----------
    scores
        Of each gyro's diagnosis; None: it was not diagnosed.
    origins
        Where each gyro's runs come from.
    rate
        Chance that a clean lot is given anything.

    Returns
    -------
    CommonCauses
        Surest first, each beside the others.

    Examples
    --------
    Twenty gyros whose gain is 2 σ off each, where it is no fault of a single one:

    >>> import numpy as np
    >>> from hrg_cli.lots.common_causes import find_common_causes
    >>> from hrg_cli.lots.groups import Origin
    >>> def score(z):
    ...     told = {"names": ["gain_mismatch.gain"], "units": ["1"], "correlation": [[]]}
    ...     return told | {"value": [3e-4 * z], "std": [3e-4]}
    >>> scores = [score(2 + z) for z in np.random.default_rng(1).standard_normal(20)]
    >>> (one,) = find_common_causes(scores, [Origin({})] * 20).causes
    >>> one.name, one.gyros, bool(abs(one.value - 6e-4) < 3 * one.std)
    ('gain_mismatch.gain', 20, True)
    """
    first = gather_estimates(scores)
    groups = list_groups(origins)
    tables = [_pooled(first, group) for group in groups]
    known = [np.isfinite(table.z) for table in tables]
    price = count_tests(known, groups)
    tested = int(np.sum(known))
    taken: list[tuple[int, Group]] = []
    now, explained = first, np.zeros(first.z.shape)
    while len(taken) < MOST:
        best = _surest(tables, groups, taken, price, rate)
        if best is None:
            break
        cause, place = best
        used = tables[place].used[:, cause]
        members = [k for k, there in zip(groups[place].members, used, strict=True) if there]
        explained[members, cause] += tables[place].value[cause]
        taken.append((cause, groups[place]))
        now = estimate_beside(now, cause, members)
        less = Estimates(
            now.names, now.units, now.z - explained * now.per_sigma, now.per_sigma, now.alike
        )
        tables = [_pooled(less, group) for group in groups]
    causes = [
        _describe_cause(first, taken, k, price[groups.index(taken[k][1])])
        for k in range(len(taken))
    ]
    kept = [one for one in causes if one is not None and one.p_value < rate]
    return CommonCauses(tuple(sorted(kept, key=lambda one: -abs(one.z))), tested, len(groups), rate)


def _pooled(estimates: Estimates, group: Group) -> Pooled:
    rows = list(group.members)
    return pool_estimates(estimates.value[rows], estimates.std[rows])


def _surest(
    tables: Sequence[Pooled],
    groups: Sequence[Group],
    taken: Sequence[tuple[int, Group]],
    price: Array,
    rate: float,
) -> tuple[int, int] | None:
    """(cause, group) of the largest z² less the price of a smaller group, of those that are
    sure."""
    best: tuple[float, int, int] | None = None
    for place, (table, group) in enumerate(zip(tables, groups, strict=True)):
        sure = np.isfinite(table.z) & (
            compute_improbability(np.nan_to_num(table.z)) * price[place] < rate
        )
        for cause in np.flatnonzero(sure):
            if any(cause == c and group.members == g.members for c, g in taken):
                continue
            worth = float(table.z[cause] ** 2) - WORTH * group.depth
            if best is None or worth > best[0]:
                best = (worth, int(cause), place)
    return None if best is None else best[1:]


def _describe_cause(
    first: Estimates,
    taken: Sequence[tuple[int, Group]],
    which: int,
    price: int,
) -> CommonCause | None:
    """A common cause beside all others that were taken in, with what it cannot be told from."""
    cause, group = taken[which]
    others = first
    less = np.zeros(first.z.shape)
    for k, (other, its) in enumerate(taken):
        if k == which:
            continue
        if other == cause:
            less[list(its.members), cause] += _pooled(first, its).value[cause]
        else:
            others = estimate_beside(others, other, its.members)
    mine = Estimates(
        others.names,
        others.units,
        others.z - less * others.per_sigma,
        others.per_sigma,
        others.alike,
    )
    table = _pooled(mine, group)
    if not np.isfinite(table.z[cause]):
        return None
    rows = np.array(group.members)
    chi2 = table.z**2
    close = np.isfinite(chi2) & (chi2 > chi2[cause] - WORTH)
    rivals = [
        first.names[k]
        for k in np.flatnonzero(close)
        if k != cause and not any(k == c for c, _ in taken)
    ]
    known = np.flatnonzero(np.isfinite(mine.z[:, cause]))
    in_group = np.isfinite(mine.z[rows, cause])
    return CommonCause(
        first.names[cause],
        first.units[first.names[cause]],
        group,
        float(table.value[cause]),
        float(table.std[cause]),
        float(table.spread[cause]),
        float(table.z[cause]),
        min(1.0, float(compute_improbability(table.z[cause])) * price),
        int(table.count[cause]),
        tuple(rivals),
        tuple(int(k) for k in rows[in_group & ~table.used[:, cause]]),
        tuple((int(k), float(mine.value[k, cause]), float(mine.std[k, cause])) for k in known),
    )
