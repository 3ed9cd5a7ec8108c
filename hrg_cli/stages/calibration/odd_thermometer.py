"""A run whose thermometer its own frequency contradicts by little: half a degree off in one of many
runs, or a log that stands still while the gyro warms.

A resonator's frequency is the best thermometer near it. Every run is held against what the others
make of the frequency,
    f = a + b T + c T² + p cos 2mθ + q sin 2mθ,
over its length in a few parts: where their mean stands beside the others' course by far more than
these scatter about it, the run was at another temperature than it is logged at; where they run off
it, its log did not follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...fitting.tables.increments import AnglePath
from ...fourier import build_harmonic_basis
from ..suspicion import Suspicion
from .shown_temperatures import LEAST_DEGC, OF_SCATTER, SAME_DEGC, list_dwells

Array = np.ndarray
PARTS = 8
"""Parts of a run whose means are looked at."""
FEWEST = 4
"""Runs beside the one that is doubted, whose scatter is known."""
SWEPT = 0.05
"""Part of what a run sweeps by which its thermometer may lag, which is asked of all sweeps
together."""


@dataclass(frozen=True)
class OddThermometer:
    """A run (its place and name), the mean of its log, and what its frequency shows besides: how
    much warmer it was on the whole, and by how much more it warmed [°C]; `certain` where that is
    more than a thermometer beside the resonator may be wrong by."""

    run: int
    name: str
    logged_degc: float
    warmer_degc: float
    warming_degc: float
    times_scatter: float

    @property
    def certain(self) -> bool:
        """Whether it is told without asking what it does to the tables."""
        return max(abs(self.warmer_degc), abs(self.warming_degc)) > LEAST_DEGC

    @property
    def suspicion(self) -> Suspicion:
        """In words."""
        others = f"{self.times_scatter:.2g} times as far off as the other runs scatter"
        if abs(self.warmer_degc) >= abs(self.warming_degc):
            shown = self.logged_degc + self.warmer_degc
            evidence = (
                f"it is logged at {self.logged_degc:.4g} °C and oscillates as the others do at"
                f" {shown:.4g} °C, {others}"
            )
            return Suspicion(self.name, "thermometer wrong", evidence, _CORRECT)
        evidence = (
            f"its frequency moves as by {self.warming_degc:+.2g} °C that its log does not hold,"
            f" {others}"
        )
        return Suspicion(self.name, "thermometer does not follow", evidence, _CORRECT)

    def set_right(self, path: AnglePath) -> AnglePath:
        """The run at the temperature that its frequency shows."""
        along = (path.time_s - path.time_s.mean()) / max(float(np.ptp(path.time_s)), 1e-300)
        shown = path.temperature_degc + self.warmer_degc + self.warming_degc * along
        return replace(path, temperature_degc=shown)


_CORRECT = "correct its temperature log or leave it out, and calibrate again"


@dataclass(frozen=True)
class _Parts:
    """Means over the parts (P,) of a run: temperature less a reference [°C], place in the run from
    −½ to ½, frequency [Hz] less a reference, and cos 2mθ, sin 2mθ (P, 2)."""

    degc: Array
    along: Array
    hz: Array
    turned: Array

    def design(self, bends: bool) -> Array:
        """Columns 1, T, T² (where it bends), cos 2mθ, sin 2mθ."""
        powers = np.vander(self.degc, 3 if bends else 2, increasing=True)
        return np.concatenate([powers, self.turned], axis=1)


def find_odd_thermometer(paths: Sequence[AnglePath]) -> OddThermometer | None:
    """The run whose frequency and thermometer do not agree as those of the others do.

    Parameters
    ----------
    paths
        The runs.

    Returns
    -------
    OddThermometer or None
        None where none stands out, the frequency follows no temperature, or the run is logged
        beyond all others.

    Examples
    --------
    Of nine runs one is logged 2 °C too low:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.odd_thermometer import find_odd_thermometer
    >>> def dwell(degc, random):
    ...     hz = 5e3 + 0.4 * degc + 1e-4 * random.standard_normal()
    ...     return draw_path(blocks=99, temperature_degc=degc, frequency_hz=hz)
    >>> random = np.random.default_rng(1)
    >>> runs = [dwell(degc, random) for degc in (0, 0.1, 0.2, 20, 20.1, 20.2, 40, 40.1, 40.2)]
    >>> find_odd_thermometer(runs) is None
    True
    >>> from dataclasses import replace
    >>> runs[4] = replace(runs[4], temperature_degc=runs[4].temperature_degc - 2)
    >>> odd = find_odd_thermometer(runs)
    >>> odd.run, round(odd.warmer_degc, 2)
    (4, 2.0)
    """
    if len(paths) <= FEWEST or not all(_is_measured(path) for path in paths):
        return None
    middle = float(np.mean([path.temperature_degc.mean() for path in paths]))
    usual = float(np.median([path.frequency_hz.mean() for path in paths]))
    parts = [_average(path, middle, usual) for path in paths]
    judged = [_judge(run, parts) for run in range(len(parts))]
    told = [(found.times_scatter, run, found) for run, found in enumerate(judged) if found]
    if not told:
        return None
    _, run, found = max(told, key=lambda one: one[0])
    name = paths[run].run_id or f"number {run + 1}"
    return replace(found, name=name, logged_degc=found.logged_degc + middle)


def _is_measured(path: AnglePath) -> bool:
    return len(path.time_s) >= PARTS and bool(
        np.isfinite(path.temperature_degc).all() and np.isfinite(path.frequency_hz).all()
    )


def _average(path: AnglePath, middle: float, usual: float) -> _Parts:
    """The means over the parts of a run."""
    turned = build_harmonic_basis(path.angle_rad, 1, path.mode_number)[:, 1:]
    along = (path.time_s - path.time_s.mean()) / max(float(np.ptp(path.time_s)), 1e-300)
    rows = np.column_stack([path.temperature_degc - middle, along, path.frequency_hz - usual])
    means = [part.mean(axis=0) for part in np.array_split(np.hstack([rows, turned]), PARTS)]
    degc, along, hz = np.array(means)[:, :3].T
    return _Parts(degc, along, hz, np.array(means)[:, 3:])


def _judge(run: int, parts: Sequence[_Parts]) -> OddThermometer | None:
    """A run against the course of the others; None where it is as near to it as they are."""
    own, others = parts[run], [part for k, part in enumerate(parts) if k != run]
    levels = np.array([part.degc.mean() for part in others])
    if not levels.min() - SAME_DEGC <= own.degc.mean() <= levels.max() + SAME_DEGC:
        return None
    bends = len(list_dwells(levels)) > 2
    X = np.concatenate([part.design(bends) for part in others])
    y = np.concatenate([part.hz for part in others])
    found = np.linalg.lstsq(X, y, rcond=1e-9)[0]
    offsets = np.array([_find_offset(part, found, bends) for part in others])
    spare = max(len(others) - (3 if bends else 2), 1)
    scatter = np.sqrt(np.sum(offsets**2, axis=0) / spare)
    slope = found[1] + (2 * found[2] * own.degc.mean() if bends else 0.0)
    # a frequency that follows no temperature is no thermometer
    if not abs(slope) * np.ptp(levels) > OF_SCATTER * scatter[0]:
        return None
    off = _find_offset(own, found, bends)
    unsure = _find_bend_between(own.degc.mean(), others, found, bends)
    swept = SWEPT * abs(slope) * float(np.ptp(own.degc))
    least = OF_SCATTER * scatter + np.array([unsure + swept, swept])
    if not (np.abs(off) > least).any():
        return None
    warmer, warming = off / slope
    # farther than the others go it is no temperature that made the frequency
    if max(abs(warmer), abs(warming)) > 2 * np.ptp(levels):
        return None
    times = float(np.max(np.abs(off) / np.maximum(scatter, 1e-300)))
    return OddThermometer(run, "", float(own.degc.mean()), float(warmer), float(warming), times)


def _find_offset(part: _Parts, found: Array, bends: bool) -> Array:
    """How far a run stands from a course on the whole, and by how much it runs off it [Hz] (2,)."""
    left = part.hz - part.design(bends) @ found
    return np.polynomial.polynomial.polyfit(part.along, left, 1)


def _find_bend_between(degc: float, others: Sequence[_Parts], found: Array, bends: bool) -> float:
    """What a course that bends in another way may be off by where no other run is as warm [Hz]: by
    as much as this one bends between its neighbours."""
    levels = np.array([part.degc.mean() for part in others])
    if not bends or np.abs(levels - degc).min() <= SAME_DEGC:
        return 0.0
    below, above = levels[levels < degc].max(), levels[levels > degc].min()
    return float(abs(found[2] * (degc - below) * (above - degc)))
