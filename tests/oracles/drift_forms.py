"""Other forms of seed A's drift and phase rate, for tests: to first order in r, and with the
measured phase in place of the axes."""

from __future__ import annotations

import numpy as np

from hrg_cli.physics.resonator import Mechanics

Array = np.ndarray
Angle = float | Array


def _angles(mechanics: Mechanics, wave_angle_rad: Angle) -> tuple[Angle, Angle]:
    m2 = 2 * mechanics.mode_number
    return m2 * (wave_angle_rad - mechanics.damping_axis_rad), m2 * (
        wave_angle_rad - mechanics.stiffness_axis_rad
    )


def drift_small_quadrature(
    mechanics: Mechanics, wave_angle_rad: Angle, ratio: Angle = 0.0, quadrature_force: Angle = 0.0
) -> Array:
    """D [rad/s] to first order in r: νδμ sin χ − 2r δω cos ζ − f_B   (seed A (8))."""
    chi, zeta = _angles(mechanics, wave_angle_rad)
    return np.asarray(
        mechanics.damping_split_1_s * np.sin(chi)
        - 2 * np.asarray(ratio) * mechanics.frequency_split_rad_s * np.cos(zeta)
        - quadrature_force
    )


def phase_rate(
    mechanics: Mechanics,
    wave_angle_rad: Angle,
    ratio: Angle = 0.0,
    quadrature_force: Angle = 0.0,
    main_force: Angle = 0.0,
) -> Array:
    """dφ/dt above the mean frequency, rad/s: [δω cos ζ (1 + r²) − 2r νδμ sin χ − f_A + r f_B]/(1 − r²)   (PHYSICS §4)."""
    chi, zeta = _angles(mechanics, wave_angle_rad)
    r = np.asarray(ratio, float)
    split = mechanics.frequency_split_rad_s * np.cos(zeta) * (1 + r**2)
    return np.asarray(
        (
            split
            - 2 * r * mechanics.damping_split_1_s * np.sin(chi)
            - main_force
            + r * quadrature_force
        )
        / (1 - r**2)
    )


def drift_from_phase(
    mechanics: Mechanics,
    wave_angle_rad: Angle,
    ratio: Angle,
    phase_rate_rad_s: Angle,
    quadrature_force: Angle = 0.0,
) -> Array:
    """D [rad/s] with the stiffness axes replaced by the measured dφ/dt   (seed A (12), to first order in r): νδμ sin χ − 2r dφ/dt − f_B.

    dφ/dt must be against the *mean* frequency: an error δ of it, a millikelvin of temperature,
    costs 2rδ.
    """
    chi, _ = _angles(mechanics, wave_angle_rad)
    return np.asarray(
        mechanics.damping_split_1_s * np.sin(chi)
        - 2 * np.asarray(ratio) * phase_rate_rad_s
        - quadrature_force
    )
