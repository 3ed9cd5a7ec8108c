"""Readings of one run's thermometer: another unit, stuck, missing, or in another place than in the
other runs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from ....errors import HrgError
from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
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
    seen = _shown_course(wave, others)
    if seen is not None:
        stuck = (
            _logs_temperature(wave)
            and float(np.ptp(np.asarray(wave.temperature_degc, float)[wave.good()])) == 0
        )
        shown = np.asarray(seen.temperature_degc, float)
        moved = float(shown[-1] - shown[0])
        what = (
            "thermometer missing"
            if not _logs_temperature(wave)
            else "thermometer stuck"
            if stuck
            else "thermometer wrong"
        )
        yield Reading(
            what,
            (seen,),
            2,
            f"its frequency shows a temperature that moves by {moved:+.3g} °C: with that",
            "repair the thermometer, or leave the run out of what depends on temperature",
        )


def _logs_temperature(wave: Wave) -> bool:
    return wave.temperature_degc is not None and bool(np.isfinite(wave.temperature_degc).any())


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


def _shown_course(wave: Wave, others: ExtendedFit) -> Wave | None:
    """The wave with the quadratic course of temperature that its phase shows beside the others'
    model, at the level of its damping."""
    relative = others.point.find_temperature_slopes()
    slope, loss = relative.get("frequency_hz", 0.0), relative.get("damping_rate_1_s", 0.0)
    if slope == 0:
        return None
    level, slopes = _average_degc(others), np.zeros(2)
    span = float(wave.time_s[-1] - wave.time_s[0])
    per_degc = slope * 2 * np.pi * wave.reference_frequency_hz * span
    for number in range(COURSE_ROUNDS):
        free = [DAMPING] if number else []
        with contextlib.suppress(extended_fit.DivergedError, HrgError, np.linalg.LinAlgError):
            fit = fit_held([change.replace_temperature(wave, level, slopes)], others, free)
            rows = fit.series.weight[0] > 0
            x = (fit.series.time_s[0][rows] - float(wave.time_s[0])) / span
            left = _phase_left(fit)[rows]
            bend = np.polynomial.polynomial.polyfit(x, left, 3)
            slopes = slopes + np.array([2 * bend[2], 3 * bend[3]]) / per_degc
            if free and loss != 0:
                warmer = (fit.coordinate(DAMPING) / others.coordinate(DAMPING) - 1) / loss
                level += warmer if abs(warmer) < PLAUSIBLE_DEGC else 0.0
            continue
        return None
    return change.replace_temperature(wave, level, slopes)


def _phase_left(fit: ExtendedFit) -> Array:
    """Phase of what was measured against the model, unwrapped, along the rows of the only run."""
    seen = fit.prediction.seen[0]
    return np.unwrap(np.angle(np.sum(fit.series.envelope[0] * np.conj(seen), axis=-1)))
