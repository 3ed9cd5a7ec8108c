"""Diagnosis, the extended model: one measured run as the tables of a simulation file: start, courses of rate and temperature, loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from ...fitting.causes.extended import Point, motion_of
from ...fitting.causes.extended_fit import Fit
from ...fitting.causes.layout import FREQUENCY
from ...fitting.causes.wave_frame import imaginary
from ...physics import ellipse
from ...records import Wave

Array = np.ndarray
COURSE = 1e-6
"""Part of its range by which a course of straight lines may miss the log."""
LOOP = 0.5
"""Part of a logged command's power that a loop must explain to be taken for one."""
BACKWARD = 16
"""Steps from the first row back to the run's start."""
HELD = ("weight", "temperature_rate_degc_s", "branch", "main_drive", "quadrature_drive", "forced", "held_amplitude", "held_slope")
"""Columns that stay what they are at the first row."""
FEWEST, ROUNDS = 20, 8
"""Windows from which a loop is looked for, and rounds of the fit of its level."""


def run_table(fit: Fit, own: Sequence[int], wave: Wave, piece: Wave, sample_rate_hz: float, change: Array) -> dict[str, Any]:
    """[start], [environment], [readout], [recording] and [control] of a run, of which the fit's runs `own` are the pieces.

    change (5,): what is added to the start state.
    """
    series, k = fit.series, own[0]
    a_A, a_B, angle, phase = (float(v) for v in ellipse.wave(_start(fit, k, wave) + imaginary(change[:FREQUENCY]), series.mode_number))
    length = float(wave.time_s[-1] + wave.window_s / 2)
    run: dict[str, Any] = {
        "start": {"amplitude": a_A, "quadrature": a_B, "wave_angle_rad": angle, "phase_rad": phase},
        "environment": _environment(fit, own, wave, length),
        "readout": {"noise": _sample_noise(piece, sample_rate_hz), "units": wave.units},
        "recording": {"duration_s": length},
    }
    if wave.mode == "forced":
        run["control"] = {"mode": "forced"} | _loops(_moving(fit, own, wave), max(float(fit.point.p[0]), 0.0))
    return run


def _moving(fit: Fit, own: Sequence[int], wave: Wave) -> Wave:
    """The wave with the modelled motion's amplitudes: the simulated loops see those, without noise and the read-out's defects."""
    good = [fit.series.weight[k] > 0 for k in own]
    times = np.concatenate([fit.series.time_s[k][g] for k, g in zip(own, good, strict=True)])
    u = np.concatenate([fit.prediction.motion[k][g] for k, g in zip(own, good, strict=True)])
    a_A, a_B = ellipse.wave(u, fit.series.mode_number)[:2]
    t = np.asarray(wave.time_s, float)
    return wave.replace(main_amplitude=np.interp(t, times, a_A), quadrature_amplitude=np.interp(t, times, a_B))


def _start(fit: Fit, k: int, wave: Wave) -> Array:
    """Envelopes (2,) at t = 0: the whole equation integrated back from the first row, drive and effects included."""
    series, first = fit.series.runs([k]), float(fit.series.time_s[k, 0])
    if first <= 0:
        return fit.prediction.motion[k, 0]
    times = np.linspace(first, 0.0, BACKWARD + 1)[None]
    since = times - first

    def along(values: Array, slope: Array | float = 0.0) -> Array:
        return values[:, :1] + slope * since

    rate = along(series.rate_rad_s)
    if wave.rate_rad_s is not None and np.any(known := np.isfinite(wave.rate_rad_s)):
        rate = np.interp(times, np.asarray(wave.time_s, float)[known], np.asarray(wave.rate_rad_s, float)[known])
    columns: dict[str, Any] = {name: np.broadcast_to(getattr(series, name)[:, :1], times.shape) for name in HELD}
    back = replace(
        series,
        time_s=times,
        envelope=np.repeat(series.envelope[:, :1], times.size, axis=1),
        rate_rad_s=rate,
        temperature_degc=along(series.temperature_degc, series.temperature_rate_degc_s[:, :1]),
        table_angle_rad=along(series.table_angle_rad, rate),
        phase_rad=along(series.phase_rad, series.turn_rad_s[:, None]),
        main_impulse=along(series.main_impulse, series.main_drive[:, :1]),
        quadrature_impulse=along(series.quadrature_impulse, series.quadrature_drive[:, :1]),
        unsettled=None,
        **columns,
    )
    point = Point(fit.point.p, fit.prediction.motion[[k], 0], fit.point.offset_rad_s[[k]], fit.point.active)
    return motion_of(back, point)[0, -1]


def _sample_noise(wave: Wave, sample_rate_hz: float) -> float:
    """Noise of one sample that gives the windows' noise at this sampling rate."""
    std = np.asarray(wave.signal_std, float)
    std = std[np.isfinite(std) & (std > 0)]
    return float(np.median(std) * np.sqrt(max(2.0, sample_rate_hz * wave.window_s) / 2)) if len(std) else 0.0


def _environment(fit: Fit, own: Sequence[int], wave: Wave, length_s: float) -> dict[str, Any]:
    """Rate and temperature, constant or along straight lines; the temperature is the resonator's where the thermometer lags."""
    series = fit.series
    out: dict[str, Any] = {}
    if wave.rate_rad_s is not None and np.any(known := np.isfinite(wave.rate_rad_s)):
        rate = np.asarray(wave.rate_rad_s, float)[known]
        if np.ptp(rate) <= 1e-6 * max(1e-9, float(np.abs(rate).max())):
            out["rate_rad_s"] = float(rate.mean())
        else:
            times, values = _points(np.asarray(wave.time_s, float)[known], rate)
            out["rate"] = {"kind": "points", "time_s": times, "rate_rad_s": values}
    if series.has_temperature:
        good = [series.weight[k] > 0 for k in own]
        t = np.concatenate([series.time_s[k][g] for k, g in zip(own, good, strict=True)])
        warm = np.concatenate([series.temperature_degc[k][g] for k, g in zip(own, good, strict=True)])
        steep = np.concatenate([series.temperature_rate_degc_s[k][g] for k, g in zip(own, good, strict=True)])
        lag = next((float(v["time_constant_s"]) for effect, v in fit.point.active if effect.name == "thermal_lag"), 0.0)
        warm = warm + lag * steep
        if np.ptp(warm) <= 1e-4:
            out["temperature_degc"] = float(warm.mean())
        else:
            ends = np.array([0.0, length_s])
            outside = warm[[0, -1]] + steep[[0, -1]] * (ends - t[[0, -1]])
            times, values = _points(np.concatenate([ends[:1], t, ends[1:]]), np.concatenate([outside[:1], warm, outside[1:]]))
            out["temperature"] = {"kind": "points", "time_s": times, "temperature_degc": values}
    return out


def _points(t: Array, values: Array) -> tuple[list[float], list[float]]:
    """Corners of straight lines that follow the values to `COURSE` of their range: the point furthest off is added until none is."""
    t, place = np.unique(t, return_index=True)
    values = values[place]
    kept, tolerance = [0, len(t) - 1], COURSE * float(np.ptp(values))
    while len(kept) < len(t):
        off = np.abs(values - np.interp(t, t[kept], values[kept]))
        parts = [slice(a + 1, b) for a, b in pairwise(kept) if b > a + 1]
        further = [p.start + int(np.argmax(off[p])) for p in parts]
        further = [k for k in further if off[k] > tolerance]
        if not further:
            break
        kept = sorted({*kept, *further})
    return [float(v) for v in t[kept]], [float(v) for v in values[kept]]


def _loops(wave: Wave, damping_rate_1_s: float) -> dict[str, Any]:
    """Set amplitude and gains of the amplitude and the quadrature loop, as far as the logged commands show them.

    a_ΦA = ν a₀ + k_A (a₀ − a_A) + k_I ∫(a₀ − a_A) dt and a_ΦB = −k_q a_B − k_i ∫a_B dt.
    """
    level = float(np.median(wave.main_amplitude[wave.good()]))
    out: dict[str, Any] = {"amplitude": level}
    law = _law(wave, wave.drive_main, wave.main_amplitude, level, damping_rate_1_s)
    if law is not None:
        out |= {"amplitude": law[0], "amplitude_gain_1_s": law[1], "amplitude_integral_1_s2": law[2]}
    law = _law(wave, wave.drive_quadrature, wave.quadrature_amplitude, 0.0, None)
    if law is not None:
        out |= {"quadrature_loop": "finite", "quadrature_gain_1_s": law[1], "quadrature_integral_1_s2": law[2]}
    return out


def _law(wave: Wave, command: Array | None, values: Array, level: float, forward_1_s: float | None) -> tuple[float, float, float] | None:
    """(level, gain, integral gain) of command = forward·level + gain·e + integral·∫e dt, e = level − values; None: the log shows another.

    The level is fitted where the command is fed forward, and held elsewhere.
    """
    if command is None:
        return None
    good = wave.good() & np.isfinite(command) & np.isfinite(values)
    if np.count_nonzero(good) < FEWEST or np.ptp(command[good]) == 0:
        return None
    t, right, x = (np.asarray(column, float)[good] for column in (wave.time_s, command, values))
    fitted = forward_1_s is not None
    forward = forward_1_s or 0.0
    for terms in (2, 1):
        gains, now = np.zeros(2), level
        for _ in range(ROUNDS):
            e = now - x
            total = e[0] * t[0] + np.concatenate([[0.0], np.cumsum(np.diff(t) * (e[1:] + e[:-1]) / 2)])
            columns = [e, total][:terms] + ([forward + gains[0] + gains[1] * t] if fitted else [])
            design = np.column_stack(columns)
            found = np.linalg.lstsq(design, right - forward * now, rcond=None)[0]
            gains = np.append(found[:terms], 0.0)[:2]
            now += float(found[-1]) if fitted else 0.0
        if gains[0] > 0 and gains[1] >= 0:
            left, whole = right - forward * now - design @ np.append(found[:terms], 0.0)[: design.shape[1]], right - right.mean() * fitted
            return (now, float(gains[0]), float(gains[1])) if left @ left < (1 - LOOP) * (whole @ whole) else None
    return None
