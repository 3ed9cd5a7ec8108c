"""Readings of one run's thermometer: another unit, stuck, missing, or in another place than in the
other runs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Chebyshev

from ....errors import HrgError
from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.least_squares import fit_columns, invert_scaled
from ....records import Array, Wave
from ..base.data import estimate_log_noise
from ..thresholds import ANOTHER_PLACE, PLAUSIBLE_DEGC
from . import transformations as change
from .readings import DAMPING, FINEST, Reading, find_least_misfit, fit_held

COURSE_ROUNDS = 4
"""Of the course and, but in the first, the level: beside a course that is far off a damping is
anything."""
COURSE_NUMBERS = 20
"""Numbers that a smoothed course has, about."""
FEWEST_DEGREE, MOST_DEGREE, ROWS_A_NUMBER = 3, 14, 6
"""Degrees of a phase between which its bend is looked for: a temperature that goes along a
parabola, or through some three swings; and rows of the fit that each of its numbers needs."""
LONGEST_LAG = 0.5
"""Part of the run by which a thermometer may be behind."""


def find_thermometer_mistakes(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """A thermometer in another unit, stuck, missing or elsewhere; only where frequency or damping
    follow the temperature.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    iterator of Reading
        Each made when it is asked for.

    Examples
    --------
    A temperature logged in K among those in °C, as warm once it is read so:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.thermometers import find_thermometer_mistakes
    >>> wave = draw_waves()[1]
    >>> kelvin = wave.replace(temperature_degc=wave.temperature_degc + 273.15)
    >>> one = next(find_thermometer_mistakes(kelvin, draw_fit()))
    >>> one.what, round(one.degc_apart, 6)
    ('thermometer in K', 0.0)
    """
    if _logs_temperature(wave):
        level = float(np.nanmean(np.asarray(wave.temperature_degc, float)))
        for name, turned in (("K", change.from_kelvin(wave)), ("°F", change.from_fahrenheit(wave))):
            yield Reading(
                f"thermometer in {name}",
                (turned,),
                0,
                f"with its temperature of {level:.4g} read as {name}",
                f"import this run's temperature with its unit, {name}",
                _measure_distance(turned, others),
            )
        lag = _lag(wave, others)
        if lag is not None and _is_beyond_noise(wave, change.undo_lag(wave, lag)):
            yield Reading(
                "thermometer in another place",
                (change.undo_lag(wave, lag),),
                1,
                f"with its temperature {abs(lag):.4g} s {'behind' if lag > 0 else 'before'} the"
                " resonator's",
                "put the thermometer where it was in the other runs, or let the gyro's own"
                " frequency be the thermometer",
            )
    still = _stands_still(wave)
    seen = _shown_course(wave, others, MOST_DEGREE if still else FEWEST_DEGREE)
    if seen is not None:
        yield Reading(
            "thermometer missing"
            if not _logs_temperature(wave)
            else "thermometer stuck"
            if still
            else "thermometer wrong",
            (seen.wave,),
            seen.numbers,
            f"its frequency shows a temperature that moves by {seen.moved_degc:.3g} ±"
            f" {seen.moved_std_degc:.1g} °C: with that",
            "repair the thermometer, or leave the run out of what depends on temperature",
        )


def _logs_temperature(wave: Wave) -> bool:
    return wave.temperature_degc is not None and bool(np.isfinite(wave.temperature_degc).any())


def _stands_still(wave: Wave) -> bool:
    """Whether no log says how the temperature moved: none is there, or it holds one value."""
    if not _logs_temperature(wave):
        return True
    return float(np.ptp(np.asarray(wave.temperature_degc, float)[wave.good()])) == 0


def _average_degc(others: ExtendedFit) -> float:
    """Mean temperature of the other runs."""
    return float(np.mean(others.series.temperature_degc[others.series.weight > 0]))


def _measure_distance(wave: Wave, others: ExtendedFit) -> float:
    """By how much a run's mean temperature, °C, is beside that of the others."""
    own = float(np.nanmean(np.asarray(wave.temperature_degc, float)))
    return abs(own - _average_degc(others))


def _is_beyond_noise(wave: Wave, moved: Wave) -> bool:
    """Whether a log differs from another by more than its own noise leaves of a smoothed course."""
    good = wave.good()
    logged, other = (np.asarray(w.temperature_degc, float)[good] for w in (wave, moved))
    known = np.isfinite(logged) & np.isfinite(other)
    left = estimate_log_noise(logged[known]) * np.sqrt(
        min(1.0, COURSE_NUMBERS / max(1, known.sum()))
    )
    return bool(np.sqrt(np.mean((other - logged)[known] ** 2)) > ANOTHER_PLACE * left)


def _lag(wave: Wave, others: ExtendedFit) -> float | None:
    """By how much this thermometer is behind."""
    span = float(wave.time_s[-1] - wave.time_s[0])
    return find_least_misfit(
        lambda lag: change.undo_lag(wave, lag), others, LONGEST_LAG * span, FINEST * span
    )


@dataclass(frozen=True)
class _ShownCourse:
    """A wave with the temperature that its phase shows, the numbers which that has, and by how much
    it moves from its lowest to its highest, with σ."""

    wave: Wave
    numbers: int
    moved_degc: float
    moved_std_degc: float


def _shown_course(wave: Wave, others: ExtendedFit, most: int) -> _ShownCourse | None:
    """The wave with the course of temperature that its phase shows beside the others' model, at the
    level of its damping; most: degree of the phase's bend up to which one more is worth it.

    Where a log moves with the temperature a bend of that is what it may be wrong by; of one that
    stands still the run's own frequency is all there is, however the temperature swung.
    """
    relative = others.point.find_temperature_slopes()
    slope, loss = relative.get("frequency_hz", 0.0), relative.get("damping_rate_1_s", 0.0)
    if slope == 0:
        return None
    time = np.asarray(wave.time_s, float)
    ends = float(time[0]), float(time[-1])
    level, bend = _average_degc(others), Chebyshev([0.0], ends)
    per_degc = slope * 2 * np.pi * wave.reference_frequency_hz

    def follow() -> Wave:
        course = bend.deriv()(time) / per_degc
        return wave.replace(temperature_degc=level + course - float(np.mean(course)))

    for number in range(COURSE_ROUNDS):
        free = [DAMPING] if number else []
        with contextlib.suppress(extended_fit.DivergedError, HrgError, np.linalg.LinAlgError):
            fit = fit_held([follow()], others, free)
            rows = fit.series.weight[0] > 0
            seen_s, left = fit.series.time_s[0][rows], _phase_left(fit)[rows]
            bend = bend + _find_bend(seen_s, left, ends, most)
            if free and loss != 0:
                warmer = (fit.coordinate(DAMPING) / others.coordinate(DAMPING) - 1) / loss
                level += warmer if abs(warmer) < PLAUSIBLE_DEGC else 0.0
            continue
        return None
    course = bend.deriv()(time)
    between = time[int(np.argmin(course))], time[int(np.argmax(course))]
    std = _find_slope_doubt(bend, seen_s, left, between) / abs(per_degc)
    return _ShownCourse(follow(), bend.degree() - 1, float(np.ptp(course)) / abs(per_degc), std)


def _find_slope_doubt(
    bend: Chebyshev, time_s: Array, left_rad: Array, between: tuple[float, float]
) -> float:
    """σ of the difference of a bend's slopes at two instants, by what it leaves of the phase:
    towards the ends of a run a slope is known far less well than the phase."""
    columns = [Chebyshev.basis(k, bend.domain) for k in range(bend.degree() + 1)]
    design = np.column_stack([one(time_s) for one in columns])
    slopes = np.array([one.deriv()(np.array(between)) for one in columns[1:]])
    apart = np.concatenate([[0.0], slopes[:, 1] - slopes[:, 0]])
    off = left_rad - design @ fit_columns(design, left_rad)
    noise = float(off @ off) / max(1, len(time_s) - design.shape[1])
    return float(np.sqrt(noise) * np.linalg.norm(invert_scaled(design).T @ apart))


def _find_bend(time_s: Array, phase_rad: Array, ends: tuple[float, float], most: int) -> Chebyshev:
    """The bend of a phase along time, of the degree that is worth its numbers."""
    count = len(time_s)
    degrees = range(FEWEST_DEGREE, min(most, count // ROWS_A_NUMBER) + 1)
    fits = [Chebyshev.fit(time_s, phase_rad, k, ends) for k in degrees or [FEWEST_DEGREE]]
    left = [float(np.sum((phase_rad - one(time_s)) ** 2)) for one in fits]
    costs = [
        count * np.log(max(squares, np.finfo(float).tiny)) + one.degree() * np.log(count)
        for one, squares in zip(fits, left, strict=True)
    ]
    return fits[int(np.argmin(costs))]


def _phase_left(fit: ExtendedFit) -> Array:
    """Phase of what was measured against the model, unwrapped, along the rows of the only run."""
    seen = fit.prediction.seen[0]
    return np.unwrap(np.angle(np.sum(fit.series.envelope[0] * np.conj(seen), axis=-1)))
