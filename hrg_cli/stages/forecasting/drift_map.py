"""The drift over the wave angle, and the named figures of seed A's (8) and (9)."""

from __future__ import annotations

import numpy as np

from ...fitting.envelopes.resonator_spread import find_deviation
from ...physics import drift as law
from ...physics.resonator import Mechanics

Array = np.ndarray
NODES = 48
"""Wave angles of the drift's map over its period π/m."""


def map_drift(gyros: Mechanics, drive: str, gain: float) -> dict[str, Array]:
    """The drift D over the wave angle.

    It is exact at the settled quadrature where the gyro is driven, after one time constant in a
    run-down.

    Parameters
    ----------
    gyros
        The resonator (1 + 2k, 1) with its spread.
    drive
        "free", or how the wave is driven.
    gain
        Of the quadrature loop by force [1/s].

    Returns
    -------
    dict
        Columns over the period π/m of the wave angle: D with its σ, what damping and frequency
        split make of it [rad/s], and the quadrature over the main amplitude.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.resonator_spread import (
    ...     from_vector,
    ...     make_vector,
    ...     spread_points,
    ... )
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.forecasting.drift_map import map_drift
    >>> gyro = Mechanics(1000.0, 0.2, 1e-3)
    >>> gyros = from_vector(spread_points(make_vector(gyro), 1e-12 * np.eye(6)), gyro)
    >>> float(np.abs(map_drift(gyros, "force", 0.0)["drift_rad_s"]).max().round(9))
    0.001
    """
    angle = np.arange(NODES) * _spacing(gyros)
    damping = law.compute_drift(gyros, angle)
    total, r = _drift_at(gyros, angle, drive, gain)
    return {
        "wave_angle_rad": angle,
        "drift_rad_s": total[0],
        "drift_rad_s_std": find_deviation(total),
        "damping_part_rad_s": damping[0],
        "split_part_rad_s": (total - damping)[0],
        "quadrature_ratio": np.asarray(r)[0],
    }


def _spacing(gyros: Mechanics) -> float:
    """Of the map's wave angles, rad."""
    return float(np.pi / gyros.mode_number / NODES)


def _drift_at(gyros: Mechanics, angle: Array, drive: str, gain: float) -> tuple[Array, Array]:
    """D [rad/s] and r of each gyro at each wave angle."""
    if drive == "free":
        r = law.compute_quasi_static_quadrature(gyros, angle, drive)
        return law.compute_quasi_static_drift(gyros, angle, drive), r
    r = law.find_settled_quadrature(gyros, angle, drive, gain)
    return law.compute_drift(gyros, angle, r), r


def _largest_drift(
    gyros: Mechanics, drawn: dict[str, Array], drive: str, gain: float
) -> dict[str, float]:
    """The largest |D| with its standard deviation, looked for between the map's angles: at these
    alone it may be a thousandth too small, ten of its deviations."""
    worst = int(np.argmax(np.abs(drawn["drift_rad_s"])))
    near = np.linspace(-1, 1, 2 * NODES + 1) * _spacing(gyros)
    drift, _ = _drift_at(gyros, drawn["wave_angle_rad"][worst] + near, drive, gain)
    peak = int(np.argmax(np.abs(drift[0])))
    return {"value": float(abs(drift[0, peak])), "std": float(find_deviation(drift)[peak])}


def name_figures(
    gyros: Mechanics, drawn: dict[str, Array], drive: str, gain: float, rate: float
) -> dict[str, dict[str, float]]:
    """The named figures of seed A's (8) and (9), with their standard deviations.

    Parameters
    ----------
    gyros
        The resonator (1 + 2k, 1) with its spread.
    drawn
        Of it, as `map_drift` gives it.
    drive
        "free", or how the wave is driven.
    gain
        Of the quadrature loop by force [1/s].
    rate
        Ω [rad/s].

    Returns
    -------
    dict
        Name -> value and std [rad/s].

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.resonator_spread import (
    ...     from_vector,
    ...     make_vector,
    ...     spread_points,
    ... )
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.forecasting.drift_map import map_drift, name_figures
    >>> gyro = Mechanics(1000.0, 0.2, 1e-3)
    >>> gyros = from_vector(spread_points(make_vector(gyro), 1e-12 * np.eye(6)), gyro)
    >>> figures = name_figures(gyros, map_drift(gyros, "force", 0.0), "force", 0.0, 0.0)
    >>> round(figures["drift_largest_rad_s"]["value"], 9)
    0.001
    """
    split = np.square(gyros.frequency_split_rad_s) / law.compute_quadrature_decay(
        gyros, drive, gain
    )
    figures = {
        "damping_part_rad_s": np.asarray(gyros.damping_split_1_s),
        "sin_8_theta_part_rad_s": np.asarray(split),
        "drift_bound_rad_s": law.bound_drift(gyros, drive, gain),
        "drift_bound_input_rad_s": law.bound_drift(gyros, drive, gain) / gyros.scale_factor,
    }
    if rate and drive != "free":  # in a run-down r settles at no mean
        turning, nu = (
            2 * gyros.scale_factor * rate,
            np.asarray(law.compute_quadrature_decay(gyros, drive, gain)),
        )
        figures["mean_drift_while_turning_rad_s"] = (
            -turning * np.square(gyros.frequency_split_rad_s) / (nu**2 + turning**2)
        )
    out = {
        name: {"value": float(v[0, 0]), "std": float(find_deviation(v)[0])}
        for name, v in figures.items()
    }
    out["drift_largest_rad_s"] = _largest_drift(gyros, drawn, drive, gain)
    return out
