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


def describe_need(kind: str, axis: str) -> str:
    """What has to be measured for a factor.

    Parameters
    ----------
    kind
        Of the factor.
    axis
        Of the tables: "temperature" or "frequency".

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.stages.calibration.prices import describe_need
    >>> describe_need("drift nodes", "frequency")
    'runs at several temperatures; the frequency is the thermometer'
    >>> describe_need("quadrature_drive", "temperature")
    "a log of the quadrature loop's force"
    """
    word = kind.removeprefix("drift ").removeprefix("scale ")
    return NEEDS.get(f"nodes of {axis}" if word == "nodes" else word, "no sensor more")


def forecast_hour_more(
    record: Calibration, paths: Sequence[AnglePath], more_s: float = HOUR_S
) -> dict[str, float]:
    """The tables' standard deviations now, and with an hour more of recordings like these.

    Runs are independent, so that n times as many of the same length know n times as much: σ√(T/(T +
    1 h)). What the model leaves out does not get smaller.

    Parameters
    ----------
    record
        The tables.
    paths
        The runs they are made of.
    more_s
        What is recorded more [s].

    Returns
    -------
    dict
        Of drift [rad/s] and scale factor [ppm], rms over nodes and angles, and how long was
        recorded [s].

    Examples
    --------
    20 minutes, and an hour more: four times as long, half the error.

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.prices import forecast_hour_more
    >>> record = Told(drift_rad_s_std=[[2e-6]], scale_factor=[[0.5]], scale_factor_std=[[1e-6]])
    >>> found = forecast_hour_more(record, [Told(time_s=[0.0, 1200.0])])
    >>> found["drift_std_with_it_rad_s"], round(found["scale_factor_std_ppm"], 9)
    (1e-06, 2.0)
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
