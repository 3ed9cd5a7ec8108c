"""demodulate: samples of the two channels -> least-squares signals a window, against one constant reference frequency.

C = c_cos·cos ω_r t + c_sin·sin ω_r t (CONTRACT), so C0 = c_cos − j·c_sin at the window's centre. Every window of a fixed
number of samples shares one least-squares basis about its centre at the local frequency; one matrix product serves a
block, one turn by the reference phase at each centre makes the signals. No whole periods are needed and nothing leaks.
With a carrier the basis has the two side bands |ω_c ∓ ω| and the carrier's leakage: eight signals (PHYSICS §3, seed B (1)).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting import windows as fitted
from ..fitting.basis import WindowBasis, columns, window_basis
from ..fitting.frequency import bands, nuisances
from ..fitting.survey import Survey, survey
from ..records import FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING, Array, Periods, Recording

CHUNK_SAMPLES, CHUNK_WINDOWS = (1 << 16, 1 << 20), 256
"""Samples, at least and at most, and windows in between, that share one local basis frequency."""

FREQUENCY_STEP = 3e-4
"""The local frequency is rounded to this part of 1/window, so that steady runs share one basis; the amplitude errs by 4e-8."""

MOVING_PERIODS = 3.0
"""From so many periods a window the basis holds t·cos, t·sin, which then cost no precision."""

SETTLING_FACTOR, SETTLING_SHARE = 5.0, 0.1
"""A settling start has a residual so many times the run's, absolutely and relative to the wave, and is at most this part of the run."""

AUXILIARY = ("temperature_degc", "rate_rad_s", "drive_main", "drive_quadrature")


def demodulate(
    recording: Recording,
    *,
    periods_per_window: Annotated[float, Field(gt=0, description="oscillation periods a window, any fraction")] = 1.0,
    moving_envelope: Annotated[
        bool | None, Field(description="let the envelope move linearly within a window (t·cos, t·sin); by default from 3 periods a window")
    ] = None,
    block_samples: Annotated[int, Field(gt=0, description="samples worked on at once; memory depends on it, results do not")] = 1 << 20,
) -> Iterator[Periods]:
    """Signals a window as a stream of Periods; memory does not grow with the recording; the last block holds spectrum and status.

    HrgError: no samples, unequal or constant channels, nothing below half the sampling rate, times that do not increase, too short for a window.
    """
    run = _Run(recording, survey(recording, _checked(recording)), periods_per_window, moving_envelope)
    pieces = _even(run, block_samples) if recording.time_s is None else _uneven(run, block_samples)
    held: Periods | None = None
    for rows in pieces:
        if held is not None:
            yield held
        held = run.periods(rows)
    if held is None:
        raise run.too_short()
    found = run.survey
    held = held.replace(
        spectrum_frequency_hz=found.spectrum_hz,
        spectrum_density=found.spectrum_density,
        spectrum_line_frequency_hz=found.line_hz,
        spectrum_line_amplitude=found.line_amplitude,
        spectrum_line_ratio=found.line_ratio,
    )
    yield run.judge(held)


def _checked(recording: Recording) -> str:
    """The run's name for messages, after the checks that need no sample."""
    name = f"run {recording.run_id}" if recording.run_id else "the recording"
    c, s = len(recording.c), len(recording.s)
    if c != s:
        raise HrgError(f"{name}: channel C has {c} samples and S {s}; equal lengths were expected")
    if recording.time_s is not None and len(recording.time_s) != c:
        raise HrgError(f"{name}: time_s has {len(recording.time_s)} values for {c} samples; one time a sample was expected")
    rate = recording.sample_rate_hz
    if recording.time_s is None and not (rate is not None and np.isfinite(rate) and rate > 0):
        raise HrgError(f"{name}: sample_rate_hz is {rate}; a positive number (or a time_s of every sample) was expected")
    if recording.readout == "carrier" and recording.carrier_hz is None:
        raise HrgError(f"{name}: read-out is by carrier, but carrier_hz is missing; add it to the recording")
    if recording.readout not in ("direct", "carrier"):
        raise HrgError(f"{name}: read-out is {recording.readout!r}; direct or carrier was expected")
    return name


@dataclass
class _Run:
    """One recording on its way through: what was found before, the window, and what the rows so far have shown."""

    recording: Recording
    survey: Survey
    periods_asked: float
    moving_asked: bool | None
    rows: int = 0
    flagged: dict[int, int] = field(default_factory=dict)
    settled: bool = False
    outside_log: int = 0
    window_s: float = 0.0
    moving: bool = False
    ahead_hz: float = 0.0
    kept: tuple[float, WindowBasis] | None = None
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.name = _checked(self.recording)
        self.course = np.zeros((0, 1), complex)
        self.f = self.survey.reference_hz
        self.carrier = self.survey.carrier_hz
        self.sign = np.array([1.0]) if self.carrier is None else np.array([-1.0, 1.0])
        self.reference = np.array(bands(self.f, self.carrier))
        self.duration = float(self.recording.times(len(self.recording.c) - 1)[0])
        self.moving = self.periods_asked >= MOVING_PERIODS if self.moving_asked is None else self.moving_asked
        names = [name for name in AUXILIARY if getattr(self.recording, name) is not None]
        self.log = {name: np.asarray(getattr(self.recording, name), float) for name in names}
        time = self.recording.auxiliary_time_s
        self.log_time = np.asarray(time, float) if time is not None and len(time) else None

    def local_hz(self, time_s: float) -> float:
        """Frequency of the basis at a time: the survey's course, corrected by what the chunk before has shown."""
        step = FREQUENCY_STEP / self.window_s
        return float(round((self.survey.frequency_hz(time_s) + self.ahead_hz) / step) * step)

    def follow(self, u: Array, time_s: float) -> None:
        """Learn from a chunk's envelopes u (channel, rows, F) by how much the frequency differs from the survey's course."""
        cross = (u[:, 1:] * u[:, :-1].conj()).sum((0, 1))
        power = float((np.abs(u[:, :-1]) ** 2).sum())
        total = complex(np.where(self.sign < 0, cross.conj(), cross).sum())
        if np.isfinite(total) and u.shape[1] > 8 and abs(total) > 0.95 * power:
            self.ahead_hz = self.f + float(np.angle(total)) / (2 * np.pi * self.window_s) - self.survey.frequency_hz(time_s)

    def basis(self, samples: int, rate: float, local_hz: float) -> WindowBasis:
        """The shared basis at a local frequency, kept while that stays the same."""
        if self.kept is None or self.kept[0] != local_hz:
            basis = window_basis(samples, rate, bands(local_hz, self.carrier), nuisances(self.carrier), self.moving)
            if basis is None:
                raise self.too_short()
            self.kept = (local_hz, basis)
        return self.kept[1]

    def too_short(self) -> HrgError:
        """The sentence for a recording that holds no window."""
        return HrgError(
            f"{self.name}: its {len(self.recording.c)} samples do not hold one window of {self.periods_asked:g} periods at {self.f:.6g} Hz; "
            "record longer or set periods_per_window lower"
        )

    def signals(self, fits: fitted.Fits, times: Array, local_hz: float, keep: slice, out: dict[str, Array], rows: slice) -> None:
        """Fill `rows` of a block from a chunk: reference phase, standard deviations; `keep` drops neighbours fitted only for the slopes."""
        tones = len(self.reference)
        turn = self.turns(float(times[0]), len(times))
        offset = 2 * np.pi * (local_hz - self.f) * self.sign
        u = fitted.to_reference(fits.envelope, turn, offset, self.window_s, fits.alpha, fits.beta)[:, keep]
        self.follow(u, float(times[0] + times[-1]) / 2)
        freedom = fits.freedom if np.ndim(fits.freedom) == 0 else fits.freedom[keep]
        samples = fits.samples if np.ndim(fits.samples) == 0 else np.maximum(fits.samples[keep], 1)
        variance = fits.variance if len(fits.variance) == 1 else fits.variance[keep]
        p, q = variance[:, 0::2], variance[:, 1::2]
        part = turn[keep].real ** 2 * (p - q)
        factor_p, factor_q = np.sqrt(part + q), np.sqrt(p - part)
        for k in range(2):
            first = 2 * k * tones
            out["signals"][rows, first : first + tones] = u[k].real
            np.negative(u[k].imag, out=out["signals"][rows, first + tones : first + 2 * tones])
            residual2 = fits.residual2[k][keep]
            sigma = np.sqrt(np.maximum(fitted.pooled_variance(residual2, freedom), self.least2(k)))[:, None]
            np.multiply(sigma, factor_p, out=out["signals_std"][rows, first : first + tones])
            np.multiply(sigma, factor_q, out=out["signals_std"][rows, first + tones : first + 2 * tones])
            np.sqrt(residual2 / samples, out=out["residual_rms"][rows, k])
        out["time_s"][rows] = times[keep]

    def turns(self, start_s: float, rows: int) -> Array:
        """e^{−jω_r t} (rows, F) at windows one after another from a centre; the course within a chunk is computed once."""
        if len(self.course) < rows:
            self.course = np.exp(-2j * np.pi * np.fmod(np.arange(rows)[:, None] * self.window_s * self.reference, 1.0))
        return self.course[:rows] * np.exp(-2j * np.pi * np.fmod(start_s * self.reference, 1.0))

    def empty(self, rows: int) -> dict[str, Array]:
        """A block's columns, to be filled."""
        signals = 4 * len(self.reference)
        shapes = {"time_s": (rows,), "signals": (rows, signals), "signals_std": (rows, signals), "residual_rms": (rows, 2)}
        return {name: np.empty(shape) for name, shape in shapes.items()} | {"flags": np.zeros(rows, "u1")}

    def scale(self, k: int) -> float:
        """Unit of a channel a raw count."""
        return float(self.recording.c_scale_factor if k == 0 else self.recording.s_scale_factor)

    def least2(self, k: int) -> float:
        """Least variance a sample: a converter's rounding, 1/12 of a count squared; for floats their own rounding."""
        channel = self.recording.c if k == 0 else self.recording.s
        if np.issubdtype(channel.dtype, np.integer):
            return self.scale(k) ** 2 / 12
        return max(self.survey.strength2 * float(np.finfo(channel.dtype).eps) ** 2, 1e-300)

    def settling(self, rows: dict[str, Array], times: Array) -> None:
        """Flag the leading rows whose residual is far above the run's, until the first that is not."""
        if self.settled:
            return
        residual2 = (rows["residual_rms"] ** 2).sum(1)
        wave2 = (rows["signals"] ** 2).sum(1) / 2
        far = (residual2 > SETTLING_FACTOR**2 * self.survey.noise2.sum()) & (
            residual2 > (SETTLING_FACTOR * self.survey.relative_noise) ** 2 * wave2
        )
        start = float(self.recording.times(0, 1)[0])
        far &= times - start < SETTLING_SHARE * (self.duration - start)
        calm = np.flatnonzero(~far & np.isfinite(residual2))
        stop = int(calm[0]) if len(calm) else len(far)
        rows["flags"][:stop][far[:stop]] |= FLAG_SETTLING
        self.settled = len(calm) > 0

    def periods(self, rows: dict[str, Array]) -> Periods:
        """One block of the stream."""
        recording, times = self.recording, rows["time_s"]
        self.settling(rows, times)
        self.rows += len(times)
        for bit in (FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING):
            self.flagged[bit] = self.flagged.get(bit, 0) + int(np.count_nonzero(rows["flags"] & bit))
        return Periods(
            **rows,
            **self.auxiliary(times),
            reference_frequency_hz=self.f,
            periods_per_window=self.window_s * self.f,
            window_s=self.window_s,
            mode=recording.mode,
            readout=recording.readout,
            carrier_hz=recording.carrier_hz,
            mode_number=recording.mode_number,
            gyro_id=recording.gyro_id,
            run_id=recording.run_id,
            lot_id=recording.lot_id,
            start_time=recording.start_time,
            units=recording.c_units,
        )

    def auxiliary(self, times: Array) -> dict[str, Array]:
        """The log at the windows' centres; up to one of its steps beyond its ends the end value, farther out NaN."""
        if self.log_time is None or not self.log:
            return {}
        log = self.log_time
        reach = float(np.median(np.diff(log))) if len(log) > 1 else np.inf
        outside = (times < log[0] - reach) | (times > log[-1] + reach)
        self.outside_log += int(outside.sum())
        values = {name: np.interp(times, log, series) for name, series in self.log.items()}
        if outside.any():
            for series in values.values():
                series[outside] = np.nan
        return values

    def judge(self, periods: Periods) -> Periods:
        """The last block with the reasons to note, suspect or refuse the whole."""
        suspect = list(self.survey.suspect)
        clipped, gaps, bad, settling = (self.flagged.get(bit, 0) for bit in (FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING))
        notes = list(self.notes)
        of = f"of {self.rows} windows"
        if clipped:
            (suspect if clipped > 0.01 * self.rows else notes).append(f"{clipped} {of} hold clipped samples")
        if gaps:
            (suspect if gaps > 0.1 * self.rows else notes).append(f"{gaps} {of} lie in or beside gaps of the sampling")
        if bad:
            (suspect if bad > 0.01 * self.rows else notes).append(f"{bad} {of} hold samples that are not finite")
        if settling:
            notes.append(f"the first {settling} windows settle")
        if self.outside_log:
            notes.append(f"{self.outside_log} {of} lie outside the auxiliary log; their temperature and rate are NaN")
        if self.recording.s_units != self.recording.c_units:
            suspect.append(f"channel C is in {self.recording.c_units!r} and S in {self.recording.s_units!r}; the same unit was expected")
        refused = list(self.survey.refused)
        if clipped == self.rows:
            refused.append("every window is clipped")
        if bad == self.rows:
            refused.append("no window holds finite samples only")
        return periods.judged(notes, "valid").judged(suspect, "suspect").judged(refused, "refused")


def _even(run: _Run, block_samples: int) -> Iterator[dict[str, Array]]:
    """Blocks of rows from even sampling."""
    recording, rate = run.recording, float(run.recording.sample_rate_hz or 0)
    samples = _window_samples(run, rate)
    run.window_s = samples / rate
    total = len(recording.c) // samples
    pool = fitted.pool_rows(samples - 3)
    chunk = pool * max(1, _chunk_samples(samples) // (pool * samples))
    halo = 0 if run.moving else fitted.NEIGHBOURS
    step = chunk * max(1, block_samples // (chunk * samples))
    for first in range(0, total, step):
        last = min(first + step, total)
        lead = max(0, first - halo)
        raw = [np.asarray(channel[lead * samples : min(last + halo, total) * samples]) for channel in (recording.c, recording.s)]
        suspects = [_beyond(raw[k], run.survey.rails[k]) for k in range(2)]
        block = run.empty(last - first)
        for start in range(first, last, chunk):
            stop = min(start + chunk, last)
            low, high = max(0, start - halo), min(stop + halo, total)
            times = (np.arange(low, high) * samples + (samples - 1) / 2) / rate
            local = run.local_hz(float((start + chunk / 2) * samples / rate))
            basis = run.basis(samples, rate, local)
            keep = slice(start - low, stop - low)
            flags = np.zeros(stop - start, "u1")
            envelopes, residuals = [], []
            for k in range(2):
                piece = raw[k][(low - lead) * samples : (high - lead) * samples].reshape(-1, samples)
                envelope, residual2 = fitted.fit_even(piece, basis)
                envelopes.append(envelope * run.scale(k))
                residuals.append(residual2 * run.scale(k) ** 2)
                flags[~np.isfinite(residual2[keep])] |= FLAG_NOT_FINITE
                if suspects[k]:
                    rail = run.survey.rails[k]
                    flags[(piece[keep].max(1) >= rail[1]) | (piece[keep].min(1) <= rail[0])] |= FLAG_CLIPPED
            fits = fitted.Fits(
                np.array(envelopes),
                np.array(residuals),
                np.asarray(basis.freedom),
                np.asarray(samples),
                basis.variance[None],
                basis.alpha[None],
                basis.beta[None],
            )
            rows = slice(start - first, stop - first)
            run.signals(fits, times, local, keep, block, rows)
            block["flags"][rows] = flags
        yield block


def _beyond(raw: Array, rail: tuple[float, float]) -> bool:
    """Whether any sample of a block touches a rail (one fast pass, so that clean blocks cost no more)."""
    if not np.isfinite(rail[0]) and not np.isfinite(rail[1]):
        return False
    return bool(raw.max() >= rail[1] or raw.min() <= rail[0]) or not bool(np.isfinite(raw.max()))


def _chunk_samples(window: float) -> int:
    return int(min(max(CHUNK_SAMPLES[0], CHUNK_WINDOWS * window), CHUNK_SAMPLES[1]))


def _window_samples(run: _Run, rate: float) -> int:
    """Samples a window: those asked for, or as many more as the basis needs to be regular with a degree of freedom to spare."""
    n = len(run.recording.c)
    asked = max(1, int(round(run.periods_asked * rate / run.f)))
    frequencies, beside = bands(run.f, run.carrier), nuisances(run.carrier)
    if run.moving and run.moving_asked is None and asked < 3 * columns(np.zeros(1), frequencies, beside, True).shape[1]:
        run.moving = False
    worst = 30.0 if run.periods_asked >= 0.9 else 1e3
    samples = asked
    while samples <= n:
        basis = window_basis(samples, rate, frequencies, beside, run.moving)
        if basis is not None and basis.freedom >= 2 and basis.condition <= worst:
            if samples > asked:
                run.notes.append(
                    f"windows of {samples} samples ({samples * run.f / rate:.3g} periods) are used: {asked} ({run.periods_asked:g} periods) are too few for the fit"
                )
            return samples
        samples += max(1, samples // 16)
    raise run.too_short()


def _uneven(run: _Run, block_samples: int) -> Iterator[dict[str, Array]]:
    """Blocks of rows from true times, a fixed number of windows at a time."""
    recording, n = run.recording, len(run.recording.c)
    begin = float(recording.times(0, 1)[0])
    step = run.survey.step_s
    needed = columns(np.zeros(1), bands(run.f, run.carrier), nuisances(run.carrier)).shape[1]
    if run.moving and run.moving_asked is None and run.periods_asked / (run.f * step) < 2 * (needed + 2 * len(run.reference)):
        run.moving = False
    needed += 2 * len(run.reference) if run.moving else 0
    width = run.periods_asked / run.f
    if width < (needed + 2) * step:
        width = (needed + 2) * step
        run.notes.append(f"windows of {width * run.f:.3g} periods are used: {run.periods_asked:g} hold too few samples for the fit")
    run.window_s = width
    span = run.duration - begin + step
    if span > 20 * n * step:
        raise HrgError(
            f"{run.name}: its times span {span:.6g} s, but {n} samples at its usual step fill {n * step:.6g} s; a clock that jumps? split the run at its gaps"
        )
    total = int(span / width + 1e-9)
    per_window = width / step
    pool = fitted.pool_rows(per_window - needed)
    chunk = pool * max(1, int(_chunk_samples(per_window) / (pool * per_window)))
    halo = 0 if run.moving else fitted.NEIGHBOURS
    reader = _Reader(recording, begin, width, block_samples, run.name)
    for first in range(0, total, chunk):
        last = min(first + chunk, total)
        low, high = max(0, first - halo), min(last + halo, total)
        time, raw, window = reader.windows(low, high)
        centre = begin + (np.arange(low, high) + 0.5) * width
        local = run.local_hz(begin + (first + chunk / 2) * width)
        y = np.stack([raw[0] * run.scale(0), raw[1] * run.scale(1)])
        fits = fitted.fit_uneven(time, y, window - low, centre, width, bands(local, run.carrier), nuisances(run.carrier), run.moving)
        keep = slice(first - low, last - low)
        flags = np.zeros(high - low, "u1")
        flags[_gaps(time, begin, width, step, low, high)] |= FLAG_GAP
        bad = window[~np.isfinite(y).all(0)] - low
        flags[bad] |= FLAG_NOT_FINITE
        flags[~np.isfinite(fits.residual2).all(0) & ~(flags & FLAG_NOT_FINITE).astype(bool)] |= FLAG_GAP
        for k in range(2):
            rail = run.survey.rails[k]
            flags[window[(raw[k] >= rail[1]) | (raw[k] <= rail[0])] - low] |= FLAG_CLIPPED
        block = run.empty(last - first)
        run.signals(fits, centre, local, keep, block, slice(None))
        block["flags"][:] = flags[keep]
        yield block


def _gaps(time: Array, begin: float, width: float, step: float, low: int, high: int) -> Array:
    """Rows (of low … high − 1) touched by a stretch of more than 2.5 usual steps without a sample."""
    touched = np.zeros(high - low, bool)
    edges = (
        np.concatenate([[begin + low * width - step], time, [begin + high * width + step]])
        if len(time)
        else np.array([begin, begin + high * width])
    )
    for k in np.flatnonzero(np.diff(edges) > 2.5 * step):
        a, b = int((edges[k] - begin) / width) - low, int((edges[k + 1] - begin) / width) - low
        touched[max(0, a) : max(0, b) + 1] = True
    return touched


class _Reader:
    """Samples of an unevenly sampled recording by windows, read forward in blocks; checks that times increase."""

    def __init__(self, recording: Recording, begin: float, width: float, block: int, name: str) -> None:
        self.recording, self.begin, self.width, self.block, self.name = recording, begin, width, block, name
        self.read = 0
        self.time = np.zeros(0)
        self.raw = [np.zeros(0), np.zeros(0)]

    def windows(self, low: int, high: int) -> tuple[Array, list[Array], Array]:
        """Times, both channels and window numbers of the samples in windows low … high − 1; low never goes back."""
        start, stop = self.begin + low * self.width, self.begin + high * self.width
        while self.read < len(self.recording.c) and not (len(self.time) and self.time[-1] >= stop):
            more = slice(self.read, min(self.read + self.block, len(self.recording.c)))
            time = np.asarray(self.recording.time_s[more], float)  # type: ignore[index]
            joined = np.concatenate([self.time[-1:], time])
            wrong = np.flatnonzero(~(np.diff(joined) > 0))
            if len(wrong):
                at = int(wrong[0]) + self.read + (0 if len(self.time) else 1)
                raise HrgError(
                    f"{self.name}: time_s[{at}] = {joined[wrong[0] + 1]:.9g} s follows {joined[wrong[0]]:.9g} s; strictly increasing times were expected: "
                    "sort the samples or drop the repeated ones"
                )
            self.time = np.concatenate([self.time, time])
            self.raw = [
                np.concatenate([kept, np.asarray(channel[more], float)])
                for kept, channel in zip(self.raw, (self.recording.c, self.recording.s), strict=True)
            ]
            self.read = more.stop
        a, b = np.searchsorted(self.time, [start, stop])
        window = np.clip(((self.time[a:b] - self.begin) / self.width).astype(int), low, high - 1)
        out = self.time[a:b], [channel[a:b] for channel in self.raw], window
        keep = max(0, int(np.searchsorted(self.time, stop - 2 * (fitted.NEIGHBOURS + 1) * self.width)) - 1)
        self.time, self.raw = self.time[keep:], [channel[keep:] for channel in self.raw]
        return out
