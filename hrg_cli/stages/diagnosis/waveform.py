"""Diagnosis, the waveform: what the samples show before any dynamics: lines of the residual,
clipped windows, samples lost.

A tone stands still in frequency and in size; an odd multiple of the oscillation, folded at half the
sampling rate, is the pick-off's or the converter's own. Lost samples turn both channels alike
between two windows. What is named has a size that could be nought and is not; all else is listed as
a line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...fitting.samples.windows import BEND, CURVED
from ...records import Wave
from .harmonics import below_the_codes, nonlinear
from .lines import WIDTH_CELLS, Line, cell_hz, frequency_of, harmonic_of, lines, sampling_hz, spurs
from .lost_samples import PhaseStep, lost, phase_steps, split_at, together
from .offered import UNMEASURED, entry, sound
from .tones import MOST_TONES, Tone

__all__ = ["causes", "phase_steps", "split_at"]


def causes(
    waves: Sequence[Wave],
    steps: Sequence[PhaseStep],
    tones: Sequence[Tone],
    frequency_hz: float,
    found: Sequence[str],
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """(effects the waveform shows, as the report's entries; every line with its meaning). `found`:
    effects named by the dynamics."""
    sampling, cell, far = sampling_hz(waves), cell_hz(waves), lines(waves)
    direct = all(w.readout == "direct" for w in waves)
    near, strange, listed = [], [], []
    for tone in tones:
        line = _as_line(tone)
        if sampling and (multiple := harmonic_of(line, frequency_hz, sampling, cell)):
            near.append(
                (line, multiple)
            )  # a harmonic that the sampling folds beside the resonance is no tone from outside
        elif not tone.standing:
            listed.append(
                line.listed(
                    0, "it dies away beside the wave: a partial of the resonator and no tone"
                )
            )
        elif not any(_folded(other, tone, waves) for other in far):
            strange.append(tone)
    everywhere = [*(line for line, _ in near), *far]
    wander = float(np.std([frequency_of(w) for w in waves]))
    codes = spurs(everywhere, frequency_hz, wander, sampling, cell) if direct else []
    codes += (
        [line for line in far if line not in codes and below_the_codes(line, waves)]
        if direct
        else []
    )
    harmonics = {multiple: line for line, multiple in near}
    open_lines = []
    for line in far:
        multiple = harmonic_of(line, frequency_hz, sampling, cell)
        if multiple:
            harmonics.setdefault(multiple, line)
            listed.append(line.listed(multiple, f"harmonic {multiple} of the oscillation"))
        elif line in codes:
            listed.append(
                line.listed(
                    0,
                    "the converter's: an odd harmonic of the oscillation, folded, or below one of"
                    " its codes",
                )
            )
        elif not direct:
            listed.append(line.listed(0, "beside the carrier"))
        elif any(abs(line.frequency_hz - t.frequency_hz) < WIDTH_CELLS * cell for t in strange):
            listed.append(line.listed(0, "the tone beside the resonance"))
        elif line.follows_the_wave:
            listed.append(
                line.listed(
                    0, "its size follows the wave's: a partial of the resonator and no tone"
                )
            )
        else:
            open_lines.append(line)
    named = open_lines if len(open_lines) <= MOST_TONES else []
    unjudged = f"one of {len(open_lines)} lines: partials or several sources, none judged"
    listed += [line.listed(0, "a tone" if named else unjudged) for line in open_lines]
    offered = [
        offer
        for group in together(steps, waves)
        if (offer := lost(group, waves, frequency_hz)) is not None
    ]
    offered += [_beating(tone, waves, frequency_hz) for tone in strange]
    offered += [_tone(line, waves) for line in named]
    offered += nonlinear(waves, harmonics, codes, found) if direct else []
    return [offer for offer in offered if sound(offer)], listed


def _as_line(tone: Tone) -> Line:
    size = np.sqrt(np.mean(np.abs(tone.vector) ** 2, axis=0))
    return Line(tone.frequency_hz, size, tone.gain / 2, len(tone.vector), np.ones((1, 2)))


def _folded(line: Line, tone: Tone, waves: Sequence[Wave]) -> bool:
    """Whether the tone seen at the windows' rate is a line of the samples, folded."""
    windows = (line.frequency_hz - tone.frequency_hz) * float(
        np.median([np.median(np.diff(w.time_s)) for w in waves])
    )
    return abs(windows) > 0.5 and abs(windows - round(windows)) < 0.05 + 0.02 * abs(windows)


def _beating(tone: Tone, waves: Sequence[Wave], frequency_hz: float) -> dict[str, Any]:
    """A tone near the resonance; a window of length T shows sin(πx)/(πx)·(1 + E(1 + cE)/24), x =
    Tδ, of what beats at δ.

    The second factor is the curvature that demodulate puts back, from h windows on either side: E =
    (2 sin(πhx)/h)².

    σ of its frequency over runs of length T: √(12/χ²)/2πT, the Cramér–Rao bound with the phases
    free.
    """
    longest = max(float(w.time_s[-1] - w.time_s[0]) for w in waves)
    turns = (tone.frequency_hz - frequency_hz) * float(np.median([w.window_s for w in waves]))
    bend = float((2 * np.sin(np.pi * BEND * turns) / BEND) ** 2)
    response = float(np.sinc(turns)) * (1 + bend * (1 + CURVED * bend) / 24)
    tone = (
        replace(tone, vector=tone.vector / response, std=tone.std / abs(response))
        if abs(response) > 0.05
        else tone
    )
    weight = 1 / tone.std**2
    mean = np.sum(tone.vector * weight[:, None], axis=0) / weight.sum()
    scatter = np.sum(np.abs(tone.vector - mean) ** 2 * weight[:, None])
    common = scatter < 0.2 * tone.gain
    vector, std = (mean, weight.sum() ** -0.5) if common else (tone.vector[0], tone.std[0])
    frequency_std = float(np.sqrt(12 / tone.gain) / (2 * np.pi * longest))
    turn = (
        np.pi * longest * frequency_std
    )  # phase at t = 0 that goes with the frequency's error, known best in the middle of the run
    parts = {
        "c_cos": vector[0].real,
        "c_sin": -vector[0].imag,
        "s_cos": vector[1].real,
        "s_sin": -vector[1].imag,
    }
    beside = {"c_cos": "c_sin", "c_sin": "c_cos", "s_cos": "s_sin", "s_sin": "s_cos"}
    parameters = {
        name: (float(v), float(np.hypot(std, parts[beside[name]] * turn)), "amplitude")
        for name, v in parts.items()
    }
    parameters["frequency_hz"] = (tone.frequency_hz, frequency_std, "Hz")
    return entry("mains_tone", float(np.sqrt(tone.gain)), parameters, tone.gain) | {
        "same_phase_in_all_runs": bool(common)
    }


def _tone(line: Line, waves: Sequence[Wave]) -> dict[str, Any]:
    """A line of the averaged spectrum, which knows the size and not the phase: each part is
    anything up to it."""
    parameters = {}
    least = 1e-6 * float(line.amplitude.max())
    for channel, size in zip("cs", line.amplitude, strict=True):
        parameters[f"{channel}_cos"] = (float(size), float(max(size, least)), "amplitude")
        parameters[f"{channel}_sin"] = (0.0, float(max(size, least)), "amplitude")
    parameters["frequency_hz"] = (line.frequency_hz, cell_hz(waves), "Hz")
    return (
        entry("mains_tone", float(np.sqrt(2 * line.ratio)), parameters, 2 * line.ratio)
        | _magnitude(line)
        | {"phase": UNMEASURED}
    )


def _magnitude(line: Line) -> dict[str, Any]:
    return {
        "magnitude": {
            channel: float(size) for channel, size in zip("cs", line.amplitude, strict=True)
        },
        "magnitude_std": {
            channel: float(size) for channel, size in zip("cs", line.std, strict=True)
        },
    }
