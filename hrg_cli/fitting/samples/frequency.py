"""Find an oscillation's frequency in both channels at once: the spectrum's peak, refined by the
phase slope of short fits.

With a carrier ω_c the oscillation is the pair of side bands ω_c ∓ ω: `list_bands` gives the
frequencies to fit for an oscillation at f.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..medians import find_median
from ..parabola import find_peak_offset
from .basis import build_columns, build_rotations
from .spectrum import compute_chi_square_excess

Array = np.ndarray

PADDING = 2
"""Zero padding of the spectra, so that the parabola through the peak is right within a tenth of a
bin."""


def list_bands(frequency_hz: float, carrier_hz: float | None) -> tuple[float, ...]:
    """Frequencies of the signals: f itself, or the difference and sum with a carrier.

    Parameters
    ----------
    frequency_hz
        Of the oscillation.
    carrier_hz
        None: the oscillation is read directly.

    Returns
    -------
    tuple of float
        One or two, Hz.

    Examples
    --------
    >>> from hrg_cli.fitting.samples.frequency import list_bands
    >>> list_bands(5e3, None), list_bands(5e3, 40e3)
    ((5000.0,), (35000.0, 45000.0))
    """
    return (
        (frequency_hz,)
        if carrier_hz is None
        else (carrier_hz - frequency_hz, carrier_hz + frequency_hz)
    )


def fold(frequency_hz: float | Array, sample_rate_hz: float | None) -> Any:
    """A frequency as even sampling shows it, |f − n f_s|, between 0 and half the rate.

    Parameters
    ----------
    frequency_hz
        Of any shape.
    sample_rate_hz
        None or 0 where it is not known, or samples are not evenly apart: nothing is folded.

    Returns
    -------
    float or ndarray
        Of the same shape [Hz].

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.frequency import fold
    >>> fold(np.array([1000.0, 2000.0, 3000.0]), 2700.0).tolist(), fold(2000.0, None)
    ([1000.0, 700.0, 300.0], 2000.0)
    """
    if not sample_rate_hz:
        return frequency_hz
    half = sample_rate_hz / 2
    return np.abs((frequency_hz + half) % sample_rate_hz - half)


def list_nuisances(carrier_hz: float | None) -> tuple[float, ...]:
    """Frequencies fitted beside the signals: the carrier's own leakage.

    Parameters
    ----------
    carrier_hz
        None: the oscillation is read directly.

    Returns
    -------
    tuple of float
        Hz.

    Examples
    --------
    >>> from hrg_cli.fitting.samples.frequency import list_nuisances
    >>> list_nuisances(None), list_nuisances(40e3)
    ((), (40000.0,))
    """
    return () if carrier_hz is None else (carrier_hz,)


def compute_even_power(y: Array, sample_rate_hz: float) -> tuple[Array, Array]:
    """Power of evenly sampled channels, summed over them: mean removed, Hann window, zero padded.

    Parameters
    ----------
    y
        Samples (channels, n).
    sample_rate_hz
        Of them.

    Returns
    -------
    frequency_hz : ndarray
        (k,), from 0 to half the sampling rate.
    power : ndarray
        (k,), unit of the samples squared, not normalised.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.frequency import compute_even_power
    >>> t = np.arange(1000) / 1000
    >>> hz, power = compute_even_power(np.cos(2 * np.pi * 125 * t)[None], 1000.0)
    >>> float(hz[np.argmax(power)])
    125.0
    """
    n = y.shape[-1]
    window = np.hanning(n + 2)[1:-1]
    mean = (y * window).sum(-1, keepdims=True) / window.sum()
    # A power of two: a transform of a length with a large prime factor is many times slower.
    size = 1 << int(np.ceil(np.log2(PADDING * n)))
    power = (np.abs(np.fft.rfft((y - mean) * window, size)) ** 2).sum(0)
    return np.fft.rfftfreq(size, 1 / sample_rate_hz), power


def compute_least_squares_power(time_s: Array, y: Array, frequency_hz: Array) -> Array:
    """Power explained by cos, sin and a constant, summed over the channels, on an even grid of
    frequencies.

    Lomb's periodogram with a floating mean: true least squares, for uneven times and few periods
    alike. All sums follow from E = e^{jωt}: Σcos² and Σcos·sin from ΣE², the mean from ΣE, the
    right side from ΣyE.

    Parameters
    ----------
    time_s
        Of the samples (n,), s.
    y
        Samples (channels, n).
    frequency_hz
        The grid (k,), rising by equal steps.

    Returns
    -------
    ndarray
        (k,): by how much the sum of squares about the mean falls.

    Examples
    --------
    A cosine of amplitude 2 at uneven times has 2²/2 a sample:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.frequency import compute_least_squares_power
    >>> t = np.sort(np.random.default_rng(0).uniform(0, 10, 5000))
    >>> y = 2 * np.cos(2 * np.pi * 7 * t + 0.4)[None] + 5
    >>> power = compute_least_squares_power(t, y, np.array([6.0, 7.0, 8.0]))
    >>> (power / len(t)).round(2).tolist()
    [0.0, 2.0, 0.0]
    """
    n = len(time_s)
    centred = time_s - time_s.mean()
    y = y - y.mean(-1, keepdims=True)
    power = np.empty(len(frequency_hz))
    rows = max(1, (1 << 15) // n)
    for start in range(0, len(frequency_hz), rows):
        turn = build_rotations(centred, frequency_hz[start : start + rows])
        total, square = turn.sum(1), np.einsum("kn,kn->k", turn, turn)
        right = turn @ y.T
        cc = (n + square.real) / 2 - total.real**2 / n
        ss = (n - square.real) / 2 - total.imag**2 / n
        cs = square.imag / 2 - total.real * total.imag / n
        # At 0 and at half of an even rate the sine vanishes: its sum of squares must not be divided
        # by.
        cc, ss = cc + 1e-9 * n, ss + 1e-9 * n
        yc, ys = right.real, right.imag
        explained = (
            (yc**2).sum(1) * ss + (ys**2).sum(1) * cc - 2 * (yc * ys).sum(1) * cs
        ) / np.maximum(cc * ss - cs**2, 1e-18 * n * n)
        power[start : start + rows] = explained
    return power


def fold_carrier(frequency_hz: Array, power: Array, carrier_hz: float) -> tuple[Array, Array]:
    """Power against the oscillation's frequency of its side bands about a carrier.

    At f it is the geometric mean of that at |f_c − f| and at f_c + f, so that a lone line counts
    little.

    Parameters
    ----------
    frequency_hz
        Even grid (n,), from 0.
    power
        On it (n,).
    carrier_hz
        f_c.

    Returns
    -------
    frequency_hz : ndarray
        Of the oscillation (k,), up to the grid's end less f_c.
    power : ndarray
        (k,).

    Examples
    --------
    A pair of side bands 5 Hz from a carrier of 40 Hz, beside a stronger lone line:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.frequency import fold_carrier
    >>> power = np.ones(61)
    >>> power[[35, 45, 52]] = 100, 100, 1000
    >>> hz, folded = fold_carrier(np.arange(61.0), power, 40.0)
    >>> float(hz[np.argmax(folded)]), float(folded.max())
    (5.0, 100.0)
    """
    step = frequency_hz[1] - frequency_hz[0]
    grid = np.arange(1, int((float(frequency_hz[-1]) - carrier_hz) / step)) * step
    low, high = (
        np.interp(np.abs(carrier_hz - grid), frequency_hz, power),
        np.interp(carrier_hz + grid, frequency_hz, power),
    )
    return grid, np.sqrt(low * high)


def find_peak(
    frequency_hz: Array, power: Array, low_hz: float, high_hz: float
) -> tuple[float, float]:
    """Frequency of the highest local maximum of a spectrum in a band, by a parabola through its
    logarithm, and its power over the floor.

    The floor is the median within a factor two of the peak's frequency, so that a noise that falls
    with frequency does not pass for a line.

    Parameters
    ----------
    frequency_hz
        Even grid (n,).
    power
        On it (n,).
    low_hz, high_hz
        The band.

    Returns
    -------
    frequency_hz : float
        NaN where there is no maximum.
    ratio : float
        0 there.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.frequency import find_peak
    >>> hz = np.arange(100.0)
    >>> frequency, ratio = find_peak(hz, 1 + 1e4 * np.exp(-((hz - 40.3) ** 2)), 10.0, 90.0)
    >>> round(frequency, 3), round(ratio)
    (40.3, 9140)
    """
    inside = np.flatnonzero((frequency_hz >= low_hz) & (frequency_hz <= high_hz))
    inside = inside[(inside > 0) & (inside < len(power) - 1)]
    inside = inside[(power[inside] >= power[inside - 1]) & (power[inside] >= power[inside + 1])]
    if not len(inside):
        return float("nan"), 0.0
    top = inside[np.argmax(power[inside])]
    near = power[
        (frequency_hz >= 0.5 * frequency_hz[top]) & (frequency_hz <= 2 * frequency_hz[top])
    ]
    below = float(find_median(near))
    ratio = float(power[top]) / below if below > 0 else (np.inf if power[top] > 0 else 0.0)
    offset = float(np.clip(find_peak_offset(power[top - 1 : top + 2]), -0.5, 0.5))
    return float(frequency_hz[top] + offset * (frequency_hz[1] - frequency_hz[0])), ratio


def compute_detection_ratio(segments: int, bins: int) -> float:
    """Peak over median above which noise alone passes once in about 10⁵ recordings (χ² of two
    channels' averaged spectra).

    Parameters
    ----------
    segments
        Spectra that are averaged.
    bins
        Independent ones, of which the highest is taken.

    Returns
    -------
    float
        Falls towards 1.3 with the segments.

    Examples
    --------
    >>> from hrg_cli.fitting.samples.frequency import compute_detection_ratio
    >>> [round(compute_detection_ratio(segments, 1000), 2) for segments in (1, 16)]
    [16.06, 3.12]
    """
    # 4.3 σ is one in 10⁵ for a single bin; a decade more of bins wants half a σ more.
    sigmas = 4.3 + 0.5 * np.log10(max(10, bins))
    return 1.3 * compute_chi_square_excess(4 * max(1, segments), sigmas)


def refine_frequency(
    time_s: Array, y: Array, frequency_hz: float, carrier_hz: float | None = None, rounds: int = 3
) -> float:
    """Frequency of an oscillation near a start that is right within half of 1/duration.

    Sub-windows are fitted at their true times; the phase between the record's halves, weighted by
    power over both channels and side bands, arg Σ u(t + T/2) u*(t), corrects the frequency. With
    too few sub-windows, a narrowing least-squares scan.

    Parameters
    ----------
    time_s
        Of the samples (n,), s.
    y
        Samples (channels, n).
    frequency_hz
        The start.
    carrier_hz
        None: the oscillation is read directly.
    rounds
        Corrections, each from the frequency of the one before.

    Returns
    -------
    float
        Hz.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.frequency import refine_frequency
    >>> t = np.arange(10000) / 10000
    >>> y = np.cos(2 * np.pi * 1234.5678 * t)[None]
    >>> round(refine_frequency(t, y, 1234.2), 4)
    1234.5678
    """
    n = y.shape[-1]
    duration = float(time_s[-1] - time_s[0]) * n / max(1, n - 1)
    f = list_bands(frequency_hz, carrier_hz)
    # Two periods at least, so that cos, sin and a constant are apart; and no more than 64 sub-
    # windows, each a fit.
    samples = max(int(np.ceil(2 * n / (frequency_hz * duration))), 4 * len(f) + 4, n // 64)
    count = n // samples
    steps = np.diff(time_s)
    broken = len(steps) and steps.max() > 3 * find_median(steps)
    # The phase between halves wants two sub-windows in each, and means nothing across a gap.
    if count < 4 or broken:
        return (
            _scan(time_s, y, frequency_hz, 0.5 / duration) if carrier_hz is None else frequency_hz
        )
    t = time_s[: count * samples].reshape(count, samples)
    centre = t.mean(1)
    # Half the record, so that every sub-window counts once; its phase is known modulo 2π, hence how
    # right the start must be.
    lag = count // 2
    sign = np.array([1.0]) if carrier_hz is None else np.array([-1.0, 1.0])
    even = np.allclose(steps, steps[0], rtol=1e-6)
    y = y[:, : count * samples].reshape(-1, count, samples)
    for _ in range(rounds):
        # even sub-windows are alike about their middles: one basis serves all
        u = _fit_sub_envelopes(
            t, centre, y, list_bands(frequency_hz, carrier_hz), list_nuisances(carrier_hz), even
        )
        cross = (u[:, lag:] * u[:, : count - lag].conj()).sum((0, 1))
        # The lower side band turns against the oscillation.
        cross = np.where(sign < 0, cross.conj(), cross).sum()
        frequency_hz = float(
            frequency_hz
            + np.angle(cross) / (2 * np.pi * float(np.mean(centre[lag:] - centre[: count - lag])))
        )
    return frequency_hz


def _fit_sub_envelopes(
    t: Array, centre: Array, y: Array, f: tuple[float, ...], beside: tuple[float, ...], alike: bool
) -> Array:
    """Envelopes (channels, windows, tones) of y (channels, windows, n) against e^{jωt}, fitted at
    the times t (windows, n) about their centres (windows,); one basis for all where they are
    alike."""
    some = slice(0, 1) if alike else slice(None)
    basis = [
        build_columns(row - mid, f, beside) for row, mid in zip(t[some], centre[some], strict=True)
    ]
    inverse = np.linalg.pinv(np.stack(basis))[:, : 2 * len(f)]
    fit = np.einsum("wan,cwn->cwa", np.broadcast_to(inverse, (len(centre), *inverse.shape[1:])), y)
    return np.asarray(
        (fit[..., 0::2] - 1j * fit[..., 1::2])
        * np.exp(-2j * np.pi * np.multiply.outer(centre, np.asarray(f)))
    )


def _scan(time_s: Array, y: Array, frequency_hz: float, width_hz: float, rounds: int = 5) -> float:
    """The frequency within ± `width_hz` of a start where least squares explains most power; the
    grid narrows with each round."""
    for _ in range(rounds):
        grid = frequency_hz + np.linspace(-1, 1, 17) * width_hz
        grid = grid[grid > 0]
        power = compute_least_squares_power(time_s, y, grid)
        frequency_hz = float(grid[np.argmax(power)])
        # Sixteen intervals narrowed by five: the next grid reaches over more than one of this
        # one's.
        width_hz /= 5
    return frequency_hz
