"""Diagnosis, tones beside the resonance that are multiples of the oscillation: folded by the
sampling, and once more by the windows' own rate.

What bends a channel's value puts β(a) cos nφ into its samples. A window of N samples Δt shows it
in the coefficient at ω as β e^{jnφ} D((nω − ω)Δt) + β* e^{−jnφ} D((−nω − ω)Δt), D(x) = sin(Nx/2)/
(N sin(x/2)) and the curvature that demodulate puts back; in rows that stand T apart it is a tone at
±nf + k/T. There a multiple has n times the phase of the wave in every run, and a size that goes
with the wave's; a tone from outside has neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....fitting.envelopes.envelope_runs import compute_envelopes
from ....fitting.samples.frequency import fold
from ....records import Wave
from ..thresholds import BY_CHANCE
from .lines import (
    HARMONICS,
    WIDTH_CELLS,
    Line,
    find_even_step,
    find_folding_hz,
    find_median_amplitude,
    find_median_frequency,
)
from .tone import SCATTER, Tone, compute_curvature_gain

Array = np.ndarray
HIGHEST = 9
"""Highest multiple whose size goes with a power of the wave's, and that is looked for where the
windows' rate folds it: higher ones are a converter's steps', and windows weaken them."""
BOTH_WAYS = (1, -1)


@dataclass(frozen=True)
class OwnMultiple:
    """A tone that is a multiple of the oscillation: which, the line that the samples hold of it,
    and the frequency at which the windows' rate shows it elsewhere (None: it does not)."""

    order: int
    line: Line
    shown_hz: float | None

    @property
    def meaning(self) -> str:
        """What the report says of the line."""
        if self.shown_hz is None:
            return f"harmonic {self.order} of the oscillation, folded beside it"
        return (
            f"harmonic {self.order} of the oscillation, which the windows' rate shows at"
            f" {self.shown_hz:.6g} Hz beside it"
        )


def find_own_multiple(tone: Tone, waves: Sequence[Wave], frequency_hz: float) -> OwnMultiple | None:
    """The multiple of the oscillation that a tone beside the resonance is.

    Runs of length T tell its frequency to 1/T, and the oscillation's own from run to run apart. Of
    the amplitudes e (R, 2) no more may be left than noise has, or a fifth of their χ², by one
    complex number times what the windows show of β = aⁿ, or of β the same at all a; by its phases
    alone of a multiple so high that a converter's steps make it of any size and sign.

    Parameters
    ----------
    tone
        Beside the resonance.
    waves
        Of the runs.
    frequency_hz
        Of the oscillation [Hz].

    Returns
    -------
    OwnMultiple or None
        None of a tone from outside, and where samples are not evenly apart.

    Examples
    --------
    Third harmonic of 500 Hz, sampled at 2000 Hz, folded onto 500 Hz; one vector in all runs has not
    three times their phase:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.own_multiples import find_own_multiple
    >>> from hrg_cli.stages.diagnosis.samples.tone import Tone
    >>> tone = Tone(511.0, np.full((3, 2), 1e-3 + 0j), np.full((3, 2), 1e-5), 6e4)
    >>> find_own_multiple(tone, draw_waves(), 500.0) is None
    True
    """
    sampling = find_folding_hz(waves)
    if not sampling:
        return None
    size = float(np.median([find_median_amplitude(wave) for wave in waves]))
    for order in _list_orders(tone, waves, frequency_hz, sampling):
        place = float(fold(order * frequency_hz, sampling))
        direct = abs(tone.frequency_hz - place) < _tolerance(waves, order)
        for power in (order, 0):
            shown = np.array([_show(tone, wave, order, power) for wave in waves])
            leave = _leave_common if order <= HIGHEST or power else _leave_phases
            left, allowed = leave(tone, shown)
            if not left < allowed:
                continue
            amplitude = np.full(2, _scale(tone, shown) * size**power)
            line = Line(place, amplitude, tone.gain / 2, len(waves), np.ones((1, 2)))
            return OwnMultiple(order, line, None if direct else tone.frequency_hz)
    return None


def _tolerance(waves: Sequence[Wave], order: int) -> float:
    """Distance [Hz] of a tone from a multiple within which runs may have it there."""
    wander = float(np.ptp([find_median_frequency(wave) for wave in waves]))
    return WIDTH_CELLS / max(float(w.time_s[-1] - w.time_s[0]) for w in waves) + order * wander


def _list_orders(
    tone: Tone, waves: Sequence[Wave], frequency_hz: float, sampling_hz: float
) -> list[int]:
    """Multiples that stand at a tone's frequency: any that the sampling folds there, lowest first,
    and those that the windows' rate shows there."""
    step_s = float(np.median([np.median(np.diff(wave.time_s)) for wave in waves]))
    direct, shown = list[int](), list[int]()
    for order in range(2, HARMONICS + 1):
        near = _tolerance(waves, order)
        turns = (tone.frequency_hz - np.array(BOTH_WAYS) * order * frequency_hz) * step_s
        if abs(tone.frequency_hz - fold(order * frequency_hz, sampling_hz)) < near:
            direct.append(order)
        elif order <= HIGHEST and np.abs(turns - np.round(turns)).min() < near * step_s:
            shown.append(order)
    return [*direct, *shown]


def _show(tone: Tone, wave: Wave, order: int, power: int) -> Array:
    """What the windows of a run show of a^power cos nφ at a tone's frequency, (2,)."""
    good = wave.good()
    t = np.asarray(wave.time_s, float)[good]
    own = find_median_frequency(wave)
    u = compute_envelopes(wave, good)
    size = np.abs(u)
    turn = u / np.where(size > 0, size, 1.0)
    made = size**power * turn**order
    made = made * np.exp(2j * np.pi * order * wave.reference_frequency_hz * t)[:, None]
    seen = made * _respond(wave, order * own - own)
    seen += np.conj(made) * _respond(wave, -order * own - own)
    return np.asarray(np.mean(seen * np.exp(-2j * np.pi * tone.frequency_hz * t)[:, None], axis=0))


def _respond(wave: Wave, beat_hz: float) -> float:
    """Part that a window of whole samples shows of what beats at a frequency with its own."""
    step_s = find_even_step(wave) or 0.0
    count = max(round(wave.window_s / step_s), 1)
    half = np.pi * beat_hz * step_s
    part = np.sin(count * half) / (count * np.sin(half)) if abs(np.sin(half)) > 1e-9 else 1.0
    return float(part) * compute_curvature_gain(beat_hz * wave.window_s)


def _scale(tone: Tone, shown: Array) -> float:
    """Size of a tone over what windows show (R, 2)."""
    weight = 1 / tone.std**2
    power = float(np.sum(weight * np.abs(tone.vector) ** 2))
    return float(np.sqrt(power / max(np.sum(weight * np.abs(shown) ** 2), np.finfo(float).tiny)))


def _leave_common(tone: Tone, shown: Array) -> tuple[float, float]:
    """χ² that what windows show (R, 2), times one complex number, leaves of a tone, and what it may
    leave."""
    unit, along = tone.vector / tone.std, shown / tone.std
    power = max(float(np.sum(np.abs(along) ** 2)), np.finfo(float).tiny)
    taken = float(np.abs(np.sum(np.conj(along) * unit)) ** 2 / power)
    return _hold_against_noise(unit, taken, 2)


def _leave_phases(tone: Tone, shown: Array) -> tuple[float, float]:
    """The same where only the phases are those of what windows show (R, 2), but for a common one
    and signs."""
    unit = tone.vector / tone.std
    turned = unit * np.exp(-1j * np.angle(shown))
    taken = float(np.sum(np.abs(unit) ** 2) + np.abs(np.sum(turned**2))) / 2
    return _hold_against_noise(unit, taken, unit.size + 1)


def _hold_against_noise(unit: Array, taken: float, numbers: int) -> tuple[float, float]:
    """χ² that is left of amplitudes over σ, and a fifth of all or what noise leaves beside so many
    numbers."""
    from scipy.special import chdtri

    gain = float(np.sum(np.abs(unit) ** 2))
    noise = float(chdtri(max(2 * unit.size - numbers, 1), BY_CHANCE))
    return gain - taken, max(SCATTER * gain, noise)
