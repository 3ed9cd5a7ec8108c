"""What accuracy costs: the measurement each factor of the final analysis rests on, and what one
hour more of recordings brings the tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...fitting.tables.increments import AnglePath
from ...records import Calibration

HOUR_S = 3600.0
NEEDS = {
    "angle": "a wave that turns through all angles; no sensor more",
    "nodes of temperature": "a thermometer, and runs at several temperatures",
    "nodes of frequency": "runs at several temperatures; the frequency is the thermometer",
    "quadrature": "the estimated quadrature, and runs in which it varies; no sensor more",
    "quadrature_drive": "a log of the quadrature loop's force",
    "main_drive": "a log of the main drive's force, and runs of several amplitudes",
    "drive_matrix": "free run-downs of the same gyro",
    "loop_delay": "free run-downs of the same gyro that turn, and a log of the main drive's force",
    "drive_delay": "free run-downs of the same gyro that turn",
}
"""Kind of factor -> what has to be measured for it."""


def need(kind: str, axis: str) -> str:
    """What a factor of this kind rests on, in tables over this axis ("temperature",
    "frequency")."""
    word = kind.removeprefix("drift ").removeprefix("scale ")
    return NEEDS.get(f"nodes of {axis}" if word == "nodes" else word, "no sensor more")


def forecast_hour_more(
    record: Calibration, paths: Sequence[AnglePath], more_s: float = HOUR_S
) -> dict[str, float]:
    """The tables' standard deviations (rms over nodes and angles) now and with an hour more of
    recordings like these.

    Runs are independent, so that n times as many of the same length know n times as much:
    σ·√(T/(T + 1 h)). What the model leaves out does not get smaller.
    """
    recorded = sum(float(path.time_s[-1] - path.time_s[0]) for path in paths)
    part = float(np.sqrt(recorded / (recorded + more_s)))
    drift = float(np.sqrt(np.nanmean(np.square(record.drift_rad_s_std))))
    mean = abs(float(np.nanmean(record.scale_factor))) or 1.0
    scale = float(np.sqrt(np.nanmean(np.square(record.scale_factor_std)))) / mean * 1e6
    return {
        "recorded_s": recorded,
        "drift_std_rad_s": drift,
        "drift_std_with_it_rad_s": part * drift,
        "scale_factor_std_ppm": scale,
        "scale_factor_std_with_it_ppm": part * scale,
    }
