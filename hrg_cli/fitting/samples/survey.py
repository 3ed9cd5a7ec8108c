"""A few looks along a recording before it is demodulated: the frequency and its course, rails,
noise level, residual spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import HrgError
from ...records import Recording
from ...records.recording import ONE_CHANNEL
from . import frequency as finding
from .least_count import count_values, least_count
from .spectrum import AveragedSpectrum, lines, look_residual

Array = np.ndarray

LOOKS, LOOK_SAMPLES = 16, 1 << 14
"""Places along an even recording where the frequency is found, and samples a look."""

UNEVEN_LOOKS, UNEVEN_SAMPLES = 24, 1024
"""The same for uneven sampling, whose transforms are direct sums."""

LONGEST_SPAN = 20.0
"""Times that span so many times what the samples fill at their usual step are a clock that jumps,
not a run with gaps."""

LINE_LEAST = 1e-8
"""Lines below this part of the oscillation are the arithmetic's rounding."""

STEP_LOOKS = 4
"""Looks, about, whose values show the converter's step."""

NOMINAL_BAND = 0.1
"""A nominal frequency narrows the search to this part of it on either side."""

Spectra = list[tuple[Array, Array]]


@dataclass(frozen=True)
class Look:
    """One stretch of samples."""

    time_s: Array
    y: Array  # (2, n) physical units
    raw: tuple[Array, Array]


@dataclass(frozen=True)
class Survey:
    """What the looks show.

    `step_s`: median sampling step; `track_s`, `track_hz`: course of the frequency; `rails` ((low,
    high) raw, a channel): where samples are stuck; `least_count` (a channel, its unit, 0: none):
    the values' step; `strength2`: the stronger channel's variance; `spectrum_*`, `line_*`: as in
    Periods, from so many segments; `blind_hz`: where the oscillation itself was taken out of the
    spectrum; reasons to suspect or refuse.
    """

    reference_hz: float
    carrier_hz: float | None
    step_s: float
    track_s: Array
    track_hz: Array
    rails: tuple[tuple[float, float], tuple[float, float]]
    strength2: float
    looks: tuple[Look, ...]
    spectrum_hz: Array
    spectrum_density: Array
    spectrum_segments: int
    blind_hz: tuple[tuple[float, float], ...]
    line_hz: Array
    line_amplitude: Array
    line_ratio: Array
    suspect: tuple[str, ...]
    refused: tuple[str, ...]
    least_count: tuple[float, float] = (0.0, 0.0)

    def frequency_hz(self, time_s: float) -> float:
        """Local frequency, interpolated between the looks."""
        return float(np.interp(time_s, self.track_s, self.track_hz))


def survey(recording: Recording, name: str) -> Survey:
    """Look at a recording. HrgError: no samples, constant channels, no oscillation possible below
    half the sampling rate."""
    even = recording.time_s is None
    carrier = recording.carrier_hz if recording.readout == "carrier" else None
    looks = _looks(recording, even, name)
    suspect, refused = _dead(looks, name, recording.status_reasons)
    step = float(np.median(np.concatenate([np.diff(look.time_s) for look in looks])))
    if not even and not all(np.isfinite(look.time_s).all() for look in looks):
        raise HrgError(
            f"{name}: time_s holds values that are not finite; strictly increasing times were"
            " expected"
        )
    if not even and min(np.diff(look.time_s).min() for look in looks) <= 0:
        raise HrgError(
            f"{name}: its times do not increase; strictly increasing time_s was expected: sort the"
            " samples or drop the repeated ones"
        )
    if not even:
        begin, end = (float(recording.times(k, k + 1)[0]) for k in (0, len(recording.c) - 1))
        if end - begin > LONGEST_SPAN * len(recording.c) * step:
            raise HrgError(
                f"{name}: its times span {end - begin:.6g} s, but {len(recording.c)} samples at the"
                f" usual step fill {len(recording.c) * step:.6g} s; the clock jumps or a gap is"
                " huge: correct time_s or split the run"
            )
    rails = (
        _rail(recording.c, [look.raw[0] for look in looks]),
        _rail(recording.s, [look.raw[1] for look in looks]),
    )
    spectra = [finding.even_power(look.y, 1 / step) for look in looks] if even else []
    found, ratio, limit, warned = _search(
        looks, spectra, step, carrier, recording.nominal_frequency_hz, name
    )
    suspect += warned
    if not ratio > limit:
        refused += (
            (
                f"no oscillation stands out of the noise: the highest peak, at {found:.6g} Hz, has"
                f" {ratio:.3g} times the power around it where {limit:.3g} was expected"
            ),
        )
    track_s, track_hz = _track(looks, spectra, step, found, carrier)
    width = (
        min(len(looks[0].time_s), LOOK_SAMPLES // 4 if len(looks) < 8 else LOOK_SAMPLES)
        if even
        else min(len(looks[0].time_s), UNEVEN_SAMPLES // 2)
    )
    if len(looks) == 1:
        width = max(min(width, len(looks[0].time_s) // 4), min(64, len(looks[0].time_s)))
    grid = np.fft.rfftfreq(width, step)
    spectrum = AveragedSpectrum(grid)
    variance, strength = [], []
    blind = 4 / (width * step)
    for look, local in zip(
        looks, np.interp([look.time_s.mean() for look in looks], track_s, track_hz), strict=True
    ):
        f = finding.bands(float(local), carrier)
        residual, reach = look_residual(look.time_s, look.y, f, finding.nuisances(carrier))
        blind = max(blind, reach)
        variance.append((residual**2).mean(-1))
        strength.append(look.y.var(-1) - variance[-1])
        for start in range(0, residual.shape[-1] - width + 1, max(1, width // 2)):
            piece = slice(start, start + width)
            if even or np.diff(look.time_s[piece]).max() < 3 * step:
                spectrum.add(look.time_s[piece], residual[:, piece], even)
    reference = float(np.round(np.median(track_hz), 6))
    skip = tuple((f - blind, f + blind) for f in (*finding.bands(reference, carrier), 0.0))
    strength2 = float(np.max(strength))
    line_hz, line_amplitude, line_ratio = lines(
        grid,
        spectrum.mean(),
        spectrum.segments,
        skip,
        least=LINE_LEAST * np.sqrt(max(strength2, 0.0)),
    )
    return Survey(
        reference,
        carrier,
        step,
        track_s,
        track_hz,
        rails,
        strength2,
        tuple(looks),
        grid,
        spectrum.mean(),
        spectrum.segments,
        skip,
        line_hz,
        line_amplitude,
        line_ratio,
        suspect,
        refused,
        _least_counts(recording, looks),
    )


def _least_counts(recording: Recording, looks: list[Look]) -> tuple[float, float]:
    """Step of each channel's values in their unit, 0 where they are a continuum: as the recording
    says, or as its values show."""
    if recording.least_count:
        return recording.least_count, recording.least_count
    scales = (recording.c_scale_factor, recording.s_scale_factor)
    some = looks[:: max(1, len(looks) // STEP_LOOKS)]
    c, s = (abs(scales[k]) * least_count(look.raw[k] for look in some) for k in range(2))
    return c, s


def _looks(recording: Recording, even: bool, name: str) -> list[Look]:
    n = len(recording.c)
    most, length = (LOOKS, min(n, LOOK_SAMPLES)) if even else (UNEVEN_LOOKS, min(n, UNEVEN_SAMPLES))
    if n < 6:
        raise HrgError(
            f"{name}: has {n} samples; an oscillation cannot be found in fewer than 6: record"
            " longer"
        )
    looks, patched, stretches = [], [], []
    for a in dict.fromkeys(
        np.linspace(0, n - length, min(most, max(1, n // length))).astype(int).tolist()
    ):
        raw = (np.asarray(recording.c[a : a + length]), np.asarray(recording.s[a : a + length]))
        y = np.stack(
            [
                raw[0] * recording.c_scale_factor + recording.c_add_offset,
                raw[1] * recording.s_scale_factor + recording.s_add_offset,
            ]
        )
        y = y.astype(float)
        time = recording.times(a, a + length).astype(float)
        bad = ~np.isfinite(y)
        if not bad.any():
            looks.append(Look(time, y, raw))
        else:
            whole = _longest(np.isfinite(y.sum(0)))
            stretches.append(Look(time[whole], y[:, whole], (raw[0][whole], raw[1][whole])))
            if bad.mean() < 0.2:
                for k in range(2):
                    y[k, bad[k]] = y[k, ~bad[k]].mean()
                patched.append(Look(time, y, raw))
    shortest = max(64, length // 8)
    stretches = [look for look in stretches if len(look.time_s) >= shortest]
    if stretches and not looks:
        common = min(len(look.time_s) for look in stretches)
        cut = slice(0, common)
        looks = [
            Look(look.time_s[cut], look.y[:, cut], (look.raw[0][cut], look.raw[1][cut]))
            for look in stretches
        ]
    looks = looks or patched
    if not looks:
        raise HrgError(
            f"{name}: has hardly any finite sample (NaN or infinite values); finite values of both"
            " channels were expected: check it"
        )
    return looks


def _longest(good: Array) -> slice:
    """The longest run of true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    if not len(edges):
        return slice(0, 0)
    k = int(np.argmax(edges[1::2] - edges[::2]))
    return slice(int(edges[2 * k]), int(edges[2 * k + 1]))


def _dead(
    looks: list[Look], name: str, known: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Channels that do not move; an S that was not recorded is no dead one. known: the recording's
    own reasons."""
    spread = np.array([max(float(np.ptp(look.y[k])) for look in looks) for k in range(2)])
    level = [float(looks[0].y[k, 0]) for k in range(2)]
    dead = [k for k in range(2) if spread[k] <= 1e-14 * abs(level[k])]
    if len(dead) == 2:
        what = "all zero" if not any(level) else "constant"
        raise HrgError(
            f"{name}: both channels are {what}; an oscillation was expected: check the pick-off and"
            " the converter"
        )
    if any(reason.startswith(ONE_CHANNEL) for reason in known):
        dead = [k for k in dead if k != 1]
    return (
        tuple(
            f"channel {'CS'[k]} is {'all zero' if level[k] == 0 else f'constant at {level[k]:g}'};"
            " it may be dead"
            for k in dead
        ),
        (),
    )


def _search(
    looks: list[Look],
    spectra: Spectra,
    step_s: float,
    carrier_hz: float | None,
    nominal_hz: float | None,
    name: str,
) -> tuple[float, float, float, tuple[str, ...]]:
    """Frequency, its power ratio, the ratio needed, and reasons for suspicion."""
    nyquist = 0.5 / step_s
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
    if spectra:
        grid, power = spectra[0][0], np.sum([p for _, p in spectra], 0)
    else:
        some = sorted(looks, key=_span)[:3]
        span = min(_span(some[0]), 4 * len(some[0].time_s) * step_s)
        band = (
            (0.9 * nominal_hz, 1.1 * nominal_hz)
            if nominal_hz is not None and carrier_hz is None
            else (0.5 / span, nyquist)
        )
        grid = np.arange(max(0.5, band[0] * span), band[1] * span, 0.5) / span
        power = np.sum([finding.least_squares_power(look.time_s, look.y, grid) for look in some], 0)
    if carrier_hz is not None:
        grid, power = finding.fold_carrier(grid, power, carrier_hz)
    resolution = 1 / float(looks[0].time_s[-1] - looks[0].time_s[0])
    limit = finding.detection_ratio(len(looks), len(grid) // finding.PADDING)
    if nominal_hz is not None:
        found, ratio = finding.peak(
            grid, power, (1 - NOMINAL_BAND) * nominal_hz, (1 + NOMINAL_BAND) * nominal_hz
        )
        if ratio > limit:
            return found, ratio, limit, ()
        hint, _ = finding.peak(grid, power, 1.5 * resolution, top)
        if not np.isfinite(found):
            found = nominal_hz
        return (
            found,
            ratio,
            limit,
            (
                (
                    f"nothing stands out within 10 % of the nominal frequency of {nominal_hz:g} Hz;"
                    f" the highest peak lies at {hint:.6g} Hz"
                ),
            ),
        )
    found, ratio = finding.peak(grid, power, 1.5 * resolution, top)
    if not np.isfinite(found):
        found, ratio = finding.peak(grid, power, 0.5 * resolution, top)
    if not np.isfinite(found):
        raise HrgError(
            f"{name}: no oscillation between 0 and {top:g} Hz in either channel; several periods"
            " were expected: check it or record longer"
        )
    return found, ratio, limit, ()


def _span(look: Look) -> float:
    return float(look.time_s[-1] - look.time_s[0])


def _track(
    looks: list[Look], spectra: Spectra, step_s: float, found: float, carrier_hz: float | None
) -> tuple[Array, Array]:
    """Times and frequencies of the looks in which the line is clear."""
    times, frequencies = [], []
    for number, look in enumerate(looks):
        span = min(_span(look), 4 * len(look.time_s) * step_s)
        reach = 0.01 * found + 2 / span
        if spectra:
            grid, power = spectra[number]
            if carrier_hz is not None:
                grid, power = finding.fold_carrier(grid, power, carrier_hz)
        else:
            grid = np.arange(max(0.5 / span, found - 4 * reach), found + 4 * reach, 0.5 / span)
            power = finding.least_squares_power(look.time_s, look.y, grid)
        local, ratio = finding.peak(grid, power, found - reach, found + reach)
        if not np.isfinite(local):
            local, ratio = found, 0.0
        if ratio > 15 or len(looks) == 1:
            times.append(float(look.time_s.mean()))
            frequencies.append(finding.refine(look.time_s, look.y, local, carrier_hz))
    if not times:
        return np.array([0.0]), np.array([found])
    return np.array(times), np.array(frequencies)


def _rail(channel: Array, raws: list[Array]) -> tuple[float, float]:
    """Raw values (low, high) at which samples are stuck; infinite where none is. An integer's own
    range counts always."""
    low, high = -np.inf, np.inf
    if np.issubdtype(channel.dtype, np.integer):
        info = np.iinfo(channel.dtype)
        low, high = float(info.min), float(info.max)
    for raw in raws:
        values = raw.astype(float)
        if _stuck_at_top(values):
            high = min(high, float(np.nanmax(values)))
        if _stuck_at_top(-values):
            low = max(low, float(np.nanmin(values)))
    return low, high


def _stuck_at_top(values: Array) -> bool:
    """Whether more samples share the highest value than a sine of that size leaves there: √(2/A)/π
    of all, A its amplitude in steps.

    Sampling commensurate with the oscillation repeats values too; so either a run of equal samples
    must be longer than the rounded top of the sine allows, or the next lower values must be much
    rarer.
    """
    values = values[np.isfinite(values)]
    if len(values) < 8 or np.count_nonzero(values == values.max()) < 5:
        return False
    distinct, counts = count_values(values)
    if len(distinct) < 8:
        return False
    amplitude = max(1.0, float(np.ptp(distinct)) / 2 / max(float(np.diff(distinct).min()), 1e-300))
    share = np.sqrt(2 / amplitude) / np.pi
    top = values == distinct[-1]
    if counts[-1] < 5 or counts[-1] < 3 * share * len(values):
        return False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], top, [False]]).astype(int)))
    longest = int((edges[1::2] - edges[::2]).max())
    crossings = max(1, int((np.diff(np.sign(values - values.mean())) > 0).sum()))
    return (
        longest >= 3 + 2 * share * len(values) / crossings or counts[-1] > 3 * counts[-6:-1].max()
    )
