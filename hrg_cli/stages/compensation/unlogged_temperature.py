"""A temperature that was logged for a part of a run only: what stands in its place beyond the log's
ends, and what that may do to the angle.

Between two known temperatures the course is a straight line. Beyond an end the last one is held,
and it may have moved as far as it did within the log in as long a time; a log speaks for no longer
than it lasts itself, and of a longer stretch the tables' whole range is open.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...fitting.checks import Check, check_at_most
from ...fitting.tables.increments import AnglePath
from ...records import Calibration, Wave
from ..calibration.interpolation import compute_corrections

Array = np.ndarray
ROWS_AT_ONCE = 1 << 16
COURSES = 9
"""Courses between the coldest and the warmest that are tried: as the tables bend between nodes, the
worst need not be one of these two."""
NEGLIGIBLE = 3.0
"""Standard deviations of the angle by which a temperature that was held may move it: beside them
a few windows at an end say nothing."""


@dataclass(frozen=True)
class KnownTemperatures:
    """The part of a run's times from `first_s` to `last_s` whose temperature is logged; °C (2,) at
    both, and how fast [°C/s] (2,) it may move beyond them, infinite where the log does not say."""

    first_s: float
    last_s: float
    at_ends: tuple[float, float]
    speeds: tuple[float, float]

    def bound(self, time_s: Array, low: float, high: float) -> tuple[Array, Array]:
        """The coldest and warmest (n,) that it may be, within `low` to `high` of the tables."""
        held = np.where(time_s < self.first_s, *self.at_ends)
        lead = np.maximum(self.first_s - time_s, time_s - self.last_s)
        speed = np.where(time_s < self.first_s, *self.speeds)
        moved = np.where(lead > 0, np.maximum(lead, 0.0), np.nan) * speed
        coldest, warmest = np.fmax(held - moved, low), np.fmin(held + moved, high)
        return np.minimum(coldest, held), np.maximum(warmest, held)

    def is_beyond(self, time_s: Array) -> Array:
        """Which times (n,) lie beyond the log."""
        return np.asarray((time_s < self.first_s) | (time_s > self.last_s))


def fill_temperature(wave: Wave) -> tuple[Wave, KnownTemperatures | None]:
    """The wave with a temperature in every window, and where it is known.

    Parameters
    ----------
    wave
        Of a run; of a file nothing but times and temperatures is read.

    Returns
    -------
    tuple
        The same wave and None where all are known, or none is.

    Examples
    --------
    The log of a run of 40 s that warms by half a degree a second ends after 30 s; it may go on so:

    >>> import numpy as np
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.compensation.unlogged_temperature import fill_temperature
    >>> class Run(SimpleNamespace):
    ...     def only(self, columns): return self
    ...     def blocks(self, rows): return [self]
    ...     def replace(self, **columns): return Run(**vars(self) | columns)
    >>> t = np.arange(40.0)
    >>> run = Run(time_s=t, temperature_degc=np.where(t < 31, 20 + t / 2, np.nan))
    >>> filled, known = fill_temperature(run)
    >>> float(filled.temperature_degc[-1]), known.last_s, round(known.speeds[1], 3)
    (35.0, 30.0, 0.5)
    """
    if wave.temperature_degc is None:
        return wave, None
    pieces = list(wave.only(("time_s", "temperature_degc")).blocks(ROWS_AT_ONCE))
    time = np.concatenate([np.asarray(piece.time_s, float) for piece in pieces])
    degc = np.concatenate([np.asarray(piece.temperature_degc, float) for piece in pieces])
    known = np.isfinite(degc) & np.isfinite(time)
    if np.isfinite(degc).all() or not known.any():
        return wave, None
    filled = np.interp(time, time[known], degc[known])
    first, last = time[known][[0, -1]]
    gaps = first - np.nanmin(time), np.nanmax(time) - last
    inside = (time >= first) & (time <= last)
    speeds = [_measure_speed(time[inside], filled[inside], float(gap)) for gap in gaps]
    ends = degc[known][[0, -1]]
    told = KnownTemperatures(
        float(first), float(last), (float(ends[0]), float(ends[1])), (speeds[0], speeds[1])
    )
    return wave.replace(temperature_degc=filled), told


def _measure_speed(time_s: Array, degc: Array, gap_s: float) -> float:
    """How fast [°C/s] the temperature moves over such a time at most: by means over stretches of
    it, so that a thermometer's noise is no motion; infinite beside a log that is shorter."""
    span = float(time_s[-1] - time_s[0]) if len(time_s) else 0.0
    if gap_s <= 0:
        return 0.0
    if gap_s > span:
        return np.inf
    stretches = max(2, int(span / gap_s))
    number = np.minimum(((time_s - time_s[0]) / span * stretches).astype(int), stretches - 1)
    count = np.bincount(number, minlength=stretches)
    seen = count > 0
    means = np.bincount(number, degc, stretches)[seen] / count[seen]
    middles = np.bincount(number, time_s, stretches)[seen] / count[seen]
    return float(np.abs(np.diff(means) / np.diff(middles)).max(initial=0.0))


class HeldTemperature:
    """Sums over one run, piece by piece, of what other temperatures beyond its log's ends would
    make of the angle."""

    def __init__(self, calibration: Calibration, known: KnownTemperatures | None) -> None:
        self.calibration, self.known = calibration, known
        self.moved_rad, self.held_s, self.std = np.zeros(COURSES), 0.0, np.nan
        self.low, self.high = np.inf, -np.inf

    def add(self, path: AnglePath, angle_std: Array) -> None:
        """Take in a piece's own increments (n,), with σ of the angle at each."""
        stated = angle_std[np.isfinite(angle_std)]
        self.std = float(stated[-1]) if len(stated) else self.std
        if self.known is None or self.calibration.axis != "temperature":
            return
        beyond = self.known.is_beyond(path.time_s)
        own = beyond[1:] | beyond[:-1]
        if not own.any():
            return
        self.held_s += float(path.interval_s[own].sum())
        low, high = self.known.bound(
            path.time_s, float(self.calibration.node_min), float(self.calibration.node_max)
        )
        self.low = min(self.low, float(low[beyond].min()))
        self.high = max(self.high, float(high[beyond].max()))
        held = self._find_rates(path)
        for k, part in enumerate(np.linspace(0.0, 1.0, COURSES)):
            degc = np.where(beyond, low + part * (high - low), path.temperature_degc)
            apart = self._find_rates(replace(path, temperature_degc=degc)) - held
            self.moved_rad[k] += float(np.sum((apart * path.interval_s)[own]))

    def _find_rates(self, path: AnglePath) -> Array:
        drift, scale = compute_corrections(self.calibration, path)
        return np.asarray((drift - path.turn / path.interval_s) / scale)

    def check(self, name: str) -> Check:
        """Whether the angle is the same within its σ, whatever the temperature was."""
        moved = float(np.abs(self.moved_rad).max())
        over = moved / self.std if self.std > 0 else 0.0
        return check_at_most(
            "temperature_is_logged",
            over,
            NEGLIGIBLE,
            f"{name}: the temperature of {self.held_s:.3g} s at an end of the run is not logged and"
            f" is taken for that logged last; by the rest of the log it may be {self.low:.3g} to"
            f" {self.high:.3g} °C there, which moves the angle by up to {moved:.2g} rad,"
            f" {over:.2g} of its standard deviations; log it over the whole run, or cut the run"
            " to its log (--from-s, --to-s)",
        )
