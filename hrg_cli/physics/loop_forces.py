"""What the control does in one kick of the fast engine: the wave it sees, what it commands, the
force that reaches the mode.

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
    """What the loops ask for: a_ΦA, a_ΦB, the spring's rate σ, and the wave as they see it: e_A,
    the direction twice as far, e^{jφ} of the oscillator, amplitude."""

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
    """Both envelopes u e^{jωt} at the middle of the kick, as expected from the last one.

    The momentum holds the force's part of u' too, by the factor `sampled`; left inside, it would
    ripple at 2ω through the gains. p/ω would not do: of a split resonator it ripples at 2ω as well.

    Parameters
    ----------
    x, y
        Displacements, in amplitudes.
    px, py
        Momenta over `Motion.scale`, likewise.
    force_x, force_y
        The force's phasor of the step before.
    angle
        ωh, the turn of a step.
    sampled
        ωh·cot ωh.
    local
        (14,): a row of `Motion.local`.

    Returns
    -------
    tuple of complex
        Of C and S.

    Examples
    --------
    Without a force the displacement is the real part and the momentum −Im u, here of e^{j·60°}:

    >>> import math
    >>> import numpy as np
    >>> from hrg_cli.physics.loop_forces import see_envelopes
    >>> local = np.zeros(14)
    >>> local[6:10] = 1.0, 0.0, 0.0, 1.0
    >>> x, p = math.cos(math.pi / 3), -math.sin(math.pi / 3)
    >>> ux, uy = see_envelopes(x, 0.0, p, 0.0, 0j, 0j, 0.1, 0.1 / math.tan(0.1), local)
    >>> round(abs(ux), 9), round(math.degrees(math.atan2(ux.imag, ux.real)), 9), abs(uy)
    (1.0, 60.0, 0.0)
    """
    step = math.cos(angle) + 1j * math.sin(angle)
    gx, gy = force_x * step, force_y * step
    a, b, c, d = local[REAL], local[REAL + 1], local[REAL + 2], local[REAL + 3]
    ex = px - angle * gx.imag - sampled * gx.real - a * x - b * y
    ey = py - angle * gy.imag - sampled * gy.real - c * x - d * y
    wx = local[INVERSE] * ex + local[INVERSE + 1] * ey
    wy = local[INVERSE + 2] * ex + local[INVERSE + 3] * ey
    return x - 1j * wx, y - 1j * wy


def find_stokes(ux: complex, uy: complex) -> tuple[float, float, float, float]:
    """S0 … S3 of one pair of envelopes, as `ellipse.compute_stokes` has them.

    Parameters
    ----------
    ux, uy
        Of C and S.

    Returns
    -------
    tuple of float
        S0 (the square of the amplitude), S1, S2 (the direction), S3 (the quadrature).

    Examples
    --------
    A line at 45° between the electrodes is all S2, a circle all S3:

    >>> from hrg_cli.physics.loop_forces import find_stokes
    >>> find_stokes(1 + 0j, 1 + 0j), find_stokes(1 + 0j, complex(0, -1))
    ((2.0, 0.0, 2.0, 0.0), (2.0, 0.0, 0.0, 2.0))
    """
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
    """What loops command that see the wave without noise or delay.

    Where a log is replayed, the commands are its own. A wave that has no direction gets nothing.

    Parameters
    ----------
    i
        The row of the log.
    ux, uy
        Envelopes of C and S.
    h
        The step [s].
    quadrature_loop
        LOOP_OFF, LOOP_FORCE or LOOP_SPRING.
    gains
        Set point and gains.
    commanded
        (n, 2): a_ΦA and a_ΦB of a log; empty for none.
    memory
        (MEMORY,): the integrals go on, and e_A keeps its side there.

    Returns
    -------
    Command
        With the wave as the loops see it.

    Examples
    --------
    A wave below the set amplitude is driven in proportion to what it lacks:

    >>> import numpy as np
    >>> from hrg_cli.physics.loop_forces import command_ideally
    >>> from hrg_cli.physics.loop_values import LOOP_OFF, MEMORY, Gains
    >>> gains = Gains(1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0)
    >>> no_log = np.zeros((0, 2))
    >>> made = command_ideally(0, 0.9 + 0j, 0j, 1e-4, LOOP_OFF, gains, no_log, np.zeros(MEMORY))
    >>> round(float(made.main), 9), made.cos, made.sin, round(made.amplitude, 9)
    (0.2, 1.0, 0.0, 0.9)
    """
    s0, s1, s2, s3 = find_stokes(ux, uy)
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
    """a_ΦA and a_ΦB of proportional and integral loops on amplitude and quadrature.

    A spring acts on r = a_B/a_A by σ = −a_ΦB/a_A: its integral is one of σ.

    Parameters
    ----------
    a_A, a_B
        The wave.
    h
        The step [s].
    quadrature_loop
        LOOP_OFF, LOOP_FORCE or LOOP_SPRING.
    gains
        Set point and gains.
    memory
        (MEMORY,): the integrals in it go on by h.

    Returns
    -------
    tuple of float
        a_ΦA and a_ΦB, amplitudes per second.

    Examples
    --------
    A quadrature of 0.01 under a gain of 5 s⁻¹; the integral that it leaves is felt in the next
    step:

    >>> import numpy as np
    >>> from hrg_cli.physics.loop_forces import regulate
    >>> from hrg_cli.physics.loop_values import LOOP_FORCE, MEMORY, Gains
    >>> gains = Gains(1.0, 0.0, 0.0, 0.0, 5.0, 10.0, 1.0, 0.0, 1.0, 0.0)
    >>> memory = np.zeros(MEMORY)
    >>> forces = [regulate(1.0, 0.01, 0.1, LOOP_FORCE, gains, memory)[1] for _ in range(2)]
    >>> [round(float(force), 9) for force in forces]
    [-0.05, -0.06]
    """
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


def find_board_command(state: Array) -> Command:
    """The command that acts on the board, at the phase of its oscillator.

    Parameters
    ----------
    state
        (STATE,): `Board.state`.

    Returns
    -------
    Command
        With the wave as the board last saw it.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.electronics import COMMAND_COS, MAIN, OSCILLATOR_SIN, STATE
    >>> from hrg_cli.physics.loop_forces import find_board_command
    >>> state = np.zeros(STATE)
    >>> state[MAIN], state[COMMAND_COS], state[OSCILLATOR_SIN] = 0.3, 1.0, 1.0
    >>> made = find_board_command(state)
    >>> float(made.main), complex(made.turn), float(made.cos2)
    (0.3, 1j, 1.0)
    """
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
    """Force at the electrodes before `drive_matrix`.

    The main one acts along e_A, or is parametric (the stiffness pumped at twice the frequency,
    which pushes whatever wave there is); that against quadrature acts along e_B, a quarter period
    later.

    Parameters
    ----------
    command
        What the loops ask for.
    ux, uy
        Envelopes of C and S.
    parametric
        Whether the drive is.
    quadrature_loop
        LOOP_OFF, LOOP_FORCE or LOOP_SPRING; a spring makes no force here.
    gains
        Phase errors of both forces.

    Returns
    -------
    tuple of complex
        Phasors of C and S, amplitudes per second.

    Examples
    --------
    A force whose phase is 60° off drives with half its size; the rest moves the frequency:

    >>> import math
    >>> from hrg_cli.physics.loop_forces import Command, make_force
    >>> from hrg_cli.physics.loop_values import LOOP_OFF, Gains
    >>> off = math.radians(60)
    >>> gains = Gains(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, math.cos(off), math.sin(off), 1.0, 0.0)
    >>> command = Command(0.2, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1 + 0j, 1.0)
    >>> fx, fy = make_force(command, 1 + 0j, 0j, False, LOOP_OFF, gains)
    >>> round(fx.real, 9), round(fx.imag, 3), abs(fy)
    (0.1, -0.173, 0.0)
    """
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


def compute_spring_pull(x: float, y: float, omega: float, command: Command) -> tuple[float, float]:
    """Acceleration by the electric spring 2ωσR(2mθ + 90°), R a reflection.

    Parameters
    ----------
    x, y
        Displacements.
    omega
        ω [rad/s].
    command
        With σ and the direction of the wave.

    Returns
    -------
    tuple of float
        Of C and S, amplitudes per second squared.

    Examples
    --------
    Of a wave along C the spring pulls at S alone. That is what turns quadrature back:

    >>> from hrg_cli.physics.loop_forces import Command, compute_spring_pull
    >>> command = Command(0.0, 0.0, 0.25, 1.0, 0.0, 1.0, 0.0, 1 + 0j, 1.0)
    >>> ax, ay = compute_spring_pull(1.0, 0.0, 100.0, command)
    >>> abs(ax), ay
    (0.0, 50.0)
    """
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
    """What of the force arrives at the mode.

    Parameters
    ----------
    fx, fy
        Phasors at the electrodes.
    turn
        e^{jφ} at which couples in what is not commanded.
    rough_x, rough_y
        The drive's 1/f noise.
    drive_matrix
        (2, 2): from commanded to real force.
    parasitic
        (2,), complex: what couples in.
    settings
        Of the board, which may drive a part of the time.
    state
        (STATE,): whether it drives now.

    Returns
    -------
    tuple of complex
        Phasors of C and S, amplitudes per second.

    Examples
    --------
    A board that drives for a third of the time makes three times the force then, and none else:

    >>> import numpy as np
    >>> from hrg_cli.physics.electronics import DRIVING, STATE, BoardSettings
    >>> from hrg_cli.physics.loop_forces import reach_mode
    >>> settings, state = BoardSettings(driving_steps=10, drive_share=3.0), np.zeros(STATE)
    >>> arrived = []
    >>> for state[DRIVING] in (0, 1):
    ...     fx, _ = reach_mode(
    ...         0.2 + 0j, 0j, 1 + 0j, 0j, 0j, np.eye(2), np.zeros(2), settings, state
    ...     )
    ...     arrived.append(round(float(fx.real), 9))
    >>> arrived
    [0.0, 0.6]
    """
    hx = drive_matrix[0, 0] * fx + drive_matrix[0, 1] * fy
    hy = drive_matrix[1, 0] * fx + drive_matrix[1, 1] * fy
    if settings.driving_steps > 0:
        # Driving a part of the time, the force is stronger by the inverse of that part.
        acting = settings.drive_share if state[DRIVING] == 1 else 0.0
        hx, hy = hx * acting, hy * acting
    return hx + (parasitic[0] + rough_x) * turn, hy + (parasitic[1] + rough_y) * turn
