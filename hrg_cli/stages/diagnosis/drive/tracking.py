"""Diagnosis, what a loop of second order that follows a course leaves of it.

−s²/(s² + √2 ω_n s + ω_n²), ω_n the loop's natural frequency and 1/√2 its damping; where it stands
when the course begins is another question, and answered in three ways.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np

from ....fitting.causes.measured_runs import MeasuredRuns
from .scatter import find_row_length_s

Array = np.ndarray
APART = 1.25
"""Ratio of neighbouring loops' natural frequencies: what one between two of them leaves is a
combination of what all leave, to a thousandth. At a ratio of 2, to 4 %: of a phase that a split
turns by 0.05 rad that was 20 σ over a run, and eight clean gyros of ten had an "angle that changes
with wave angle"."""
FINER = 4
"""Instants a row at which a loop's answer is followed."""
DAMPING = 0.5**0.5
"""Of the loops: what one with up to four times as much leaves is a combination of theirs to 2 %,
with half of it to a sixth."""
SETTLED_BY = 0.3
"""Part of a run by which its trackers have settled, to a thirtieth of what they began with."""
SETTLED_TO = 1 / 30
FARTHER = 2.0
"""Ratio of neighbouring natural frequencies where what begins is a small part of what loops
leave."""

Beginning = Literal["along its line", "long before", "on its value"]


def compute_slope(time_s: Array, course: Array) -> Array:
    """Rate of change over the rows.

    Parameters
    ----------
    time_s
        [s], (R, n).
    course
        (R, n).

    Returns
    -------
    ndarray
        (R, n), the course's unit per second; 0 where rows are padded.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drive.tracking import compute_slope
    >>> compute_slope(np.array([[0.0, 0.5, 1.0]]), np.array([[0.0, 1.0, 2.0]])).tolist()
    [[2.0, 2.0, 2.0]]
    """
    step = np.gradient(time_s, axis=1)
    return np.divide(np.gradient(course, axis=1), step, out=np.zeros_like(course), where=step > 0)


def choose_natural_frequencies(
    series: MeasuredRuns, slowest: float = 2 * np.pi, apart: float = APART
) -> Array:
    """ω_n of the loops allowed for, from a run's length to a row's.

    Parameters
    ----------
    series
        The runs' rows.
    slowest
        Times the run's inverse length with which they begin.
    apart
        Ratio of neighbours at most.

    Returns
    -------
    ndarray
        [rad/s], rising.

    Examples
    --------
    Rows of 20 ms within 1 s:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.tracking import choose_natural_frequencies
    >>> found = choose_natural_frequencies(draw_fit().series, apart=3.0)
    >>> found.round(1).tolist()
    [6.4, 17.9, 50.0]
    """
    lengths = [np.ptp(t[w > 0]) for t, w in zip(series.time_s, series.weight, strict=True)]
    least, most = slowest / max(lengths), 1 / find_row_length_s(series)
    most = max(most, least)
    return np.geomspace(least, most, 1 + max(1, int(np.ceil(np.log(most / least) / np.log(apart)))))


def choose_settling_frequencies(series: MeasuredRuns) -> Array:
    """ω_n of the trackers that have settled early enough in a run, from the slowest to a row's.

    Parameters
    ----------
    series
        The runs' rows.

    Returns
    -------
    ndarray
        [rad/s], rising.

    Examples
    --------
    To a thirtieth within 0.3 of 1 s:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.tracking import choose_settling_frequencies
    >>> choose_settling_frequencies(draw_fit().series).round(1).tolist()
    [16.4, 28.6, 50.0]
    """
    slowest = np.log(1 / SETTLED_TO) / SETTLED_BY / DAMPING
    return choose_natural_frequencies(series, float(slowest), FARTHER)


def compute_unfollowed(
    series: MeasuredRuns,
    course: Array,
    natural_rad_s: Array,
    beginning: Beginning = "along its line",
) -> Array:
    """What loops of second order leave of a course: −s²/(s² + √2 ω_n s + ω_n²), by the bilinear
    rule on a fine grid.

    Parameters
    ----------
    series
        The runs' rows.
    course
        (R, n).
    natural_rad_s
        ω_n of the loops [rad/s].
    beginning
        Loops have followed the run's mean line when it begins; or a course like the run's own,
        turned about its start, so that nothing begins and what is left is what the course alone
        leaves; or they begin where it does, and at rest.

    Returns
    -------
    ndarray
        (R, n, loops), in the course's unit.

    Examples
    --------
    A loop that is fast beside a course of 1 Hz leaves less of it:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.tracking import compute_unfollowed
    >>> series = draw_fit().series
    >>> left = compute_unfollowed(series, np.sin(2 * np.pi * series.time_s), np.array([3.0, 30.0]))
    >>> left.shape, bool(np.ptp(left[0, :, 1]) < np.ptp(left[0, :, 0]))
    ((3, 50, 2), True)
    """
    from scipy import signal

    out = np.zeros((*course.shape, len(natural_rad_s)))
    for k, (t, weight) in enumerate(zip(series.time_s, series.weight, strict=True)):
        good = weight > 0
        if not course[k].any():
            continue
        grid = np.linspace(t[good][0], t[good][-1], FINER * int(np.count_nonzero(good)))
        whole = _begin(np.interp(grid, t[good], course[k][good]), beginning)
        for loop, natural in enumerate(natural_rad_s):
            rule = _make_rule(float(natural), float(grid[1] - grid[0]))
            left = signal.lfilter(*rule, whole)[-len(grid) :]
            out[k, :, loop] = np.interp(t, grid, left)
    return out


@lru_cache(maxsize=1 << 12)
def _make_rule(natural_rad_s: float, step_s: float) -> tuple[Array, Array]:
    """The bilinear rule of what a loop leaves; every fit of a search asks for the same loops."""
    from scipy import signal

    loop = [1.0, 2 * DAMPING * natural_rad_s, natural_rad_s**2]
    numerator, denominator = signal.bilinear([-1.0, 0.0, 0.0], loop, 1 / step_s)
    return np.asarray(numerator), np.asarray(denominator)


def _begin(values: Array, beginning: Beginning) -> Array:
    """A course as loops meet it that begin so, with all that went before it."""
    values = values - values[0]
    if beginning == "on its value":
        return values
    # a course turned about its start is odd: it goes on through the start without a bend, and
    # nothing begins
    whole = np.concatenate([-values[:0:-1], values]) if beginning == "long before" else values
    steps = np.arange(len(whole))
    # loops of second order follow a line without error once they are settled
    return whole - np.polynomial.Polynomial.fit(steps, whole, 1)(steps)
