"""Diagnosis, the waveform: what the samples show before any dynamics: lines of the residual,
clipped windows, samples lost.

A tone stands still in frequency and in size; an odd multiple of the oscillation, folded at half the
sampling rate, is the pick-off's or the converter's own. Lost samples turn both channels alike
between two windows. What is named has a size that could be nought and is not; all else is listed as
a line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ....effects import mains_tone
from ....effects.effect import Effect
from ....records import Array, Wave
from ..thresholds import LINE_RATIO
from .harmonics import is_below_codes, name_bent_channels, read_cubic
from .lines import (
    WIDTH_CELLS,
    Line,
    find_cell_hz,
    find_folding_hz,
    find_lines,
    find_median_frequency,
    find_spurs,
    list_harmonics,
)
from .lost_samples import PhaseStep, count_lost, find_phase_steps, join_steps, split_at
from .offered import UNMEASURED, is_sound, make_entry
from .own_multiples import HIGHEST, find_own_multiple
from .tone import Tone, split_channels
from .tones import MOST_TONES

ALIKE = 1.5
"""Ratio of the sizes of two sidebands up to which they are a pair."""
LEAKS = 2.0
"""Times 1/πx of a line that windows show at most of it x turns away, the curvature that demodulate
puts back included."""
LOWEST = 3
"""Lowest cells of a spectrum at which an offset that drifts stands out."""
SIDEBAND = "one of two as far above as below the oscillation: its modulation and no tone"
"""What is said of a line that has a mirror."""
IMAGE = "what a line far from the oscillation, or an offset that drifts, leaks into the windows"
"""What is said of a tone that is the image of something else."""

__all__ = [
    "find_phase_steps",
    "find_waveform_causes",
    "list_near_tones",
    "list_unnamed_tones",
    "split_at",
]


def find_waveform_causes(
    waves: Sequence[Wave],
    steps: Sequence[PhaseStep],
    tones: Sequence[Tone],
    frequency_hz: float,
    found: Sequence[Effect],
    of_motion: float = 0.0,
    find_most_cubic: Callable[[], float] | None = None,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """What the samples show: causes by their lines and steps, and what every line is.

    Parameters
    ----------
    waves
        Of the runs.
    steps
        Of their phases.
    tones
        Found at the windows' rate.
    frequency_hz
        Of the oscillation [Hz].
    found
        Effects named by the dynamics.
    of_motion
        The third harmonic that the motion itself may have, in the signals' unit.
    find_most_cubic
        The largest cubic of the pick-off that the motion allows, asked where there is a third
        harmonic: one that would take more is a tone. None: any may be.

    Returns
    -------
    tuple
        Effects as the report's entries, and every line with its meaning.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.waveform import find_waveform_causes
    >>> find_waveform_causes(draw_waves(), [], [], 500.0, [])
    ([], [])
    """
    far = find_lines(waves)
    near, listed = _judge_tones(tones, far, waves, frequency_hz)
    strange = list_near_tones(tones, waves, frequency_hz)
    direct = all(w.readout == "direct" for w in waves)
    codes = _codes(waves, near, far, frequency_hz) if direct else []

    # of what two tones show of one multiple the stronger tells its size
    harmonics = {multiple: line for line, multiple in sorted(near, key=lambda pair: pair[0].ratio)}
    sampling, cell = find_folding_hz(waves), find_cell_hz(waves)
    open_lines = []
    for line in far:
        together = list_harmonics(line, frequency_hz, sampling, cell)
        multiple, meaning = next(iter(together), 0), ""
        if multiple == 3 and direct and find_most_cubic is not None:
            multiple = 3 if _is_own_third(line, waves, of_motion, find_most_cubic) else 0
            meaning = "" if multiple else _say_together(together)
        meaning = meaning or _meaning(line, multiple, codes, direct, strange, cell)
        if multiple:
            others = filter(None, (harmonics.get(multiple),))
            harmonics[multiple] = max([line, *others], key=lambda one: one.ratio)
        if meaning:
            listed.append(line.make_entry(multiple, meaning))
        else:
            open_lines.append(line)
    sidebands = [line for line in open_lines if _is_sideband(line, far, frequency_hz, cell)]
    listed += [line.make_entry(0, SIDEBAND) for line in sidebands]
    open_lines = [line for line in open_lines if line not in sidebands]
    named = open_lines if len(open_lines) <= MOST_TONES else []
    unjudged = f"one of {len(open_lines)} lines: partials or several sources, none judged"
    listed += [line.make_entry(0, "a tone" if named else unjudged) for line in open_lines]

    offered = [
        offer
        for group in join_steps(steps, waves)
        if (offer := count_lost(group, waves, frequency_hz)) is not None
    ]
    offered += [_beating(tone, waves) for tone in strange]
    offered += [_tone(line, waves) for line in named]
    offered += name_bent_channels(waves, harmonics, codes, found, of_motion) if direct else []
    return [offer for offer in offered if is_sound(offer)], listed


def _is_own_third(
    line: Line, waves: Sequence[Wave], of_motion: float, find_most_cubic: Callable[[], float]
) -> bool:
    """Whether a line at three times the oscillation is the motion's own, or as large as a pick-off
    makes it that bends the wave by no more than it is bent."""
    if float(np.max(line.amplitude)) <= of_motion:
        return True
    return read_cubic(line, waves) <= find_most_cubic()


def _say_together(orders: Sequence[int]) -> str:
    """What a line is that is too large for the third multiple of a cubic's, and stands where the
    sampling has other low odd ones too: what makes them all it does not tell. Empty where no other
    stands there, and the line is a tone."""
    low = [order for order in orders if order % 2 and order <= HIGHEST]
    if len(low) < 2:
        return ""
    names = " and ".join(str(order) for order in low)
    return f"multiples {names} of the oscillation, which the sampling folds together"


def _judge_tones(
    tones: Sequence[Tone], far: Sequence[Line], waves: Sequence[Wave], frequency_hz: float
) -> tuple[list[tuple[Line, int]], list[dict[str, Any]]]:
    """Of the tones beside the resonance those that are folded harmonics of the oscillation, with
    their multiple, and what is listed of all that are no tone from outside."""
    near, listed = [], []
    for tone in tones:
        line = _as_line(tone)
        if own := find_own_multiple(tone, waves, frequency_hz):
            near.append((own.line, own.order))
            listed.append(own.line.make_entry(own.order, own.meaning))
        elif _is_image(tone, far, waves):
            listed.append(line.make_entry(0, IMAGE))
        elif not tone.standing:
            listed.append(
                line.make_entry(
                    0, "it dies away beside the wave: a partial of the resonator and no tone"
                )
            )
    return near, listed


def _codes(
    waves: Sequence[Wave],
    near: Sequence[tuple[Line, int]],
    far: Sequence[Line],
    frequency_hz: float,
) -> list[Line]:
    """Lines that a converter's codes make."""
    wander = float(np.std([find_median_frequency(w) for w in waves]))
    everywhere = [*(line for line, _ in near), *far]
    codes = find_spurs(
        everywhere, frequency_hz, wander, find_folding_hz(waves), find_cell_hz(waves)
    )
    return codes + [line for line in far if line not in codes and is_below_codes(line, waves)]


def _meaning(
    line: Line,
    multiple: int,
    codes: Sequence[Line],
    direct: bool,
    strange: Sequence[Tone],
    cell: float,
) -> str:
    """What a line of the spectrum is; empty where it may be a tone from outside."""
    if multiple:
        return f"harmonic {multiple} of the oscillation"
    if line in codes:
        return (
            "the converter's: an odd harmonic of the oscillation, folded, or below one of its codes"
        )
    if not direct:
        return "beside the carrier"
    if any(abs(line.frequency_hz - t.frequency_hz) < WIDTH_CELLS * cell for t in strange):
        return "the tone beside the resonance"
    if line.follows_the_wave:
        return "its size follows the wave's: a partial of the resonator and no tone"
    return ""


def _is_sideband(line: Line, far: Sequence[Line], frequency_hz: float, cell: float) -> bool:
    """Whether another line stands as far on the other side of the oscillation, in size too: what
    bends or switches the oscillation itself makes both, a source of its own one."""
    if abs(line.frequency_hz - frequency_hz) < WIDTH_CELLS * cell:
        return False
    mirror = 2 * frequency_hz - line.frequency_hz
    size = float(np.hypot(*line.amplitude))
    return any(
        other is not line
        and abs(other.frequency_hz - mirror) < WIDTH_CELLS * cell
        and 1 / ALIKE < float(np.hypot(*other.amplitude)) / size < ALIKE
        for other in far
    )


def _as_line(tone: Tone) -> Line:
    size = np.sqrt(np.mean(np.abs(tone.vector) ** 2, axis=0))
    return Line(tone.frequency_hz, size, tone.gain / 2, len(tone.vector), np.ones((1, 2)))


def list_unnamed_tones(tones: Sequence[Tone], named: Sequence[Effect]) -> list[Tone]:
    """Tones that were taken out of the waves where nothing that is named makes a line.

    Parameters
    ----------
    tones
        As they were found.
    named
        Causes.

    Returns
    -------
    list of Tone
        Without those that die away, which were not taken out.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.samples.tone import Tone
    >>> from hrg_cli.stages.diagnosis.samples.waveform import list_unnamed_tones
    >>> tone = Tone(510.0, np.full((1, 2), 1e-4 + 0j), np.full((1, 2), 1e-5), 100.0)
    >>> [len(list_unnamed_tones([tone], named)) for named in ([], [find("mains_tone")])]
    [1, 0]
    """
    makes_lines = any(effect.makes_lines for effect in named)
    return [] if makes_lines else [tone for tone in tones if tone.standing]


def _is_image(tone: Tone, far: Sequence[Line], waves: Sequence[Wave]) -> bool:
    """Whether the tone seen at the windows' rate is what a line of the samples far from the
    oscillation leaks into the windows, or what an offset of the channels does that drifts.

    A line A cos ω_L t stands in the coefficients of windows of length T as A sin(πx)/(πx) with x =
    (±f_L − f)T turns a window, and there as a tone at ±f_L + k/T: both signs are as strong far
    below the oscillation. What drifts is the same in every window: a line at nought.
    """
    step_s = float(np.median([np.median(np.diff(w.time_s)) for w in waves]))
    longest = max(float(w.time_s[-1] - w.time_s[0]) for w in waves)
    own = tone.frequency_hz * step_s
    if abs(own - round(own)) < WIDTH_CELLS * step_s / longest and _may_drift(waves):
        return True
    near = WIDTH_CELLS * find_cell_hz(waves) * step_s
    size = np.sqrt(np.mean(np.abs(tone.vector) ** 2))
    for line in far:
        for turns in (line.frequency_hz * step_s - own, -line.frequency_hz * step_s - own):
            leaks = LEAKS * float(line.amplitude.max()) / (np.pi * max(abs(turns), 0.5))
            if round(turns) != 0 and abs(turns - round(turns)) < near and size < leaks:
                return True
    away, amplitudes = _find_power_beside(tone.frequency_hz, step_s, waves)
    return bool(np.any(size < LEAKS * amplitudes / (np.pi * away)))


def _find_power_beside(
    frequency_hz: float, step_s: float, waves: Sequence[Wave]
) -> tuple[Array, Array]:
    """Turns a window (k,) and amplitudes (k,) of what the samples' spectrum holds above its floor
    where it would have a tone's image in the windows.

    Of a line some windows' widths beside the oscillation the windows' own fits leave a comb, which
    stands out of no running floor as a line does.
    """
    known = [w for w in waves if w.spectrum_density is not None]
    if not known:
        return np.ones(0), np.ones(0)
    grid = np.asarray(known[0].spectrum_frequency_hz, float)
    densities = [np.asarray(w.spectrum_density, float) for w in known]
    density = np.mean([one for one in densities if len(one) == len(grid)], axis=0)
    strong = np.where(density > LINE_RATIO * np.median(density, axis=0), density, 0.0).max(axis=1)
    about = strong[:-2] + strong[1:-1] + strong[2:]

    most = int(grid[-1] * step_s)
    turns = np.concatenate([np.arange(-most, 0), np.arange(1, most + 1)])
    cells = np.rint(np.abs(frequency_hz + turns / step_s) / grid[1]).astype(int)
    power = about[np.clip(cells - 1, 0, len(about) - 1)] * grid[1]
    return np.abs(turns), np.sqrt(2 * power)


def _may_drift(waves: Sequence[Wave]) -> bool:
    """Whether a channel's offset may drift: its samples' spectrum stands out at its low end, or is
    not known."""
    for wave in waves:
        if wave.spectrum_density is None:
            return True
        density = np.asarray(wave.spectrum_density, float)
        lowest = density[1 : 1 + LOWEST].mean(axis=0)  # the first is each segment's mean, taken off
        if np.any(lowest > LINE_RATIO * np.median(density, axis=0)):
            return True
    return False


def list_near_tones(
    tones: Sequence[Tone], waves: Sequence[Wave], frequency_hz: float
) -> list[Tone]:
    """Of the tones seen at the windows' rate those that stand on their own there, at their true
    size.

    Parameters
    ----------
    tones
        As they were found.
    waves
        Of the runs.
    frequency_hz
        Of the oscillation [Hz].

    Returns
    -------
    list of Tone
        Without multiples of the oscillation and images of lines farther off.

    Examples
    --------
    What beats by a fifth of a turn in a window is shown smaller there than it is:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.tone import Tone
    >>> from hrg_cli.stages.diagnosis.samples.waveform import list_near_tones
    >>> tone = Tone(510.0, np.full((3, 2), 1e-3 + 0j), np.full((3, 2), 1e-5), 1e4)
    >>> found = list_near_tones([tone], draw_waves(), 500.0)
    >>> [bool(abs(one.vector[0, 0]) > 1e-3) for one in found]
    [True]
    """
    far = find_lines(waves)
    window = float(np.median([w.window_s for w in waves]))
    return [
        tone.undo_windows(frequency_hz, window)
        for tone in tones
        if tone.standing
        and find_own_multiple(tone, waves, frequency_hz) is None
        and not _is_image(tone, far, waves)
    ]


def _beating(tone: Tone, waves: Sequence[Wave]) -> dict[str, Any]:
    """A tone near the resonance, at its true size.

    σ of its frequency over runs of length T: √(12/χ²)/2πT, the Cramér–Rao bound with the phases
    free.
    """
    longest = max(float(w.time_s[-1] - w.time_s[0]) for w in waves)
    vector = tone.mean if tone.common else tone.vector[0]
    std = np.sum(tone.std**-2.0, axis=0) ** -0.5 if tone.common else tone.std[0]
    frequency_std = float(np.sqrt(12 / tone.gain) / (2 * np.pi * longest))
    turn = (
        np.pi * longest * frequency_std
    )  # phase at t = 0 that goes with the frequency's error, known best in the middle of the run
    parts = split_channels(vector)
    beside = {"c_cos": "c_sin", "c_sin": "c_cos", "s_cos": "s_sin", "s_sin": "s_cos"}
    parameters = {
        name: (float(v), float(np.hypot(own, parts[beside[name]] * turn)), "amplitude")
        for (name, v), own in zip(parts.items(), np.repeat(std, 2), strict=True)
    }
    parameters["frequency_hz"] = (tone.frequency_hz, frequency_std, "Hz")
    return _make_tone(parameters, np.abs(vector), std) | {"same_phase_in_all_runs": tone.common}


def _tone(line: Line, waves: Sequence[Wave]) -> dict[str, Any]:
    """A line of the averaged spectrum, which knows the size and not the phase: each part is
    anything up to it."""
    parameters = {}
    least = 1e-6 * float(line.amplitude.max())
    for channel, size in zip("cs", line.amplitude, strict=True):
        parameters[f"{channel}_cos"] = (float(size), float(max(size, least)), "amplitude")
        parameters[f"{channel}_sin"] = (0.0, float(max(size, least)), "amplitude")
    parameters["frequency_hz"] = (line.frequency_hz, find_cell_hz(waves), "Hz")
    return _make_tone(parameters, line.amplitude, line.std) | {"phase": UNMEASURED}


def _make_tone(
    parameters: dict[str, tuple[float, float, str]], amplitude: Array, std: Array
) -> dict[str, Any]:
    """The entry of a tone with its amplitudes in C and S (2,), by which it stands off nought."""
    gain = float(np.sum((amplitude / std) ** 2))
    return make_entry(mains_tone.EFFECT, float(np.sqrt(gain)), parameters, gain) | {
        "magnitude": {name: float(size) for name, size in zip("cs", amplitude, strict=True)},
        "magnitude_std": {name: float(one) for name, one in zip("cs", std, strict=True)},
    }
