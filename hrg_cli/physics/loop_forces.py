"""What the control does in one kick of the fast engine: the wave it sees, what it commands, the force
that reaches the mode.

Force drive, resonant with the main wave (seed A (7), PHYSICS §1(c)), and parametric drive (M3p), as
`control` has them for the envelopes; here at the phase of the sample. Every function is compiled
into the loop.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .electronics import (
    AMPLITUDE,
    COMMAND_COS,
    COMMAND_SIN,
    DRIVING,
    MAIN,
    OSCILLATOR_COS,
    OSCILLATOR_SIN,
    QUADRATURE,
    SPRING,
    BoardSettings,
)
from .loop_values import (
    AMPLITUDE_INTEGRAL,
    AXIS_COS,
    AXIS_SIN,
    INVERSE,
    LOOP_FORCE,
    LOOP_SPRING,
    QUADRATURE_INTEGRAL,
    REAL,
    Gains,
)

Array = np.ndarray


class Command(NamedTuple):
    """What the loops ask for: a_ΦA, a_ΦB, the spring's rate σ, and the wave as they see it: e_A, the
    direction twice as far, e^{jφ} of the oscillator, amplitude."""

    main: float
    quadrature: float
    spring: float
    cos: float
    sin: float
    cos2: float
    sin2: float
    turn: complex
    amplitude: float


def see_envelopes(
    x: float,
    y: float,
    px: float,
    py: float,
    force_x: complex,
    force_y: complex,
    angle: float,
    sampled: float,
    local: Array,
) -> tuple[complex, complex]:
    """Both envelopes u e^{jωt} at the middle of the kick, as expected from the last one; momenta in
    amplitudes, angle: ωh, sampled: ωh·cot ωh.

    The momentum holds the force's part of u' too, by the factor `sampled`; left inside, it would
    ripple at 2ω through the gains. p/ω would not do: of a split resonator it ripples at 2ω as well.
    """
    step = math.cos(angle) + 1j * math.sin(angle)
    gx, gy = force_x * step, force_y * step
    a, b, c, d = local[REAL], local[REAL + 1], local[REAL + 2], local[REAL + 3]
    ex = px - angle * gx.imag - sampled * gx.real - a * x - b * y
    ey = py - angle * gy.imag - sampled * gy.real - c * x - d * y
    wx = local[INVERSE] * ex + local[INVERSE + 1] * ey
    wy = local[INVERSE + 2] * ex + local[INVERSE + 3] * ey
    return x - 1j * wx, y - 1j * wy


def stokes_of(ux: complex, uy: complex) -> tuple[float, float, float, float]:
    """S0 … S3 of one pair of envelopes, as `ellipse.stokes` has them."""
    a, b, c, d = ux.real, ux.imag, uy.real, uy.imag
    return (
        a * a + b * b + c * c + d * d,
        a * a + b * b - c * c - d * d,
        2 * (a * c + b * d),
        2 * (b * c - a * d),
    )


def command_ideally(
    i: int,
    ux: complex,
    uy: complex,
    h: float,
    quadrature_loop: int,
    gains: Gains,
    commanded: Array,
    memory: Array,
) -> Command:
    """What loops command that see the wave without noise or delay; a log's row i where one is
    replayed. Nothing of a wave that has no direction."""
    s0, s1, s2, s3 = stokes_of(ux, uy)
    s12 = math.sqrt(s1 * s1 + s2 * s2)
    a_A = math.sqrt((s0 + s12) / 2)
    if not (a_A > 0.0 and s12 > 0.0):
        return Command(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0j, 1.0)
    a_B = s3 / (2 * a_A)

    # half the angle by the formula that does not cancel; e_A keeps its side
    if s1 > 0:
        cos = math.sqrt((1 + s1 / s12) / 2)
        sin = s2 / s12 / (2 * cos)
    else:
        sin = math.sqrt((1 - s1 / s12) / 2)
        cos = s2 / s12 / (2 * sin)
    # (mθ, φ) and (mθ + π, φ + π) are one wave; a jump between them would turn the force about.
    if cos * memory[AXIS_COS] + sin * memory[AXIS_SIN] < 0:
        cos, sin = -cos, -sin
    memory[AXIS_COS], memory[AXIS_SIN] = cos, sin

    if len(commanded) > 0:
        main, quadrature = commanded[i, 0], commanded[i, 1]
    else:
        main, quadrature = regulate(a_A, a_B, h, quadrature_loop, gains, memory)
    return Command(
        main,
        quadrature,
        -quadrature / a_A,
        cos,
        sin,
        s1 / s12,
        s2 / s12,
        (cos * ux + sin * uy) / a_A,
        a_A,
    )


def regulate(
    a_A: float, a_B: float, h: float, quadrature_loop: int, gains: Gains, memory: Array
) -> tuple[float, float]:
    """a_ΦA and a_ΦB of proportional and integral loops on amplitude and quadrature; the integrals in
    `memory` go on by h."""
    error = gains.amplitude - a_A
    main = gains.feed_forward + gains.amplitude_gain_1_s * error + memory[AMPLITUDE_INTEGRAL]
    memory[AMPLITUDE_INTEGRAL] += gains.amplitude_integral_1_s2 * error * h
    quadrature = 0.0
    if quadrature_loop == LOOP_FORCE:
        quadrature = -gains.quadrature_gain_1_s * a_B - memory[QUADRATURE_INTEGRAL]
        memory[QUADRATURE_INTEGRAL] += gains.quadrature_integral_1_s2 * a_B * h
    elif quadrature_loop == LOOP_SPRING:
        # By σ = −a_ΦB/a_A a spring acts on r = a_B/a_A; its integral is one of σ.
        quadrature = -gains.quadrature_gain_1_s * a_B - memory[QUADRATURE_INTEGRAL] * a_A
        memory[QUADRATURE_INTEGRAL] += gains.quadrature_integral_1_s2 * a_B / a_A * h
    return main, quadrature


def command_of_board(state: Array) -> Command:
    """The command that acts on the board, at the phase of its oscillator."""
    cos, sin = state[COMMAND_COS], state[COMMAND_SIN]
    return Command(
        state[MAIN],
        state[QUADRATURE],
        state[SPRING],
        cos,
        sin,
        cos * cos - sin * sin,
        2 * cos * sin,
        state[OSCILLATOR_COS] + 1j * state[OSCILLATOR_SIN],
        state[AMPLITUDE],
    )


def make_force(
    command: Command,
    ux: complex,
    uy: complex,
    parametric: bool,
    quadrature_loop: int,
    gains: Gains,
) -> tuple[complex, complex]:
    """Force at the electrodes before `drive_matrix`: the main one along e_A or parametric, that
    against quadrature along e_B a quarter period later."""
    turn, late = command.turn, gains.main_cos - 1j * gains.main_sin
    if parametric:
        pump = turn * turn * late * (command.main / command.amplitude)
        fx, fy = pump * ux.conjugate(), pump * uy.conjugate()
    else:
        fx = turn * late * command.main * command.cos
        fy = turn * late * command.main * command.sin
    if quadrature_loop == LOOP_FORCE:
        late = gains.quadrature_cos - 1j * gains.quadrature_sin
        side = -1j * turn * late * command.quadrature
        fx -= side * command.sin
        fy += side * command.cos
    return fx, fy


def pull_of_spring(x: float, y: float, omega: float, command: Command) -> tuple[float, float]:
    """Acceleration by the electric spring 2ωσR(2mθ + 90°)."""
    stiff = 2 * omega * command.spring
    return stiff * (-command.sin2 * x + command.cos2 * y), stiff * (
        command.cos2 * x + command.sin2 * y
    )


def reach_mode(
    fx: complex,
    fy: complex,
    turn: complex,
    rough_x: complex,
    rough_y: complex,
    drive_matrix: Array,
    parasitic: Array,
    settings: BoardSettings,
    state: Array,
) -> tuple[complex, complex]:
    """What of the force arrives: by the drive matrix, while the board drives, with what couples in
    and the drive's 1/f noise."""
    hx = drive_matrix[0, 0] * fx + drive_matrix[0, 1] * fy
    hy = drive_matrix[1, 0] * fx + drive_matrix[1, 1] * fy
    if settings.driving_steps > 0:
        # Driving a part of the time, the force is stronger by the inverse of that part.
        acting = settings.drive_share if state[DRIVING] == 1 else 0.0
        hx, hy = hx * acting, hy * acting
    return hx + (parasitic[0] + rough_x) * turn, hy + (parasitic[1] + rough_y) * turn
