"""The drift D of m·dθ/dt = −KΩ + D: seed A (8), (9), the tangent law and the Adams integration, with the errata of PHYSICS §4.

Angles: χ = 2m(θ − θ_μ), ζ = 2m(θ − θ_ω), r = a_B/a_A. Forces are envelope rates a_ΦA, a_ΦB with phase errors Δφ_A, Δφ_B; both
control terms enter as (a_Φ/a_A)·Δφ.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .resonator import Mechanics

Array = np.ndarray
Angle = float | Array


def _angles(mechanics: Mechanics, wave_angle_rad: Angle) -> tuple[Angle, Angle]:
    m2 = 2 * mechanics.mode_number
    return m2 * (wave_angle_rad - mechanics.damping_axis_rad), m2 * (wave_angle_rad - mechanics.stiffness_axis_rad)


def drift(mechanics: Mechanics, wave_angle_rad: Angle, ratio: Angle = 0.0, quadrature_force: Angle = 0.0, main_force: Angle = 0.0) -> Array:
    """D [rad/s] exactly, for any |r| < 1   (PHYSICS §4 to seed A (8)).

    D = [νδμ sin χ (1 + r²) − 2r δω cos ζ − f_B + r f_A]/(1 − r²), f_A = a_ΦA Δφ_A/a_A, f_B = a_ΦB Δφ_B/a_A in 1/s.
    """
    chi, zeta = _angles(mechanics, wave_angle_rad)
    r = np.asarray(ratio, float)
    damping = mechanics.damping_split_1_s * np.sin(chi) * (1 + r**2)
    return np.asarray((damping - 2 * r * mechanics.frequency_split_rad_s * np.cos(zeta) - quadrature_force + r * main_force) / (1 - r**2))


def drift_small_quadrature(mechanics: Mechanics, wave_angle_rad: Angle, ratio: Angle = 0.0, quadrature_force: Angle = 0.0) -> Array:
    """D [rad/s] to first order in r: νδμ sin χ − 2r δω cos ζ − f_B   (seed A (8))."""
    chi, zeta = _angles(mechanics, wave_angle_rad)
    return np.asarray(
        mechanics.damping_split_1_s * np.sin(chi)
        - 2 * np.asarray(ratio) * mechanics.frequency_split_rad_s * np.cos(zeta)
        - quadrature_force
    )


def phase_rate(
    mechanics: Mechanics, wave_angle_rad: Angle, ratio: Angle = 0.0, quadrature_force: Angle = 0.0, main_force: Angle = 0.0
) -> Array:
    """dφ/dt above the mean frequency, rad/s: [δω cos ζ (1 + r²) − 2r νδμ sin χ − f_A + r f_B]/(1 − r²)   (PHYSICS §4)."""
    chi, zeta = _angles(mechanics, wave_angle_rad)
    r = np.asarray(ratio, float)
    split = mechanics.frequency_split_rad_s * np.cos(zeta) * (1 + r**2)
    return np.asarray((split - 2 * r * mechanics.damping_split_1_s * np.sin(chi) - main_force + r * quadrature_force) / (1 - r**2))


def drift_from_phase(
    mechanics: Mechanics, wave_angle_rad: Angle, ratio: Angle, phase_rate_rad_s: Angle, quadrature_force: Angle = 0.0
) -> Array:
    """D [rad/s] with the stiffness axes replaced by the measured dφ/dt   (seed A (12), to first order in r): νδμ sin χ − 2r dφ/dt − f_B.

    dφ/dt must be against the *mean* frequency: an error δ of it, a millikelvin of temperature, costs 2rδ.
    """
    chi, _ = _angles(mechanics, wave_angle_rad)
    return np.asarray(mechanics.damping_split_1_s * np.sin(chi) - 2 * np.asarray(ratio) * phase_rate_rad_s - quadrature_force)


def quadrature_quasi_static(mechanics: Mechanics, wave_angle_rad: Angle, drive: str = "force", quadrature_gain_1_s: float = 0.0) -> Array:
    """r once it follows the wave angle: δω sin ζ/λ   (seed A after (9)); λ = ν (force), 2ν (parametric: the pump damps B), plus
    the loop's gain.

    For νt ≫ 1, δω ≪ ν and a wave that moves slowly against ν only.
    """
    _, zeta = _angles(mechanics, wave_angle_rad)
    return np.asarray(mechanics.frequency_split_rad_s * np.sin(zeta) / _decay(mechanics, drive, quadrature_gain_1_s))


def drift_quasi_static(mechanics: Mechanics, wave_angle_rad: Angle, drive: str = "force", quadrature_gain_1_s: float = 0.0) -> Array:
    """D [rad/s] with the quasi-static quadrature: νδμ sin χ − (δω²/λ) sin 2ζ   (seed A (9); half of it with a parametric drive, M3p)."""
    chi, zeta = _angles(mechanics, wave_angle_rad)
    split = mechanics.frequency_split_rad_s**2 / _decay(mechanics, drive, quadrature_gain_1_s)
    return np.asarray(mechanics.damping_split_1_s * np.sin(chi) - split * np.sin(2 * zeta))


def _decay(mechanics: Mechanics, drive: str, gain: float) -> float:
    if drive not in ("force", "parametric"):
        raise ValueError(f'drive is "force" or "parametric", not {drive!r}')
    return mechanics.damping_rate_1_s * (2 if drive == "parametric" else 1) + gain


def tangent_law(mechanics: Mechanics, start_rad: float, time_s: Angle) -> Array:
    """θ(t) [rad] at rest with damping split alone: tan m(θ − θ_μ) = tan m(θ₀ − θ_μ)·e^{2νδμ t}   (seed A, after (10); the constant
    is omitted there).

    The axis at θ_μ + π/2m, of least damping, attracts.
    """
    m = mechanics.mode_number
    offset = m * (start_rad - mechanics.damping_axis_rad)
    turns = np.round(offset / np.pi)
    growth = np.exp(2 * mechanics.damping_split_1_s * np.asarray(time_s, float))
    angle = np.arctan2(np.sin(offset - np.pi * turns) * growth, np.cos(offset - np.pi * turns))
    return np.asarray(mechanics.damping_axis_rad + (angle + np.pi * turns) / m)


def adams(rate: Callable[[float, float], float], start_rad: float, step_s: float, steps: int) -> Array:
    """θ (steps + 1,) of dθ/dt = f(t, θ) by the explicit four-point Adams method, error O(step⁴); the first three steps by Runge–Kutta.

    θ₄ = θ₃ + Δt(55f₃ − 59f₂ + 37f₁ − 9f₀)/24   (seed A, after (10)).
    """
    angle = np.empty(steps + 1)
    angle[0] = start_rad
    slopes: list[float] = []
    for k in range(steps):
        t, y = k * step_s, float(angle[k])
        slopes.append(rate(t, y))
        if len(slopes) < 4:
            k1 = slopes[-1]
            k2 = rate(t + step_s / 2, y + step_s / 2 * k1)
            k3 = rate(t + step_s / 2, y + step_s / 2 * k2)
            k4 = rate(t + step_s, y + step_s * k3)
            angle[k + 1] = y + step_s * (k1 + 2 * k2 + 2 * k3 + k4) / 6
        else:
            f0, f1, f2, f3 = slopes[-4:]
            angle[k + 1] = y + step_s * (55 * f3 - 59 * f2 + 37 * f1 - 9 * f0) / 24
    return angle
