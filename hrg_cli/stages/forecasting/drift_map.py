"""The drift over the wave angle, and the named figures of seed A's (8) and (9)."""

from __future__ import annotations

import numpy as np

from ...fitting.envelopes.resonator_spread import deviation
from ...physics import drift as law
from ...physics.resonator import Mechanics

Array = np.ndarray
NODES = 48
"""Wave angles of the drift's map over its period π/m."""


def map_drift(gyros: Mechanics, drive: str, gain: float) -> dict[str, Array]:
    """D over the wave angle: exact at the settled quadrature where the gyro is driven, after one
    time constant in a run-down."""
    angle = np.arange(NODES) * np.pi / gyros.mode_number / NODES
    damping = law.drift(gyros, angle)
    r = (
        law.quadrature_quasi_static(gyros, angle, drive)
        if drive == "free"
        else law.quadrature_settled(gyros, angle, drive, gain)
    )
    total = (
        law.drift_quasi_static(gyros, angle, drive)
        if drive == "free"
        else law.drift(gyros, angle, r)
    )
    return {
        "wave_angle_rad": angle,
        "drift_rad_s": total[0],
        "drift_rad_s_std": deviation(total),
        "damping_part_rad_s": damping[0],
        "split_part_rad_s": (total - damping)[0],
        "quadrature_ratio": np.asarray(r)[0],
    }


def name_figures(
    gyros: Mechanics, drawn: dict[str, Array], drive: str, gain: float, rate: float
) -> dict[str, dict[str, float]]:
    """Named figures with their standard deviations."""
    split = np.square(gyros.frequency_split_rad_s) / law.quadrature_decay(gyros, drive, gain)
    figures = {
        "damping_part_rad_s": np.asarray(gyros.damping_split_1_s),
        "sin_8_theta_part_rad_s": np.asarray(split),
        "drift_bound_rad_s": law.drift_bound(gyros, drive, gain),
        "drift_bound_input_rad_s": law.drift_bound(gyros, drive, gain) / gyros.scale_factor,
    }
    if rate and drive != "free":  # in a run-down r settles at no mean
        turning, nu = (
            2 * gyros.scale_factor * rate,
            np.asarray(law.quadrature_decay(gyros, drive, gain)),
        )
        figures["mean_drift_while_turning_rad_s"] = (
            -turning * np.square(gyros.frequency_split_rad_s) / (nu**2 + turning**2)
        )
    out = {
        name: {"value": float(v[0, 0]), "std": float(deviation(v)[0])}
        for name, v in figures.items()
    }
    worst = int(np.argmax(np.abs(drawn["drift_rad_s"])))
    out["drift_largest_rad_s"] = {
        "value": float(abs(drawn["drift_rad_s"][worst])),
        "std": float(drawn["drift_rad_s_std"][worst]),
    }
    return out
