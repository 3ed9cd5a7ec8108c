"""Tables drawn by hand, for examples and trials: one temperature, no harmonics."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...records import Calibration

DRIFT_RAD_S, DRIFT_STD_RAD_S = 1e-5, 1e-7
SCALE_FACTOR, SCALE_FACTOR_STD = 0.55, 1e-5


def draw_tables(**columns: Any) -> Calibration:
    """A calibration at 20 °C and four wave angles: a drift of 10⁻⁵ rad/s, a scale factor of 0.55.

    Parameters
    ----------
    **columns
        Fields of the record that are otherwise.

    Returns
    -------
    Calibration
        With standard deviations of 10⁻⁷ rad/s and 10⁻⁵.

    Examples
    --------
    >>> from hrg_cli.stages.calibration.drawn_tables import draw_tables
    >>> tables = draw_tables(gyro_id="SN-17")
    >>> tables.gyro_id, tables.drift_rad_s.shape, float(tables.scale_factor[0, 0])
    ('SN-17', (1, 4), 0.55)
    """
    zero = np.zeros((1, 4))
    first = zero[:, :1]
    drawn = Calibration(
        temperature_degc=np.array([20.0]),
        node_min=15.0,
        node_max=25.0,
        rate_min_rad_s=-2.0,
        rate_max_rad_s=2.0,
        wave_angle_rad=np.arange(4) * np.pi / 8,
        drift_rad_s=zero + DRIFT_RAD_S,
        drift_rad_s_std=zero + DRIFT_STD_RAD_S,
        scale_factor=zero + SCALE_FACTOR,
        scale_factor_std=zero + SCALE_FACTOR_STD,
        drift_harmonics=first + DRIFT_RAD_S,
        drift_harmonics_std=first + DRIFT_STD_RAD_S,
        scale_factor_harmonics=first + SCALE_FACTOR,
        scale_factor_harmonics_std=first + SCALE_FACTOR_STD,
        covariance=np.diag([DRIFT_STD_RAD_S**2, SCALE_FACTOR_STD**2]),
    )
    return drawn.replace(**columns)
