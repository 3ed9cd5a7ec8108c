"""Diagnosis, the written model: the TOML simulated as a user would, and held against the
measurement and against the fit it comes from.

Raw samples of the engine that is not the fitting model, demodulated like a recording, without
noise: what is left over σ must be what the fit leaves, or the file is not the model that was
fitted.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ....effects import EFFECTS
from ....effects.effect import OF_EVERY_RUN, Effect
from ....errors import HrgError
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.slow_equation import find_strikes
from ....fitting.causes.wave_frame import to_reals
from ....fitting.causes.whitened_rows import flatten_rows
from ....fitting.envelopes.coordinates import SCALE_FACTOR, SECOND_ORDER
from ....fitting.envelopes.envelope_runs import compute_envelopes
from ....fitting.samples.demodulator import MOVING_PERIODS
from ....records import Wave, collect
from ...demodulate import demodulate_quiet
from ...estimate import estimate
from ...simulate import simulate_run
from ...simulation_file import SimulationFile, list_runs
from ..samples.tone import Tone
from .model import SAMPLES_A_PERIOD, TONE
from .run_changes import find_change
from .written_run import Way

Array = np.ndarray
MOST_SAMPLES = 30_000_000
"""Samples simulated at most, all runs together; longer runs are followed for their first part
only."""
NEAR = 1.02
"""Misfit over that of the fit up to which a file is left as it is."""
PERIODS, QUICK_PERIODS = MOVING_PERIODS, 1.0
"""Periods per window of the simulated samples: the fewest whose basis moves with the envelope; one
where it bends within them. The file's own demodulation must miss nothing that the measurement's
noise could show."""
QUICK_SAMPLES = 12.0
"""Samples a period that windows of one need, to hold apart its own motion."""
QUICK_RAD = 0.1
"""Turn and decay of the envelope within `PERIODS` from which they are too many."""
FEW_SAMPLES = 5 - 5**0.5
"""Samples a period where nothing bends them: the oscillation is all that they hold, and those of
the file would tell no more of it. As far from even numbers as the file's own."""
FEW_PERIODS = round(PERIODS * SAMPLES_A_PERIOD / FEW_SAMPLES, 1)
"""Periods per window of so few, which hold as many samples as `PERIODS` of the file's."""
WINDOWS_A_ROW = 3.0
"""Such windows that rows hold at least: then all rows lie between the first and the last, behind
which up to one is cut off."""
DEGREE = 5
"""Of the spline through the simulated windows: a split that turns its modes by x a window against
each other leaves x⁴/400 of a cubic one."""
NO_SECOND_ORDER = 0.5
"""Scale of the second order, 1 of a resonator, below which the equation averaged over a period is
nearer: another simulator's."""
MOVES = 3
"""Rounds in which a file's starts and frequencies are moved nearer to the fit."""
NEXT_ROWS = 2.0
"""Rows' lengths on either side of a jump in which measured rows hold a mean of both sides,
simulated ones do not."""


@dataclass(frozen=True)
class Written:
    """rms over σ of measured less simulated, of measured less fitted on the same rows, and the part
    of the runs that was simulated.

    change (R, 5): of every run's start state and frequency offset that would bring the simulation
    nearest to the fit.
    """

    rms_over_noise: float
    fitted_rms_over_noise: float
    share: float
    change: Array

    @property
    def ratio(self) -> float:
        """How much worse the file is than the fit."""
        return self.rms_over_noise / max(self.fitted_rms_over_noise, 1e-300)

    def to_json(self) -> dict[str, float]:
        """As JSON."""
        return {
            "rms_over_noise": self.rms_over_noise,
            "fitted_rms_over_noise": self.fitted_rms_over_noise,
            "share": self.share,
        }


Candidate = tuple[str, Written | None]
"""A file's text and how it holds; None: it cannot be simulated."""


def write_faithfully(
    written: Callable[[Array | None, Way], str],
    fit: ExtendedFit,
    origin: Sequence[int],
    extra_effects: Sequence[Effect],
    tone: Tone | None = None,
) -> Candidate:
    """The file of an extended model and how it holds: the first way that misses the measurement no
    more than the fit, or the one that misses least.

    Loops are the better model of an instrument, since they serve other runs too, but those that are
    fitted to a log may not be the recorded ones: then the log stands, with starts and frequencies
    moved to where the simulation misses the fit least. Then rates go straight: one that swings
    beside its log may be nearer to that than to the log's course. Last, where the fit has no second
    order, the equation is averaged: what another simulator made is told by a file of the same kind.

    Parameters
    ----------
    written
        The file's text with a change of the runs' starts and frequencies, in one of the ways that
        it may be written.
    fit
        The extended model's.
    origin
        The file's run of each piece.
    extra_effects
        The user's, beside the catalogue.
    tone
        The one that was taken out of the measurement and is in the file.

    Returns
    -------
    Candidate
        The text, and what it misses.

    Examples
    --------
    >>> from functools import partial
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.extended.model import compose_simulation_file
    >>> from hrg_cli.stages.diagnosis.extended.written import write_faithfully
    >>> waves = draw_waves()
    >>> written = partial(compose_simulation_file, draw_fit(), waves, waves, [0, 1, 2], [])
    >>> text, found = write_faithfully(written, draw_fit(), [0, 1, 2], ())
    >>> text.startswith("#") or "[device]" in text, found.share
    (True, 1.0)
    """
    driven = bool(np.any(fit.series.forced))
    along = Way(replayed=driven)
    ways = [*([Way()] if driven else []), along, Way(replayed=driven, straight=True)]
    if fit.point.p[SECOND_ORDER] < NO_SECOND_ORDER:
        ways.append(replace(along, averaged=True))

    def tried(text: str) -> Candidate:
        return text, hold_written(text, fit, origin, extra_effects, tone)

    def moved(way: Way, change: Array) -> Candidate:
        return tried(written(change, way))

    best: Candidate = "", None
    told: set[str] = set()
    for way in ways:
        text = written(None, way)
        if text in told:  # constant rates are written alike in every way
            continue
        told.add(text)
        one = tried(text)
        if way.replayed == driven and not way.straight:
            one = _moved_nearer(one, partial(moved, way))
        best = _choose_nearer(best, one)
        if best[1] is not None and best[1].ratio < NEAR:
            break
    return best


def _moved_nearer(one: Candidate, tried: Callable[[Array], Candidate]) -> Candidate:
    """The file with the runs' starts and frequencies moved to where the simulation misses the fit
    least; a round is linear in what the last left."""
    change: Array | float = 0.0
    for _ in range(MOVES):
        held = one[1]
        if held is None or held.ratio < NEAR:
            break
        change = change + held.change
        other = tried(change)
        if _choose_nearer(one, other) is one:
            break
        one = other
    return one


def _choose_nearer(one: Candidate, other: Candidate) -> Candidate:
    """Of two files the one that misses less; the first where the other cannot be simulated."""
    if one[1] is None or other[1] is None:
        return other if one[1] is None else one
    return other if other[1].rms_over_noise < one[1].rms_over_noise else one


def hold_written(
    text: str,
    fit: ExtendedFit,
    origin: Sequence[int],
    extra_effects: Sequence[Effect],
    tone: Tone | None = None,
) -> Written | None:
    """Simulate a written model and compare it at the fit's rows.

    A tone far from the oscillation is left out: the file knows its size and not its phase, and with
    it not what it leaks into these windows; the rows were freed of what it leaked into theirs.

    Parameters
    ----------
    text
        The file.
    fit
        The extended model's.
    origin
        The file's run of each piece.
    extra_effects
        The user's, beside the catalogue.
    tone
        The one that the rows were freed of; the simulation is freed of the same, so that one which
        the file has wrong is left in it.

    Returns
    -------
    Written or None
        None where it cannot be simulated.

    Examples
    --------
    >>> from hrg_cli import diagnose
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.extended.written import hold_written
    >>> model = diagnose(draw_waves()).extended_model
    >>> found = hold_written(model, draw_fit(), [0, 1, 2], ())
    >>> found.share, bool(found.rms_over_noise < 1.1 * found.fitted_rms_over_noise)
    (1.0, True)
    """
    table = tomllib.loads(text)
    if tone is None:
        table.get("effects", {}).pop(TONE, None)
    try:
        runs = list_runs(table)
    except HrgError:
        return None
    sampling = _choose_sampling(fit, runs, (*extra_effects, *EFFECTS))
    share, simulated = _simulate_first_part(runs, extra_effects, sampling)
    if simulated is None:
        return None
    order = list(dict.fromkeys(origin))
    courses = {
        number: _course_of(wave, fit, tone, origin.index(number))
        for number, wave in zip(order, simulated, strict=True)
    }
    series = fit.series
    missed, fitted = np.zeros((2, *series.envelope.shape), complex)
    compared = np.zeros(series.weight.shape, bool)
    for k in range(len(series.names)):
        course = courses[origin[k]]
        inside = course.find_within(series.time_s[k]) & (series.weight[k] > 0) & ~_jumping(fit, k)
        if not inside.any():
            continue
        measured = series.envelope[k][inside]
        compared[k] = inside
        simulated = course.interpolate(series.time_s[k][inside]) * series.row_turn[k][inside]
        missed[k, inside] = measured - simulated
        fitted[k, inside] = measured - fit.prediction.by_log[k][inside]
    missed, fitted = (to_reals(series.whiten(one)) for one in (missed, fitted))
    # what nobody knows of the runs (the way through a step of the rate) counts neither for the fit
    # nor for the file
    figures = [
        float(np.sqrt(np.mean(flatten_rows(series, side) ** 2))) for side in (missed, fitted)
    ]
    change = find_change(fit, missed - fitted, compared, origin)
    return Written(figures[0], figures[1], share, change) if fitted.any() else None


@dataclass(frozen=True)
class Sampling:
    """How the files' runs are sampled for the comparison: periods in a window, and times as many
    samples as the file asks for."""

    periods: float
    times: float = 1.0


def _simulate_first_part(
    runs: Sequence[SimulationFile], extra_effects: Sequence[Effect], sampling: Sampling
) -> tuple[float, list[Wave] | None]:
    """(the part of every run that is simulated, the waves); None where one cannot be."""
    rates = [run.recording.sample_rate_hz * sampling.times for run in runs]
    lengths = [run.recording.duration_s for run in runs]
    share = min(1.0, MOST_SAMPLES / float(np.dot(rates, lengths)))
    waves = []
    for run, rate, length in zip(runs, rates, lengths, strict=True):
        part = {"duration_s": length * share, "sample_rate_hz": rate}
        quiet = run.model_copy(
            update={
                "recording": run.recording.model_copy(update=part),
                "readout": run.readout.model_copy(update={"noise": 0.0}),
            }
        )
        try:
            recording = collect(simulate_run(quiet, extra_effects))
            waves.append(_estimated(recording, sampling.periods))
        except HrgError:
            return share, None
    return share, waves


def _choose_sampling(
    fit: ExtendedFit, runs: Sequence[SimulationFile], known: Sequence[Effect]
) -> Sampling:
    """Windows in which the fit's envelope hardly bends: long ones of few samples, the fewest
    periods of the file's own where rows are no longer than those, or, where a read-out bends the
    samples, as many as the measured rows hold, for a clip takes few samples of a period, and in a
    short window one more or less."""
    p, hz = fit.point.p, fit.series.reference_frequency_hz
    # the coordinates before the scale factor are damping and splits, rad/s
    own = float(np.linalg.norm(p[:SCALE_FACTOR]))
    turned = float(np.abs(p[SCALE_FACTOR] * fit.series.rate_rad_s).max())
    most = QUICK_RAD * hz / max(own + turned, 1e-300)
    if most < PERIODS:
        own_hz = runs[0].recording.sample_rate_hz
        return Sampling(QUICK_PERIODS, float(np.ceil(QUICK_SAMPLES * hz / own_hz)))
    several = np.flatnonzero(np.sum(fit.series.weight > 0, axis=1) > 1)
    shortest = min(_row_s(fit, k) for k in several.tolist()) * hz
    if any(effect.makes_harmonics for effect, _ in fit.point.active):
        return Sampling(float(np.clip(np.round(shortest), PERIODS, np.floor(most))))
    if min(most, shortest / WINDOWS_A_ROW) < FEW_PERIODS or _needs_own_samples(runs, known):
        return Sampling(PERIODS)
    return Sampling(FEW_PERIODS, FEW_SAMPLES / SAMPLES_A_PERIOD)


def _needs_own_samples(runs: Sequence[SimulationFile], known: Sequence[Effect]) -> bool:
    """Whether files have effects that act on single samples: bend them, lose some, or add to them
    what is no part of the oscillation."""
    names = {name for run in runs for name in run.effects}
    return any(
        effect.makes_harmonics or effect.whole_samples or effect.makes_tone
        for effect in known
        if effect.name in names
    )


def _row_s(fit: ExtendedFit, k: int) -> float:
    """Time between a run's rows."""
    return float(np.median(np.diff(fit.series.time_s[k][fit.series.weight[k] > 0])))


def _estimated(recording: Any, periods: float) -> Wave:
    """The simulated recording's wave, by the chain that a measurement goes through, without what
    noise asks of it."""
    return collect(estimate(collect(demodulate_quiet(recording, periods_per_window=periods))))


@dataclass(frozen=True)
class SimulatedCourse:
    """Envelopes (n, 2) of a simulated run at times (n,), less the mean turn [rad/s] against the
    fit's reference: what is left is slow enough for a spline."""

    time_s: Array
    slow: Array
    turn_rad_s: float

    def find_within(self, t: Array) -> Array:
        """Which of the times (k,) lie between the first and the last."""
        return np.asarray((t >= self.time_s[0]) & (t <= self.time_s[-1]))

    def interpolate(self, t: Array) -> Array:
        """Envelopes (k, 2) at times."""
        from scipy.interpolate import make_interp_spline

        degree = min(DEGREE, (len(self.time_s) - 1) // 2 * 2 - 1)
        slow = make_interp_spline(self.time_s, self.slow, k=max(1, degree))(t)
        return np.asarray(slow * np.exp(1j * self.turn_rad_s * t)[:, None])


def _course_of(wave: Wave, fit: ExtendedFit, tone: Tone | None, k: int) -> SimulatedCourse:
    """The simulated wave of piece k, freed of the tone that the measured one was freed of."""
    good = wave.good()
    t = np.asarray(wave.time_s, float)[good]
    u = compute_envelopes(wave, good)
    if tone is not None:
        seen = tone.average_in_windows(float(fit.frequency_hz[k]), float(wave.window_s))
        u = u - seen.compute_envelopes(k, t, float(wave.reference_frequency_hz))
    phase = np.asarray(wave.phase_rad, float)[good]
    shift = 2 * np.pi * (float(wave.reference_frequency_hz) - fit.series.reference_frequency_hz)
    own = float((phase[-1] - phase[0]) / (t[-1] - t[0]))
    return SimulatedCourse(t, u * np.exp(-1j * own * t)[:, None], own + shift)


def _jumping(fit: ExtendedFit, k: int) -> Array:
    """Rows of a run (n,) next to an instant at which its motion or a gain jumps, where windows see
    both sides."""
    t = fit.series.time_s[k]
    near = np.zeros(len(t), bool)
    for number, instant in find_strikes(fit.series, fit.point):
        if number in (OF_EVERY_RUN, fit.series.numbers[k]):
            near |= np.abs(t - instant) < NEXT_ROWS * _row_s(fit, k)
    return near
