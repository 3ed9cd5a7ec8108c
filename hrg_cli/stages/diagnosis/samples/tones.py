"""Diagnosis, tones near the resonance: what beats in the envelopes at a fixed frequency, seen at
the windows' own rate.

The residual of the fitted model at every window, a fixed vector e e^{j(ω_m − ω_r)t}, is one-sided
in frequency about the resonance; a modulation of the resonator or of the read-out has both
sidebands and is left to the open search.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from ....fitting.causes.extended_fit import DivergedError, ExtendedFit, unsettled_part
from ....fitting.envelopes import channel_noise
from ....fitting.envelopes.envelope_runs import envelopes_of
from ....fitting.samples.envelope_motion import BEND, CURVED
from ....fitting.samples.spectrum import floor
from ....physics import ellipse
from ....records import Wave
from ..drive.scatter import corner_hz
from ..fits.scoring import is_gross

Array = np.ndarray
NEAREST_CYCLES = 4.0
"""Cycles of beat with every run's own frequency in the shortest run from which a tone is looked
for."""
ONE_SIDED, MIRRORED = 6.0, 2.0
"""Power of a tone over its mirror's beside the resonance, less the floor in both, and σ of the
mirror's noise allowed beside."""
FINE = 41
LINE = 8.0
"""Power over a spectrum's floor from which a bin is a line's and no noise."""
MOST_TONES = 4
DIES, SURE = 0.7, 4.0
"""Part of its power that a tone has in the second half of the runs at least, and σ by which less
must be sure."""
ISOLATED, LOBE, BESIDE = 10.0, 2.5, 8.0
"""Power of a tone beside a gross misfit over all that stands from LOBE to BESIDE cells of the longest
run away from it: a misfit of the motion is no line alone."""
SHOWN = 0.05
"""Part of a tone that a window must show for its true size to be told from what is seen."""
LEFT_OUT = 1.75
"""Usual distances of the rows beyond which some between two were left out; a row of two windows
beside rows of one stands 1.5 away."""
SCATTER = 0.2
"""Part of a tone's χ² that its vectors' scatter from run to run may have where its phase is the
same in all of them."""


@dataclass(frozen=True)
class Tone:
    """A tone: frequency, complex amplitudes e (R, 2) of every run at t = 0 of the run, σ (R, 2) of
    one real part in either channel, χ² it takes away.

    `standing`: as strong in the second half of the runs as in the first; a partial of the resonator
    dies away.
    """

    frequency_hz: float
    vector: Array
    std: Array
    gain: float
    standing: bool = True

    @property
    def mean(self) -> Array:
        """Mean vector (2,) of the runs, weighed by their noise."""
        weight = 1 / self.std**2
        return np.asarray(np.sum(self.vector * weight, axis=0) / weight.sum(axis=0))

    @property
    def common(self) -> bool:
        """Whether its phase at t = 0 is the same in all runs."""
        scatter = np.abs(self.vector - self.mean) ** 2 / self.std**2
        return bool(np.sum(scatter) < SCATTER * self.gain)

    def in_windows(self, frequency_hz: float, window_s: float) -> Tone:
        """What windows of an oscillation show of a true tone."""
        part = response((self.frequency_hz - frequency_hz) * window_s)
        return replace(self, vector=self.vector * part, std=self.std * abs(part))

    def true(self, frequency_hz: float, window_s: float) -> Tone:
        """The tone whose part is seen; as seen where windows show next to nothing of it."""
        part = response((self.frequency_hz - frequency_hz) * window_s)
        if abs(part) <= SHOWN:
            return self
        return replace(self, vector=self.vector / part, std=self.std / abs(part))

    def envelope(self, k: int, time_s: Array, reference_hz: float) -> Array:
        """Its envelopes (n, 2) in run k against a reference: e e^{j2π(f − f_ref)t}."""
        turn = np.exp(2j * np.pi * (self.frequency_hz - reference_hz) * time_s)
        return np.asarray(self.vector[k] * turn[:, None])


def channel_parts(vector: Array) -> dict[str, float]:
    """A tone's complex amplitudes (2,) as the cosine and sine of each channel."""
    return {
        "c_cos": float(vector[0].real),
        "c_sin": float(-vector[0].imag),
        "s_cos": float(vector[1].real),
        "s_sin": float(-vector[1].imag),
    }


def response(turns: float) -> float:
    """Part that a window shows of what beats by so many turns in it: sin(πx)/(πx)·(1 + E(1 +
    cE)/24).

    The second factor is the curvature that demodulate puts back, from h windows on either side: E =
    (2 sin(πhx)/h)².
    """
    bend = float((2 * np.sin(np.pi * BEND * turns) / BEND) ** 2)
    return float(np.sinc(turns)) * (1 + bend * (1 + CURVED * bend) / 24)


def residuals(fit: ExtendedFit, waves: Sequence[Wave]) -> list[tuple[Array, Array, Array]]:
    """Of every run: times, envelopes measured less modelled (n, 2) against the common reference, of
    equal noise in both channels, and its σ, at the windows' own rate; without the windows that the
    model leaves out."""
    from scipy.interpolate import CubicSpline

    out = []
    reference = fit.series.reference_frequency_hz
    model = fit.prediction.by_log + unsettled_part(fit)
    for k, wave in enumerate(waves):
        rows = fit.series.weight[k] > 0
        at = fit.series.time_s[k][rows]
        good = wave.good() & _among(np.asarray(wave.time_s, float), at)
        t = np.asarray(wave.time_s, float)[good]
        measured = envelopes_of(wave, good)
        measured = (
            measured * np.exp(2j * np.pi * (wave.reference_frequency_hz - reference) * t)[:, None]
        )
        slow = np.exp(-1j * fit.point.offset_rad_s[k] * at)[:, None]
        seen = (
            CubicSpline(at, model[k][rows] * slow)(t)
            * np.exp(1j * fit.point.offset_rad_s[k] * t)[:, None]
        )
        own = None if fit.series.whitening is None else fit.series.whitening[[k]]
        left = channel_noise.whiten(own, (measured - seen)[None])[0]
        out.append((t, left, np.asarray(wave.signal_std, float)[good]))
    return out


def _among(time_s: Array, rows_s: Array) -> Array:
    """Which windows (n,) stand among rows that follow one another, and not where rows between two
    were left out."""
    apart = np.diff(rows_s)
    gap = np.append(np.append(False, apart > LEFT_OUT * np.median(apart)), False)
    return np.asarray(~gap[np.searchsorted(rows_s, time_s)])


def strongest(fit: ExtendedFit, waves: Sequence[Wave]) -> Tone | None:
    """The strongest one-sided tone that stands out of its surroundings by chance once in a million,
    common to the runs in frequency; beside a gross misfit one that stands there alone."""
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
    level = np.fft.ifftshift(_floor(np.fft.fftshift(power)))
    # where a cause pulls it, a run's own frequency is not the one at which it turned
    own = np.concatenate([fit.point.offset_rad_s, fit.series.turn_rad_s]) / (2 * np.pi)
    nearest = np.min(np.abs(frequency[:, None] - own), axis=1)
    # a wave that walks under its drive has a spectrum of its own about the resonance
    level = level * (1 + (corner_hz(fit) / np.maximum(nearest, 1 / longest)) ** 2)
    relative = power / level
    distance = frequency - offset
    mirror = np.interp(
        offset - distance, np.fft.fftshift(frequency), np.fft.fftshift(power), period=1 / step
    )
    # of a sum of 2·used exponentials, its median set to 1
    expected = 4 * used * np.maximum(relative, 0)
    noise = MIRRORED * level / np.sqrt(2 * used)  # of a sum of 2·used exponentials
    wanted = (
        (nearest * shortest > NEAREST_CYCLES)
        & (mirror - level < (power - level) / ONE_SIDED + noise)
        & (chdtrc(4 * used, expected) < 1e-6 / size)
    )
    if is_gross(fit):
        wanted &= power > ISOLATED * _beside(power, longest / (size * step))
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
    whitening = fit.series.whitening
    vector = channel_noise.whiten(channel_noise.inverse(whitening), vector[:, None])[:, 0]
    std = std[:, None] * channel_noise.spread(whitening)
    return Tone(best + fit.series.reference_frequency_hz, vector, std, gain, _stands(data, best))


def _beside(power: Array, cells: float) -> Array:
    """The largest power (n,) near every bin of a whole spectrum, but for the bin's own lobe;
    `cells`: length of a bin in cells of the longest run."""
    near, far = int(np.ceil(LOBE / cells)), int(BESIDE / cells)
    if 2 * far + 1 >= len(power):
        return np.full(len(power), np.inf)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(power, far, mode="wrap"), 2 * far + 1)
    return np.asarray(np.delete(around, np.arange(far - near, far + near + 1), axis=1).max(axis=1))


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


def take_out_tone(waves: Sequence[Wave], tone: Tone) -> list[Wave]:
    """The waves with the tone taken out of every run."""
    out = []
    for k, wave in enumerate(waves):
        t = np.asarray(wave.time_s, float)
        u = envelopes_of(wave)
        u = u - tone.envelope(k, t, float(wave.reference_frequency_hz))
        a_A, a_B, angle, phase = ellipse.wave(u, wave.mode_number)
        angle, phase = ellipse.unwrap(angle, phase, wave.mode_number)
        out.append(
            wave.replace(
                main_amplitude=a_A,
                quadrature_amplitude=a_B,
                wave_angle_rad=angle,
                phase_rad=phase,
                **_std_without(wave, tone.vector[k]),
            )
        )
    return out


def without_tones(waves: Sequence[Wave], tones: Sequence[Tone]) -> list[Wave]:
    """The waves without the tones; one that dies away is listed only, and stays in them."""
    return reduce(take_out_tone, (tone for tone in tones if tone.standing), list(waves))


def _std_without(wave: Wave, vector: Array) -> dict[str, Array]:
    """σ (n,) of a coefficient, and of either channel's (n, 2), less what the tone e has in it, √(σ² −
    |e_C|²/2) for C, not below what the spectrum's floor beside the oscillation promises, √(S/T).

    The demodulation weighs the residual's colour and takes a tone for noise that every window draws
    anew: A²/2 of it in each coefficient of its channel, two of which a channel has.
    """
    if wave.spectrum_density is None or wave.spectrum_frequency_hz is None:
        return {}
    frequency = np.asarray(wave.spectrum_frequency_hz, float)
    density = np.asarray(wave.spectrum_density, float)
    level = floor(density)
    at = int(np.argmin(np.abs(frequency - wave.reference_frequency_hz)))
    white = level[at] * _mean_over_median(density / level) / wave.window_s
    tone = np.abs(vector) ** 2 / 2

    def without(std: Array, tone: Array, white: Array) -> Array:
        quiet = np.asarray(std, float) ** 2
        return np.asarray(np.sqrt(np.maximum(quiet - tone, np.minimum(quiet, white))))

    out = {"signal_std": without(wave.signal_std, tone.mean(), white.mean())}
    if wave.channel_std is not None:
        out["channel_std"] = without(wave.channel_std, tone, white)
    return out


def _mean_over_median(ratio: Array) -> Array:
    """Mean of a noise spectrum over its running median, of each channel, lines left out: an average
    of few segments has its median below its mean."""
    return np.array([one[one < LINE].mean() for one in ratio.T])


def take_out_tones(
    fit: ExtendedFit,
    waves: Sequence[Wave],
    fitted: Callable[[Sequence[Wave]], ExtendedFit],
    nearest: Callable[[ExtendedFit], ExtendedFit],
) -> tuple[ExtendedFit, list[Wave], list[Tone]]:
    """The fit and the waves without the tones found one after another, and these.

    fitted: the base model's fit to waves; nearest: from it one that leaves as little as a few causes
    can, beside which the tones of a gross misfit are looked for.
    """
    left, tones = list(waves), list[Tone]()
    while len(tones) < MOST_TONES:
        tone = strongest(nearest(fit), left)
        if tone is None:
            break
        if not tone.standing:
            return fit, left, [*tones, tone]  # listed and not taken out
        cleaned = take_out_tone(left, tone)
        try:
            fit = fitted(cleaned)
        except DivergedError:  # what is left has no fit: it was no tone
            break
        left = cleaned
        tones.append(tone)
    return fit, left, tones


def confirm_tones(
    tones: Sequence[Tone], waves: Sequence[Wave], fitted: Callable[[Sequence[Wave]], ExtendedFit]
) -> list[Tone]:
    """The tones that stand out of the waves beside a complete model as well, each with the others
    taken out; what is listed only stays.

    Before its cause is known a misfit of the motion can look like a line. fitted: the complete
    model's fit to waves; where it has none nothing speaks against the tone.
    """

    def stands(tone: Tone) -> bool:
        left = without_tones(waves, [other for other in tones if other is not tone])
        try:
            again = strongest(fitted(left), left)
        except DivergedError:
            return True
        longest = max(float(wave.time_s[-1] - wave.time_s[0]) for wave in left)
        return again is not None and abs(again.frequency_hz - tone.frequency_hz) * longest < 1

    return [tone for tone in tones if not tone.standing or stands(tone)]
