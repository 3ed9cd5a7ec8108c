"""Stretches in which both channels repeat one value: no oscillation stands still in both for half a
period, but a recorder that lost its converter does, and one that pads what it has not got."""

from __future__ import annotations

import numpy as np

Array = np.ndarray

PERIODS, FEWEST = 0.5, 8
"""Periods of the oscillation, and samples, that a stretch lasts at least. A coarse converter
repeats the largest value for a part of that, and of two channels not both for half a period."""


def count_least(period_samples: float) -> int:
    """Samples that a still stretch has at least.

    Parameters
    ----------
    period_samples
        Of the oscillation.

    Returns
    -------
    int
        At least `FEWEST`.

    Examples
    --------
    >>> from hrg_cli.fitting.samples.stillness import count_least
    >>> count_least(8.0), count_least(100.0)
    (8, 50)
    """
    return max(FEWEST, int(np.ceil(PERIODS * period_samples)))


def mark_stretches(stretches: Array, count: int) -> Array:
    """Which of so many places stand in a stretch.

    Parameters
    ----------
    stretches
        First and last place of each, (k, 2).
    count
        Of all places.

    Returns
    -------
    ndarray
        (count,) bool.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.stillness import mark_stretches
    >>> mark_stretches(np.array([[1, 2]]), 4).tolist()
    [False, True, True, False]
    """
    marked = np.zeros(count, bool)
    for first, last in stretches:
        marked[first : last + 1] = True
    return marked


def find_still(c: Array, s: Array, least: int) -> Array:
    """First and last sample of every stretch in which both channels repeat one value.

    Parameters
    ----------
    c, s
        Samples (n,) one after the other.
    least
        Samples that such a stretch has at least.

    Returns
    -------
    ndarray
        (k, 2) places, the last included.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.stillness import find_still
    >>> c = np.cos(0.7 * np.arange(100))
    >>> c[40:60] = 0.0
    >>> find_still(c, c, 8).tolist()
    [[40, 59]]
    """
    # a stretch of so many has two that follow one another at one of these places
    step = max(1, least // 2)
    if not np.any((c[1::step] == c[:-1:step]) & (s[1::step] == s[:-1:step])):
        return np.zeros((0, 2), int)
    same = (c[1:] == c[:-1]) & (s[1:] == s[:-1])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).view(np.int8)))
    stretches = edges.reshape(-1, 2)
    return np.asarray(stretches[stretches[:, 1] - stretches[:, 0] + 1 >= least])
