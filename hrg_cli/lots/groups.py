"""The groups of a lot in which gyros may have a cause in common: all of them, those of a station, a
fixture, …, and of each of these the ones before or from a day on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .pooling import FEWEST

Array = np.ndarray
GROUPED_BY = ("station", "fixture", "operator", "firmware", "order")
"""Keys of a gyro (`[[gyro]]` of the lot's file, or attributes of its recordings) that group it."""
MOST_GROUPS = 40
"""Groups of one key that are looked at; a key with more (a serial number) groups nothing."""
MOST_DAYS = 12
"""Days a group at which a change is looked for; of more, these are spread evenly over the gyros."""


@dataclass(frozen=True)
class Origin:
    """Where a gyro's runs come from: the keys that group it, and the day of the first run (ISO
    8601; empty: not known)."""

    groups: Mapping[str, str]
    day: str = ""


@dataclass(frozen=True)
class Group:
    """Gyros (places in the lot): by which key and value ("" for the whole lot), from or until which
    day, and other names of just the same gyros."""

    members: tuple[int, ...]
    by: str = ""
    value: str = ""
    since: str = ""
    until: str = ""
    also: tuple[str, ...] = ()

    @property
    def depth(self) -> int:
        """How many times the lot was divided to come to it."""
        return bool(self.by) + self.timed

    @property
    def timed(self) -> bool:
        """Whether it is limited in time."""
        return bool(self.since or self.until)

    def describe(self) -> str:
        """In words, for instance: all gyros of station 2 since 2026-05-04."""
        text = f"all gyros of {self.by} {self.value}" if self.by else "all gyros"
        if self.also:
            text += f" (which is {' and '.join(self.also)})"
        text += f" since {self.since}" if self.since else ""
        return text + (f" until {self.until}" if self.until else "")


def list_groups(origins: Sequence[Origin]) -> list[Group]:
    """Every group with enough gyros, none twice; the whole lot first.

    Parameters
    ----------
    origins
        Of each gyro of the lot.

    Returns
    -------
    list of Group
        By each key and value, and of those the ones before and from a day on; of `FEWEST` gyros at
        least. Other names of just the same gyros stand in `also`.

    Examples
    --------
    >>> from hrg_cli.lots.groups import Origin, list_groups
    >>> origins = [Origin({"station": "12"[k % 2]}) for k in range(20)]
    >>> [group.describe() for group in list_groups(origins)]
    ['all gyros', 'all gyros of station 1', 'all gyros of station 2']
    """
    whole = [Group(tuple(range(len(origins))))]
    for by in GROUPED_BY:
        values: dict[str, list[int]] = {}
        for place, origin in enumerate(origins):
            if origin.groups.get(by):
                values.setdefault(origin.groups[by], []).append(place)
        if 1 < len(values) <= MOST_GROUPS or 0 < len(values) == 1 < len(origins):
            whole += [Group(tuple(members), by, value) for value, members in sorted(values.items())]
    found: dict[tuple[int, ...], Group] = {}
    for group in [*whole, *(part for one in whole for part in _in_time(one, origins))]:
        if len(group.members) < FEWEST:
            continue
        known = found.get(group.members)
        if known is None:
            found[group.members] = group
        elif known.by and group.by and known.by != group.by and known.depth == group.depth:
            also = (*known.also, f"{group.by} {group.value}")
            found[group.members] = Group(
                known.members, known.by, known.value, known.since, known.until, also
            )
    return list(found.values())


def count_tests(known: Sequence[Array], groups: Sequence[Group]) -> Array:
    """How many tests a single one's p is multiplied by, group by group.

    Those of its kind (limited in time or not), times the kinds there are, which share the rate
    evenly.

    Parameters
    ----------
    known
        Of each group, for which parameters (M,) there is a value.
    groups
        The groups.

    Returns
    -------
    ndarray
        (G,) of the groups.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.lots.groups import Group, count_tests
    >>> groups = [Group((0, 1)), Group((1,), since="2026-05-04")]
    >>> count_tests([np.array([True, True]), np.array([True, False])], groups).tolist()
    [4, 2]
    """
    counts = {kind: 0 for kind in (False, True)}
    for own, group in zip(known, groups, strict=True):
        counts[group.timed] += int(np.sum(own))
    kinds = sum(count > 0 for count in counts.values())
    return np.array([counts[group.timed] * kinds for group in groups])


def _in_time(group: Group, origins: Sequence[Origin]) -> list[Group]:
    """The gyros of a group from a day on, and those before it."""
    dated = sorted((origins[k].day, k) for k in group.members if origins[k].day)
    days = [day for day, _ in dated]
    starts = [
        k
        for k in range(1, len(days))
        if days[k] != days[k - 1] and FEWEST <= k <= len(days) - FEWEST
    ]
    if len(starts) > MOST_DAYS:
        picked = np.linspace(0, len(starts) - 1, MOST_DAYS).round().astype(int)
        starts = [starts[k] for k in picked]
    out = []
    for k in starts:
        early, late = (tuple(sorted(n for _, n in part)) for part in (dated[:k], dated[k:]))
        out.append(Group(late, group.by, group.value, since=days[k]))
        out.append(Group(early, group.by, group.value, until=days[k - 1]))
    return out
