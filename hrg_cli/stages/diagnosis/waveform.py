"""Diagnosis, the waveform: what the samples show before any dynamics: lines of the residual, clipped windows, samples lost.

A tone stands still in frequency and in size; an odd multiple of the oscillation, folded at half the sampling rate, is the pick-off's or the
converter's own. Lost samples turn both channels alike between two windows. What is named has a size that could be nought and is not; all
else is listed as a line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...effects import EFFECTS
from ...fitting.samples.windows import BEND, CURVED
from ...physics import ellipse
from ...records import Array, Wave
from .jumps import TOUCHED, jumps
from .lines import WIDTH_CELLS, Line, amplitude_of, cell_hz, harmonic_of, lines, sampling_hz, spurs
from .tones import MOST_TONES, Tone

FEWEST_ROWS = 40
NAMED = 3.0
"""σ that the size of what the waveform offers must stand off nought."""
CUBIC_LARGEST = 0.3
"""γa² of a pick-off's cubic beyond which it is none."""
WHOLE = 2e-3
"""Distance from a whole number of samples that a loss may have, beside its σ."""
KNOWN_STEP = 0.15
"""σ of a loss in samples up to which it can be asked to be whole."""
SHIFTED = 5.0
"""σ of the slow motion's shift within which the time lost lies."""
MOST_PERIODS = 40
"""Whole periods that may be lost beside what the phase shows."""
UNMEASURED = "not measured: a line of the averaged spectrum"
CLIPPED_PEAK = 4 / np.pi
"""Fundamental of a wave that is clipped to a square, over the level."""


@dataclass(frozen=True)
class PhaseStep:
    """A step of the phase of one run: last row before and first row after it, instant, size in (−π, π], its σ."""

    run: int
    before: int
    after: int
    time_s: float
    step_rad: float
    std_rad: float
    shift_s: float = 0.0
    shift_std_s: float = np.inf
    """Time by which the slow motion moved on, and its σ."""


def phase_steps(waves: Sequence[Wave]) -> list[PhaseStep]:
    """Where both channels of a run turn alike between two windows and do nothing else, at most a few a run."""
    return [
        PhaseStep(number, jump.before, jump.after, jump.time_s, jump.turn_rad, jump.turn_std_rad, jump.shift_s, jump.shift_std_s)
        for number, wave in enumerate(waves)
        for jump in jumps(wave)
        if jump.alike
    ]


def split_at(waves: Sequence[Wave], steps: Sequence[PhaseStep]) -> tuple[list[Wave], list[int]]:
    """The waves cut at every step, each piece a run of its own, and the wave each comes from; pieces too short are left out."""
    pieces, origin = [], []
    for number, wave in enumerate(waves):
        cuts = sorted((max(0, s.before + 1 - TOUCHED), min(len(wave), s.after + TOUCHED)) for s in steps if s.run == number)
        begin = 0
        for stop, start in [*cuts, (len(wave), len(wave))]:
            piece = wave.rows(begin, stop)
            if cuts:
                # the window over the step has spoilt the noise estimate of those it was pooled with
                piece = piece.replace(signal_std=np.minimum(piece.signal_std, _rough(piece)))
            if not cuts or int(np.count_nonzero(piece.good())) >= FEWEST_ROWS:
                pieces.append(piece)
                origin.append(number)
            begin = start
    return pieces, origin


def _rough(wave: Wave) -> float:
    """Noise of one signal coefficient from the envelopes' third differences."""
    good = wave.good()
    u = ellipse.envelopes(wave.main_amplitude, wave.quadrature_amplitude, wave.wave_angle_rad, wave.phase_rad, wave.mode_number)[good]
    return float(np.sqrt(np.median(np.abs(np.diff(u, n=3, axis=0)) ** 2) / (20 * 2 * np.log(2)))) if len(u) > 3 else np.inf


def causes(
    waves: Sequence[Wave], steps: Sequence[PhaseStep], tones: Sequence[Tone], frequency_hz: float, found: Sequence[str]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """(effects the waveform shows, as the report's entries; every line with its meaning). `found`: effects named by the dynamics."""
    sampling, cell, far = sampling_hz(waves), cell_hz(waves), lines(waves)
    direct = all(w.readout == "direct" for w in waves)
    near, strange, listed = [], [], []
    for tone in tones:
        line = _as_line(tone)
        if sampling and (multiple := harmonic_of(line, frequency_hz, sampling, cell)):
            near.append((line, multiple))  # a harmonic that the sampling folds beside the resonance is no tone from outside
        elif not tone.standing:
            listed.append(line.listed(0, "it dies away beside the wave: a partial of the resonator and no tone"))
        elif not any(_folded(other, tone, waves) for other in far):
            strange.append(tone)
    everywhere = [*(line for line, _ in near), *far]
    wander = float(np.std([_frequency(w) for w in waves]))
    codes = spurs(everywhere, frequency_hz, wander, sampling, cell) if direct else []
    harmonics = {multiple: line for line, multiple in near}
    open_lines = []
    for line in far:
        multiple = harmonic_of(line, frequency_hz, sampling, cell)
        if multiple:
            harmonics.setdefault(multiple, line)
            listed.append(line.listed(multiple, f"harmonic {multiple} of the oscillation"))
        elif line in codes:
            listed.append(line.listed(0, "an odd harmonic of the oscillation, folded"))
        elif not direct:
            listed.append(line.listed(0, "beside the carrier"))
        elif any(abs(line.frequency_hz - t.frequency_hz) < WIDTH_CELLS * cell for t in strange):
            listed.append(line.listed(0, "the tone beside the resonance"))
        elif line.follows_the_wave:
            listed.append(line.listed(0, "its size follows the wave's: a partial of the resonator and no tone"))
        else:
            open_lines.append(line)
    named = open_lines if len(open_lines) <= MOST_TONES else []
    listed += [line.listed(0, "a tone" if named else f"one of {len(open_lines)} lines: partials or several sources, none judged") for line in open_lines]
    offered = [entry for group in _together(steps, waves) if (entry := _lost(group, waves, frequency_hz)) is not None]
    offered += [_beating(tone, waves, frequency_hz) for tone in strange]
    offered += [_tone(line, waves) for line in named]
    offered += _nonlinear(waves, harmonics, codes, found) if direct else []
    return [entry for entry in offered if _sound(entry)], listed


def _as_line(tone: Tone) -> Line:
    size = np.sqrt(np.mean(np.abs(tone.vector) ** 2, axis=0))
    return Line(tone.frequency_hz, size, tone.gain / 2, len(tone.vector), np.ones((1, 2)))


def _frequency(wave: Wave) -> float:
    good = wave.good()
    phase, t = np.asarray(wave.phase_rad, float)[good], np.asarray(wave.time_s, float)[good]
    return float(wave.reference_frequency_hz + np.median(np.diff(phase) / np.diff(t)) / (2 * np.pi)) if len(t) > 1 else wave.reference_frequency_hz


def _folded(line: Line, tone: Tone, waves: Sequence[Wave]) -> bool:
    """Whether the tone seen at the windows' rate is a line of the samples, folded."""
    windows = (line.frequency_hz - tone.frequency_hz) * float(np.median([np.median(np.diff(w.time_s)) for w in waves]))
    return abs(windows) > 0.5 and abs(windows - round(windows)) < 0.05 + 0.02 * abs(windows)


def _entry(name: str, z: float, parameters: dict[str, tuple[float, float, str]], gain: float) -> dict[str, Any]:
    return {
        "name": name,
        "z": z,
        "p_value": float(np.exp(-0.5 * min(z**2, 1400))),
        "delta_bic": gain,
        "parameters": {k: {"value": v, "std": s, "units": u} for k, (v, s, u) in parameters.items()},
        "indistinguishable_from": [],
        "next_experiment": next((effect.next_experiment for effect in EFFECTS if effect.name == name), ""),
        "view": "waveform",
    }


def _sound(entry: dict[str, Any]) -> bool:
    """Whether an entry stands off nought, and every parameter has a size and a σ that are numbers."""
    values = [(p["value"], p["std"]) for p in entry["parameters"].values()]
    sizes = [size for size in entry.get("magnitude", {"": 1.0}).values() if size > 0]
    return bool(entry["z"] > NAMED and sizes and all(np.isfinite(v) and np.isfinite(s) and s > 0 for v, s in values))


def _together(steps: Sequence[PhaseStep], waves: Sequence[Wave]) -> list[list[PhaseStep]]:
    """Steps at the same instant and of the same size in several runs are one cause."""
    groups: list[list[PhaseStep]] = []
    for step in steps:
        for group in groups:
            first = group[0]
            same_size = abs(np.angle(np.exp(1j * (first.step_rad - step.step_rad)))) < 8 * np.hypot(first.std_rad, step.std_rad)
            if abs(first.time_s - step.time_s) < waves[step.run].window_s and same_size and first.run != step.run:
                group.append(step)
                break
        else:
            groups.append([step])
    return groups


def _lost(group: Sequence[PhaseStep], waves: Sequence[Wave], frequency_hz: float) -> dict[str, Any] | None:
    """Samples lost, or repeated where the time is negative; None where the sampling is even and no whole number of samples does it."""
    omega, first = 2 * np.pi * frequency_hz, group[0]
    weight = np.array([s.std_rad**-2 for s in group])
    mean = first.step_rad + float(np.sum(weight * [np.angle(np.exp(1j * (s.step_rad - first.step_rad))) for s in group]) / weight.sum())
    std = float(weight.sum() ** -0.5)
    lost, samples = float(np.mod(mean, 2 * np.pi)) / omega, None
    step_s = _even_step(waves[first.run])
    if step_s is not None and std / omega < KNOWN_STEP * step_s:
        shown = min(group, key=lambda s: s.shift_std_s)
        whole = _whole(mean / omega, std / omega, step_s, 1 / frequency_hz, (shown.shift_s, shown.shift_std_s))
        if whole is None:
            return None
        lost, samples = whole * step_s, whole
    elif mean < 0 and abs(mean) < np.pi / 2:
        lost = mean / omega
    parameters = {
        "lost_s": (lost, std / omega, "s"),
        "time_s": (first.time_s, float(waves[first.run].window_s) / 2, "s"),
    }
    entry = _entry("dropped_samples", abs(mean) / std, parameters, (mean / std) ** 2)
    entry |= {"runs": [waves[s.run].run_id for s in group], "ambiguity_s": 1 / frequency_hz, "what": "lost" if lost > 0 else "repeated"}
    return entry if samples is None else entry | {"samples": samples}


def _even_step(wave: Wave) -> float | None:
    """Sampling step of an evenly sampled run, whose windows are then all equally far apart; None elsewhere."""
    rate = sampling_hz([wave])
    steps = np.diff(np.asarray(wave.time_s, float))
    regular = len(steps) > 0 and float(np.abs(steps / np.median(steps) - np.round(steps / np.median(steps))).max()) < 1e-6
    return 1 / rate if rate and regular else None


def _whole(time_s: float, std_s: float, step_s: float, period_s: float, shift: tuple[float, float]) -> int | None:
    """Fewest samples whose time agrees with a step of the phase, but for whole periods, and with the shift of the slow motion."""
    most = MOST_PERIODS
    if np.isfinite(shift[1]):
        most = max(most, int((abs(shift[0]) + SHIFTED * shift[1]) / period_s) + 1) if shift[1] < MOST_PERIODS * period_s else most
    times = time_s + np.arange(-most, most + 1) * period_s
    whole = np.round(times / step_s)
    fits = (np.abs(times / step_s - whole) < 4 * std_s / step_s + WHOLE) & (whole != 0) & (np.abs(times - shift[0]) < SHIFTED * shift[1])
    return int(min(whole[fits], key=lambda n: (abs(n), -n))) if fits.any() else None


def _beating(tone: Tone, waves: Sequence[Wave], frequency_hz: float) -> dict[str, Any]:
    """A tone near the resonance; a window of length T shows sin(πx)/(πx)·(1 + E(1 + cE)/24), x = Tδ, of what beats at δ.

    The second factor is the curvature that demodulate puts back, from h windows on either side: E = (2 sin(πhx)/h)².

    σ of its frequency over runs of length T: √(12/χ²)/2πT, the Cramér–Rao bound with the phases free.
    """
    longest = max(float(w.time_s[-1] - w.time_s[0]) for w in waves)
    turns = (tone.frequency_hz - frequency_hz) * float(np.median([w.window_s for w in waves]))
    bend = float((2 * np.sin(np.pi * BEND * turns) / BEND) ** 2)
    response = float(np.sinc(turns)) * (1 + bend * (1 + CURVED * bend) / 24)
    tone = replace(tone, vector=tone.vector / response, std=tone.std / abs(response)) if abs(response) > 0.05 else tone
    weight = 1 / tone.std**2
    mean = np.sum(tone.vector * weight[:, None], axis=0) / weight.sum()
    scatter = np.sum(np.abs(tone.vector - mean) ** 2 * weight[:, None])
    common = scatter < 0.2 * tone.gain
    vector, std = (mean, weight.sum() ** -0.5) if common else (tone.vector[0], tone.std[0])
    frequency_std = float(np.sqrt(12 / tone.gain) / (2 * np.pi * longest))
    turn = np.pi * longest * frequency_std  # phase at t = 0 that goes with the frequency's error, known best in the middle of the run
    parts = {"c_cos": vector[0].real, "c_sin": -vector[0].imag, "s_cos": vector[1].real, "s_sin": -vector[1].imag}
    beside = {"c_cos": "c_sin", "c_sin": "c_cos", "s_cos": "s_sin", "s_sin": "s_cos"}
    parameters = {name: (float(v), float(np.hypot(std, parts[beside[name]] * turn)), "amplitude") for name, v in parts.items()}
    parameters["frequency_hz"] = (tone.frequency_hz, frequency_std, "Hz")
    return _entry("mains_tone", float(np.sqrt(tone.gain)), parameters, tone.gain) | {"same_phase_in_all_runs": bool(common)}


def _tone(line: Line, waves: Sequence[Wave]) -> dict[str, Any]:
    """A line of the averaged spectrum, which knows the size and not the phase: each part is anything up to it."""
    parameters = {}
    least = 1e-6 * float(line.amplitude.max())
    for channel, size in zip("cs", line.amplitude, strict=True):
        parameters[f"{channel}_cos"] = (float(size), float(max(size, least)), "amplitude")
        parameters[f"{channel}_sin"] = (0.0, float(max(size, least)), "amplitude")
    parameters["frequency_hz"] = (line.frequency_hz, cell_hz(waves), "Hz")
    return _entry("mains_tone", float(np.sqrt(2 * line.ratio)), parameters, 2 * line.ratio) | _magnitude(line) | {"phase": UNMEASURED}


def _magnitude(line: Line) -> dict[str, Any]:
    return {
        "magnitude": {channel: float(size) for channel, size in zip("cs", line.amplitude, strict=True)},
        "magnitude_std": {channel: float(size) for channel, size in zip("cs", line.std, strict=True)},
    }


def _nonlinear(waves: Sequence[Wave], harmonics: dict[int, Line], codes: Sequence[Line], found: Sequence[str]) -> list[dict[str, Any]]:
    """What the odd harmonics are: clipping where samples were clipped, the converter where they are many, the pick-off's cubic where the third is."""
    odd = [n for n in sorted(harmonics) if n % 2]
    if {"pickoff_nonlinearity", "saturation", "converter_nonlinearity"} & set(found):
        return []
    if any(np.any(w.flags & 1) for w in waves):
        clipping = _clipping(waves, [harmonics[n] for n in odd])
        return [clipping] if clipping is not None else []
    if codes:
        return [_converter(waves, codes, harmonics)]
    if 3 not in harmonics:
        return []
    line, size = harmonics[3], float(np.median([amplitude_of(w) for w in waves]))
    cubic = 4 * float(np.max(line.amplitude)) / size**3
    if not 0 < cubic * size**2 < CUBIC_LARGEST:
        return []
    entry = _entry("pickoff_nonlinearity", float(np.sqrt(2 * line.ratio)), {"cubic": (cubic, cubic, "amplitude-2")}, 2 * line.ratio)
    known = {"magnitude": {"cubic": cubic}, "magnitude_std": {"cubic": cubic / np.sqrt(2 * line.ratio)}}
    return [entry | known | {"sign": UNMEASURED}]


def _clipping(waves: Sequence[Wave], odd: Sequence[Line]) -> dict[str, Any] | None:
    """The level between the largest channel that was not clipped and the smallest that was; None where that is no level.

    A channel clipped to a square shows 4/π of the level, so the level is no less than π/4 of the largest seen.
    """
    seen = [np.abs(_channels(w)).max(axis=-1) for w in waves]
    clipped = [(np.asarray(w.flags) & 1) > 0 for w in waves]
    high = np.concatenate([s[c] for s, c in zip(seen, clipped, strict=True)])
    free = np.concatenate([s[~c & np.isfinite(s)] for s, c in zip(seen, clipped, strict=True)])
    if not len(high):
        return None
    least, most = float(np.nanmax(high)) / CLIPPED_PEAK, float(np.nanmin(high))
    if len(free):
        least = max(least, float(free.max()))
    level, std = (least + max(most, least)) / 2, max(abs(most - least) / 2, 1e-3 * least)
    z = float(np.sqrt(max([2 * line.ratio for line in odd], default=float(len(high)))))
    return _entry("saturation", z, {"inverse_level": (1 / level, std / level**2, "amplitude-1")}, z**2) | {"clipped_windows": len(high)}


def _channels(wave: Wave) -> Array:
    return ellipse.envelopes(wave.main_amplitude, wave.quadrature_amplitude, wave.wave_angle_rad, wave.phase_rad, wave.mode_number)


def _converter(waves: Sequence[Wave], codes: Sequence[Line], harmonics: dict[int, Line]) -> dict[str, Any]:
    """The codes' own harmonics as one cause. A step h of the codes at mid-scale makes harmonics 4h/πn: h from each of them, its sign unknown."""
    counts = [step for w in waves if (step := getattr(w, "least_count", None))]
    gain = float(sum(2 * line.ratio for line in codes))
    low = [(n, line) for n, line in harmonics.items() if n % 2]
    sizes = [np.pi * n * float(line.amplitude.max()) / 4 for n, line in low] or [np.pi / 4 * float(max(line.amplitude.max() for line in codes))]
    height = float(np.median(sizes))
    parameters = {"mid_scale": (height, height, "amplitude")}
    if counts:
        parameters["step"] = (float(np.median(counts)), 1e-3 * float(np.median(counts)), "amplitude")
    entry = _entry("converter_nonlinearity", float(np.sqrt(gain)), parameters, gain)
    return entry | {"lines": len(codes), "magnitude": {"mid_scale": height}, "magnitude_std": {"mid_scale": height / np.sqrt(2)}, "sign": UNMEASURED}
