"""Diagnosis, the extended model: the fitted resonator, the runs and the effects as a simulation file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..fitting.coordinates import physical
from ..fitting.extended import generators
from ..fitting.extended_fit import Fit
from ..physics import ellipse
from ..physics.resonator import exponential
from ..records import Wave
from ..settings import to_toml
from .diagnosis_orientation import COHERENT

Array = np.ndarray
SAMPLES_A_PERIOD = 8


def simulation_file(
    fit: Fit, waves: Sequence[Wave], pieces: Sequence[Wave], origin: Sequence[int], effects_named: Sequence[dict[str, Any]]
) -> str:
    """TOML that `hrg simulate` runs: [device], [effects.NAME], and a [[run]] a run with its start, rate, temperature and length.

    The fit's runs are `pieces` of the waves (`origin`: of which); samples lost between two pieces become the run's own effect.
    """
    values, _ = physical(fit.point.p, fit.series.mode_number)
    frequency = _frequencies(fit)
    device: dict[str, Any] = {
        "frequency_hz": float(np.median(frequency)),
        "damping_rate_1_s": max(float(values[0]), 0.0),
        "damping_split_1_s": float(min(values[1], max(values[0], 0.0))),
        "damping_axis_rad": float(values[2]),
        "frequency_split_rad_s": float(values[3]),
        "stiffness_axis_rad": float(values[4]),
        "scale_factor": float(values[5]),
        "mode_number": fit.series.mode_number,
    }
    if any(effect.name.startswith("thermal") or effect.name == "split_temperature" for effect, _ in fit.point.active):
        device["temperature"] = {"reference_degc": float(np.round(np.mean(fit.series.temperature_degc[fit.series.weight > 0]), 3))}
    table: dict[str, Any] = {
        "device": device,
        "recording": {"sample_rate_hz": float(np.ceil(SAMPLES_A_PERIOD * frequency.max())), "duration_s": 1.0},
    }
    if waves[0].gyro_id:
        table["recording"]["gyro_id"] = waves[0].gyro_id
    lost = {
        run: {k: v["value"] for k, v in e["parameters"].items()}
        for e in reversed(effects_named)
        if e["name"] == "dropped_samples"
        for run in e["runs"]
    }
    tone = [{k: v["value"] for k, v in e["parameters"].items()} for e in effects_named if e["name"] == "mains_tone"][:1]
    effects = {effect.name: {k: float(v) for k, v in given.items()} for effect, given in fit.point.active}
    if tone:
        effects["mains_tone"] = tone[0]
    for e in effects_named:
        if e.get("view") == "waveform" and e["name"] in ("pickoff_nonlinearity", "saturation"):
            effects[e["name"]] = {k: v["value"] for k, v in e["parameters"].items()}
    if effects:
        table["effects"] = effects
    names: set[str] = set()
    table["run"] = []
    for number, wave in enumerate(waves):
        own = [k for k, o in enumerate(origin) if o == number]
        if not own:
            continue
        run = _run(fit, pieces[own[0]], own[0], float(frequency[own[0]]), table["recording"]["sample_rate_hz"], names)
        run["recording"]["duration_s"] = float(wave.time_s[-1] + wave.window_s / 2)
        turned = [name for name in COHERENT if name in effects and _turned(fit, own[0], run)]
        own_effects = {name: {k: -v for k, v in effects[name].items()} for name in turned}
        if wave.run_id in lost:
            own_effects["dropped_samples"] = lost[wave.run_id]
        if own_effects:
            run["effects"] = own_effects
        table["run"].append(run)
    return to_toml(table)


def _turned(fit: Fit, k: int, run: dict[str, Any]) -> bool:
    """Whether the run's phase was turned by π against that of its start in the file, so that coherent vectors change sign."""
    return bool(np.cos(fit.series.phase_rad[k, 0] - run["start"]["phase_rad"]) < 0)


def _frequencies(fit: Fit) -> Array:
    """Frequency of every run, Hz."""
    return fit.series.reference_frequency_hz + fit.point.offset_rad_s / (2 * np.pi)


def _run(fit: Fit, wave: Wave, k: int, frequency_hz: float, sample_rate_hz: float, names: set[str]) -> dict[str, Any]:
    series = fit.series
    good = series.weight[k] > 0
    t = series.time_s[k][good]
    back = exponential(generators(series, fit.point)[k, 0], -t[0]) @ fit.point.start[k]
    a_A, a_B, angle, phase = (float(v) for v in ellipse.wave(back, series.mode_number))
    name = "".join(c if c not in "/\\ \t\n" else "_" for c in series.names[k])
    while name in names:
        name += "_"
    names.add(name)
    run: dict[str, Any] = {
        "run_id": name,
        "device": {"frequency_hz": frequency_hz},
        "start": {"amplitude": a_A, "quadrature": a_B, "wave_angle_rad": angle, "phase_rad": phase},
        "environment": _environment(series.rate_rad_s[k][good], series.temperature_degc[k][good], t, series.has_temperature),
        "readout": {"noise": _sample_noise(wave, sample_rate_hz), "units": wave.units},
        "recording": {"duration_s": float(t[-1] + wave.window_s / 2)},
    }
    if wave.mode == "forced":
        run["control"] = {"mode": "forced", "amplitude": float(np.median(wave.main_amplitude[wave.good()]))}
    return run


def _sample_noise(wave: Wave, sample_rate_hz: float) -> float:
    """Noise of one sample that gives the windows' noise at this sampling rate."""
    std = np.asarray(wave.signal_std, float)
    std = std[np.isfinite(std) & (std > 0)]
    return float(np.median(std) * np.sqrt(max(2.0, sample_rate_hz * wave.window_s) / 2)) if len(std) else 0.0


def _environment(rate: Array, temperature: Array, t: Array, has_temperature: bool) -> dict[str, Any]:
    """Constant rate or steps that follow it; constant temperature or a ramp."""
    out: dict[str, Any] = {}
    spread = float(np.ptp(rate))
    if spread <= 1e-6 * max(1e-9, float(np.abs(rate).max())):
        out["rate_rad_s"] = float(rate.mean())
    else:
        levels = np.interp(np.arange(0.0, t[-1], dwell := max(float(np.median(np.diff(t))), t[-1] / 400)) + dwell / 2, t, rate)
        out["rate"] = {"kind": "steps", "levels_rad_s": [float(v) for v in levels], "dwell_s": 0.8 * dwell, "transition_s": 0.2 * dwell}
    if has_temperature:
        slope, level = np.polyfit(t, temperature, 1)
        if abs(slope) * t[-1] > 1e-3:
            out["temperature"] = {
                "kind": "ramp",
                "start_degc": float(level),
                "stop_degc": float(level + slope * t[-1]),
                "end_s": float(t[-1]),
            }
        else:
            out["temperature_degc"] = float(temperature.mean())
    return out
