"""Diagnosis, first step: waves become runs side by side with few rows, and a first guess of the
base model."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ....effects.effect import find_frame
from ....errors import HrgError
from ....fitting.causes.fit_point import Point
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.envelopes import envelope_runs, propagator
from ....fitting.envelopes.coordinates import DAMPING, DAMPING_SPLIT, FREQUENCY_SPLIT, SCALE_FACTOR
from ....fitting.envelopes.envelope_runs import EnvelopeRun
from ....fitting.envelopes.matrices import Matrix
from ....fitting.envelopes.phase_course import follow_phase, straighten_phases
from ....fitting.noise import channel_noise
from ....fitting.noise.difference_noise import MEDIAN, measure_difference_noise
from ....fitting.samples.course import (
    Course,
    Impulse,
    average_over_windows,
    build_course,
    integrate_means,
)
from ....physics import ellipse
from ....records import Wave
from ....records.time_origin import count_from_first
from .base_priors import choose_held_scale_factor
from .branches import average_branch
from .first_guess import guess

Array = np.ndarray
STEP_ANGLE = 0.05
"""Largest |L|·step of the rows: the Runge–Kutta rule's error stays below 1e-8 a row."""
FEWEST, MOST = 120, 1500
GAP = 2.5
"""Steps over the usual one from which a gap is bridged by empty rows."""
DEGREES, ENDS = 3, 3
"""Highest power of time by which a temperature log is smoothed, and rows at its ends that do not
count."""
EXACT = 1e-6
"""Misfit, as a part of its range, below which a temperature log is the polynomial."""
WELL = 0.1
"""σ by which the averages of all rows' windows together may miss the rows' middles."""
MOSTLY_ROUNDING, FEW_CODES = 0.5, 100.0
"""Part of the noise that rounding makes, and codes that the amplitude spans, from which and up to
which a run is coarse."""
DIFFERENCES = (2, 3, 4, 5)
"""Orders of differences by which a thermometer's noise is told from its course."""
FEWEST_SMOOTHED, STEP_OF_KNOTS = 80, 0.5
"""Rows from which a noisy temperature log is smoothed, and powers of two between the numbers of
knots that are tried."""
BENT = 2.0
"""Misfit of the smoothed log, over its noise, from which it bends faster than rows can tell."""
LEAST_PIECES, MOST_PIECES = 24, 40
"""Pieces of a held amplitude at least, and those of which each has two rows or more."""
QUIET = 1e-3 / (MEDIAN * 6**0.5)
"""Noise of the temperature log, as a part of its range, up to which it is taken as it is: its
second differences are 1e-3 of that range."""


def prepare(
    waves: Sequence[Wave],
    scale_factor: float | None,
    blocks: int,
    coarser: int = 1,
    along: Point | None = None,
    straight: bool = False,
) -> tuple[MeasuredRuns, Point, list[EnvelopeRun]]:
    """Runs side by side, and where a fit of them starts.

    Parameters
    ----------
    waves
        Of the runs.
    scale_factor
        That is held; None: it is not known.
    blocks
        Fewest averaged rows a run.
    coarser
        Times as long as they would be that the rows are.
    along
        Where a first fit stands, to average along its motion; without it along that of a guess.
    straight
        The guess is one where phases do not count.

    Returns
    -------
    tuple
        The rows, the start, and the runs' envelopes.

    Raises
    ------
    HrgError
        No run, mixed mode numbers, runs without enough good windows.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.data import prepare
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> series, point, runs = prepare(draw_waves(), None, 100)
    >>> series.envelope.shape, len(point.p), len(runs)
    ((3, 50, 2), 7, 3)
    """
    if not waves:
        raise HrgError("there is no run; give at least one wave file")
    modes = sorted({w.mode_number for w in waves})
    if len(modes) > 1:
        raise HrgError(
            f"the runs have mode numbers {', '.join(map(str, modes))}, one was expected; diagnose"
            " them apart"
        )
    runs = [envelope_runs.from_wave(w) for w in waves]
    free = [r for r, w in zip(runs, waves, strict=True) if w.mode != "forced"]
    own = np.array([r.reference_frequency_hz for r in runs])
    shift = 2 * np.pi * (own - _common_reference_hz(runs))
    p, offsets = (
        guess(runs, free, waves, choose_held_scale_factor(waves, runs, scale_factor), straight)
        if along is None
        else (along.p, along.offset_rad_s - shift)
    )
    rows = _count_rows(runs, p, blocks, coarser)
    # a drive that holds the amplitude leaves the wave no damping to be averaged along
    thin = [
        _average_rows(
            r,
            rows,
            propagator.make_propagator(p if w.mode != "forced" else _undamped(p), o),
            _drive_less_loss(r, w, float(p[DAMPING])),
        )
        for r, o, w in zip(runs, offsets, waves, strict=True)
    ]
    series = replace(
        align_runs([bridge_gaps(r, w) for r, w in zip(thin, waves, strict=True)], waves),
        averaged_along=p,
    )
    return series, Point(p, series.envelope[:, 0].copy(), offsets + shift), runs


def _average_rows(
    run: EnvelopeRun, rows: int, carry: Callable[[Array, Array], Matrix], beside: Array | None
) -> EnvelopeRun:
    """A run's rows averaged along a motion and along its own phase's course beside it: a frequency
    that moves turns the windows of a row against each other, whatever cause will be found for
    it."""
    if len(run) <= rows:
        return run
    course = follow_phase(run, carry)
    (straight,) = straighten_phases([run], [course])
    thin = envelope_runs.average_rows(straight, rows, carry, beside=beside)
    # the row is a mean along that course as well, as every effect's turn is
    # (`integrate_temperature`)
    turn = _average_over_rows(lambda t: course(t - run.time_s[0]), thin.time_s, run.window_s)
    return replace(
        thin,
        envelope=thin.envelope * np.exp(1j * turn)[:, None],
        lead_rad=turn - course(thin.time_s - run.time_s[0]),
    )


def _average_over_rows(course: Callable[[Array], Array], t: Array, window_s: float) -> Array:
    """The mean of a course over rows about times t (n,), of windows that hold means already."""
    half = np.sqrt(np.maximum(np.gradient(t) ** 2 - window_s**2, 0.0)) / 2
    return (course(t - half) + 4 * course(t) + course(t + half)) / 6


def _count_rows(runs: Sequence[EnvelopeRun], p: Array, blocks: int, coarser: int) -> int:
    """Rows a run: so many that the fastest motion moves by no more than `STEP_ANGLE` in each."""
    turn = np.array([abs(p[SCALE_FACTOR]) * _fastest_turn(r) for r in runs])
    at_rest = abs(p[DAMPING]) + np.hypot(*p[DAMPING_SPLIT]) + np.hypot(*p[FREQUENCY_SPLIT])
    fastest = at_rest + turn
    span = np.array([r.duration_s for r in runs])
    rows = int(np.clip(np.max(fastest * span / STEP_ANGLE), max(FEWEST, blocks), MOST))
    return min(rows, max(len(run) for run in runs)) // coarser if coarser > 1 else rows


def is_averaged_well(series: MeasuredRuns, fitted: Point) -> bool:
    """Whether rows miss their middles by less than a tenth of σ, all together, had they followed
    another motion than that which they were averaged along.

    In the frame that L carries, what Δ more does changes as both turn it, ẅ = (Δ² + [Δ, L])w, and
    the mean of a row of length h misses its middle by h²ẅ/24: a split of which the average knew
    nothing is missed in proportion to itself where the wave turns.

    Parameters
    ----------
    series
        The rows.
    fitted
        The motion.

    Returns
    -------
    bool
        The rows may stay.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.data import is_averaged_well
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> is_averaged_well(draw_fit().series, draw_fit().point)
    True
    """
    if series.averaged_along is None:
        return True
    change = fitted.p - series.averaged_along
    row = np.diff(series.time_s, axis=1)
    turn = np.abs(np.diff(series.table_angle_rad, axis=1))
    moved = np.linalg.norm(change[:SCALE_FACTOR]) * row + abs(change[SCALE_FACTOR]) * turn
    # damping alike in all directions commutes with everything
    carried = (
        np.linalg.norm(fitted.p[DAMPING_SPLIT.start : FREQUENCY_SPLIT.stop]) * row
        + abs(fitted.p[SCALE_FACTOR]) * turn
    )
    size = np.sqrt(np.sum(np.abs(series.envelope) ** 2, axis=-1)) * series.weight
    return bool(np.linalg.norm(moved * (moved + 2 * carried) / 24 * size[:, :-1]) < WELL)


def _undamped(p: Array) -> Array:
    """Coordinates of a wave whose amplitude the drive holds."""
    held = np.array(p, float)
    held[0] = 0.0
    return held


def _drive_less_loss(run: EnvelopeRun, wave: Wave, damping_1_s: float) -> Array | None:
    """What a logged drive makes of a wave beside the undamped resonator, f − νu at a run's rows
    (n, 2); None where none is logged.

    Of a held amplitude little is left of the two together, so that an error of ν does nothing.
    """
    if wave.mode != "forced" or not _has(wave.drive_main):
        return None

    def at_rows(values: Array | None) -> Array:
        return np.interp(run.time_s, *_finite(wave.time_s, values))

    turn, e_A, e_B, _ = find_frame(run.envelope, at_rows(wave.phase_rad))
    main = at_rows(wave.drive_main)
    quadrature = at_rows(wave.drive_quadrature) if _has(wave.drive_quadrature) else 0 * main
    force = turn[:, None] * (main[:, None] * e_A - 1j * quadrature[:, None] * e_B)
    return force - damping_1_s * run.envelope


def _fastest_turn(run: EnvelopeRun) -> float:
    step = np.diff(run.time_s)
    return float(np.quantile(np.abs(np.diff(run.turn_rad)) / step, 0.99))


def bridge_gaps(run: EnvelopeRun, wave: Wave) -> EnvelopeRun:
    """The run with empty rows (σ = ∞) in its gaps, in which table and temperature go on as logged.

    No step of the Runge–Kutta rule is then longer than the others.

    Parameters
    ----------
    run
        Its envelopes.
    wave
        Whose logs go on in the gaps.

    Returns
    -------
    EnvelopeRun
        The same where it has no gap.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.diagnosis.base.data import bridge_gaps
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> run = draw_run_down(0.0)
    >>> bridge_gaps(run, draw_waves()[0]) is run
    True
    """
    steps = np.diff(run.time_s)
    usual = float(np.median(steps))
    wide = np.flatnonzero(steps > GAP * usual)
    if not len(wide):
        return run
    counts = np.ceil(steps[wide] / usual).astype(int)
    times = np.concatenate(
        [run.time_s[k] + steps[k] * np.arange(1, n) / n for k, n in zip(wide, counts, strict=True)]
    )
    place = np.repeat(wide + 1, counts - 1)

    def straight(values: Array) -> Array:
        return np.interp(times, run.time_s, values)

    def filled(values: Array, log: Callable[[Array], Array] | None) -> Array:
        bent = 0.0 if log is None else log(times) - straight(log(run.time_s))
        return np.insert(values, place, straight(values) + bent)

    turned = _course_of(wave.time_s, wave.rate_rad_s)
    warm = _course_of(wave.time_s, wave.temperature_degc)
    return replace(
        run,
        time_s=np.insert(run.time_s, place, times),
        envelope=np.insert(run.envelope, place, run.envelope[place - 1], axis=0),
        std=np.insert(run.std, place, np.inf),
        turn_rad=filled(run.turn_rad, None if turned is None else turned.integrate_to),
        temperature_degc=None
        if run.temperature_degc is None
        else filled(run.temperature_degc, None if warm is None else warm.interpolate),
        lead_rad=None if run.lead_rad is None else filled(run.lead_rad, None),
    )


def _course_of(time_s: Array, logged: Array | None) -> Course | None:
    """The course of what a wave logs; None where it logs nothing."""
    return build_course(*_finite(time_s, logged)) if _has(logged) else None


def _common_reference_hz(runs: Sequence[EnvelopeRun]) -> float:
    """The frequency that the envelopes of all runs are put against."""
    return float(np.median([r.reference_frequency_hz for r in runs]))


def align_runs(runs: Sequence[EnvelopeRun], waves: Sequence[Wave]) -> MeasuredRuns:
    """Padded arrays against one reference frequency, with everything the effects may look at.

    Parameters
    ----------
    runs
        Their envelopes.
    waves
        Of the same runs.

    Returns
    -------
    MeasuredRuns
        (R, n) each; padded rows have no weight.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.data import align_runs, prepare
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> _, _, runs = prepare(draw_waves(), None, 100)
    >>> align_runs(runs, draw_waves()).time_s.shape
    (3, 50)
    """
    longest = max(len(run) for run in runs)
    reference_hz = _common_reference_hz(runs)
    columns: dict[str, list[Array]] = {}
    for run, wave in zip(runs, waves, strict=True):
        padding = longest - len(run)
        for name, values in _columns_of(run, wave, reference_hz).items():
            # the last row again, so that padded steps have length 0 and move nothing
            padded = np.concatenate([values, np.repeat(values[-1:], padding, axis=0)])
            columns.setdefault(name, []).append(padded)
        weight = np.concatenate([1 / run.std, np.zeros(padding)])
        columns.setdefault("weight", []).append(weight)
    stacked: dict[str, Any] = {name: np.stack(values) for name, values in columns.items()}
    phase, time = stacked["phase_rad"], stacked["time_s"]
    return MeasuredRuns(
        names=tuple(w.run_id or f"run {k}" for k, w in enumerate(waves)),
        **stacked,
        turn_rad_s=(phase[:, -1] - phase[:, 0]) / (time[:, -1] - time[:, 0]),
        reference_frequency_hz=reference_hz,
        mode_number=int(waves[0].mode_number),
        begun_s=np.array(count_from_first([wave.start_time for wave in waves])),
        has_temperature=any(_has(w.temperature_degc) for w in waves),
        whitening=channel_noise.stack_matrices([r.whitening for r in runs]),
        coarse=tuple(k for k, wave in enumerate(waves) if is_coarse(wave)),
    )


def is_coarse(wave: Wave) -> bool:
    """Whether rounding to few codes makes most of a run's noise: what it leaves repeats with the
    wave and moves with its angle, where white noise would not.

    Parameters
    ----------
    wave
        Of the run.

    Returns
    -------
    bool
        False where no converter's step is known.

    Examples
    --------
    Amplitude 1 on steps of 0.02, without other noise:

    >>> from hrg_cli.stages.diagnosis.base.data import is_coarse
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> wave = draw_waves()[0]
    >>> is_coarse(wave), is_coarse(wave.replace(least_count=0.02, quantisation_share=1.0))
    (False, True)
    """
    return is_mostly_rounding(wave) and count_codes(wave) < FEW_CODES


def is_mostly_rounding(wave: Wave) -> bool:
    """Whether rounding to codes makes most of a run's noise.

    Parameters
    ----------
    wave
        Of the run.

    Returns
    -------
    bool
        False where no converter's step is known.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.data import is_mostly_rounding
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> is_mostly_rounding(draw_waves()[0].replace(least_count=1e-3, quantisation_share=0.9))
    True
    """
    share = wave.quantisation_share
    return share is not None and share >= MOSTLY_ROUNDING


def count_codes(wave: Wave) -> float:
    """Codes of the converter that a run's amplitude spans.

    Parameters
    ----------
    wave
        Of the run.

    Returns
    -------
    float
        Infinite where no converter's step is known, or no window is good.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.data import count_codes
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> wave = draw_waves()[0]
    >>> count_codes(wave), round(count_codes(wave.replace(least_count=0.02)))
    (inf, 39)
    """
    amplitude = np.asarray(wave.main_amplitude, float)[wave.good()]
    if not wave.least_count or not len(amplitude):
        return float("inf")
    return float(np.median(amplitude) / wave.least_count)


def _columns_of(run: EnvelopeRun, wave: Wave, reference_hz: float) -> dict[str, Array]:
    """What `MeasuredRuns` holds of one run, but for the weight, by its names there."""
    t = run.time_s
    # another reference turns the envelope and the phase alike: u e^{jωt} stays
    shift = 2 * np.pi * (run.reference_frequency_hz - reference_hz) * t
    forced = np.full(len(t), float(wave.mode == "forced"))
    held = _held_amplitude(run, wave)
    return {
        "time_s": t,
        "envelope": run.envelope * np.exp(1j * shift)[:, None],
        "rate_rad_s": _rate_of(wave, t),
        **_temperature_of(run, wave),
        "table_angle_rad": run.turn_rad,
        "phase_lead_rad": np.zeros(len(t)) if run.lead_rad is None else run.lead_rad,
        "phase_rad": np.interp(t, *_finite(wave.time_s, wave.phase_rad)) + shift,
        "main_drive": interpolate_command(wave, "drive_main", t, forced),
        "quadrature_drive": interpolate_command(wave, "drive_quadrature", t, forced),
        "main_impulse": integrate_command(wave, "drive_main", t, forced),
        "quadrature_impulse": integrate_command(wave, "drive_quadrature", t, forced),
        "forced": forced,
        "held_amplitude": held,
        "held_slope": np.gradient(held, t),
    }


def _rate_of(wave: Wave, t: Array) -> Array:
    """The logged rate at times t; 0 where none is logged."""
    course = _course_of(wave.time_s, wave.rate_rad_s)
    return np.zeros(len(t)) if course is None else course.interpolate(t)


def _temperature_of(run: EnvelopeRun, wave: Wave) -> dict[str, Array]:
    """The temperature's columns; zeros where none is logged."""
    t = run.time_s
    logged = run.temperature_degc if run.temperature_degc is not None else np.zeros(len(t))
    known = np.isfinite(logged).any()
    warm = np.interp(t, *_finite(t, logged)) if known else np.zeros(len(t))
    smooth = _smoothed(t, warm)
    # a log that needs no smoothing tells what happens within a row too, a smoothed one does not
    impulse_along = None if smooth is warm else smooth
    return {
        "temperature_degc": smooth,
        "temperature_rate_degc_s": np.gradient(smooth, t),
        "temperature_impulse": integrate_temperature(wave, t, impulse_along),
        "branch": average_branch(t, smooth),
    }


def _held_amplitude(run: EnvelopeRun, wave: Wave) -> Array:
    """The main amplitude (n,) that a drive without a log keeps up: the measured one itself, without
    its noise, since of such a drive nothing else is known. NaN where that is not so."""
    t = run.time_s
    if wave.mode != "forced" or _has(wave.drive_main):
        return np.full(len(t), np.nan)
    amplitude, pieces = _amplitude(run.envelope), max(LEAST_PIECES, len(t) // 3)
    if len(t) < 2 * min(pieces, MOST_PIECES):
        return amplitude
    return _lines_through_means(t, amplitude, pieces)


def _has(values: Array | None) -> bool:
    return values is not None and bool(np.isfinite(values).any())


def _finite(x: Array, y: Array | None) -> tuple[Array, Array]:
    assert y is not None
    good = np.isfinite(x) & np.isfinite(y)
    return np.asarray(x)[good], np.asarray(y, float)[good]


def interpolate_command(wave: Wave, name: str, t: Array, forced: Array) -> Array:
    """A logged drive command over rows.

    Parameters
    ----------
    wave
        Of the run.
    name
        Of its column.
    t
        Middles of the rows [s], (n,).
    forced
        Rows of the wave in which it is driven, (k,) bool.

    Returns
    -------
    ndarray
        (n,), in the column's unit; zero where nothing is logged.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.base.data import interpolate_command
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> wave = draw_waves()[0]
    >>> interpolate_command(wave, "drive_main", wave.time_s[:2], np.ones(50, bool)).tolist()
    [0.0, 0.0]
    """
    logged = _logged(wave, name, forced)
    return np.zeros(len(t)) if logged is None else average_over_windows(logged, t, np.gradient(t))


def integrate_command(wave: Wave, name: str, t: Array, forced: Array) -> Array:
    """∫ of a logged drive command from the log's start.

    Parameters
    ----------
    wave
        Of the run.
    name
        Of its column.
    t
        To where [s], (n,).
    forced
        Rows of the wave in which it is driven, (k,) bool.

    Returns
    -------
    ndarray
        (n,), in the column's unit times seconds; zero where nothing is logged.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.base.data import integrate_command
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> wave = draw_waves()[0]
    >>> integrate_command(wave, "drive_main", wave.time_s[:2], np.ones(50, bool)).tolist()
    [0.0, 0.0]
    """
    logged = _logged(wave, name, forced)
    return np.zeros(len(t)) if logged is None else logged.integrate_to(t)


def integrate_temperature(wave: Wave, t: Array, smooth: Array | None) -> Array:
    """∫ of the temperature to rows, each its mean over the row, as what it moves of the wave is.

    Parameters
    ----------
    wave
        Of the run, whose log knows where in a row it turned a corner.
    t
        Middles of the rows [s], (n,).
    smooth
        A smoothed course at the rows (n,) [°C], along which it is taken from row to row instead.

    Returns
    -------
    ndarray
        (n,) [°C s]

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.base.data import integrate_temperature
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> t = np.arange(3.0)
    >>> integrate_temperature(draw_waves()[0], t, np.full(3, 20.0)).tolist()
    [0.0, 20.0, 40.0]
    """
    if smooth is not None or not _has(wave.temperature_degc):
        course = np.zeros(len(t)) if smooth is None else smooth
        return np.concatenate([[0.0], np.cumsum(np.diff(t) * (course[1:] + course[:-1]) / 2)])
    logged = integrate_means(*_finite(wave.time_s, wave.temperature_degc))
    return _average_over_rows(logged.integrate_to, t, wave.window_s)


def _logged(wave: Wave, name: str, forced: Array) -> Impulse | None:
    """The integral of a command of which the windows hold the means; None where none is logged."""
    values = getattr(wave, name)
    if not forced.any() or not _has(values):
        return None
    return integrate_means(*_finite(wave.time_s, values))


def _amplitude(u: Array) -> Array:
    return ellipse.find_wave(u, 1)[0]


def _smoothed(t: Array, values: Array) -> Array:
    """Temperature by a line or a low polynomial, else by a spline of few knots where the
    thermometer is noisy.

    Its slope is then not the noise's, and what bends is not straightened.
    """
    if np.ptp(values) == 0 or len(t) <= 4 * ENDS:
        return values
    noise = estimate_log_noise(values)
    curve = _polynomial_through(t, values, noise)
    if curve is not None:
        return curve
    if len(t) < FEWEST_SMOOTHED or noise < QUIET * float(np.ptp(values)):
        return values
    curve = _smooth_by_spline(t, values)
    return curve if np.std(values - curve) < BENT * noise else values


def _smooth_by_spline(t: Array, values: Array) -> Array:
    """A log by a cubic spline of even knots, of the number n that foretells each row best from the
    others: least RSS/(1 − n/N)² (Craven and Wahba 1978, generalised cross-validation)."""
    from scipy.interpolate import make_lsq_spline

    rows, best, smooth = len(t), np.inf, values
    x = (t - t[0]) / (t[-1] - t[0])
    for power in np.arange(2.0, np.log2(rows / 2), STEP_OF_KNOTS):
        count = int(2**power)
        knots = np.r_[np.zeros(3), np.linspace(0, 1, count - 2), np.ones(3)]
        with contextlib.suppress(ValueError, np.linalg.LinAlgError):  # no row between two knots
            curve = make_lsq_spline(x, values, knots)(x)
            score = float(np.sum((values - curve) ** 2)) / (1 - count / rows) ** 2
            if score < best:
                best, smooth = score, np.asarray(curve)
    return smooth


def estimate_log_noise(values: Array) -> float:
    """Standard deviation of a log's white noise, told from its course.

    A course that bends has second differences too, of higher orders ever less: the least of several
    orders is the noise's.

    Parameters
    ----------
    values
        (n,), evenly spaced.

    Returns
    -------
    float
        In their unit; 0 for fewer than four.

    Examples
    --------
    A swing, and the same with a noise of 0.01:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.base.data import estimate_log_noise
    >>> swing = np.sin(np.linspace(0, 12, 2000))
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(2000)
    >>> round(estimate_log_noise(swing), 6), round(estimate_log_noise(swing + noise), 3)
    (0.0, 0.01)
    """
    orders = [k for k in DIFFERENCES if len(values) > k + 1]
    return min((float(measure_difference_noise(values, k)) for k in orders), default=0.0)


def _polynomial_through(t: Array, values: Array, noise: float) -> Array | None:
    """The lowest polynomial of time that leaves of a log no more than its noise; None where none of
    a low degree does. `noise`: its standard deviation."""
    x = (t - t.mean()) / np.ptp(t)
    # a log's first and last value may have been held beyond it
    inner = slice(ENDS, -ENDS)
    least = max(1.2 * MEDIAN * noise, EXACT * float(np.ptp(values)))
    for degree in range(1, DEGREES + 1):
        polynomial = np.polynomial.polynomial.polyfit(x[inner], values[inner], degree)
        curve = np.polynomial.polynomial.polyval(x, polynomial)
        if np.median(np.abs(values - curve)) <= least:
            return np.asarray(curve)
    return None


def _lines_through_means(t: Array, values: Array, pieces: int) -> Array:
    """Straight lines through the means of so many parts of a log, those at the ends continued."""
    parts = np.array_split(np.arange(len(t)), pieces)
    x = np.array([t[i].mean() for i in parts])
    y = np.array([values[i].mean() for i in parts])
    slope = np.gradient(y, x)
    inside = np.interp(t, x, y)
    left, right = t < x[0], t > x[-1]
    inside[left] = y[0] + slope[0] * (t[left] - x[0])
    inside[right] = y[-1] + slope[-1] * (t[right] - x[-1])
    return inside
