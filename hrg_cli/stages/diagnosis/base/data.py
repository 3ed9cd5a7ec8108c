"""Diagnosis, first step: waves become runs side by side with few rows, and a first guess of the
base model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ....effects.effect import frame
from ....errors import HrgError
from ....fitting.causes.fit_point import Point
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.envelopes import channel_noise, envelope_runs, propagator
from ....fitting.envelopes.coordinates import DAMPING, DAMPING_SPLIT, FREQUENCY_SPLIT, SCALE_FACTOR
from ....fitting.envelopes.envelope_runs import EnvelopeRun
from ....fitting.samples.course import Impulse, course, impulse, mean_of
from ....physics import ellipse
from ....records import Wave
from .base_priors import held_scale_factor
from .branches import mean_branch
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
QUIET = 1e-3
"""Roughness of the temperature log, as a part of its range, up to which it is taken as it is."""


def prepare(
    waves: Sequence[Wave],
    scale_factor: float | None,
    blocks: int,
    coarser: int = 1,
    along: Point | None = None,
) -> tuple[MeasuredRuns, Point, list[EnvelopeRun]]:
    """Runs side by side and where to start, the rows `coarser` times as long as they would be.

    along: where a first fit stands, to average along its motion; without it along that of a guess.
    HrgError: no run, mixed mode numbers, runs without enough good windows.
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
        guess(runs, free, waves, held_scale_factor(waves, runs, scale_factor))
        if along is None
        else (along.p, along.offset_rad_s - shift)
    )
    fastest = np.array(
        [
            abs(p[DAMPING])
            + np.hypot(*p[DAMPING_SPLIT])
            + np.hypot(*p[FREQUENCY_SPLIT])
            + abs(p[SCALE_FACTOR]) * _fastest_turn(r)
            for r in runs
        ]
    )
    span = np.array([r.duration_s for r in runs])
    rows = int(np.clip(np.max(fastest * span / STEP_ANGLE), max(FEWEST, blocks), MOST))
    if coarser > 1:
        rows = min(rows, max(len(run) for run in runs)) // coarser
    thin = [
        envelope_runs.average_rows(
            r,
            rows,
            propagator.carry(p if w.mode != "forced" else _undamped(p), o),
            beside=_drive_less_loss(r, w, float(p[DAMPING])),
        )
        for r, o, w in zip(runs, offsets, waves, strict=True)
    ]
    series = side_by_side([bridge_gaps(r) for r in thin], waves)
    return series, Point(p, series.envelope[:, 0].copy(), offsets + shift), runs


def is_averaged_well(series: MeasuredRuns, averaged_along: Point, fitted: Point) -> bool:
    """Whether rows that were averaged along one motion miss their middles by less than a tenth of
    σ, all together, had they followed another.

    In the frame that L carries, what Δ more does changes as both turn it, ẅ = (Δ² + [Δ, L])w, and
    the mean of a row of length h misses its middle by h²ẅ/24: a split of which the average knew
    nothing is missed in proportion to itself where the wave turns.
    """
    change = fitted.p - averaged_along.p
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

    turn, e_A, e_B, _ = frame(run.envelope, at_rows(wave.phase_rad))
    main = at_rows(wave.drive_main)
    quadrature = at_rows(wave.drive_quadrature) if _has(wave.drive_quadrature) else 0 * main
    force = turn[:, None] * (main[:, None] * e_A - 1j * quadrature[:, None] * e_B)
    return force - damping_1_s * run.envelope


def _fastest_turn(run: EnvelopeRun) -> float:
    step = np.diff(run.time_s)
    return float(np.quantile(np.abs(np.diff(run.turn_rad)) / step, 0.99))


def bridge_gaps(run: EnvelopeRun) -> EnvelopeRun:
    """The run with empty rows (σ = ∞) in its gaps, so that no step of the Runge–Kutta rule is
    longer than the others."""
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

    def filled(values: Array) -> Array:
        return np.insert(values, place, np.interp(times, run.time_s, values))

    return replace(
        run,
        time_s=np.insert(run.time_s, place, times),
        envelope=np.insert(run.envelope, place, run.envelope[place - 1], axis=0),
        std=np.insert(run.std, place, np.inf),
        turn_rad=filled(run.turn_rad),
        temperature_degc=None if run.temperature_degc is None else filled(run.temperature_degc),
    )


def _common_reference_hz(runs: Sequence[EnvelopeRun]) -> float:
    """The frequency that the envelopes of all runs are put against."""
    return float(np.median([r.reference_frequency_hz for r in runs]))


def side_by_side(runs: Sequence[EnvelopeRun], waves: Sequence[Wave]) -> MeasuredRuns:
    """Padded arrays against one reference frequency, with everything the effects may look at."""
    longest = max(len(r) for r in runs)
    reference = _common_reference_hz(runs)

    def padded(values: Array) -> Array:
        return np.concatenate([values, np.repeat(values[-1:], longest - len(values), axis=0)])

    columns: dict[str, list[Array]] = {}
    for run, wave in zip(runs, waves, strict=True):
        t = run.time_s
        shift = 2 * np.pi * (run.reference_frequency_hz - reference) * t
        rate = (
            course(*_finite(wave.time_s, wave.rate_rad_s)).at(t)
            if _has(wave.rate_rad_s)
            else np.zeros(len(t))
        )
        warm = run.temperature_degc if run.temperature_degc is not None else np.zeros(len(t))
        warm = np.interp(t, *_finite(t, warm)) if np.isfinite(warm).any() else np.zeros(len(t))
        smooth = _smoothed(t, warm)
        forced = np.full(len(t), float(wave.mode == "forced"))
        unlogged = wave.mode == "forced" and not _has(wave.drive_main)
        held = (
            _smoothed(t, _amplitude(run.envelope), pieces=max(24, len(t) // 3), always=True)
            if unlogged
            else np.full(len(t), np.nan)
        )
        row = {
            "time_s": t,
            "envelope": run.envelope * np.exp(1j * shift)[:, None],
            "rate_rad_s": rate,
            "temperature_degc": smooth,
            "temperature_rate_degc_s": np.gradient(smooth, t),
            "temperature_impulse": temperature_impulse_of(
                wave, t, None if smooth is warm else smooth
            ),
            "branch": mean_branch(t, smooth),
            "table_angle_rad": run.turn_rad,
            "phase_rad": np.interp(t, *_finite(wave.time_s, wave.phase_rad)) + shift,
            "main_drive": command(wave, "drive_main", t, forced),
            "quadrature_drive": command(wave, "drive_quadrature", t, forced),
            "main_impulse": impulse_of(wave, "drive_main", t, forced),
            "quadrature_impulse": impulse_of(wave, "drive_quadrature", t, forced),
            "forced": forced,
            "held_amplitude": held,
            "held_slope": np.gradient(held, t),
        }
        for name, values in row.items():
            columns.setdefault(name, []).append(padded(values))
        columns.setdefault("weight", []).append(
            np.concatenate([1 / run.std, np.zeros(longest - len(run))])
        )
    stacked: dict[str, Any] = {name: np.stack(values) for name, values in columns.items()}
    return MeasuredRuns(
        names=tuple(w.run_id or f"run {k}" for k, w in enumerate(waves)),
        **stacked,
        turn_rad_s=(stacked["phase_rad"][:, -1] - stacked["phase_rad"][:, 0])
        / (stacked["time_s"][:, -1] - stacked["time_s"][:, 0]),
        reference_frequency_hz=reference,
        mode_number=int(waves[0].mode_number),
        has_temperature=any(_has(w.temperature_degc) for w in waves),
        whitening=channel_noise.side_by_side([r.whitening for r in runs]),
    )


def _has(values: Array | None) -> bool:
    return values is not None and bool(np.isfinite(values).any())


def _finite(x: Array, y: Array | None) -> tuple[Array, Array]:
    assert y is not None
    good = np.isfinite(x) & np.isfinite(y)
    return np.asarray(x)[good], np.asarray(y, float)[good]


def command(wave: Wave, name: str, t: Array, forced: Array) -> Array:
    """A logged drive command over rows about times t; zero where there is none."""
    logged = _logged(wave, name, forced)
    return np.zeros(len(t)) if logged is None else mean_of(logged, t, np.gradient(t))


def impulse_of(wave: Wave, name: str, t: Array, forced: Array) -> Array:
    """∫ of a logged drive command from the log's start to times t; zero where there is none."""
    logged = _logged(wave, name, forced)
    return np.zeros(len(t)) if logged is None else logged.at(t)


def temperature_impulse_of(wave: Wave, t: Array, smooth: Array | None) -> Array:
    """∫ of the temperature to rows about times t, each its mean over the row, as what it moves of
    the wave is: of the log, which knows where in a row it turned a corner, or along a smoothed
    course from row to row."""
    if smooth is not None or not _has(wave.temperature_degc):
        course = np.zeros(len(t)) if smooth is None else smooth
        return np.concatenate([[0.0], np.cumsum(np.diff(t) * (course[1:] + course[:-1]) / 2)])
    logged = impulse(*_finite(wave.time_s, wave.temperature_degc))
    half = np.sqrt(np.maximum(np.gradient(t) ** 2 - wave.window_s**2, 0.0)) / 2
    return (logged.at(t - half) + 4 * logged.at(t) + logged.at(t + half)) / 6


def _logged(wave: Wave, name: str, forced: Array) -> Impulse | None:
    """The integral of a command of which the windows hold the means; None where none is logged."""
    values = getattr(wave, name)
    if not forced.any() or not _has(values):
        return None
    return impulse(*_finite(wave.time_s, values))


def _amplitude(u: Array) -> Array:
    return ellipse.wave(u, 1)[0]


def _smoothed(t: Array, values: Array, pieces: int = 40, always: bool = False) -> Array:
    """Temperature by a line or a low polynomial, else by lines through about `pieces` local means
    where the thermometer is noisy.

    Its slope is then not the noise's.
    """
    rough = float(np.median(np.abs(np.diff(values, n=2)))) if len(t) > 3 else 0.0
    if np.ptp(values) == 0:
        return values
    if not always and len(t) > 4 * ENDS:
        x, inner = (
            (t - t.mean()) / np.ptp(t),
            slice(ENDS, -ENDS),
        )  # a log's first and last value may have been held beyond it
        for degree in range(1, DEGREES + 1):
            curve = np.polynomial.polynomial.polyval(
                x, np.polynomial.polynomial.polyfit(x[inner], values[inner], degree)
            )
            # second differences of white noise are √6 times as large
            if np.median(np.abs(values - curve)) <= max(
                1.2 * rough / np.sqrt(6), EXACT * float(np.ptp(values))
            ):
                return curve
    if len(t) < 2 * min(pieces, 40) or (not always and rough < QUIET * float(np.ptp(values))):
        return values
    parts = np.array_split(np.arange(len(t)), pieces)
    x = np.array([t[i].mean() for i in parts])
    y = np.array([values[i].mean() for i in parts])
    slope = np.gradient(y, x)
    inside = np.interp(t, x, y)
    left, right = t < x[0], t > x[-1]
    inside[left] = y[0] + slope[0] * (t[left] - x[0])
    inside[right] = y[-1] + slope[-1] * (t[right] - x[-1])
    return inside
