"""Diagnosis, the waveform: what the samples show before any dynamics: lines of the residual, clipped windows, samples lost.

A tone stands still in frequency; an odd multiple of the oscillation, folded at half the sampling rate, is the pick-off's own nonlinearity.
Lost samples are a step of the phase between two windows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...effects import find
from ...fitting.samples.windows import BEND, CURVED
from ...physics import ellipse
from ...records import Wave
from .tones import Tone

Array = np.ndarray
STEP_SIGMA = 8.0
NEIGHBOURS = 12
FEWEST_ROWS = 40
TOUCHED = 6
"""Windows on either side of a step whose demodulation used the other side's slope."""
LINE_RATIO = 8.0
"""Power of a line over the floor from which it counts, in a good part of the runs."""


@dataclass(frozen=True)
class PhaseStep:
    """A step of the phase of one run: last row before and first row after it, instant, size in (−π, π], its σ."""

    run: int
    before: int
    after: int
    time_s: float
    step_rad: float
    std_rad: float


@dataclass(frozen=True)
class Line:
    """A line of the residual spectrum: frequency, amplitudes of C and S, power over the floor, runs that show it."""

    frequency_hz: float
    amplitude: Array
    ratio: float
    runs: int


def phase_steps(waves: Sequence[Wave]) -> list[PhaseStep]:
    """Steps of the phase that stand out of the neighbouring increments, at most a few a run."""
    out = []
    for number, wave in enumerate(waves):
        rows = np.flatnonzero(wave.good() & np.isfinite(wave.phase_rad))
        if len(rows) < 4 * NEIGHBOURS:
            continue
        t, phase = wave.time_s[rows], wave.phase_rad[rows]
        rate = np.diff(phase) / np.diff(t)
        off = (rate - _running_median(rate)) * np.diff(t)
        noise = np.median(wave.signal_std[rows] / wave.main_amplitude[rows])
        scale = max(1.4826 * float(np.median(np.abs(off))), 1.2 * float(noise))
        big = np.flatnonzero(np.abs(off) > max(STEP_SIGMA, 0.02 / scale) * scale)
        groups = np.split(big, np.flatnonzero(np.diff(big) > 2) + 1) if len(big) else []
        if len(groups) > 5:
            continue
        for group in groups:
            first, last = group[0], group[-1] + 1
            left = rows[max(0, first + 1 - TOUCHED - 2 * NEIGHBOURS) : max(0, first + 1 - TOUCHED)]
            right = rows[last + TOUCHED : last + TOUCHED + 2 * NEIGHBOURS]
            if len(left) < 4 or len(right) < 4 or len(group) > 3:
                continue
            before, after = int(rows[first]), int(rows[last])
            middle = float(wave.time_s[before] + wave.time_s[after]) / 2
            jump, std = _jump(wave, left, right, middle)
            if abs(jump) > STEP_SIGMA * std:
                out.append(PhaseStep(number, before, after, middle, jump, std))
    return out


def _running_median(values: Array) -> Array:
    width = 2 * NEIGHBOURS + 1
    padded = np.pad(values, NEIGHBOURS, mode="reflect")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)


def _jump(wave: Wave, left: Array, right: Array, middle: float) -> tuple[float, float]:
    """Phase on the right less on the left at the middle, from straight lines of one slope, wrapped; and its σ."""
    rows = np.concatenate([left, right])
    x = wave.time_s[rows] - middle
    y = np.unwrap(wave.phase_rad[left]).tolist() + np.unwrap(wave.phase_rad[right]).tolist()
    design = np.column_stack([x, np.ones(len(x)), x > 0])
    solution, residual, *_ = np.linalg.lstsq(design, np.array(y), rcond=None)
    spread = float(np.sqrt(residual[0] / max(1, len(x) - 3))) if len(residual) else 0.0
    sigma = max(spread, float(np.median(wave.signal_std[rows] / wave.main_amplitude[rows])))
    covariance = np.linalg.pinv(design.T @ design)
    return float(np.angle(np.exp(1j * solution[2]))), sigma * float(np.sqrt(covariance[2, 2]))


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


def lines(waves: Sequence[Wave]) -> list[Line]:
    """Lines that a third of the runs at least show, strongest first."""
    pool = []
    for number, wave in enumerate(waves):
        if wave.spectrum_line_frequency_hz is None or wave.spectrum_line_ratio is None or wave.spectrum_line_amplitude is None:
            continue
        for f, a, ratio in zip(wave.spectrum_line_frequency_hz, wave.spectrum_line_amplitude, wave.spectrum_line_ratio, strict=True):
            if ratio > LINE_RATIO:
                pool.append((float(f), np.asarray(a, float), float(ratio), number))
    out = []
    while pool:
        f, _, _, _ = max(pool, key=lambda p: p[2])
        near = [p for p in pool if abs(p[0] - f) < 2.0 + 1e-4 * f]
        pool = [p for p in pool if abs(p[0] - f) >= 2.0 + 1e-4 * f]
        runs = len({p[3] for p in near})
        if 3 * runs >= len(waves):
            weight = np.array([p[2] for p in near])
            frequency = float(np.average([p[0] for p in near], weights=weight))
            out.append(Line(frequency, np.sqrt(np.mean([p[1] ** 2 for p in near], axis=0)), float(weight.max()), runs))
    return out


def harmonic_of(line: Line, frequency_hz: float, sampling_hz: float | None, tolerance: float = 2e-4) -> int:
    """Which multiple of the oscillation (2 … 25) a line is, folded at half the sampling rate where that is known; 0: none."""
    for n in range(2, 26):
        f = n * frequency_hz
        if sampling_hz:
            f = abs((f + sampling_hz / 2) % sampling_hz - sampling_hz / 2)
        if abs(line.frequency_hz - f) < 2.0 + tolerance * n * frequency_hz:
            return n
    return 0


def causes(
    waves: Sequence[Wave], steps: Sequence[PhaseStep], tones: Sequence[Tone], frequency_hz: float, found: Sequence[str]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """(effects the waveform shows, as the report's entries; every line with its meaning). `found`: effects named by the dynamics."""
    far = lines(waves)
    density = [w.spectrum_frequency_hz for w in waves if w.spectrum_frequency_hz is not None and len(w.spectrum_frequency_hz)]
    sampling = 2 * float(density[0][-1]) if density else None
    harmonics: dict[int, Line] = {}
    strange = []
    for tone in tones:
        line = Line(tone.frequency_hz, np.sqrt(np.mean(np.abs(tone.vector) ** 2, axis=0)), tone.gain / 2, len(tone.vector))
        multiple = harmonic_of(line, frequency_hz, sampling) if sampling else 0
        if multiple:
            # a harmonic that the sampling folds beside the resonance is no tone from outside
            harmonics.setdefault(multiple, line)
        elif not any(_folded(far_line, tone, waves) for far_line in far):
            strange.append(tone)
    tones = strange
    out = [_lost(group, waves, frequency_hz) for group in _together(steps, waves)] + [_beating(tone, waves, frequency_hz) for tone in tones]
    listed = []
    direct = all(w.readout == "direct" for w in waves)
    for line in far:
        multiple = harmonic_of(line, frequency_hz, sampling)
        listed.append(
            {
                "frequency_hz": line.frequency_hz,
                "amplitude": [float(a) for a in line.amplitude],
                "power_over_floor": line.ratio,
                "multiple": multiple or None,
            }
        )
        if multiple:
            harmonics.setdefault(multiple, line)
        elif direct and not any(abs(line.frequency_hz - t.frequency_hz) < 2 for t in tones):
            out.append(_tone(line, waves))
    odd = [n for n in harmonics if n % 2]
    if odd and direct and not {"pickoff_nonlinearity", "saturation"} & set(found):
        out.append(_nonlinear(waves, harmonics[min(odd)], min(odd), len(odd)))
    return out, listed


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
        "next_experiment": find(name).next_experiment,
        "view": "waveform",
    }


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


def _lost(group: Sequence[PhaseStep], waves: Sequence[Wave], frequency_hz: float) -> dict[str, Any]:
    omega, first = 2 * np.pi * frequency_hz, group[0]
    weight = np.array([s.std_rad**-2 for s in group])
    mean = first.step_rad + float(np.sum(weight * [np.angle(np.exp(1j * (s.step_rad - first.step_rad))) for s in group]) / weight.sum())
    std = float(weight.sum() ** -0.5)
    parameters = {
        "lost_s": (float(np.mod(mean, 2 * np.pi)) / omega, std / omega, "s"),
        "time_s": (first.time_s, float(waves[first.run].window_s) / 2, "s"),
    }
    runs = [waves[s.run].run_id for s in group]
    return _entry("dropped_samples", abs(mean) / std, parameters, (mean / std) ** 2) | {"runs": runs, "ambiguity_s": 1 / frequency_hz}


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
    for channel, size in zip("cs", line.amplitude, strict=True):
        parameters[f"{channel}_cos"] = (float(size), float(size), "amplitude")
        parameters[f"{channel}_sin"] = (0.0, float(size), "amplitude")
    parameters["frequency_hz"] = (line.frequency_hz, _cell_hz(waves), "Hz")
    return _entry("mains_tone", float(np.sqrt(2 * line.ratio)), parameters, 2 * line.ratio) | {
        "phase": "not measured: a line of the averaged spectrum",
        "magnitude": {channel: float(size) for channel, size in zip("cs", line.amplitude, strict=True)},
        "magnitude_std": {channel: float(size / np.sqrt(2 * line.ratio)) for channel, size in zip("cs", line.amplitude, strict=True)},
    }


def _cell_hz(waves: Sequence[Wave]) -> float:
    """Distance of two cells of the averaged spectrum."""
    return float(np.median([np.diff(w.spectrum_frequency_hz).mean() for w in waves if w.spectrum_frequency_hz is not None]))


def _nonlinear(waves: Sequence[Wave], line: Line, multiple: int, count: int) -> dict[str, Any]:
    """The cubic from the third harmonic γ|C|³/4 of the larger channel, or clipping where more odd harmonics or clipped windows are seen."""
    size = float(np.median([np.median(w.main_amplitude[w.good()]) for w in waves]))
    if count > 2 or any(np.any(w.flags & 1) for w in waves):
        largest = float(max(np.max(w.main_amplitude[w.good()]) for w in waves))
        return _entry(
            "saturation", float(np.sqrt(2 * line.ratio)), {"inverse_level": (1 / largest, 0.1 / largest, "amplitude-1")}, 2 * line.ratio
        )
    cubic = 4 * float(np.max(line.amplitude)) / size**3 if multiple == 3 else float("nan")
    value = cubic if np.isfinite(cubic) else 0.0
    return _entry(
        "pickoff_nonlinearity", float(np.sqrt(2 * line.ratio)), {"cubic": (value, 0.5 * abs(value), "amplitude-2")}, 2 * line.ratio
    )
