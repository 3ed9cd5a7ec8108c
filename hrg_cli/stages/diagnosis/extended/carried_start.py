"""Diagnosis, the extended model: where a piece of a run was before its first row."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.fit_point import Point
from ....fitting.causes.slow_equation import RungeKuttaStage
from ....fitting.causes.slow_prediction import march_motion
from ....fitting.samples.course import build_course
from ....physics import ellipse
from ....records import Wave
from ..base.data import integrate_command, interpolate_command

Array = np.ndarray
BACKWARD = 16
"""Steps from the first row to the instant."""
HELD = (
    "weight",
    "temperature_rate_degc_s",
    "branch",
    "forced",
    "held_slope",
)
"""Columns that stay what they are at the first row."""


def find_start(fit: ExtendedFit, k: int, wave: Wave, straight: bool, begin: float) -> Array:
    """The displacement at an instant beside a piece's first row: the whole equation integrated from
    there, drive and effects included.

    Parameters
    ----------
    fit
        Of the final model.
    k
        The piece.
    wave
        The run that it is of, with its logs.
    straight
        The logged rate goes straight between its rows.
    begin
        The instant [s].

    Returns
    -------
    ndarray
        Envelopes (2,).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.extended.carried_start import find_start
    >>> start = find_start(draw_fit(), 0, draw_waves()[0], False, 0.0)
    >>> round(float(np.linalg.norm(start)), 2)
    1.0
    """
    series, first = fit.series.select_runs([k]), float(fit.series.time_s[k, 0])
    if first == begin:
        return fit.flow.rows.compute_displacement(fit.prediction.motion)[k, 0]
    times = np.linspace(first, begin, BACKWARD + 1)[None]
    since = times - first

    def along(values: Array, slope: Array | float = 0.0) -> Array:
        return values[:, :1] + slope * since

    rate = along(series.rate_rad_s)
    if wave.rate_rad_s is not None and np.any(known := np.isfinite(wave.rate_rad_s)):
        at, log = (
            np.asarray(wave.time_s, float)[known],
            np.asarray(wave.rate_rad_s, float)[known],
        )
        rate = np.interp(times, at, log) if straight else build_course(at, log).interpolate(times)
    columns: dict[str, Any] = {
        name: np.broadcast_to(getattr(series, name)[:, :1], times.shape) for name in HELD
    }
    back = replace(
        series.drop_shared_doubt(),
        time_s=times,
        envelope=np.repeat(series.envelope[:, :1], times.size, axis=1),
        rate_rad_s=rate,
        temperature_degc=along(series.temperature_degc, series.temperature_rate_degc_s[:, :1]),
        temperature_impulse=None,
        table_angle_rad=along(
            series.table_angle_rad, rate if straight else (rate[:, :1] + rate) / 2
        ),
        phase_rad=along(series.phase_rad, series.turn_rad_s[:, None]),
        main_drive=interpolate_command(wave, "drive_main", times[0], series.forced)[None],
        quadrature_drive=interpolate_command(wave, "drive_quadrature", times[0], series.forced)[
            None
        ],
        main_impulse=integrate_command(wave, "drive_main", times[0], series.forced)[None],
        quadrature_impulse=integrate_command(wave, "drive_quadrature", times[0], series.forced)[
            None
        ],
        held_amplitude=_hold_from(fit, k, since),
        **columns,
    )
    point = Point(
        fit.point.p, fit.prediction.motion[[k], 0], fit.point.offset_rad_s[[k]], fit.point.active
    )
    return RungeKuttaStage(back, point).compute_displacement(march_motion(back, point))[0, -1]


def _hold_from(fit: ExtendedFit, k: int, since: Array) -> Array:
    """The amplitude (1, n) that a drive without a log keeps up at times `since` the first row: from
    where the fit is, for the pull to the measured one, carried backwards, would grow."""
    series = fit.series
    motion = fit.prediction.motion[k, 0]
    held = ellipse.find_wave(motion, series.mode_number)[0] + series.held_slope[k, 0] * since
    return np.where(np.isfinite(series.held_amplitude[k, 0]), held, np.nan)
