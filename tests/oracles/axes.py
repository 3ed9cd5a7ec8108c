"""Seed A's models (1)–(7) of one resonator in resonance, instrument and moving axes, as right-hand
sides for any integrator.

Fast: (1), (2) in the resonance axes (p, q), (3) in axes turned by θ_x. Slow: (4) complex and (5)
amplitude–phase in axes turned by θ_x, (6) complex and (7) amplitude–phase in the moving axes of the
wave. All with e^{+jωt}, the convention for which (4)–(7) hold (PHYSICS §4), and the Euler term of
M14 in the fast ones. Fast states are (x, y, dx/dt, dy/dt); forces are accelerations (fast) or
envelope rates (slow).
"""

from __future__ import annotations

import numpy as np

from hrg_cli.physics.resonator import Mechanics

Array = np.ndarray


def turn(vector: Array, axis_rad: float, mode_number: int = 2) -> Array:
    """(X, Y) = components of (C, S) in axes turned by θ_x: X = C cos mθ_x + S sin mθ_x   (seed A before (3)); pairs along the last axis."""
    c, s = np.cos(mode_number * axis_rad), np.sin(mode_number * axis_rad)
    x, y = vector[..., 0::2], vector[..., 1::2]
    out = np.empty_like(vector)
    out[..., 0::2], out[..., 1::2] = c * x + s * y, -s * x + c * y
    return out


def resonance_axes(
    state: Array, mechanics: Mechanics, rate_rad_s: float = 0.0, acceleration_rad_s2: float = 0.0
) -> Array:
    """(1), (2): p'' + 2ν_p p' + 2ν_pq q' + ω_p² p − 2KΩ q' − KΩ' q = 0, likewise q with +2KΩ p' +
    KΩ' p; p along θ_ω."""
    p, q, dp, dq = state
    m = mechanics
    delta = 2 * m.mode_number * (m.damping_axis_rad - m.stiffness_axis_rad)
    along, across = m.damping_split_1_s * np.cos(delta), m.damping_split_1_s * np.sin(delta)
    omega_p, omega_q = (
        m.omega_rad_s + m.frequency_split_rad_s,
        m.omega_rad_s - m.frequency_split_rad_s,
    )
    turning, euler = m.scale_factor * rate_rad_s, m.scale_factor * acceleration_rad_s2
    ddp = (
        -2 * (m.damping_rate_1_s + along) * dp
        - 2 * (across - turning) * dq
        - omega_p**2 * p
        + euler * q
    )
    ddq = (
        -2 * (m.damping_rate_1_s - along) * dq
        - 2 * (across + turning) * dp
        - omega_q**2 * q
        - euler * p
    )
    return np.array([dp, dq, ddp, ddq])


def turned_axes(
    state: Array,
    mechanics: Mechanics,
    axis_rad: float = 0.0,
    rate_rad_s: float = 0.0,
    acceleration_rad_s2: float = 0.0,
) -> Array:
    """(3): the same in axes turned by θ_x from the electrodes (0: the instrument axes C, S).

    With Ψ = m(θ_x − θ_ω): X'' + 2ν_x X' + ω_x² X − 2KΩ Y' = Δω²_xy Y + 2Δν_xy Y' and its partner,
    Δω² = (ω_p² − ω_q²)/2.
    """
    x, y, dx, dy = state
    m = mechanics
    psi = 2 * m.mode_number * (axis_rad - m.stiffness_axis_rad)
    chi = 2 * m.mode_number * (axis_rad - m.damping_axis_rad)
    square, half = (
        m.omega_rad_s**2 + m.frequency_split_rad_s**2,
        2 * m.omega_rad_s * m.frequency_split_rad_s,
    )
    nu, dnu = m.damping_rate_1_s, m.damping_split_1_s
    turning, euler = m.scale_factor * rate_rad_s, m.scale_factor * acceleration_rad_s2
    coupling = half * np.sin(psi)
    friction = dnu * np.sin(chi)
    ddx = (
        -2 * (nu + dnu * np.cos(chi)) * dx
        - (square + half * np.cos(psi)) * x
        + 2 * turning * dy
        + euler * y
        + coupling * y
        + 2 * friction * dy
    )
    ddy = (
        -2 * (nu - dnu * np.cos(chi)) * dy
        - (square - half * np.cos(psi)) * y
        - 2 * turning * dx
        - euler * x
        + coupling * x
        + 2 * friction * dx
    )
    return np.array([dx, dy, ddx, ddy])


def _slow(mechanics: Mechanics, axis_rad: float | Array) -> tuple[Array, Array, Array, Array]:
    """δω_c, δω_s, νδμ cos χ, νδμ sin χ in axes at θ_x."""
    psi = 2 * mechanics.mode_number * (np.asarray(axis_rad) - mechanics.stiffness_axis_rad)
    chi = 2 * mechanics.mode_number * (np.asarray(axis_rad) - mechanics.damping_axis_rad)
    split, dnu = mechanics.frequency_split_rad_s, mechanics.damping_split_1_s
    return split * np.cos(psi), split * np.sin(psi), dnu * np.cos(chi), dnu * np.sin(chi)


def slow_turned_axes(
    envelope: Array,
    mechanics: Mechanics,
    axis_rad: float = 0.0,
    rate_rad_s: float = 0.0,
    force: Array | None = None,
) -> Array:
    """(4): X₀' + (ν_x − jδω_c)X₀ − KΩ Y₀ = F_x + (Δν_xy − jδω_s)Y₀; Y₀' + (ν_y + jδω_c)Y₀ + KΩ X₀ =
    F_y + (Δν_xy − jδω_s)X₀."""
    x, y = envelope
    wc, ws, dc, ds = _slow(mechanics, axis_rad)
    nu, turning = mechanics.damping_rate_1_s, mechanics.scale_factor * rate_rad_s
    push = np.zeros(2, complex) if force is None else force
    mixed = ds - 1j * ws
    return np.array(
        [
            -(nu + dc - 1j * wc) * x + turning * y + mixed * y + push[0],
            -(nu - dc + 1j * wc) * y - turning * x + mixed * x + push[1],
        ]
    )


def slow_turned_axes_polar(
    state: Array, mechanics: Mechanics, axis_rad: float = 0.0, rate_rad_s: float = 0.0
) -> Array:
    """(5) for a free wave: rates of (a_X, a_Y, φ_X, φ_Y); neither amplitude may vanish."""
    ax, ay, fx, fy = state
    wc, ws, dc, ds = _slow(mechanics, axis_rad)
    nu, turning = mechanics.damping_rate_1_s, mechanics.scale_factor * rate_rad_s
    cos, sin = np.cos(fx - fy), np.sin(fx - fy)
    dax = -(nu + dc) * ax + turning * cos * ay + (ds * cos - ws * sin) * ay
    day = -(nu - dc) * ay - turning * cos * ax + (ds * cos + ws * sin) * ax
    dfx = wc - (turning * sin + ds * sin + ws * cos) * ay / ax
    dfy = -wc + (-turning * sin + ds * sin - ws * cos) * ax / ay
    return np.array([dax, day, dfx, dfy])


def moving_axes_rates(
    mechanics: Mechanics, a_A: float, a_B: float, wave_angle_rad: float, rate_rad_s: float
) -> tuple[float, float]:
    """(m·dθ/dt, dφ/dt) that keep φ_A − φ_B = π/2: the last two of (7) solved, free wave, |a_B| <
    a_A."""
    wc, _, _, ds = _slow(mechanics, wave_angle_rad)
    r = a_B / a_A
    swing = (ds * (1 + r**2) - 2 * r * wc) / (1 - r**2)
    phase = (wc * (1 + r**2) - 2 * r * ds) / (1 - r**2)
    return float(swing - mechanics.scale_factor * rate_rad_s), float(phase)


def slow_moving_axes(state: Array, mechanics: Mechanics, rate_rad_s: float = 0.0) -> Array:
    """(6) for a free wave: rates of (A₀, B₀, θ), complex, with B₀ = −j(a_B/a_A)A₀ kept by the axes'
    own turning.

    A₀' + (ν_A − jδω_c)A₀ − (KΩ + mθ')B₀ = (Δν − jδω_s)B₀; B₀' + (ν_B + jδω_c)B₀ + (KΩ + mθ')A₀ =
    (Δν − jδω_s)A₀.
    """
    A, B, angle = state[0], state[1], float(np.real(state[2]))
    a_A, a_B = abs(A), float(np.real(1j * B * np.conj(A)) / abs(A))
    swing, _ = moving_axes_rates(mechanics, a_A, a_B, angle, rate_rad_s)
    wc, ws, dc, ds = _slow(mechanics, angle)
    nu, total = mechanics.damping_rate_1_s, mechanics.scale_factor * rate_rad_s + swing
    mixed = ds - 1j * ws
    dA = -(nu + dc - 1j * wc) * A + total * B + mixed * B
    dB = -(nu - dc + 1j * wc) * B - total * A + mixed * A
    return np.array([dA, dB, swing / mechanics.mode_number])


def slow_moving_axes_polar(
    state: Array,
    mechanics: Mechanics,
    rate_rad_s: float = 0.0,
    force: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """(7): rates of (a_A, a_B, θ, φ), forces in phase (a_ΦA, a_ΦB) [amplitude/s]."""
    a_A, a_B, angle, _ = state
    _, ws, dc, _ = _slow(mechanics, angle)
    nu = mechanics.damping_rate_1_s
    swing, phase = moving_axes_rates(mechanics, a_A, a_B, angle, rate_rad_s)
    return np.array(
        [
            -(nu + dc) * a_A - ws * a_B + force[0],
            -(nu - dc) * a_B + ws * a_A + force[1],
            swing / mechanics.mode_number,
            phase,
        ]
    )
