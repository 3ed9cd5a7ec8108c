"""estimate: the standing wave {A, B, θ, φ, ψ} of every period, from the demodulated signals (seed
B).

Direct read-out has four signals for four unknowns; carrier read-out eight for five (seed B (1)).
The direct signals are the carrier's with equal sidebands and ψ = 0, so that both go through the
same solvers.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting.ellipse.closed_form import choose_canonical, closed_form
from ..fitting.ellipse.continuity import CONTEXT_ROWS, continue_angles, local_slope, nearest_copy
from ..fitting.ellipse.gauss_newton import gauss_newton
from ..fitting.ellipse.levenberg_marquardt import levenberg_marquardt
from ..fitting.ellipse.uncertainty import standard_deviations
from ..physics.signals import envelopes_of_direct, from_sidebands
from ..records import FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, Array, Periods, Wave

BLOCK_ROWS = 16384
ITERATIVE = {"gauss-newton": gauss_newton, "levenberg-marquardt": levenberg_marquardt}
DIRTY = FLAG_CLIPPED | FLAG_GAP | FLAG_NOT_FINITE
WORSE = 1e-6
"""A solver that ends with a misfit this fraction above the global least one has not converged to
the solution."""
DETECTED = 5.0
"""An amplitude below this many standard deviations is no wave; noise alone exceeds it in 5e-5 of
the windows (χ² of four)."""
UNKNOWN = 100.0
"""A signal's standard deviation so many times the usual one says that it was not measured."""
FEWEST_USABLE = 1e-3
FAILED_LIMIT = 0.02
FLAGGED_LIMIT = 0.2
"""Fractions of the windows above which failed or flagged ones make the whole suspect."""


def estimate(
    periods: Periods,
    *,
    solver: Annotated[
        Literal["closed-form", "gauss-newton", "levenberg-marquardt"],
        Field(description="how the equations of a window are solved"),
    ] = "closed-form",
    start: Annotated[
        Literal["previous", "closed-form", "fixed"],
        Field(description="where an iterating solver starts each window"),
    ] = "previous",
    carrier_phase_rad: Annotated[
        float | None,
        Field(description="carrier phase where it is known; estimated where it is not given"),
    ] = None,
    tolerance: Annotated[
        float,
        Field(
            gt=0,
            lt=0.1,
            description="step of an iterating solver, relative to the signals, at which it ends",
        ),
    ] = 1e-10,
    max_iterations: Annotated[
        int,
        Field(
            ge=1,
            le=10000,
            description="residual evaluations after which a window counts as not converged",
        ),
    ] = 60,
    frequency_windows: Annotated[
        int,
        Field(ge=1, le=1000, description="windows on each side whose phases give the frequency"),
    ] = 16,
) -> Iterator[Wave]:
    """The standing wave of every window: amplitude, quadrature, angle and phases.

    C0 = e^{jφ}(a_A cos mθ + j a_B sin mθ), S0 = e^{jφ}(a_A sin mθ − j a_B cos mθ) (PHYSICS §1),
    solved by the iteration (2) of seed B or in closed form, and mapped to a_A ≥ |a_B| with θ, φ, ψ
    continuous through the run. `start`: the solution of the window before; the window's own closed
    form; or seed B's (A₀, 0, 0, φ₋₁, ψ₋₁).

    Parameters
    ----------
    periods
        Signals (n, 4), of a carrier (n, 8), with standard deviations; it may be open on disk.

    Returns
    -------
    Iterator[Wave]
        Blocks of windows (n,): amplitudes in the signals' unit, angles and phases [rad], frequency
        [Hz], their standard deviations; the last block holds the status.

    Raises
    ------
    HrgError
        The number of signals does not fit the read-out, or there are no rows.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect, demodulate, estimate
    >>> t = np.arange(8000) / 8000
    >>> c = np.cos(2 * np.pi * 1000 * t) + 1e-4 * np.random.default_rng(0).standard_normal(8000)
    >>> recording = Recording(c=c, s=c, sample_rate_hz=8000.0, mode="free")  # mθ = 45°, m = 2
    >>> wave = collect(estimate(collect(demodulate(recording, periods_per_window=20))))
    >>> float(wave.main_amplitude[0].round(3)), float(np.degrees(wave.wave_angle_rad[0]).round(2))
    (1.414, 22.5)
    """
    _check(periods, carrier_phase_rad)
    how = _How(
        solver,
        start,
        0.0 if periods.readout == "direct" else carrier_phase_rad,
        tolerance,
        max_iterations,
    )
    tally = _Tally()
    last: _Row | None = None
    context: Array | None = None
    emitted: Wave | None = None
    waiting: Wave | None = None
    for block in periods.blocks(BLOCK_ROWS):
        x, misfit, iterations, last = _solve(
            np.asarray(block.signals, float), periods.readout == "direct", how, last
        )
        context = _make_continuous(x, block, context)
        wave = _wave(block, x, misfit, iterations, how.carrier_phase_rad is not None)
        tally.add(wave)
        if waiting is not None:
            emitted = _with_frequency(emitted, waiting, wave, frequency_windows)
            yield emitted
        waiting = wave
    assert waiting is not None
    yield tally.judge(_with_frequency(emitted, waiting, None, frequency_windows), solver)


def _check(periods: Periods, carrier_phase_rad: float | None) -> None:
    run = periods.run_id or "this run"
    expected = {"direct": 4, "carrier": 8}.get(periods.readout)
    if expected is None:
        raise HrgError(
            f'{run}: readout is {periods.readout!r}, expected "direct" or "carrier"; demodulate the'
            " recording again"
        )
    if len(periods) == 0:
        raise HrgError(f"{run}: the periods file has no window; demodulate a longer recording")
    if periods.signals.ndim != 2 or periods.signals.shape[1] != expected:
        raise HrgError(
            f"{run}: signals have shape {tuple(periods.signals.shape)}, {expected} a window were"
            f" expected with {periods.readout} read-out; demodulate the recording again"
        )
    if carrier_phase_rad is not None and periods.readout == "direct":
        raise HrgError(
            f"{run}: carrier_phase_rad was given, but the read-out is direct and has no carrier;"
            " leave it out"
        )


@dataclass(frozen=True)
class _How:
    """The settings that every block needs; the carrier phase is None where it is estimated."""

    solver: str
    start: str
    carrier_phase_rad: float | None
    tolerance: float
    max_iterations: int


@dataclass(frozen=True)
class _Row:
    """What the next block needs of the one before: its last solution x (5), and A₀ of the start
    "fixed"."""

    x: Array
    fixed_amplitude: float


def _solve(
    signals: Array, direct: bool, how: _How, last: _Row | None
) -> tuple[Array, Array, Array, _Row | None]:
    """x (n, 5) canonical, misfit rms (n), iterations (n) of one block; rows that are not finite
    stay NaN with −1 iterations."""
    n = len(signals)
    x, misfit, iterations = np.full((n, 5), np.nan), np.full(n, np.nan), np.full(n, -1, np.int16)
    finite = _finite(signals)
    if not finite.any():
        return x, misfit, iterations, last
    z = signals if finite.all() else signals[finite]
    if direct:
        u = envelopes_of_direct(z)
        z = from_sidebands(u, u)
    best, rms = closed_form(z, how.carrier_phase_rad)
    counts = np.zeros(len(z), np.int16)
    if last is None:
        last = _Row(best[0], float(np.median(best[:, 0])))
    if how.solver in ITERATIVE:
        solution = ITERATIVE[how.solver](
            z,
            _starts(best, how.start, last),
            step_tolerance=how.tolerance,
            max_iterations=how.max_iterations,
            carrier_known=how.carrier_phase_rad is not None,
        )
        stuck = ~(solution.residual_rms <= rms * (1 + WORSE) + 1e-7 * best[:, 0])
        counts = np.where(stuck, -np.abs(solution.evaluations), solution.evaluations)
        fit, rms = (
            choose_canonical(solution.x, how.carrier_phase_rad is not None),
            solution.residual_rms,
        )
    else:
        fit = best
    rms = np.zeros(len(z)) if direct else rms
    if len(z) == n:
        return fit, rms, counts, _Row(best[-1].copy(), last.fixed_amplitude)
    x[finite], misfit[finite], iterations[finite] = fit, rms, counts
    return x, misfit, iterations, _Row(best[-1], last.fixed_amplitude)


def _finite(rows: Array) -> Array:
    """Rows (n,) whose values are all finite: their sum is, as a product, several times as fast as a
    look at each value."""
    return np.asarray(np.isfinite(rows @ np.ones(rows.shape[1])))


def _starts(best: Array, start: str, last: _Row) -> Array:
    """Start values (n, 5) of an iterating solver.

    "previous" is the solution of the row before. A sequential run would have found it by iterating;
    it is the global minimum, known beforehand as the closed form, so all rows start at once from
    the very values that the sequential run has where it converges.
    """
    if start == "closed-form":
        return best
    previous = np.concatenate([last.x[None], best[:-1]])
    if start == "fixed":
        previous[:, :3] = last.fixed_amplitude, 0.0, 0.0
    return previous


def _make_continuous(x: Array, block: Periods, context: Array | None) -> Array | None:
    """Make (mθ, φ, ψ) of x (n, 5) continuous in place; `context` and the result hold the last
    trusted rows (k, 4: time, mθ, φ, ψ).

    The path runs through trusted rows only, for one stray value near half a period away would turn
    all that follows; the others take the copy nearest to the path. Where fewer than half of the
    rows can be trusted, all have a say.
    """
    time_s, std = np.asarray(block.time_s, float), np.asarray(block.signals_std, float)
    finite = _finite(x) & np.isfinite(time_s)
    largest = functools.reduce(np.maximum, std.T)
    stray = (np.asarray(block.flags) & (FLAG_GAP | FLAG_NOT_FINITE) != 0) | (
        x[:, 0] < DETECTED * largest
    )
    trusted = finite & ~stray
    if 2 * np.count_nonzero(trusted) < np.count_nonzero(finite):
        trusted = finite
    rows = np.stack([time_s, *x[:, 2:].T])
    every = bool(trusted.all())
    if not every:
        rows = rows[:, trusted]
    if rows.shape[1] == 0:
        return context
    known = 0 if context is None else len(context)
    if context is not None:
        rows = np.concatenate([context.T, rows], axis=1)
    at, angle, phase, carrier = rows
    path = np.stack(continue_angles(at, angle, phase, carrier, block.window_s))
    if context is not None:
        path -= np.pi * np.round((path[:, known - 1] - context[-1, 1:]) / np.pi)[:, None]
    x[slice(None) if every else trusted, 2:] = path[:, known:].T
    others = finite & ~trusted
    if others.any():
        expected = np.stack(
            [np.interp(time_s[others], rows[0], column) for column in path], axis=-1
        )
        x[others, 2:] = nearest_copy(x[others, 2:], expected)
    return np.column_stack([rows[0, -CONTEXT_ROWS - 1 :], path[:, -CONTEXT_ROWS - 1 :].T])


def _wave(block: Periods, x: Array, misfit: Array, iterations: Array, carrier_known: bool) -> Wave:
    """The block's record, but for its frequency."""
    variances = np.asarray(block.signals_std, float) ** 2
    std = standard_deviations(x, variances, carrier_known)
    direct = block.readout == "direct"
    flags = np.asarray(block.flags).astype(np.uint8)
    flags[~_finite(x)] |= FLAG_NOT_FINITE
    shared = (
        name
        for name in Wave.columns()
        if name in Periods.columns() and name not in ("flags", "residual_rms")
    )
    passed: dict[str, Any] = {name: getattr(block, name) for name in shared}
    m = block.mode_number
    return Wave(
        **passed,
        main_amplitude=x[:, 0],
        quadrature_amplitude=x[:, 1],
        wave_angle_rad=x[:, 2] / m,
        phase_rad=x[:, 3],
        carrier_phase_rad=x[:, 4],
        main_amplitude_std=std[:, 0],
        quadrature_amplitude_std=std[:, 1],
        wave_angle_rad_std=std[:, 2] / m,
        phase_rad_std=std[:, 3],
        carrier_phase_rad_std=std[:, 4],
        residual_rms=misfit,
        signal_std=np.sqrt(_pooled(variances) / (1 if direct else 2)),
        iterations=iterations,
        flags=flags,
        frequency_hz=np.full(len(x), np.nan),
        status=block.status,
        status_reasons=block.status_reasons,
        provenance=block.provenance,
    )


def _pooled(variances: Array) -> Array:
    """Mean variance (n,) of the signals, without those of which nothing is known (the phase of a
    bare amplitude)."""
    mean = variances @ np.full(variances.shape[1], 1 / variances.shape[1])
    least = functools.reduce(np.minimum, variances.T)
    if np.all(mean <= UNKNOWN * least) or not least.any():
        return np.asarray(mean)
    known = variances <= UNKNOWN**2 * np.median(variances, axis=1, keepdims=True)
    return np.asarray(
        np.divide(
            (variances * known).sum(axis=1),
            known.sum(axis=1),
            out=mean.copy(),
            where=known.any(axis=1),
        )
    )


def _with_frequency(before: Wave | None, wave: Wave, after: Wave | None, half_width: int) -> Wave:
    """The wave with its frequency: reference + slope of φ over the neighbouring windows, across the
    blocks' borders too.

    Clipped rows and rows beside gaps weigh next to nothing, but where there are no others they
    still tell the frequency.
    """
    parts = (
        [wave]
        if before is None
        else [before.rows(max(0, len(before) - half_width), len(before)), wave]
    )
    if after is not None:
        parts.append(after.rows(0, half_width))
    time_s, phase, flags = (
        np.concatenate([getattr(p, name) for p in parts])
        for name in ("time_s", "phase_rad", "flags")
    )
    weights = np.where(
        np.isfinite(phase) & np.isfinite(time_s), np.where(flags & DIRTY, 1e-6, 1.0), 0.0
    )
    slope = local_slope(time_s, phase, weights, half_width)
    first = 0 if before is None else len(parts[0])
    return wave.replace(
        frequency_hz=wave.reference_frequency_hz + slope[first : first + len(wave)] / (2 * np.pi)
    )


class _Tally:
    """Counts of rows over the whole stream."""

    def __init__(self) -> None:
        self.rows = self.failed = self.flagged = self.usable = self.faint = 0

    def add(self, wave: Wave) -> None:
        good, finite = wave.good(), np.isfinite(wave.main_amplitude)
        self.rows += len(wave)
        self.failed += int((finite & (wave.iterations < 0)).sum())
        self.flagged += int(((wave.flags & DIRTY) != 0).sum())
        faint = good & (
            (wave.main_amplitude <= 0) | (wave.main_amplitude < DETECTED * wave.signal_std)
        )
        self.faint += int(faint.sum())
        self.usable += int((good & ~faint).sum())

    def judge(self, wave: Wave, solver: str) -> Wave:
        """The last block with the whole stream's status."""
        run = wave.run_id or "this run"
        if self.usable <= FEWEST_USABLE * self.rows or self.failed > self.rows / 2:
            return wave.judged(
                [
                    f"{run}: {self.usable} of {self.rows} windows are usable: {self.flagged} are"
                    f" flagged, {self.failed} did not converge, in {self.faint} the amplitude is"
                    f" below {DETECTED:g} standard deviations; check the recording"
                ],
                "refused",
            )
        reasons = []
        if self.failed > FAILED_LIMIT * self.rows:
            reasons.append(
                f"{run}: {solver} did not converge in {self.failed} of {self.rows} windows; use the"
                " solver closed-form"
            )
        if self.flagged > FLAGGED_LIMIT * self.rows:
            reasons.append(
                f"{run}: {self.flagged} of {self.rows} windows are clipped, beside a gap or not"
                " finite; check the recording"
            )
        if self.faint > FLAGGED_LIMIT * self.rows:
            reasons.append(
                f"{run}: in {self.faint} of {self.rows} windows the amplitude is below {DETECTED:g}"
                " standard deviations; demodulate with longer windows"
            )
        return wave.judged(reasons)


SUMMARY_ROWS = 1 << 17
_SUMMARISED = (
    "main_amplitude",
    "quadrature_amplitude",
    "wave_angle_rad",
    "wave_angle_rad_std",
    "frequency_hz",
    "residual_rms",
)


def summary(wave: Wave) -> dict[str, Any]:
    """Figures of a wave record for the command's JSON."""
    out: dict[str, Any] = {"windows": len(wave), "usable": 0, "flagged": 0, "not_converged": 0}
    every = max(1, len(wave) // SUMMARY_ROWS)
    kept: list[list[Array]] = []
    for start in range(0, len(wave), SUMMARY_ROWS):
        part = slice(start, start + SUMMARY_ROWS)
        columns = [np.asarray(getattr(wave, name)[part]) for name in _SUMMARISED]
        amplitude, flags, iterations = (
            columns[0],
            np.asarray(wave.flags[part]),
            np.asarray(wave.iterations[part]),
        )
        good = (flags == 0) & (iterations >= 0) & np.isfinite(columns[2]) & (amplitude > 0)
        out["usable"] += int(good.sum())
        out["flagged"] += int((flags != 0).sum())
        out["not_converged"] += int((np.isfinite(amplitude) & (iterations < 0)).sum())
        rows = np.flatnonzero(good)
        chosen = np.unique(np.concatenate([rows[:1], rows[::every], rows[-1:]]))
        kept.append([column[chosen] for column in columns])
    if not out["usable"]:
        return out
    amplitude, quadrature, angle, std, frequency, residual = (
        np.concatenate(parts) for parts in zip(*kept, strict=True)
    )
    out["main_amplitude"] = {
        "first": float(amplitude[0]),
        "last": float(amplitude[-1]),
        "units": wave.units,
    }
    out["quadrature_ratio_rms"] = float(np.sqrt(np.mean((quadrature / amplitude) ** 2)))
    out["wave_angle_rad"] = {"first": float(angle[0]), "last": float(angle[-1])}
    out["wave_angle_std_rad"] = _number(np.median(std))
    out["frequency_hz"] = (
        _number(np.median(frequency[np.isfinite(frequency)]))
        if np.isfinite(frequency).any()
        else None
    )
    out["residual_rms"] = float(np.sqrt(np.mean(residual**2)))
    return out


def _number(value: Any) -> float | None:
    """A float for JSON, which knows no NaN."""
    return float(value) if np.isfinite(value) else None
