"""What is known of a recording before it is demodulated: the frequency and its course, rails, noise
level, residual spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import HrgError
from ...records import Recording
from ..medians import find_median
from . import frequency as finding
from .looks import (
    LOOK_SAMPLES,
    UNEVEN_SAMPLES,
    Look,
    find_dead_channels,
    find_least_counts,
    find_rails,
    take_looks,
)
from .oscillation_search import SpectralPeak, follow_frequency, search_oscillation
from .overflow import tell_overflow
from .spectrum import (
    AveragedSpectrum,
    compute_look_residual,
    estimate_correlation,
    find_floor,
    find_lines,
)
from .twin_channels import tell_twins

Array = np.ndarray

LONGEST_SPAN = 20.0
"""Times that span so many times what the samples fill at their usual step are a clock that jumps,
not a run with gaps."""

QUIET = (3, 2048)
"""Looks, and samples in each, that tell the frequency's course where no noise hides it; what is
between them the demodulation follows from chunk to chunk."""

ABOUT = 0.25
"""Part of the oscillation's frequency about it within which the channels' noise is compared."""

LINE_LEAST = 1e-8
"""Lines below this part of the oscillation are the arithmetic's rounding."""


@dataclass(frozen=True)
class Survey:
    """What the looks show.

    `step_s`: median sampling step; `track_s`, `track_hz`: course of the frequency; `rails` ((low,
    high) raw, a channel): where samples are stuck; `least_count` (a channel, its unit, 0: none):
    the values' step; `strength2`: the stronger channel's variance; `look_noise2` (looks, channels):
    variance of what a look holds beside the oscillation, however that moves; `spectrum_*`,
    `line_*`: as in Periods, from so many segments; `blind_hz`: where the oscillation itself was
    taken out of the spectrum; reasons to suspect or refuse; `noise_correlation`: of both channels
    about the oscillation, None where it is not known.
    """

    reference_hz: float
    carrier_hz: float | None
    step_s: float
    track_s: Array
    track_hz: Array
    rails: tuple[tuple[float, float], tuple[float, float]]
    strength2: float
    looks: tuple[Look, ...]
    look_noise2: Array
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
    noise_correlation: float | None = None

    def interpolate_hz(self, time_s: float) -> float:
        """Local frequency, interpolated between the looks; beyond them that of the nearest.

        Parameters
        ----------
        time_s
            On the samples' clock.

        Returns
        -------
        float
            Hz.
        """
        return float(np.interp(time_s, self.track_s, self.track_hz))

    def average_floor(self) -> Array:
        """Mean over frequency of each channel's density without its lines.

        Returns
        -------
        ndarray
            (2,), one-sided, unit²/Hz.
        """
        return np.asarray(find_floor(self.spectrum_density).mean(axis=0))


@dataclass(frozen=True)
class FrequencyCourse:
    """Looks along a recording, and the frequency that they show."""

    looks: tuple[Look, ...]
    even: bool
    carrier_hz: float | None
    step_s: float
    dead: tuple[str, ...]
    found: SpectralPeak
    track: tuple[Array, Array]

    @classmethod
    def from_looks(cls, recording: Recording, name: str, looks: Sequence[Look]) -> FrequencyCourse:
        """The course that looks along a recording show.

        Parameters
        ----------
        recording
            Of both channels.
        name
            Of it, for what is said of it.
        looks
            Along it.

        Returns
        -------
        FrequencyCourse
            With doubts about the channels and the peak.

        Raises
        ------
        HrgError
            Constant channels, times that do not increase, no oscillation possible below half the
            sampling rate.
        """
        even = recording.time_s is None
        carrier = recording.carrier_hz if recording.readout == "carrier" else None
        dead = find_dead_channels(looks, name, recording.status_reasons)
        step = float(find_median(np.concatenate([np.diff(look.time_s) for look in looks])))
        if not even:
            _need_rising_times(recording, looks, step, name)
        spectra = [finding.compute_even_power(look.y, 1 / step) for look in looks] if even else []
        nominal = recording.nominal_frequency_hz
        found = search_oscillation(looks, spectra, step, carrier, nominal, name)
        track = follow_frequency(looks, spectra, step, found.frequency_hz, carrier)
        return cls(tuple(looks), even, carrier, step, dead, found, track)

    def survey(
        self, recording: Recording, rest: Residual, least_count: tuple[float, float]
    ) -> Survey:
        """The survey, with what the looks hold beside the oscillation.

        Parameters
        ----------
        recording
            Whose course this is.
        rest
            What its looks hold beside the oscillation.
        least_count
            Step of each channel's values, 0: none.

        Returns
        -------
        Survey
            Its reference frequency is the looks' median, rounded to a micro-hertz.
        """
        # A micro-hertz: a number that a person can write down and that two machines agree on.
        reference = float(np.round(find_median(self.track[1]), 6))
        away = rest.blind_hz
        at = finding.list_bands(reference, self.carrier_hz)
        skip = tuple((f - away, f + away) for f in (*at, 0.0))
        line_hz, line_amplitude, line_ratio = rest.find_lines(skip)
        common = estimate_correlation(rest.spectrum, at, ABOUT * reference, skip)
        twins = tell_twins(recording, common, rest.average_noise(), rest.strength2, least_count)
        return Survey(
            reference_hz=reference,
            carrier_hz=self.carrier_hz,
            step_s=self.step_s,
            track_s=self.track[0],
            track_hz=self.track[1],
            rails=(
                find_rails(recording.c, [look.raw[0] for look in self.looks]),
                find_rails(recording.s, [look.raw[1] for look in self.looks]),
            ),
            strength2=rest.strength2,
            looks=self.looks,
            look_noise2=rest.noise2,
            spectrum_hz=rest.spectrum.frequency_hz,
            spectrum_density=rest.spectrum.mean(),
            spectrum_segments=rest.spectrum.segments,
            blind_hz=skip,
            line_hz=line_hz,
            line_amplitude=line_amplitude,
            line_ratio=line_ratio,
            suspect=self.dead + self.found.suspect + twins,
            refused=_refuse_noise(self.found) + self._tell_overflow(recording, least_count),
            least_count=least_count,
            noise_correlation=common,
        )

    def _tell_overflow(
        self, recording: Recording, least_count: tuple[float, float]
    ) -> tuple[str, ...]:
        """Sentences on channels whose codes overflowed: of even samples of one oscillation."""
        if not self.even or self.carrier_hz is not None:
            return ()
        scales = (recording.c_scale_factor, recording.s_scale_factor)
        steps = [step / abs(scale) for step, scale in zip(least_count, scales, strict=True)]
        middles = [look.time_s.mean() for look in self.looks]
        turns = 2 * np.pi * self.step_s * np.interp(middles, *self.track)
        return tell_overflow(self.looks, turns.tolist(), (steps[0], steps[1]))


def survey(recording: Recording, name: str, looks: Sequence[Look] | None = None) -> Survey:
    """Find what looks along a recording show before it is demodulated.

    Parameters
    ----------
    recording
        Of both channels.
    name
        Of it, for what is said of it.
    looks
        Along it; None: they are taken.

    Returns
    -------
    Survey
        With reasons to suspect or refuse the recording.

    Raises
    ------
    HrgError
        No samples, constant channels, times that do not increase, no oscillation possible below
        half the sampling rate.

    Examples
    --------
    White noise of 1e-3 has the one-sided density 2·(1e-3)²/f_s:

    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.survey import survey
    >>> c = np.cos(2 * np.pi * 1234.5 * np.arange(80_000) / 8000)
    >>> noise = 1e-3 * np.random.default_rng(0).standard_normal((2, 80_000))
    >>> run = Recording(c=c + noise[0], s=c + noise[1], sample_rate_hz=8000.0, mode="free")
    >>> found = survey(run, "run")
    >>> round(found.reference_hz, 4), (found.average_floor() / (2e-6 / 8000)).round(1).tolist()
    (1234.5, [1.0, 1.0])
    """
    if looks is None:
        looks = take_looks(recording, recording.time_s is None, name)
    course = FrequencyCourse.from_looks(recording, name, looks)
    rest = _average_residual(
        course.looks, course.even, course.step_s, course.carrier_hz, course.track
    )
    return course.survey(recording, rest, find_least_counts(recording, course.looks))


def survey_quiet(recording: Recording, name: str) -> Survey:
    """Find the frequency's course alone, of samples without noise: what they hold beside the
    oscillation is nothing, and a few looks tell the rest.

    Parameters
    ----------
    recording, name
        As in `survey`.

    Returns
    -------
    Survey
        Without a spectrum and without a least count.

    Raises
    ------
    HrgError
        As `survey`.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.survey import survey_quiet
    >>> c = np.cos(2 * np.pi * 1234.5 * np.arange(80_000) / 8000)
    >>> found = survey_quiet(Recording(c=c, s=c, sample_rate_hz=8000.0, mode="free"), "run")
    >>> round(found.reference_hz, 4), found.spectrum_segments
    (1234.5, 0)
    """
    looks = take_looks(recording, recording.time_s is None, name, QUIET)
    course = FrequencyCourse.from_looks(recording, name, looks)
    strength2 = float(max(look.y.var(-1).max() for look in course.looks))
    # noise that nobody looked for bounds nothing
    unknown = np.full((len(course.looks), 2), np.inf)
    none = Residual(AveragedSpectrum(np.zeros(0)), 0.0, strength2, unknown)
    return course.survey(recording, none, (0.0, 0.0))


def _refuse_noise(found: SpectralPeak) -> tuple[str, ...]:
    """A sentence where nothing stands out; a ratio that is no number does not either."""
    if found.ratio > found.limit:
        return ()
    return (
        f"no oscillation stands out of the noise: the highest peak, at {found.frequency_hz:.6g} Hz,"
        f" has {found.ratio:.3g} times the power around it where {found.limit:.3g} was expected",
    )


def _need_rising_times(
    recording: Recording, looks: Sequence[Look], step_s: float, name: str
) -> None:
    """HrgError: times that are not finite, do not increase, or span far more than the samples
    fill."""
    if not all(np.isfinite(look.time_s).all() for look in looks):
        raise HrgError(
            f"{name}: time_s holds values that are not finite; strictly increasing times were"
            " expected"
        )
    if min(np.diff(look.time_s).min() for look in looks) <= 0:
        raise HrgError(
            f"{name}: its times do not increase; strictly increasing time_s was expected: sort the"
            " samples or drop the repeated ones"
        )
    samples = len(recording.c)
    begin, end = (float(recording.times(k, k + 1)[0]) for k in (0, samples - 1))
    if end - begin > LONGEST_SPAN * samples * step_s:
        raise HrgError(
            f"{name}: its times span {end - begin:.6g} s, but {samples} samples at the"
            f" usual step fill {samples * step_s:.6g} s; the clock jumps or a gap is"
            " huge: correct time_s or split the run"
        )


@dataclass(frozen=True)
class Residual:
    """What the looks hold beside the oscillation: its averaged spectrum, how far from the
    oscillation that is blind, the stronger channel's variance without it, and every look's own
    (looks, channels)."""

    spectrum: AveragedSpectrum
    blind_hz: float
    strength2: float
    noise2: Array

    def average_noise(self) -> Array:
        """Variance of a sample of each channel, without lines.

        Returns
        -------
        ndarray
            (2,), unit² of the signals; 0 without a spectrum.
        """
        seen = self.spectrum
        if not seen.segments:
            return np.zeros(2)
        return np.asarray(find_floor(seen.mean()).mean(axis=0) * seen.frequency_hz[-1])

    def find_lines(self, skip_hz: tuple[tuple[float, float], ...]) -> tuple[Array, Array, Array]:
        """Lines that stand out of the spectrum.

        Parameters
        ----------
        skip_hz
            Bands whose lines are left out.

        Returns
        -------
        frequency_hz : ndarray
            (lines,).
        amplitude : ndarray
            (lines, 2), unit of the signals.
        ratio : ndarray
            (lines,), power over the floor.
        """
        seen = self.spectrum
        if not seen.segments:
            return np.zeros(0), np.zeros((0, 2)), np.zeros(0)
        least = LINE_LEAST * np.sqrt(max(self.strength2, 0.0))
        return find_lines(seen.frequency_hz, seen.mean(), seen.segments, skip_hz, least=least)


def _average_residual(
    looks: Sequence[Look],
    even: bool,
    step_s: float,
    carrier_hz: float | None,
    track: tuple[Array, Array],
) -> Residual:
    """The spectrum of what is left of every look without the oscillation at its local frequency."""
    width = _choose_segment(looks, even)
    spectrum = AveragedSpectrum(np.fft.rfftfreq(width, step_s))
    strength, noise2 = [], []
    # four lines: the window's main lobe, where the fit took the oscillation's neighbours too
    blind = 4 / (width * step_s)
    middles = [look.time_s.mean() for look in looks]
    for look, local in zip(looks, np.interp(middles, *track), strict=True):
        f = finding.list_bands(float(local), carrier_hz)
        residual, reach = compute_look_residual(
            look.time_s, look.y, f, finding.list_nuisances(carrier_hz)
        )
        blind = max(blind, reach)
        noise2.append((residual**2).mean(-1))
        strength.append(look.y.var(-1) - noise2[-1])
        for start in range(0, residual.shape[-1] - width + 1, max(1, width // 2)):
            piece = slice(start, start + width)
            if even or np.diff(look.time_s[piece]).max() < 3 * step_s:
                spectrum.add(look.time_s[piece], residual[:, piece], even)
    return Residual(spectrum, blind, float(np.max(strength)), np.array(noise2))


def _choose_segment(looks: Sequence[Look], even: bool) -> int:
    """Samples a segment of the averaged spectrum: long ones resolve lines, several ones average."""
    length = len(looks[0].time_s)
    if even:
        width = min(length, LOOK_SAMPLES // 4 if len(looks) < 8 else LOOK_SAMPLES)
    else:
        width = min(length, UNEVEN_SAMPLES // 2)
    if len(looks) == 1:  # segments of one look alone
        width = max(min(width, length // 4), min(64, length))
    return width
