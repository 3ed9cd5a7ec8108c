"""Diagnosis, the extended model: one measured run as the tables of a simulation file: start,
courses of rate and temperature, loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....fitting.causes.design_columns import FREQUENCY
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.wave_frame import to_complex
from ....fitting.envelopes.coordinates import DAMPING
from ....fitting.samples.course import build_from_means
from ....physics import ellipse
from ....records import Wave
from ...run_tables import (
    compute_sample_noise,
    describe_loops,
    fit_chords,
    make_drive_log,
    make_rate_course,
)
from ..drive.command_log import shift_commands
from .carried_start import find_start

Array = np.ndarray
WARM = 1e-4
"""Part of its range by which the lines of a temperature, which keep its integral, may miss it."""


@dataclass(frozen=True)
class Way:
    """How a file is written where there is more than one. replayed: a logged drive stands as its
    log, not as the loops that the log shows; straight: a rate goes straight between its log's rows,
    not along the course that the fits integrate; averaged: the device's equation is, as no
    resonator's and many a simulator's."""

    replayed: bool = False
    straight: bool = False
    averaged: bool = False


def run_table(
    fit: ExtendedFit,
    own: Sequence[int],
    wave: Wave,
    piece: Wave,
    sample_rate_hz: float,
    change: Array,
    way: Way,
    lost_s: float = 0.0,
) -> dict[str, Any]:
    """[start], [environment], [readout], [recording] and [control] of a run.

    Parameters
    ----------
    fit
        Of the extended model.
    own
        The fit's runs that are its pieces.
    wave
        Of the run.
    piece
        The first of them.
    sample_rate_hz
        Of the samples [Hz].
    change
        (5,): what is added to the start state and the frequency offset.
    way
        How the file is written where there is more than one.
    lost_s
        Time of samples lost before the first of the pieces, which its motion has gone through [s].

    Returns
    -------
    dict
        Tables of a simulation file.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.extended.written_run import Way, run_table
    >>> wave = draw_waves()[0]
    >>> table = run_table(draw_fit(), [0], wave, wave, 2000.0, np.zeros(5), Way())
    >>> table["recording"], round(table["start"]["amplitude"], 2)
    ({'duration_s': 0.99975}, 1.0)
    """
    series, k = fit.series, own[0]
    wave = shift_commands(wave, series.drive_late_s)
    clock = np.exp(-2j * np.pi * series.reference_frequency_hz * lost_s)
    begin = min(-lost_s, float(series.time_s[k, 0]))
    start = find_start(fit, k, wave, way.straight, begin) / series.row_turn[k, 0] * clock
    a_A, a_B, angle, phase = (
        float(v)
        for v in ellipse.find_wave(start + to_complex(change[:FREQUENCY]), series.mode_number)
    )
    length = float(wave.time_s[-1] + wave.window_s / 2)
    run: dict[str, Any] = {
        "start": {"amplitude": a_A, "quadrature": a_B, "wave_angle_rad": angle, "phase_rad": phase},
        "environment": _environment(fit, own, wave, length, way.straight),
        "readout": {"noise": compute_sample_noise(piece, sample_rate_hz), "units": wave.units},
        "recording": {"duration_s": length},
    }
    if wave.start_time:
        run["recording"]["start_time"] = wave.start_time
    if wave.mode == "forced":
        log = make_drive_log(wave, length) if way.replayed else None
        run["control"] = {"mode": "forced"}
        if log is None:
            run["control"] |= describe_loops(
                _moving(fit, own, wave), max(float(fit.point.p[DAMPING]), 0.0)
            )
        else:
            both = {"quadrature_loop": "finite"} if "drive_quadrature" in log else {}
            run["control"] |= both | {"log": log}
    return run


def _moving(fit: ExtendedFit, own: Sequence[int], wave: Wave) -> Wave:
    """The wave with the modelled motion's amplitudes: the simulated loops see those, without noise
    and the read-out's defects. A drive without a log has the command that the model gives it."""
    good = [fit.series.weight[k] > 0 for k in own]
    times = np.concatenate([fit.series.time_s[k][g] for k, g in zip(own, good, strict=True)])
    shown = fit.flow.rows.compute_displacement(fit.prediction.motion)
    u = np.concatenate([shown[k][g] for k, g in zip(own, good, strict=True)])
    a_A, a_B = ellipse.find_wave(u, fit.series.mode_number)[:2]
    t = np.asarray(wave.time_s, float)
    moving = wave.replace(
        main_amplitude=np.interp(t, times, a_A), quadrature_amplitude=np.interp(t, times, a_B)
    )
    if not np.isfinite(fit.series.held_amplitude[own]).any():
        return moving
    main = fit.flow.rows.compute_main_command(fit.prediction.motion)
    held = np.concatenate([main[k][g] for k, g in zip(own, good, strict=True)])
    return moving.replace(drive_main=np.interp(t, times, held))


def _environment(
    fit: ExtendedFit, own: Sequence[int], wave: Wave, length_s: float, straight: bool
) -> dict[str, Any]:
    """Rate and temperature, constant or along straight lines; the temperature is the resonator's
    where the thermometer lags."""
    series = fit.series
    out = make_rate_course(wave.time_s, wave.rate_rad_s, length_s, straight)
    if series.has_temperature:
        # an effect may make the logged temperature the resonator's
        true = fit.flow.rows.state
        good = [series.weight[k] > 0 for k in own]
        t = np.concatenate([series.time_s[k][g] for k, g in zip(own, good, strict=True)])
        warm = np.concatenate([true.temperature_degc[k][g] for k, g in zip(own, good, strict=True)])
        steep = np.concatenate(
            [series.temperature_rate_degc_s[k][g] for k, g in zip(own, good, strict=True)]
        )
        if np.ptp(warm) <= 1e-4:
            out["temperature_degc"] = float(warm.mean())
        else:
            ends = np.array([0.0, length_s])
            outside = warm[[0, -1]] + steep[[0, -1]] * (ends - t[[0, -1]])
            # what follows a temperature turns the phase by its integral, which chords between
            # rows a fortieth of a swing apart miss by 3e-5 rad
            row_s = float(np.median(np.diff(t)))
            course = build_from_means(
                np.concatenate([ends[:1], t, ends[1:]]),
                np.concatenate([outside[:1], warm, outside[1:]]),
                row_s,
            )
            times, (values,) = fit_chords([course], length_s, WARM)
            out["temperature"] = {"kind": "points", "time_s": times, "temperature_degc": values}
    return out
