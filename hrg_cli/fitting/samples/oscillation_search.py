"""The oscillation in a recording's looks: its frequency by the power of all, and the course of it
from look to look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import HrgError
from . import frequency as finding
from .looks import Look, keep_together, measure_span

Array = np.ndarray

NOMINAL_BAND = 0.1
"""A nominal frequency narrows the search to this part of it on either side."""

CLEAR = 15.0
"""Power of the line over that around it from which a single look tells the frequency there."""

Spectra = list[tuple[Array, Array]]


@dataclass(frozen=True)
class SpectralPeak:
    """The highest peak: its frequency, its power over that around it, and the ratio from which it
    is an oscillation by more than chance; sentences of doubt."""

    frequency_hz: float
    ratio: float
    limit: float
    suspect: tuple[str, ...] = ()


def search_oscillation(
    looks: Sequence[Look],
    spectra: Spectra,
    step_s: float,
    carrier_hz: float | None,
    nominal_hz: float | None,
    name: str,
) -> SpectralPeak:
    """The oscillation in the power of all looks: near the nominal frequency where one is known,
    else the highest peak of all.

    Parameters
    ----------
    looks
        Along the recording.
    spectra
        Frequencies and powers of each look (k,); empty for uneven sampling, where they are summed.
    step_s
        Median sampling step.
    carrier_hz
        None: the oscillation is read directly.
    nominal_hz
        Expected frequency; None: none is.
    name
        Of the recording, for what is said of it.

    Returns
    -------
    SpectralPeak
        With a doubt where nothing stands out near the nominal frequency.

    Raises
    ------
    HrgError
        A carrier or a nominal frequency that the sampling does not hold, no peak at all.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.frequency import compute_even_power
    >>> from hrg_cli.fitting.samples.looks import take_looks
    >>> from hrg_cli.fitting.samples.oscillation_search import search_oscillation
    >>> c = np.cos(2 * np.pi * 5003.0 * np.arange(50_000) / 64e3)
    >>> c += 0.1 * np.random.default_rng(0).standard_normal(50_000)
    >>> looks = take_looks(Recording(c=c, s=c, sample_rate_hz=64e3, mode="free"), True, "run")
    >>> spectra = [compute_even_power(look.y, 64e3) for look in looks]
    >>> found = search_oscillation(looks, spectra, 1 / 64e3, None, None, "run")
    >>> round(found.frequency_hz), found.ratio > found.limit
    (5003, True)
    """
    nyquist = 0.5 / step_s
    top = nyquist if carrier_hz is None else nyquist - carrier_hz
    _need_within_band(carrier_hz, nominal_hz, nyquist, name)
    grid, power = _sum_power(looks, spectra, step_s, carrier_hz, nominal_hz)
    resolution = 1 / measure_span(looks[0])
    limit = finding.compute_detection_ratio(len(looks), len(grid) // finding.PADDING)
    if nominal_hz is not None:
        found, ratio = finding.find_peak(
            grid, power, (1 - NOMINAL_BAND) * nominal_hz, (1 + NOMINAL_BAND) * nominal_hz
        )
        if ratio > limit:
            return SpectralPeak(found, ratio, limit)
        hint, _ = finding.find_peak(grid, power, 1.5 * resolution, top)
        doubt = (
            f"nothing stands out within 10 % of the nominal frequency of {nominal_hz:g} Hz;"
            f" the highest peak lies at {hint:.6g} Hz"
        )
        return SpectralPeak(found if np.isfinite(found) else nominal_hz, ratio, limit, (doubt,))
    # below 1.5 lines the leakage of a constant offset is higher than a weak oscillation; only a
    # record of hardly a period leaves nothing else
    found, ratio = finding.find_peak(grid, power, 1.5 * resolution, top)
    if not np.isfinite(found):
        found, ratio = finding.find_peak(grid, power, 0.5 * resolution, top)
    if not np.isfinite(found):
        raise HrgError(
            f"{name}: no oscillation between 0 and {top:g} Hz in either channel; several periods"
            " were expected: check it or record longer"
        )
    return SpectralPeak(found, ratio, limit)


def _need_within_band(
    carrier_hz: float | None, nominal_hz: float | None, nyquist: float, name: str
) -> None:
    """HrgError: the carrier, or the highest side band expected, is above half the sampling rate."""
    top = nyquist if carrier_hz is None else nyquist - carrier_hz
    if carrier_hz is not None and not 0 < carrier_hz < nyquist:
        raise HrgError(
            f"{name}: its carrier of {carrier_hz:g} Hz is above half the sampling rate ({nyquist:g}"
            " Hz); sample faster or correct it"
        )
    if nominal_hz is not None and not 0 < nominal_hz < top:
        what = (
            "its nominal frequency"
            if carrier_hz is None
            else "the sum of its carrier and its nominal frequency"
        )
        value = nominal_hz if carrier_hz is None else nominal_hz + carrier_hz
        raise HrgError(
            f"{name}: {what}, {value:g} Hz, is not between 0 and half the sampling rate"
            f" ({nyquist:g} Hz); sample faster or correct it"
        )


def _sum_power(
    looks: Sequence[Look],
    spectra: Spectra,
    step_s: float,
    carrier_hz: float | None,
    nominal_hz: float | None,
) -> tuple[Array, Array]:
    """Frequencies [Hz] and the looks' power there; both side bands of a carrier folded onto the
    oscillation."""
    if spectra:
        grid, power = spectra[0][0], np.sum([p for _, p in spectra], 0)
    else:
        # direct sums are dear: the shortest looks alone, on the coarsest grid that misses no line
        some = sorted(looks, key=measure_span)[:3]
        span = min(measure_span(some[0]), 4 * len(some[0].time_s) * step_s)
        band = (
            (0.9 * nominal_hz, 1.1 * nominal_hz)
            if nominal_hz is not None and carrier_hz is None
            else (0.5 / span, 0.5 / step_s)
        )
        grid = np.arange(max(0.5, band[0] * span), band[1] * span, 0.5) / span
        power = np.sum(
            [finding.compute_least_squares_power(look.time_s, look.y, grid) for look in some], 0
        )
    if carrier_hz is not None:
        grid, power = finding.fold_carrier(grid, power, carrier_hz)
    return grid, power


def follow_frequency(
    looks: Sequence[Look], spectra: Spectra, step_s: float, found: float, carrier_hz: float | None
) -> tuple[Array, Array]:
    """Times and frequencies of the looks in which the line is clear.

    Parameters
    ----------
    looks, spectra, step_s, carrier_hz
        As in `search_oscillation`.
    found
        Frequency of the oscillation in all of them, Hz.

    Returns
    -------
    time_s : ndarray
        Middles of the looks (k,).
    frequency_hz : ndarray
        (k,); where no look is clear, the one that was found, at time 0.

    Examples
    --------
    A frequency that rises by 2 Hz per second:

    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.frequency import compute_even_power
    >>> from hrg_cli.fitting.samples.looks import take_looks
    >>> from hrg_cli.fitting.samples.oscillation_search import follow_frequency
    >>> t = np.arange(64_000) / 64e3
    >>> c = np.cos(2 * np.pi * (5003.0 * t + t**2))
    >>> looks = take_looks(Recording(c=c, s=c, sample_rate_hz=64e3, mode="free"), True, "run")
    >>> spectra = [compute_even_power(look.y, 64e3) for look in looks]
    >>> middle, hz = follow_frequency(looks, spectra, 1 / 64e3, 5004.0, None)
    >>> len(hz), float(np.abs(hz - 5003 - 2 * middle).max().round(2))
    (3, 0.0)
    """
    times, frequencies = [], []
    for number, whole in enumerate(looks):
        # The parts on either side of a gap are in step at the true frequency and at others, one
        # turn over the gap apart: one of the parts alone tells it.
        look = whole if spectra else keep_together(whole)
        # A look of which samples are lost resolves no better than those left, were they together;
        # four times that bounds the grid.
        span = min(measure_span(look), 4 * len(look.time_s) * step_s)
        # A run's frequency moves by less than 1 % (1e-4/K over 100 K), and noise moves a peak by a
        # line or two.
        reach = 0.01 * found + 2 / span
        if spectra:
            grid, power = spectra[number]
            if carrier_hz is not None:
                grid, power = finding.fold_carrier(grid, power, carrier_hz)
        else:
            grid = np.arange(max(0.5 / span, found - 4 * reach), found + 4 * reach, 0.5 / span)
            power = finding.compute_least_squares_power(look.time_s, look.y, grid)
        local, ratio = finding.find_peak(grid, power, found - reach, found + reach)
        if not np.isfinite(local):
            local, ratio = found, 0.0
        if ratio > CLEAR or len(looks) == 1:
            times.append(float(look.time_s.mean()))
            frequencies.append(finding.refine_frequency(look.time_s, look.y, local, carrier_hz))
    if not times:
        return np.array([0.0]), np.array([found])
    return np.array(times), np.array(frequencies)
