"""demodulate: samples of the two channels -> least-squares signals a window, against one constant reference frequency.

C = c_cos·cos ω_r t + c_sin·sin ω_r t (CONTRACT), so C0 = c_cos − j·c_sin at the window's centre. Every window of a fixed
number of samples shares one least-squares basis about its centre at the local frequency; one matrix product serves a
block, one turn by the reference phase at each centre makes the signals. No whole periods are needed and nothing leaks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting import frequency as finding
from ..fitting.basis import WindowBasis, window_basis
from ..records import FLAG_CLIPPED, FLAG_NOT_FINITE, Array, Periods, Recording

LOOKS, LOOK_SAMPLES = 48, 1 << 14
"""Places along the recording where the frequency is found, and samples a look."""

CHUNK_SAMPLES = 1 << 16
"""Samples that share one local basis frequency."""


@dataclass(frozen=True)
class Survey:
    """What a few looks along the recording show: reference frequency, its course, and levels to judge the windows by."""

    reference_hz: float
    track_s: Array
    track_hz: Array
    rails: tuple[tuple[float, float], tuple[float, float]]
    notes: list[tuple[str, str]] = field(default_factory=list)

    def frequency_hz(self, time_s: float) -> float:
        """Local frequency, interpolated between the looks."""
        return float(np.interp(time_s, self.track_s, self.track_hz))


def demodulate(
    recording: Recording,
    *,
    periods_per_window: Annotated[float, Field(gt=0, description="oscillation periods a window, any fraction")] = 1.0,
    block_samples: Annotated[int, Field(gt=0, description="samples worked on at once (memory, not results, depends on it)")] = 1 << 20,
) -> Iterator[Periods]:
    """Signals a window as a stream of Periods; memory does not grow with the recording.

    HrgError: no samples, no oscillation in either channel, a frequency above half the sampling rate, times that do not increase.
    """
    rate = recording.sample_rate_hz
    if len(recording.c) != len(recording.s):
        raise HrgError(f"{_name(recording)}: channel C has {len(recording.c)} samples and S {len(recording.s)}; equal lengths were expected")
    if rate is None or recording.time_s is not None or recording.readout != "direct":
        raise HrgError(f"{_name(recording)}: only even sampling and direct read-out are demodulated")
    yield from _even(recording, rate, periods_per_window, block_samples)


def _name(recording: Recording) -> str:
    return f"run {recording.run_id}" if recording.run_id else "the recording"


def _even(recording: Recording, rate: float, periods: float, block_samples: int) -> Iterator[Periods]:
    survey = _survey(recording, rate)
    f = survey.reference_hz
    n = len(recording.c)
    samples, basis = _window(rate, f, periods, n, _name(recording))
    windows = n // samples
    chunk = max(1, CHUNK_SAMPLES // samples)
    step = chunk * max(1, block_samples // (chunk * samples))
    group = max(1, int(np.ceil(400 / max(1, basis.freedom))))
    for first in range(0, windows, step):
        last = min(first + step, windows)
        raw = [np.asarray(channel[first * samples : last * samples]) for channel in (recording.c, recording.s)]
        times = (np.arange(first, last) * samples + (samples - 1) / 2) / rate
        signals = np.empty((last - first, 4))
        std = np.empty_like(signals)
        rms = np.empty((last - first, 2))
        flags = np.zeros(last - first, "u1")
        for start in range(0, last - first, chunk):
            rows = slice(start, min(start + chunk, last - first))
            local = survey.frequency_hz(float(times[rows].mean()))
            basis = window_basis(samples, rate, (local,))
            turn = np.exp(-2j * np.pi * np.fmod(times[rows] * f, 1.0))
            for k in range(2):
                piece = raw[k][rows.start * samples : rows.stop * samples].astype(float).reshape(-1, samples)
                scale = recording.c_scale_factor if k == 0 else recording.s_scale_factor
                envelope, residual2 = _fit(piece, basis)
                envelope = envelope * turn * scale
                signals[rows, 2 * k], signals[rows, 2 * k + 1] = envelope.real, -envelope.imag
                quantum = 1 / 12 if np.issubdtype(raw[k].dtype, np.integer) else 0.0
                rms[rows, k] = np.sqrt(residual2 / samples) * abs(scale)
                sigma = np.sqrt(np.maximum(_pooled(residual2 / max(1, basis.freedom), group), quantum)) * abs(scale)
                sigma = np.maximum(sigma, 1e-15 * np.abs(envelope))
                c2, s2 = turn.real**2, turn.imag**2
                std[rows, 2 * k] = sigma * np.sqrt(basis.covariance[0, 0] * c2 + basis.covariance[1, 1] * s2)
                std[rows, 2 * k + 1] = sigma * np.sqrt(basis.covariance[0, 0] * s2 + basis.covariance[1, 1] * c2)
                flags[rows][~np.isfinite(residual2)] |= FLAG_NOT_FINITE
                low, high = survey.rails[k]
                if piece.max() >= high or piece.min() <= low:
                    flags[rows][(piece.max(1) >= high) | (piece.min(1) <= low)] |= FLAG_CLIPPED
        yield Periods(
            time_s=times,
            signals=signals,
            signals_std=std,
            residual_rms=rms,
            flags=flags,
            **_auxiliary(recording, times),
            reference_frequency_hz=f,
            periods_per_window=samples * f / rate,
            window_s=samples / rate,
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


def _fit(piece: Array, basis: WindowBasis) -> tuple[Array, Array]:
    """Envelope p − jq about each window's centre and the residual's sum of squares, of windows (rows, samples)."""
    q = piece @ basis.orthonormal
    fit = q @ basis.triangle
    residual2 = np.maximum(np.einsum("ij,ij->i", piece, piece) - np.einsum("ij,ij->i", q, q), 0.0)
    return fit[:, 0] - 1j * fit[:, 1], residual2


def _pooled(variance: Array, group: int) -> Array:
    """Mean of each `group` neighbours, given back to each of them; a window far above its neighbours keeps its own."""
    starts = np.arange(0, len(variance), group)
    if len(starts) > 1 and len(variance) - starts[-1] < group / 2:
        starts = starts[:-1]
    counts = np.diff(np.append(starts, len(variance)))
    finite = np.nan_to_num(variance)
    mean = np.repeat(np.add.reduceat(finite, starts) / counts, counts)
    return np.where(np.isfinite(variance), mean, np.nan)


def _window(rate: float, frequency_hz: float, periods: float, n: int, name: str) -> tuple[int, WindowBasis]:
    samples = max(int(round(periods * rate / frequency_hz)), 5)
    while samples <= n:
        basis = window_basis(samples, rate, (frequency_hz,))
        if basis.condition < (1e3 if samples * frequency_hz / rate < 0.9 else 30):
            return samples, basis
        samples += 1
    raise HrgError(f"{name}: {n} samples are too few for one window of {periods:g} periods at {frequency_hz:g} Hz; record longer or set periods_per_window lower")


def _survey(recording: Recording, rate: float) -> Survey:
    n = len(recording.c)
    length = min(n, LOOK_SAMPLES)
    starts = np.unique(np.linspace(0, n - length, min(LOOKS, max(1, n // length))).astype(int))
    looks = [np.stack(recording.physical(a, a + length)) for a in starts]
    nyquist = rate / 2
    nominal = recording.nominal_frequency_hz
    low, high = (3 * rate / length, nyquist) if nominal is None else (0.9 * nominal, min(1.1 * nominal, nyquist))
    spectra = [finding.even_spectrum(np.nan_to_num(look), rate) for look in looks]
    found, ratio = finding.peak(spectra[0][0], np.sum([power for _, power in spectra], 0), low, high)
    if not np.isfinite(found) or not ratio > 20:
        raise HrgError(f"{_name(recording)}: no oscillation stands out between {low:g} and {high:g} Hz in either channel; check the recording or its nominal_frequency_hz")
    frequencies, weights = [], []
    for look, (grid, power) in zip(looks, spectra, strict=True):
        local, clear = finding.peak(grid, power, 0.99 * found - 2 * rate / length, 1.01 * found + 2 * rate / length)
        frequencies.append(finding.refine_even(np.nan_to_num(look), rate, local))
        weights.append(clear if np.isfinite(clear) else 1.0)
    centres = (starts + (length - 1) / 2) / rate
    track_s, track_hz = finding.track(centres, frequencies, weights)
    return Survey(float(np.round(np.median(track_hz), 6)), track_s, track_hz, _rails(recording))


def _rails(recording: Recording) -> Any:
    out = []
    for channel in (recording.c, recording.s):
        if np.issubdtype(channel.dtype, np.integer):
            info = np.iinfo(channel.dtype)
            out.append((float(info.min), float(info.max)))
        else:
            out.append((-np.inf, np.inf))
    return tuple(out)


def _auxiliary(recording: Recording, times: Array) -> dict[str, Array]:
    names = ("temperature_degc", "rate_rad_s", "drive_main", "drive_quadrature")
    log = recording.auxiliary_time_s
    if log is None or not len(log):
        return {}
    log = np.asarray(log)
    return {name: np.interp(times, log, np.asarray(getattr(recording, name))) for name in names if getattr(recording, name) is not None}
