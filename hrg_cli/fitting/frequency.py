"""Find an oscillation's frequency in both channels at once: the spectrum's peak, refined by the phase slope of short fits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Array = np.ndarray

PADDING = 4
"""Zero padding of the spectra, so that the peak lies within a tenth of a bin of its parabola's top."""


def even_spectrum(y: Array, sample_rate_hz: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and power, summed over the channels, of evenly sampled y (channels, n): mean removed, Hann window, zero padded.

    A channel's power is taken relative to nothing: the stronger channel leads.
    """
    n = y.shape[-1]
    window = np.hanning(n + 2)[1:-1]
    mean = (y * window).sum(-1, keepdims=True) / window.sum()
    size = 1 << int(np.ceil(np.log2(PADDING * n)))
    power = (np.abs(np.fft.rfft((y - mean) * window, size)) ** 2).sum(0)
    return np.fft.rfftfreq(size, 1 / sample_rate_hz), power


def peak(frequency_hz: Array, power: Array, low_hz: float, high_hz: float) -> tuple[float, float]:
    """Frequency of the highest point of a spectrum in [low, high] by a parabola through its logarithm, and its power over the median of the band."""
    inside = np.flatnonzero((frequency_hz >= low_hz) & (frequency_hz <= high_hz))
    if not len(inside):
        return float("nan"), 0.0
    top = inside[np.argmax(power[inside])]
    floor = float(np.median(power[inside]))
    ratio = float(power[top]) / floor if floor > 0 else (np.inf if power[top] > 0 else 0.0)
    offset = 0.0
    if 0 < top < len(power) - 1 and power[top - 1 : top + 2].min() > 0:
        a, b, c = np.log(power[top - 1 : top + 2])
        curvature = a - 2 * b + c
        if curvature < 0:
            offset = float(np.clip(0.5 * (a - c) / curvature, -0.5, 0.5))
    return float(frequency_hz[top] + offset * (frequency_hz[1] - frequency_hz[0])), ratio


def refine_even(y: Array, sample_rate_hz: float, frequency_hz: float, rounds: int = 3) -> float:
    """Frequency [Hz] of evenly sampled y (channels, n) near a start that is right within half of 1/duration.

    Sub-windows are fitted with cos, sin and a constant; the phase between halves of the record, weighted by the power of
    both channels, arg Σ u(t + T/2) u*(t), corrects the frequency. Needs four periods; with fewer the start is returned.
    """
    n = y.shape[-1]
    duration = n / sample_rate_hz
    for _ in range(rounds):
        samples = max(int(np.ceil(2 * sample_rate_hz / frequency_hz)), 6, n // 64)
        count = n // samples
        if count < 2:
            return least_squares_peak(np.arange(n) / sample_rate_hz, y, frequency_hz, 0.5 / duration)
        tau = (np.arange(samples) - (samples - 1) / 2) / sample_rate_hz
        basis = np.stack([np.cos(2 * np.pi * frequency_hz * tau), np.sin(2 * np.pi * frequency_hz * tau), np.ones(samples)], 1)
        fit = y[:, : count * samples].reshape(-1, count, samples) @ np.linalg.pinv(basis).T
        step = samples / sample_rate_hz
        u = (fit[..., 0] - 1j * fit[..., 1]) * np.exp(-2j * np.pi * frequency_hz * step * np.arange(count))
        lag = count // 2
        turn = np.angle((u[:, lag:] * u[:, : count - lag].conj()).sum())
        frequency_hz = float(frequency_hz + turn / (2 * np.pi * lag * step))
    return frequency_hz


def least_squares_power(time_s: Array, y: Array, frequency_hz: Array) -> Array:
    """Power explained by cos, sin and a constant, summed over the channels y (channels, n) at any times, for each frequency (k,).

    Lomb's periodogram with a floating mean: true least squares, for uneven times and few periods alike.
    """
    centred = time_s - time_s.mean()
    y = y - y.mean(-1, keepdims=True)
    power = np.empty(len(frequency_hz))
    rows = max(1, (1 << 20) // max(1, len(centred)))
    for start in range(0, len(frequency_hz), rows):
        phase = 2 * np.pi * np.multiply.outer(frequency_hz[start : start + rows], centred)
        basis = np.stack([np.cos(phase), np.sin(phase)], -1)
        basis -= basis.mean(1, keepdims=True)
        gram = np.einsum("fni,fnj->fij", basis, basis, optimize=True)
        gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(2)
        right = np.einsum("fni,cn->fic", basis, y, optimize=True)
        power[start : start + rows] = (right * np.linalg.solve(gram, right)).sum((1, 2))
    return power


def least_squares_peak(time_s: Array, y: Array, frequency_hz: float, width_hz: float, rounds: int = 4) -> float:
    """The frequency within ± `width_hz` of a start where least squares explains most power; the grid is narrowed `rounds` times."""
    for _ in range(rounds):
        grid = frequency_hz + np.linspace(-1, 1, 17) * width_hz
        grid = grid[grid > 0]
        frequency_hz = peak(grid, least_squares_power(time_s, y, grid), 0.0, np.inf)[0]
        width_hz /= 5
    return frequency_hz


def track(centre_s: Sequence[float], frequency_hz: Sequence[float], weight: Sequence[float]) -> tuple[Array, Array]:
    """Times and frequencies to interpolate between, from looks of which those without a clear line (weight 0) are left out."""
    keep = np.asarray(weight) > 0
    return np.asarray(centre_s)[keep], np.asarray(frequency_hz)[keep]
