"""Steps of a logged rate: a log knows the table's rate at its instants, not the angle turned while
the rate steps, which is uncertain by half of the step times the time between two rows."""

from __future__ import annotations

import numpy as np

from ..medians import find_median

Array = np.ndarray
ABOVE = 10.0
"""Times the usual change from row to row that makes a step."""
LEAST = 1e-3
"""Part of the largest rate that a step is, at least."""
MATTERS = 0.3
"""Uncertain angle over σ from which a step is worth correcting."""
MOST_A_RUN = 12
LONGEST = 8
"""Rows a step may take, where the log is coarser than the rows."""
SHARE = 0.25
"""Part of a run's rows that steps may take."""


def find_steps(rate_rad_s: Array, good: Array, sigmas_per_rad_s: Array) -> list[tuple[int, int]]:
    """Steps of a run's rate that matter; none where it always moves like that.

    Parameters
    ----------
    rate_rad_s
        Logged (n,) [rad/s].
    good
        Rows that count (n,) bool.
    sigmas_per_rad_s
        By how many σ the angle turned in each interval (n − 1,) is uncertain per rad/s of a jump.

    Returns
    -------
    list of tuple
        First row before and last row before each step: between `first` and `last + 1` the rate
        moves.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.rate_steps import find_steps
    >>> rate = np.where(np.arange(40) < 20, 0.5, -0.5)
    >>> find_steps(rate, np.ones(40, bool), np.ones(39))
    [(19, 19)]
    >>> find_steps(np.sin(np.arange(40.0)), np.ones(40, bool), np.ones(39))
    []
    """
    jump = np.abs(np.diff(rate_rad_s)) * good[1:]
    if len(jump) < 8 or not jump.any():
        return []
    big = np.flatnonzero(
        (jump > ABOVE * find_median(jump[good[1:]]))
        & (jump > LEAST * np.abs(rate_rad_s).max())
        & (jump * sigmas_per_rad_s > MATTERS)
    )
    groups = np.split(big, np.flatnonzero(np.diff(big) > 1) + 1) if len(big) else []
    few = 0 < len(groups) <= MOST_A_RUN and len(big) < SHARE * np.count_nonzero(good)
    if not few or max(map(len, groups)) > LONGEST:
        return []
    return [(int(group[0]), int(group[-1])) for group in groups]
