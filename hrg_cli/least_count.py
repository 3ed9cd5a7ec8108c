"""The least count of a converter, found from the values it made: the step of the lattice on which
they all lie."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

Array = np.ndarray

FEWEST_VALUES = 8
"""Distinct values from which a lattice is looked for."""

OFF_LATTICE = 0.1
"""Largest rms distance of the steps from whole multiples of the least count, in least counts;
values of a continuum have 0.29."""

WIDEST = 1e4
"""Usual distance of neighbouring values in steps above which no lattice can be seen: the smallest
step is then chance."""

SPREAD_VARIANCE = 1 / 3
"""Variance in q² of values on a lattice of step q from which noise of q/2, beside q²/12 of the
rounding, spreads them over the codes."""
SPREAD_SHARE = 1 / 12 / SPREAD_VARIANCE
"""Part of that variance that the rounding makes: above it the codes are not spread."""
ROUNDINGS = 4.0
"""A step must exceed the number format's own rounding so many times."""


def count_values(values: Array) -> tuple[Array, Array]:
    """The distinct values and how often each stands; numpy's own `unique` loads masked arrays,
    which costs a command time.

    Parameters
    ----------
    values
        Of any order (n,).

    Returns
    -------
    values : ndarray
        (k,), rising.
    count : ndarray
        (k,), of each.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.least_count import count_values
    >>> [part.tolist() for part in count_values(np.array([3, 1, 3, 7]))]
    [[1, 3, 7], [1, 2, 1]]
    """
    ordered = np.sort(values)
    first = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]])[: len(ordered)])
    return ordered[first], np.diff(np.append(first, len(ordered)))


def find_least_count(parts: Iterable[Array]) -> float:
    """Smallest step on which all values of some arrays lie.

    Integers: the greatest common divisor of the differences. Floats: the smallest difference of two
    distinct values, refined over all neighbours (values printed with a few digits are off the
    lattice by their rounding), and held against all of them.

    Parameters
    ----------
    parts
        Arrays of values of one type.

    Returns
    -------
    float
        In the values' own unit; 0 where there is none. Of fewer than `FEWEST_VALUES` integers it is
        1.

    Examples
    --------
    A converter of 12 bits over ±10 V, and a continuum:

    >>> import numpy as np
    >>> from hrg_cli.least_count import find_least_count
    >>> swing = 3 * np.cos(0.1 * np.arange(2000))
    >>> step = 20 / 4096
    >>> rounded = step * np.round(swing / step)
    >>> [round(find_least_count([part]) / step, 6) for part in (rounded, swing)]
    [1.0, 0.0]
    """
    arrays = [np.asarray(part).ravel() for part in parts]
    values: Any = count_values(np.concatenate(arrays))[0] if arrays else np.zeros(0)
    if values.dtype.kind in "iub":
        steps = np.diff(values.astype(np.int64))
        return float(np.gcd.reduce(steps)) if len(values) >= FEWEST_VALUES else 1.0
    rounding = float(np.finfo(values.dtype).eps)
    values = values[np.isfinite(values)].astype(float)
    if len(values) < FEWEST_VALUES:
        return 0.0
    floor = ROUNDINGS * rounding * float(np.abs(values).max())
    steps = np.diff(values)
    steps = steps[steps > floor / ROUNDINGS]  # the same value, calculated twice
    if len(steps) < FEWEST_VALUES - 1:
        return 0.0
    step = float(steps.min())
    if step <= floor or np.partition(steps, len(steps) // 2)[len(steps) // 2] > WIDEST * step:
        return 0.0
    for near in (
        4.5,
        64.5,
        WIDEST,
    ):  # from close neighbours, whose number of steps is certain, to far ones
        some = steps[steps < near * step]
        step = float(some.sum() / np.round(some / step).sum())
    off = steps / step - np.round(steps / step)
    return step if float(np.sqrt(np.mean(off**2))) < OFF_LATTICE else 0.0
