"""Diagnosis, tones near the resonance taken out of the waves, and held against the complete
model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from ....fitting.causes.extended_fit import DivergedError, ExtendedFit
from ....fitting.envelopes.envelope_runs import compute_envelopes, replace_envelopes
from ....fitting.samples.spectrum import find_floor
from ....records import Wave
from ..thresholds import LINE_RATIO
from .tone import Tone
from .tone_search import find_strongest_tone
from .tone_size import NEAREST_CYCLES, count_cycles, place_beside

Array = np.ndarray
NOTCH = 1.5
"""Distance from the oscillation, over the inverse of a window's length, within which the residual's
spectrum lacks what the windows' fits took: a third of it at half that distance."""
MOST_TONES = 4


def take_out_tone(waves: Sequence[Wave], tone: Tone) -> list[Wave]:
    """The waves with a tone taken out of every run.

    Parameters
    ----------
    waves
        Of the runs.
    tone
        With an amplitude for each of them.

    Returns
    -------
    list of Wave
        With the ellipses of what is left.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.tone import Tone
    >>> from hrg_cli.stages.diagnosis.samples.tones import take_out_tone
    >>> nothing = Tone(510.0, np.zeros((3, 2), complex), np.full((3, 2), 1e-5), 0.0)
    >>> left = take_out_tone(draw_waves(), nothing)[0]
    >>> bool(np.allclose(left.main_amplitude, draw_waves()[0].main_amplitude))
    True
    """
    out = []
    for k, wave in enumerate(waves):
        t = np.asarray(wave.time_s, float)
        u = compute_envelopes(wave)
        u = u - tone.compute_envelopes(k, t, float(wave.reference_frequency_hz))
        out.append(replace_envelopes(wave, u).replace(**_std_without(wave, tone.vector[k])))
    return out


def remove_tones(waves: Sequence[Wave], tones: Sequence[Tone]) -> list[Wave]:
    """The waves without tones.

    Parameters
    ----------
    waves
        Of the runs.
    tones
        One that dies away is listed only, and stays in them.

    Returns
    -------
    list of Wave
        In their order.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.tones import remove_tones
    >>> remove_tones(draw_waves(), [])[0] is draw_waves()[0]
    True
    """
    return reduce(take_out_tone, (tone for tone in tones if tone.standing), list(waves))


def _std_without(wave: Wave, vector: Array) -> dict[str, Array]:
    """σ (n,) of a coefficient, and of either channel's (n, 2), less what the tone e has in it, √(σ²
    −
    |e_C|²/2) for C, not below what the spectrum's floor beside the oscillation promises, √(S/T).

    The demodulation weighs the residual's colour and takes a tone for noise that every window draws
    anew: A²/2 of it in each coefficient of its channel, two of which a channel has.
    """
    if wave.spectrum_density is None or wave.spectrum_frequency_hz is None:
        return {}
    frequency = np.asarray(wave.spectrum_frequency_hz, float)
    # within 1.5/T of the oscillation every window's own fit has taken of the noise
    beside = np.abs(frequency - wave.reference_frequency_hz) > NOTCH / wave.window_s
    if np.count_nonzero(beside) < len(frequency) / 4:
        return {}
    density = np.where(beside[:, None], np.asarray(wave.spectrum_density, float), 0.0)
    level = find_floor(density)
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
    return np.array([one[(one > 0) & (one < LINE_RATIO)].mean() for one in ratio.T])


def take_out_tones(
    fit: ExtendedFit,
    waves: Sequence[Wave],
    fitted: Callable[[Sequence[Wave]], ExtendedFit],
    nearest: Callable[[ExtendedFit], ExtendedFit],
) -> tuple[ExtendedFit, list[Wave], list[Tone]]:
    """The fit and the waves without the tones found one after another.

    Parameters
    ----------
    fit
        The base model's.
    waves
        Of the runs.
    fitted
        The base model's fit to waves.
    nearest
        From a fit one that leaves as little as a few causes can, beside which the tones of a gross
        misfit are looked for.

    Returns
    -------
    tuple
        The fit, the waves, and the tones.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.tones import take_out_tones
    >>> fit, waves, tones = take_out_tones(draw_fit(), draw_waves(), None, lambda fit: fit)
    >>> fit is draw_fit(), tones
    (True, [])
    """
    left, tones = list(waves), list[Tone]()
    for _ in range(2 * MOST_TONES):
        if len(tones) == MOST_TONES:
            break
        near = nearest(fit)
        tone = find_strongest_tone(near, left)
        if tone is None:
            break
        tone = place_beside(near, tone)
        if count_cycles(near, tone) < NEAREST_CYCLES:
            break
        if not tone.standing:
            return fit, left, [*tones, tone]  # listed and not taken out
        cleaned = take_out_tone(left, tone)
        try:
            fit = fitted(cleaned)
        except DivergedError:  # what is left has no fit: it was no tone
            break
        left = cleaned
        tones = _join(tones, tone, waves)
    return fit, left, tones


def _join(tones: Sequence[Tone], tone: Tone, waves: Sequence[Wave]) -> list[Tone]:
    """The tones and one more; one within a cell of the longest run of another is a part of that
    which was not taken out."""
    longest_s = max(float(wave.time_s[-1] - wave.time_s[0]) for wave in waves)
    joined = [
        replace(one, vector=one.vector + tone.vector)
        if abs(one.frequency_hz - tone.frequency_hz) * longest_s < 1
        else one
        for one in tones
    ]
    apart = all(one is other for one, other in zip(joined, tones, strict=True))
    return [*joined, tone] if apart else joined


def confirm_tones(
    tones: Sequence[Tone], waves: Sequence[Wave], fitted: Callable[[Sequence[Wave]], ExtendedFit]
) -> list[Tone]:
    """The tones that stand out of the waves beside a complete model as well, each with the others
    taken out.

    Before its cause is known a misfit of the motion can look like a line.

    Parameters
    ----------
    tones
        As they were found; what is listed only stays.
    waves
        Of the runs, with the tones in them.
    fitted
        The complete model's fit to waves; where it has none nothing speaks against the tone.

    Returns
    -------
    list of Tone
        In their order.

    Examples
    --------
    A tone that no wave holds:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.tone import Tone
    >>> from hrg_cli.stages.diagnosis.samples.tones import confirm_tones
    >>> supposed = Tone(510.0, np.full((3, 2), 1e-4 + 0j), np.full((3, 2), 1e-5), 100.0)
    >>> confirm_tones([supposed], draw_waves(), lambda waves: draw_fit())
    []
    """

    def stands(tone: Tone) -> bool:
        left = remove_tones(waves, [other for other in tones if other is not tone])
        try:
            again = find_strongest_tone(fitted(left), left)
        except DivergedError:
            return True
        longest = max(float(wave.time_s[-1] - wave.time_s[0]) for wave in left)
        return again is not None and abs(again.frequency_hz - tone.frequency_hz) * longest < 1

    return [tone for tone in tones if not tone.standing or stands(tone)]
