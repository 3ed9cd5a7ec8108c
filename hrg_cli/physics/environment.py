"""Programmes of temperature and rate, and the one time grid on which a run's environment stands.

A programme is a function of time with its corners and the longest grid step that still draws it;
between the rows of the grid the environment is linear, for both engines alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import HrgError
from ..units import EARTH_RATE_RAD_S
from .plant import Environment

Array = np.ndarray
_ROWS = 1000
"""Fewest rows of a moving environment, so that coefficients that bend with temperature are drawn
well."""
_MOST_ROWS = 1_000_000
_ROWS_A_PERIOD = 400
_FEWEST_ROWS_A_PERIOD = 24


@dataclass(frozen=True)
class Programme:
    """A quantity's course: value(t), the times of its corners, and the period of its fastest smooth
    part."""

    value: Callable[[Array], Array]
    corners: Array
    period_s: float = np.inf
    constant: bool = False


def hold_value(level: float) -> Programme:
    """The same value at all times.

    Parameters
    ----------
    level
        The value, in the quantity's unit.

    Returns
    -------
    Programme
        Without corners.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import hold_value
    >>> hold_value(20.0).value(np.array([0.0, 1.0])).tolist()
    [20.0, 20.0]
    """
    return Programme(lambda t: np.full(np.shape(t), level), np.zeros(0), constant=True)


def follow_points(times: Sequence[float] | Array, values: Sequence[float] | Array) -> Programme:
    """Straight lines through the points; constant before the first and after the last.

    Parameters
    ----------
    times
        Times of the points [s], (k,), rising.
    values
        Values there, (k,).

    Returns
    -------
    Programme
        With a corner at every point.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import follow_points
    >>> follow_points([0.0, 10.0], [20.0, 30.0]).value(np.array([5.0, 15.0])).tolist()
    [25.0, 30.0]
    """
    t, v = np.asarray(times, float), np.asarray(values, float)
    return Programme(lambda x: np.interp(x, t, v), t)


def follow_levels(values: Sequence[float], dwell_s: float, transition_s: float) -> Programme:
    """Each value held for dwell_s, the next reached along a straight line of transition_s.

    Parameters
    ----------
    values
        The levels, in order.
    dwell_s, transition_s
        How long each is held, and how long the way to the next takes.

    Returns
    -------
    Programme
        Constant after the last level.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import follow_levels
    >>> follow_levels([0.0, 4.0], 10.0, 2.0).value(np.array([9.0, 11.0, 13.0])).tolist()
    [0.0, 2.0, 4.0]
    """
    starts = np.arange(len(values)) * (dwell_s + transition_s)
    return follow_points(
        np.column_stack([starts, starts + dwell_s]).ravel(), np.repeat(np.asarray(values, float), 2)
    )


def make_sine(
    amplitude: float, frequency_hz: float, phase_rad: float = 0.0, offset: float = 0.0
) -> Programme:
    """offset + amplitude·sin(2πft + phase).

    Parameters
    ----------
    amplitude, offset
        In the quantity's unit.
    frequency_hz, phase_rad
        f and the phase at t = 0.

    Returns
    -------
    Programme
        Smooth; its period bounds the grid's step.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import make_sine
    >>> make_sine(2.0, 0.25, offset=1.0).value(np.array([0.0, 1.0])).tolist()
    [1.0, 3.0]
    """
    omega = 2 * np.pi * frequency_hz
    return Programme(
        lambda t: offset + amplitude * np.sin(omega * np.asarray(t) + phase_rad),
        np.zeros(0),
        1 / frequency_hz,
    )


def _corners(a_period: int, period_s: float, end_s: float) -> Array:
    """Numbers of the corners, so many a period, that reach beyond end_s. HrgError: too many."""
    count = np.ceil(a_period * end_s / period_s) + 2
    if count > _MOST_ROWS:
        raise HrgError(
            f"environment: a cycle of {period_s:g} s turns too often in {end_s:g} s; lengthen the"
            " period or shorten the run"
        )
    return np.arange(int(count))


def make_triangle(low: float, high: float, period_s: float, end_s: float) -> Programme:
    """From low to high in half a period and back, again and again until end_s.

    Parameters
    ----------
    low, high
        The turning points.
    period_s
        From low to low.
    end_s
        Until when corners are needed.

    Returns
    -------
    Programme
        With a corner every half period.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import make_triangle
    >>> make_triangle(0.0, 1.0, 4.0, 8.0).value(np.array([0.0, 1.0, 2.0, 3.0])).tolist()
    [0.0, 0.5, 1.0, 0.5]
    """
    corner = _corners(2, period_s, end_s)
    return follow_points(corner * period_s / 2, np.where(corner % 2, high, low))


def make_sweep(largest: float, period_s: float, end_s: float) -> Programme:
    """From 0 to +largest, to −largest and back to 0 in each period until end_s.

    Parameters
    ----------
    largest
        The turning points are ± this.
    period_s
        From 0 to 0.
    end_s
        Until when corners are needed.

    Returns
    -------
    Programme
        With a corner every quarter period.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import make_sweep
    >>> make_sweep(2.0, 4.0, 8.0).value(np.array([0.0, 1.0, 2.0, 3.0])).tolist()
    [0.0, 2.0, 0.0, -2.0]
    """
    corner = _corners(4, period_s, end_s)
    return follow_points(
        corner * period_s / 4, largest * np.array([0.0, 1.0, 0.0, -1.0])[corner % 4]
    )


def add_programmes(parts: Sequence[Programme]) -> Programme:
    """The sum of programmes.

    Parameters
    ----------
    parts
        Programmes of one quantity, at least one.

    Returns
    -------
    Programme
        With the corners of all and the shortest of their periods.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import hold_value, follow_points, add_programmes
    >>> ramp = follow_points([0.0, 1.0], [0.0, 2.0])
    >>> add_programmes([hold_value(1.0), ramp]).value(np.array([0.5])).tolist()
    [2.0]
    """
    return Programme(
        lambda t: np.sum([p.value(np.asarray(t)) for p in parts], axis=0),
        np.concatenate([p.corners for p in parts]),
        min(p.period_s for p in parts),
        all(p.constant for p in parts),
    )


def compute_slope(values: Array, time_s: Array) -> Array:
    """dv/dt at the rows of a grid, however uneven: a line from row to row through it has the
    integral v(t) − v(0).

    The chord over both neighbours; weighed by their distances, as is exact where v is smooth, it
    would miss the integral at each corner between rows.

    Parameters
    ----------
    values
        v at the rows, (k,).
    time_s
        Times of the rows [s], (k,), rising.

    Returns
    -------
    ndarray
        (k,), per second; 0 between rows of one time.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import compute_slope
    >>> compute_slope(np.array([0.0, 1.0, 4.0]), np.array([0.0, 1.0, 2.0])).tolist()
    [1.0, 2.0, 3.0]
    """
    steps = np.diff(time_s)
    width = np.concatenate([steps[:1], time_s[2:] - time_s[:-2], steps[-1:]])
    change = np.concatenate([np.diff(values[:2]), values[2:] - values[:-2], np.diff(values[-2:])])
    return np.asarray(np.divide(change, width, out=np.zeros(len(width)), where=width > 0))


def compute_earth_rate(latitude_rad: float) -> float:
    """The Earth's rotation about the local vertical.

    Parameters
    ----------
    latitude_rad
        Geographic latitude, north positive.

    Returns
    -------
    float
        rad/s, positive on the northern hemisphere.

    Examples
    --------
    >>> import math
    >>> from hrg_cli.physics.environment import compute_earth_rate
    >>> round(math.degrees(compute_earth_rate(math.pi / 2)) * 3600, 2)
    15.04
    """
    return float(EARTH_RATE_RAD_S * np.sin(latitude_rad))


def make_environment(
    temperature: Programme,
    rate: Programme,
    unlogged_rate_rad_s: float,
    duration_s: float,
    sample_s: float,
    fine: bool = False,
) -> Environment:
    """The environment of a run on its grid.

    Parameters
    ----------
    temperature
        True temperature of the resonator [°C].
    rate
        True rate [rad/s].
    unlogged_rate_rad_s
        Part of `rate` that the log does not hold (the Earth's, say); else the log holds the truth.
    duration_s, sample_s
        Length of the run and of a sample; the grid reaches a little beyond the last.
    fine
        A full grid even where nothing moves, dense enough for effects that follow the turned angle.

    Returns
    -------
    Environment
        Rows from 0 to beyond the run's end, between which everything is linear.

    Raises
    ------
    HrgError
        A sine too fast for the run's length to be drawn on a million rows.

    Examples
    --------
    >>> from hrg_cli.physics.environment import hold_value, make_environment
    >>> world = make_environment(hold_value(20.0), hold_value(1.5), 0.5, 2.0, 0.001)
    >>> world.rate_rad_s.tolist(), world.logged_rate_rad_s.tolist()
    ([1.5, 1.5], [1.0, 1.0])
    """
    end = duration_s * (1 + 1e-3) + 2 * sample_s
    times = np.array([0.0, end])
    if fine or not (temperature.constant and rate.constant):
        period = min(temperature.period_s, rate.period_s)
        rows = max(_ROWS, int(min(np.ceil(_ROWS_A_PERIOD * end / period), _MOST_ROWS)))
        if rows * period < _FEWEST_ROWS_A_PERIOD * end:
            raise HrgError(
                f"environment: a sine of {1 / period:g} Hz over {duration_s:g} s needs more than"
                f" {_MOST_ROWS} grid rows; lower its frequency or shorten the run"
            )
        corners = np.concatenate([temperature.corners, rate.corners])
        times = np.unique(
            np.concatenate([np.linspace(0, end, rows), corners[(corners > 0) & (corners < end)]])
        )
        if fine:
            turn = 2 * np.pi / max(float(np.abs(rate.value(times)).max()), 1e-12)
            rows = int(min(_ROWS_A_PERIOD / 2 * end / turn, _MOST_ROWS))
            times = np.union1d(times, np.linspace(0, end, rows)) if rows > len(times) else times
    T, w = temperature.value(times), rate.value(times)
    return Environment(times, T, w, T.copy(), w - unlogged_rate_rad_s)
