"""Diagnosis, tones near the resonance: what beats in the envelopes at a fixed frequency, seen at
the windows' own rate.

The residual of the fitted model at every window, a fixed vector e e^{j(ω_m − ω_r)t}, is one-sided
in frequency about the resonance; a modulation of the resonator or of the read-out has both
sidebands and is left to the open search.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...fitting.causes.extended_fit import DivergedError, Fit
from ...physics import ellipse
from ...records import Wave
from .thresholds import GROSS

Array = np.ndarray
NEAREST_CYCLES = 4.0
"""Cycles of beat with every run's own frequency in the shortest run from which a tone is looked
for."""
ONE_SIDED = 6.0
FINE = 41
MOST_TONES = 4
DIES, SURE = 0.7, 4.0
"""Part of its power that a tone has in the second half of the runs at least, and σ by which less
must be sure."""
TONE_LEAVES = 0.8
"""Part of a gross misfit's χ² that a tone may leave."""


@dataclass(frozen=True)
class Tone:
    """A tone: frequency, complex amplitudes e (R, 2) of every run at t = 0 of the run, σ of one
    real part (R,), χ² it takes away.

    `standing`: as strong in the second half of the runs as in the first; a partial of the resonator
    dies away.
    """

    frequency_hz: float
    vector: Array
    std: Array
    gain: float
    standing: bool = True


def residuals(fit: Fit, waves: Sequence[Wave]) -> list[tuple[Array, Array, Array]]:
    """Of every run: times, envelopes measured less modelled (n, 2) against the common reference, σ,
    at the windows' own rate."""
    from scipy.interpolate import CubicSpline

    out = []
    reference = fit.series.reference_frequency_hz
    for k, wave in enumerate(waves):
        good = wave.good()
        t = np.asarray(wave.time_s, float)[good]
        measured = ellipse.envelopes(
            wave.main_amplitude,
            wave.quadrature_amplitude,
            wave.wave_angle_rad,
            wave.phase_rad,
            wave.mode_number,
        )[good]
        measured = (
            measured * np.exp(2j * np.pi * (wave.reference_frequency_hz - reference) * t)[:, None]
        )
        rows = fit.series.weight[k] > 0
        at = fit.series.time_s[k][rows]
        slow = np.exp(-1j * fit.point.offset_rad_s[k] * at)[:, None]
        model = (
            CubicSpline(at, fit.prediction.seen[k][rows] * slow)(t)
            * np.exp(1j * fit.point.offset_rad_s[k] * t)[:, None]
        )
        out.append((t, measured - model, np.asarray(wave.signal_std, float)[good]))
    return out


def strongest(fit: Fit, waves: Sequence[Wave]) -> Tone | None:
    """The strongest one-sided tone that stands out of its surroundings by chance once in a million,
    common to the runs in frequency."""
    from scipy.special import chdtrc

    data = residuals(fit, waves)
    step = float(np.median([np.median(np.diff(t)) for t, _, _ in data]))
    longest = max(float(t[-1] - t[0]) for t, _, _ in data)
    shortest = min(float(t[-1] - t[0]) for t, _, _ in data)
    size = 1 << int(np.ceil(np.log2(2 * longest / step + 8)))
    power, used = np.zeros(size), 0
    for t, r, std in data:
        place = np.round((t - t[0]) / step).astype(int)
        if np.any(np.abs((t - t[0]) / step - place) > 0.05) or place[-1] >= size:
            continue
        taper = np.hanning(len(t) + 2)[1:-1]
        scale = np.sqrt(np.sum((taper * std) ** 2))
        for channel in (0, 1):
            line = np.zeros(size, complex)
            line[place] = r[:, channel] * taper / scale
            power += np.abs(np.fft.fft(line)) ** 2
        used += 1
    if used == 0:
        return None
    offset = float(np.mean(fit.point.offset_rad_s)) / (2 * np.pi)
    frequency = np.fft.fftfreq(size, step)
    floor = _floor(np.fft.fftshift(power))
    relative = np.fft.ifftshift(np.fft.fftshift(power) / floor)
    distance = frequency - offset
    mirror = np.interp(
        offset - distance, np.fft.fftshift(frequency), np.fft.fftshift(power), period=1 / step
    )
    # of a sum of 2·used exponentials, its median set to 1
    expected = 4 * used * np.maximum(relative, 0)
    own = fit.point.offset_rad_s / (2 * np.pi)
    nearest = np.min(np.abs(frequency[:, None] - own), axis=1)
    wanted = (
        (nearest * shortest > NEAREST_CYCLES)
        & (power > ONE_SIDED * mirror)
        & (chdtrc(4 * used, expected) < 1e-6 / size)
    )
    if not wanted.any():
        return None
    best = float(frequency[np.argmax(np.where(wanted, power, 0))])
    width = 1 / longest
    for _ in range(3):
        trial = best + width * np.linspace(-1, 1, FINE)
        total = sum(
            np.abs(np.exp(-2j * np.pi * np.outer(trial, t)) @ (r / std[:, None])) ** 2 / len(t)
            for t, r, std in data
        )
        best = float(trial[np.argmax(np.sum(total, axis=1))])
        width /= 8
    vector = np.array(
        [np.mean(r * np.exp(-2j * np.pi * best * t)[:, None], axis=0) for t, r, _ in data]
    )
    std = np.array([float(np.median(s)) / np.sqrt(len(s)) for _, _, s in data])
    gain = float(np.sum(np.abs(vector) ** 2 / std[:, None] ** 2))
    return Tone(best + fit.series.reference_frequency_hz, vector, std, gain, _stands(data, best))


def _stands(data: Sequence[tuple[Array, Array, Array]], beat_hz: float) -> bool:
    """Whether a tone keeps its size: power in the runs' second halves against the first, each less
    what noise has."""
    powers = np.zeros(2)
    unsure = 0.0
    for t, r, std in data:
        for half, part in enumerate(np.array_split(np.arange(len(t)), 2)):
            noise = 2 * float(np.median(std[part])) ** 2 / len(part)
            power = (
                np.abs(np.mean(r[part] * np.exp(-2j * np.pi * beat_hz * t[part])[:, None], axis=0))
                ** 2
            )
            powers[half] += float(np.sum(power) - 2 * noise)
            unsure += float(np.sum(2 * power * noise + noise**2))
    return bool(powers[1] > DIES * powers[0] - SURE * np.sqrt(unsure))


def _floor(power: Array, width: int = 101) -> Array:
    """Running median, of a spectrum already in order of frequency; the least is a thousandth of the
    overall median."""
    width = min(width, len(power) // 2 * 2 - 1)
    padded = np.pad(power, width // 2, mode="wrap")
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    return np.maximum(median, 1e-3 * np.median(power))


def without(waves: Sequence[Wave], tone: Tone) -> list[Wave]:
    """The waves with the tone taken out of every run."""
    out = []
    for wave, e in zip(waves, tone.vector, strict=True):
        t = np.asarray(wave.time_s, float)
        u = ellipse.envelopes(
            wave.main_amplitude,
            wave.quadrature_amplitude,
            wave.wave_angle_rad,
            wave.phase_rad,
            wave.mode_number,
        )
        u = (
            u
            - e
            * np.exp(2j * np.pi * (tone.frequency_hz - wave.reference_frequency_hz) * t)[:, None]
        )
        a_A, a_B, angle, phase = ellipse.wave(u, wave.mode_number)
        angle, phase = ellipse.unwrap(angle, phase, wave.mode_number)
        out.append(
            wave.replace(
                main_amplitude=a_A, quadrature_amplitude=a_B, wave_angle_rad=angle, phase_rad=phase
            )
        )
    return out


def taken_out(
    fit: Fit, waves: Sequence[Wave], fitted: Callable[[Sequence[Wave]], Fit]
) -> tuple[Fit, list[Wave], list[Tone]]:
    """The fit and the waves without the tones found one after another, and these; `fitted`: the
    base model's fit to waves."""
    left, tones = list(waves), list[Tone]()
    while len(tones) < MOST_TONES and (tone := strongest(fit, left)) is not None:
        if not tone.standing:
            return fit, left, [*tones, tone]  # listed and not taken out
        cleaned = without(left, tone)
        try:
            rest = fitted(cleaned)
        except DivergedError:  # what is left has no fit: it was no tone
            break
        if fit.chi2 > GROSS * fit.dof and rest.chi2 > TONE_LEAVES * fit.chi2:
            break  # a line of a gross misfit of the motion
        fit, left = rest, cleaned
        tones.append(tone)
    return fit, left, tones
