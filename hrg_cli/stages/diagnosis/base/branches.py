"""Diagnosis, on which branch of a temperature cycle a run stands, step by step: the temperature
turns between its rows, and where it does is told by the rows on either side.

A course that turns at a corner does so where the lines through the two rows before and the two rows
behind meet; one that turns smoothly, where its slope passes through zero.
"""

from __future__ import annotations

import numpy as np

from ....effects.effect import find_branch

Array = np.ndarray
SMOOTH = 0.5
"""Part of a turn's bend that the rows on either side of it must have for the turn to be a smooth
one: beside a corner they have none."""


def average_branch(time_s: Array, temperature: Array) -> Array:
    """Mean of a temperature's branch over the step that follows each row: +1 rising, −1 falling, 0
    before any change.

    Parameters
    ----------
    time_s
        Of the rows [s], (n,).
    temperature
        (n,) [°C].

    Returns
    -------
    ndarray
        (n,); the last row has no step and repeats the one before.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.base.branches import average_branch
    >>> average_branch(np.arange(6.0), np.array([20.0, 21.0, 22.0, 23.0, 22.0, 21.0])).tolist()
    [1.0, 1.0, 1.0, -1.0, -1.0, -1.0]
    """
    signs = find_branch(temperature)[1:]  # of every step
    if len(signs) == 0 or not signs.any():
        return np.zeros(len(time_s))
    starts, values = [float(time_s[0])], [float(signs[0])]
    for step in np.flatnonzero(np.diff(signs)) + 1:
        starts.append(max(starts[-1], find_turning_time_s(time_s, temperature, int(step))))
        values.append(float(signs[step]))
    # ∫ of the branch to every row, straight between the turns
    ends = np.append(starts, float(time_s[-1]))
    area = np.concatenate([[0.0], np.cumsum(values * np.diff(ends))])
    distinct = np.append(np.diff(ends) > 0, True)
    integral = np.interp(time_s, ends[distinct], area[distinct])
    mean = np.diff(integral) / np.diff(time_s)
    return np.append(mean, mean[-1])


def find_turning_time_s(time_s: Array, temperature: Array, step: int) -> float:
    """When a temperature turned that moves another way from a step on: within that step or the one
    before.

    Parameters
    ----------
    time_s
        Of the rows [s], (n,).
    temperature
        (n,) [°C].
    step
        The first step that goes the other way.

    Returns
    -------
    float
        [s], where the straight lines from either side meet, or by a parabola where it turns
        smoothly.

    Examples
    --------
    A ramp of 1 °C/s that turns at 3.4 s:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.base.branches import find_turning_time_s
    >>> t = np.arange(8.0)
    >>> round(find_turning_time_s(t, 20 - np.abs(t - 3.4), 4), 6)
    3.4
    """
    slopes = np.diff(temperature) / np.diff(time_s)
    first, last = time_s[step - 1], time_s[step + 1]
    inner = 2 <= step <= len(slopes) - 2
    if inner and not _is_smooth(slopes, step) and slopes[step - 2] != slopes[step + 1]:
        gap = temperature[step + 1] - temperature[step - 1]
        before, behind = slopes[step - 2], slopes[step + 1]
        turn = (gap + before * first - behind * last) / (before - behind)
    else:
        middle = (time_s[1:] + time_s[:-1]) / 2
        before, behind = slopes[step - 1], slopes[step]
        turn = middle[step - 1] + (middle[step] - middle[step - 1]) * before / (before - behind)
    return float(np.clip(turn, first, last))


def _is_smooth(slopes: Array, step: int) -> bool:
    """Whether the slope changes before and behind a turn as much as at it."""
    bends = np.abs(np.diff(slopes[step - 2 : step + 2]))
    return bool(min(bends[0], bends[2]) > SMOOTH * bends[1])
