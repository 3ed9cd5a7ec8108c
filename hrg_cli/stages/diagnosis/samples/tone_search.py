"""Diagnosis, the search for tones near the resonance, at the windows' own rate.

The residual of the fitted model at every window, a fixed vector e e^{j(ω_m − ω_r)t}, is one-sided
in frequency about the resonance; a modulation of the resonator or of the read-out has both
sidebands and is left to the open search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit, compute_unsettled_part
from ....fitting.envelopes.envelope_runs import compute_envelopes
from ....fitting.noise import channel_noise
from ....records import Wave
from ..drive.scatter import find_corner_hz
from ..fits.scoring import is_gross
from ..thresholds import DIES, ISOLATED, MIRRORED, ONE_SIDED_TONE, SURE_TO_DIE, TONE
from .tone import Tone
from .tone_size import NEAREST_CYCLES

Array = np.ndarray
OFFERED = 1e-2
"""Chance, in the whole spectrum, of a bin whose frequency is looked at closely: its taper costs a
third of a tone's power, and a place between two bins as much again."""
FINE = 41
LOBE, BESIDE = 2.5, 8.0
"""Cells of the longest run away from a tone between which it is held against all that stands
there."""
LEFT_OUT = 1.75
"""Usual distances of the rows beyond which some between two were left out; a row of two windows
beside rows of one stands 1.5 away."""

Residual = tuple[Array, Array, Array]
"""Of a run: times (n,), envelopes measured less modelled (n, 2) of equal noise in both channels,
its σ (n,)."""


def collect_residuals(fit: ExtendedFit, waves: Sequence[Wave]) -> list[Residual]:
    """What a model leaves of every run at the windows' own rate, against the common reference.

    Parameters
    ----------
    fit
        Of the model.
    waves
        Of the runs.

    Returns
    -------
    list of tuple
        Of each run times [s] (n,), envelopes (n, 2) and their σ (n,), without the windows that the
        model leaves out.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.tone_search import collect_residuals
    >>> t, left, std = collect_residuals(draw_fit(), draw_waves())[0]
    >>> left.shape, bool(np.sqrt(np.mean(np.abs(left) ** 2)) < 3 * np.median(std))
    ((50, 2), True)
    """
    out = []
    reference = fit.series.reference_frequency_hz
    # a window is not the mean of its row
    model = (fit.prediction.by_log + compute_unsettled_part(fit)) / fit.series.row_turn
    for k, wave in enumerate(waves):
        rows = fit.series.weight[k] > 0
        at = fit.series.time_s[k][rows]
        good = wave.good() & _find_consecutive(np.asarray(wave.time_s, float), at)
        t = np.asarray(wave.time_s, float)[good]
        measured = compute_envelopes(wave, good)
        measured = (
            measured * np.exp(2j * np.pi * (wave.reference_frequency_hz - reference) * t)[:, None]
        )
        # against the run's own frequency, which may turn by more than half a turn from row to row
        own_turn = fit.point.offset_rad_s[k]
        slow = model[k][rows] * np.exp(-1j * own_turn * at)[:, None]
        seen = _interpolate_wave(at, slow, t) * np.exp(1j * own_turn * t)[:, None]
        own = None if fit.series.whitening is None else fit.series.whitening[[k]]
        left = channel_noise.whiten(own, (measured - seen)[None])[0]
        out.append((t, left, np.asarray(wave.signal_std, float)[good]))
    return out


def _interpolate_wave(rows_s: Array, envelope: Array, t: Array) -> Array:
    """Envelopes (n, 2) at rows, at the times t: the turn that both share and what it leaves by
    cubic splines. A frequency that moves turns an envelope by too much from row to row for one of
    its own."""
    from scipy.interpolate import CubicSpline

    shared = np.angle(np.sum(envelope[1:] * np.conj(envelope[:-1]), axis=1))
    turn = np.append(0.0, np.cumsum(shared))
    slow = CubicSpline(rows_s, envelope * np.exp(-1j * turn)[:, None])(t)
    return np.asarray(slow * np.exp(1j * CubicSpline(rows_s, turn)(t))[:, None])


def _find_consecutive(time_s: Array, rows_s: Array) -> Array:
    """Which windows (n,) stand among rows that follow one another, and not where rows between two
    were left out."""
    apart = np.diff(rows_s)
    gap = np.append(np.append(False, apart > LEFT_OUT * np.median(apart)), False)
    return np.asarray(~gap[np.searchsorted(rows_s, time_s)])


@dataclass(frozen=True)
class ResidualSpectrum:
    """The residuals' power, summed over channels and runs, in bins (n,) of frequency above the
    reference: what it is, its floor, and of how many runs."""

    frequency_hz: Array
    power: Array
    level: Array
    runs: int

    def find_mirror_power(self, centre_hz: float) -> Array:
        """Power at each bin's mirror about a frequency."""
        step_hz = self.frequency_hz[1]
        return np.interp(
            2 * centre_hz - self.frequency_hz,
            np.fft.fftshift(self.frequency_hz),
            np.fft.fftshift(self.power),
            period=len(self.power) * step_hz,
        )

    def compute_chance(self) -> Array:
        """Probability of as much power in a bin from noise alone, whose median is the floor."""
        ratio = np.maximum(self.power / self.level, 0)
        return _compute_chance(4 * self.runs * ratio, self.runs)

    def find_excess(self, frequency_hz: float) -> float:
        """The floor at a frequency over that of white noise of the stated size, at least 1."""
        at = int(np.argmin(np.abs(self.frequency_hz - frequency_hz)))
        return max(float(self.level[at]) / (4 * self.runs), 1.0)


def _compute_chance(power: Array | float, runs: int) -> Array:
    """Probability of as much power over σ² from noise alone: of two channels a run, a cosine and a
    sine each."""
    from scipy.special import chdtrc

    return np.asarray(chdtrc(4 * runs, power))


def find_strongest_tone(fit: ExtendedFit, waves: Sequence[Wave]) -> Tone | None:
    """The strongest one-sided tone that stands out of its surroundings.

    A tapered spectrum, in which nothing leaks, offers the place; what the whole of every run says
    there decides, by chance `TONE`. Beside a gross misfit it is one that stands there alone.

    Parameters
    ----------
    fit
        Of a model.
    waves
        Of the runs, to which the tone's frequency is common.

    Returns
    -------
    Tone or None
        None where there is none.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.tone_search import find_strongest_tone
    >>> find_strongest_tone(draw_fit(), draw_waves()) is None
    True
    """
    data = collect_residuals(fit, waves)
    spectrum = _spectrum(data)
    if spectrum is None:
        return None
    wanted = _stand_out(spectrum, data, fit)
    if not wanted.any():
        return None
    best = float(spectrum.frequency_hz[np.argmax(np.where(wanted, spectrum.power, 0))])
    best = _refined(best, data)
    vector = np.array(
        [np.mean(r * np.exp(-2j * np.pi * best * t)[:, None], axis=0) for t, r, _ in data]
    )
    std = np.array([float(np.median(s)) / np.sqrt(len(s)) for _, _, s in data])
    gain = float(np.sum(np.abs(vector) ** 2 / std[:, None] ** 2))
    if _compute_chance(gain / spectrum.find_excess(best), len(data)) > TONE / len(wanted):
        return None
    whitening = fit.series.whitening
    vector = channel_noise.whiten(channel_noise.invert(whitening), vector[:, None])[:, 0]
    std = std[:, None] * channel_noise.compute_spread(whitening)
    return Tone(best + fit.series.reference_frequency_hz, vector, std, gain, _stands(data, best))


def widen_by_rest(tones: Sequence[Tone], fit: ExtendedFit, waves: Sequence[Wave]) -> list[Tone]:
    """Tones with σ that hold what a model leaves beside them.

    What is left is noise to a tone as large as the mean power in the cells of the longest run on
    either side, seen as the tone is, untapered: a misfit as slow as the runs leaks that far. Its
    variances are larger by that power over the noise's, and χ² of the tone is less.

    Parameters
    ----------
    tones
        As they were found.
    fit
        Of the final model.
    waves
        Of its runs, with the tones taken out.

    Returns
    -------
    list of Tone
        In their order.

    Examples
    --------
    Beside nothing but noise σ stays, to the power's own scatter:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.tone import Tone
    >>> from hrg_cli.stages.diagnosis.samples.tone_search import widen_by_rest
    >>> tone = Tone(510.0, np.full((3, 2), 1e-3 + 0j), np.full((3, 2), 1e-5), 1e4)
    >>> (wide,) = widen_by_rest([tone], draw_fit(), draw_waves())
    >>> bool(1 <= wide.std[0, 0] / 1e-5 < 1.3)
    True
    """
    if not tones:
        return []
    data = collect_residuals(fit, waves)
    cells = np.arange(np.ceil(LOBE), BESIDE + 1) / _lengths(data)[1]
    beside = np.concatenate([-cells[::-1], cells])
    out = []
    for tone in tones:
        beat_hz = tone.frequency_hz - fit.series.reference_frequency_hz
        power = np.mean(_sum_power(beat_hz + beside, data)) / (4 * len(data))
        excess = max(float(power), 1.0)
        out.append(replace(tone, std=tone.std * np.sqrt(excess), gain=tone.gain / excess))
    return out


def _sum_power(frequency_hz: Array, data: Sequence[Residual]) -> Array:
    """Power over σ² at frequencies (k,) above the reference, of both channels and all runs: 4 a run
    of noise."""
    turn = [np.exp(-2j * np.pi * np.outer(frequency_hz, t)) for t, _, _ in data]
    parts = [
        np.abs(one @ (r / std[:, None])) ** 2 / len(t)
        for one, (t, r, std) in zip(turn, data, strict=True)
    ]
    return np.asarray(np.sum(parts, axis=(0, 2)))


def _lengths(data: Sequence[Residual]) -> tuple[float, float]:
    """The shortest and the longest run."""
    lengths = [float(t[-1] - t[0]) for t, _, _ in data]
    return min(lengths), max(lengths)


def _spectrum(data: Sequence[Residual]) -> ResidualSpectrum | None:
    """The spectrum of the runs whose rows stand on one grid; None where none does."""
    step = float(np.median([np.median(np.diff(t)) for t, _, _ in data]))
    size = 1 << int(np.ceil(np.log2(2 * _lengths(data)[1] / step + 8)))
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
    level = np.fft.ifftshift(_floor(np.fft.fftshift(power)))
    return ResidualSpectrum(np.fft.fftfreq(size, step), power, level, used)


def _stand_out(spectrum: ResidualSpectrum, data: Sequence[Residual], fit: ExtendedFit) -> Array:
    """Bins (n,) of one-sided power that noise and the wave's own walk do not make."""
    shortest, longest = _lengths(data)
    # where a cause pulls it, a run's own frequency is not the one at which it turned
    own = np.concatenate([fit.point.offset_rad_s, fit.series.turn_rad_s]) / (2 * np.pi)
    nearest = np.min(np.abs(spectrum.frequency_hz[:, None] - own), axis=1)
    # a wave that walks under its drive has a spectrum of its own about the resonance
    walk = 1 + (find_corner_hz(fit) / np.maximum(nearest, 1 / longest)) ** 2
    spectrum = replace(spectrum, level=spectrum.level * walk)
    power, level = spectrum.power, spectrum.level
    mirror = spectrum.find_mirror_power(float(np.mean(fit.point.offset_rad_s)) / (2 * np.pi))
    noise = MIRRORED * level / np.sqrt(2 * spectrum.runs)  # of a sum of 2·runs exponentials
    wanted = (
        (nearest * shortest > NEAREST_CYCLES)
        & (mirror - level < (power - level) / ONE_SIDED_TONE + noise)
        & (spectrum.compute_chance() < OFFERED / len(power))
    )
    cells = longest * spectrum.frequency_hz[1]
    # the shoulder of a peak whose mirror speaks against it is no line of its own
    wanted &= power >= _find_largest_about(power, cells)
    if is_gross(fit):
        wanted &= power > ISOLATED * _find_largest_beside(power, cells)
    return np.asarray(wanted)


def _refined(frequency_hz: float, data: Sequence[Residual]) -> float:
    """The frequency about a bin's at which the runs' own power is largest."""
    width = 1 / _lengths(data)[1]
    for _ in range(3):
        trial = frequency_hz + width * np.linspace(-1, 1, FINE)
        frequency_hz = float(trial[np.argmax(_sum_power(trial, data))])
        width /= 8
    return frequency_hz


def _find_largest_about(power: Array, cells: float) -> Array:
    """The largest power (n,) within the lobe about every bin of a whole spectrum."""
    from scipy.ndimage import maximum_filter1d

    return np.asarray(maximum_filter1d(power, 2 * int(np.ceil(LOBE / cells)) + 1, mode="wrap"))


def _find_largest_beside(power: Array, cells: float) -> Array:
    """The largest power (n,) near every bin of a whole spectrum, but for the bin's own lobe;
    `cells`: length of a bin in cells of the longest run."""
    near, far = int(np.ceil(LOBE / cells)), int(BESIDE / cells)
    if 2 * far + 1 >= len(power):
        return np.full(len(power), np.inf)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(power, far, mode="wrap"), 2 * far + 1)
    return np.asarray(np.delete(around, np.arange(far - near, far + near + 1), axis=1).max(axis=1))


def _stands(data: Sequence[Residual], beat_hz: float) -> bool:
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
    return bool(powers[1] > DIES * powers[0] - SURE_TO_DIE * np.sqrt(unsure))


def _floor(power: Array, width: int = 101) -> Array:
    """Running median, of a spectrum already in order of frequency; the least is a thousandth of the
    overall median."""
    width = min(width, len(power) // 2 * 2 - 1)
    padded = np.pad(power, width // 2, mode="wrap")
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    return np.maximum(median, 1e-3 * np.median(power))
