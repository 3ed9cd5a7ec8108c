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


def constant(level: float) -> Programme:
    """The same value at all times."""
    return Programme(lambda t: np.full(np.shape(t), level), np.zeros(0), constant=True)


def polyline(times: Sequence[float] | Array, values: Sequence[float] | Array) -> Programme:
    """Straight lines through the points; constant before the first and after the last."""
    t, v = np.asarray(times, float), np.asarray(values, float)
    return Programme(lambda x: np.interp(x, t, v), t)


def levels(values: Sequence[float], dwell_s: float, transition_s: float) -> Programme:
    """Each value held for dwell_s, the next reached along a straight line of transition_s."""
    starts = np.arange(len(values)) * (dwell_s + transition_s)
    return polyline(
        np.column_stack([starts, starts + dwell_s]).ravel(), np.repeat(np.asarray(values, float), 2)
    )


def sine(
    amplitude: float, frequency_hz: float, phase_rad: float = 0.0, offset: float = 0.0
) -> Programme:
    """offset + amplitude·sin(2πft + phase)."""
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


def triangle(low: float, high: float, period_s: float, end_s: float) -> Programme:
    """From low to high in half a period and back, again and again until end_s."""
    corner = _corners(2, period_s, end_s)
    return polyline(corner * period_s / 2, np.where(corner % 2, high, low))


def sweep(largest: float, period_s: float, end_s: float) -> Programme:
    """From 0 to +largest, to −largest and back to 0 in each period until end_s."""
    corner = _corners(4, period_s, end_s)
    return polyline(corner * period_s / 4, largest * np.array([0.0, 1.0, 0.0, -1.0])[corner % 4])


def total(parts: Sequence[Programme]) -> Programme:
    """The sum of programmes."""
    return Programme(
        lambda t: np.sum([p.value(np.asarray(t)) for p in parts], axis=0),
        np.concatenate([p.corners for p in parts]),
        min(p.period_s for p in parts),
        all(p.constant for p in parts),
    )


def slope(values: Array, time_s: Array) -> Array:
    """dv/dt at the rows of a grid, however uneven: a line from row to row through it has the
    integral v(t) − v(0).

    The chord over both neighbours; weighed by their distances, as is exact where v is smooth, it
    would miss the integral at each corner between rows.
    """
    steps = np.diff(time_s)
    width = np.concatenate([steps[:1], time_s[2:] - time_s[:-2], steps[-1:]])
    change = np.concatenate([np.diff(values[:2]), values[2:] - values[:-2], np.diff(values[-2:])])
    return np.asarray(np.divide(change, width, out=np.zeros(len(width)), where=width > 0))


def earth_rate(latitude_rad: float) -> float:
    """The Earth's rotation about the local vertical, rad/s."""
    return float(EARTH_RATE_RAD_S * np.sin(latitude_rad))


def environment(
    temperature: Programme,
    rate: Programme,
    unlogged_rate_rad_s: float,
    duration_s: float,
    sample_s: float,
    fine: bool = False,
) -> Environment:
    """The environment of a run on its grid; the log holds the truth but for `unlogged_rate_rad_s`,
    which is part of `rate`.

    fine: a full grid even where nothing moves, dense enough for effects that follow the turned
    angle. HrgError: a sine too fast for the run's length to be drawn on a million rows.
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
