"""What the board of `electronics` does at a step: it reads, demodulates at a window's end, and
sends a command on its way. Every function is compiled into the fast engine's loop and acts on the
board's state, by the places that `electronics` names."""

from __future__ import annotations

import math

import numpy as np

from .electronics import (
    ACTING,
    AMPLITUDE_INTEGRAL,
    AXIS_COS,
    AXIS_SIN,
    COMMAND,
    DRIVING,
    FILTERED,
    FREQUENCY,
    OSCILLATOR_COS,
    OSCILLATOR_SIN,
    PHASE_INTEGRAL,
    QUADRATURE_INTEGRAL,
    RING_FIRST,
    RING_LENGTH,
    STEP_COS,
    STEP_SIN,
    STEPS_DONE,
    SUM_COS2,
    SUM_COS_SIN,
    SUM_SIN2,
    SUM_X_COS,
    SUM_X_SIN,
    SUM_Y_COS,
    SUM_Y_SIN,
    X_COS,
    X_SIN,
    Y_COS,
    Y_SIN,
    BoardSettings,
)
from .loop_forces import find_stokes
from .loop_values import LOOP_FORCE, LOOP_SPRING, Gains

Array = np.ndarray


def turn_oscillator(state: Array) -> None:
    """One step of the board's oscillator.

    Parameters
    ----------
    state
        (STATE,): `Board.state`, in which it turns by the angle of STEP_COS and STEP_SIN.

    Examples
    --------
    A quarter of a period in three steps of 30°:

    >>> import math
    >>> import numpy as np
    >>> from hrg_cli.physics.board_reading import turn_oscillator
    >>> from hrg_cli.physics.electronics import OSCILLATOR_COS, OSCILLATOR_SIN, STATE
    >>> from hrg_cli.physics.electronics import STEP_COS, STEP_SIN
    >>> state = np.zeros(STATE)
    >>> state[OSCILLATOR_COS] = 1.0
    >>> state[STEP_COS], state[STEP_SIN] = math.cos(math.pi / 6), math.sin(math.pi / 6)
    >>> for _ in range(3):
    ...     turn_oscillator(state)
    >>> round(float(state[OSCILLATOR_SIN]), 9)
    1.0
    """
    c, s = state[OSCILLATOR_COS], state[OSCILLATOR_SIN]
    state[OSCILLATOR_COS] = c * state[STEP_COS] - s * state[STEP_SIN]
    state[OSCILLATOR_SIN] = s * state[STEP_COS] + c * state[STEP_SIN]


def round_to_step(value: float, step: float, limit: float) -> float:
    """A converter: the nearest step, clipped at ± limit.

    Parameters
    ----------
    value
        What goes in.
    step
        Its step; 0: infinitely fine.
    limit
        Where it saturates; 0: nowhere.

    Returns
    -------
    float
        What comes out, in the same unit.

    Examples
    --------
    >>> from hrg_cli.physics.board_reading import round_to_step
    >>> round_to_step(0.37, 0.25, 1.0), round_to_step(7.0, 0.25, 1.0), round_to_step(0.37, 0.0, 0.0)
    (0.25, 1.0, 0.37)
    """
    if step > 0:
        value = step * math.floor(value / step + 0.5)
    if limit > 0:
        value = min(max(value, -limit), limit)
    return value


def find_passed_part(amplitude: float, limit: float) -> float:
    """Part of a sine's fundamental that clipping at ± limit lets through.

    (2/π)(arcsin x + x√(1 − x²)), x = limit/amplitude: the describing function of a saturation, the
    first Fourier coefficient of the clipped sine.

    Parameters
    ----------
    amplitude
        Of the sine.
    limit
        Where it is clipped; 0: nowhere.

    Returns
    -------
    float
        1 below the limit.

    Examples
    --------
    A sine clipped at half its height keeps more than half of its fundamental, as Fourier's integral
    says too:

    >>> import numpy as np
    >>> from hrg_cli.physics.board_reading import find_passed_part
    >>> phase = 2 * np.pi * np.arange(10_000) / 10_000
    >>> whole = 2 * np.mean(np.clip(np.sin(phase), -0.5, 0.5) * np.sin(phase))
    >>> round(find_passed_part(1.0, 0.5), 5), round(float(whole), 5)
    (0.609, 0.609)
    """
    if limit <= 0 or amplitude <= limit:
        return 1.0
    x = limit / amplitude
    return 2 / math.pi * (math.asin(x) + x * math.sqrt(1 - x * x))


def take_reading(
    i: int,
    x: float,
    y: float,
    h: float,
    on: bool,
    quadrature_loop: int,
    gains: Gains,
    settings: BoardSettings,
    state: Array,
    waiting: Array,
) -> None:
    """One reading of the board at step i; at a window's end the loops put a new command on its way.

    Parameters
    ----------
    i
        Number of the step.
    x, y
        Displacements with their noise.
    h
        The step [s].
    on
        Whether the drive acts, without which no integral goes on.
    quadrature_loop
        LOOP_OFF, LOOP_FORCE or LOOP_SPRING.
    gains
        Set point and gains.
    settings
        Lengths of the window and the delay, loops and converters.
    state
        (STATE,): goes on by a step.
    waiting
        (r, COMMAND): commands on their way; one more at a window's end.

    Examples
    --------
    A window of eight steps, and a command that acts four steps after it:

    >>> import numpy as np
    >>> from hrg_cli.physics.board_reading import take_reading, turn_oscillator
    >>> from hrg_cli.physics.electronics import RING_LENGTH, Electronics, start_board
    >>> from hrg_cli.physics.loop_values import LOOP_OFF, Gains
    >>> from hrg_cli.physics.plant import Control
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> e, h = Electronics(periods_per_update=1, delay_periods=0.5), 1 / 8000
    >>> made = start_board(e, Control(forced=True), Mechanics(1000.0, 0.5), h, 0.0, 0.0, False)
    >>> gains = Gains(1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0)
    >>> for i in range(8):
    ...     x = 0.9 * np.cos(2 * np.pi * i / 8)
    ...     take_reading(
    ...         i, x, 0.0, h, True, LOOP_OFF, gains, made.settings, made.state, made.waiting
    ...     )
    ...     turn_oscillator(made.state)
    >>> step, main = made.waiting[0, :2]
    >>> int(made.state[RING_LENGTH]), int(step), round(float(main), 9)
    (1, 12, 0.2)
    """
    take_commands(i, h, settings.omega_rad_s, state, waiting)
    if state[DRIVING] == 1:
        state[STEPS_DONE] += 1
        if state[STEPS_DONE] >= settings.driving_steps:
            state[STEPS_DONE], state[DRIVING] = 0, 0
        return
    read(x, y, settings, state)
    if state[STEPS_DONE] < settings.reading_steps:
        return
    demodulate_window(settings, state)

    s0, s1, s2, s3 = find_stokes(state[X_COS] + 1j * state[X_SIN], state[Y_COS] + 1j * state[Y_SIN])
    a_A = math.sqrt((s0 + math.sqrt(s1 * s1 + s2 * s2)) / 2)
    if not a_A > 0.0:
        return
    a_B = s3 / (2 * a_A)
    phase = follow_axis(math.atan2(s2, s1) / 2, state)
    state[PHASE_INTEGRAL] += settings.phase_integral_1_s2 * phase * settings.interval_s
    main, quadrature, spring = regulate_on_board(
        a_A, a_B, on, quadrature_loop, gains, settings, state
    )
    if state[RING_LENGTH] < len(waiting):
        at = int(state[RING_FIRST] + state[RING_LENGTH]) % len(waiting)
        row = waiting[at]
        row[0] = i + 1 + settings.delay_steps
        row[1], row[2] = main, quadrature
        row[3], row[4] = state[AXIS_COS], state[AXIS_SIN]
        row[5] = spring
        row[6] = settings.phase_gain_1_s * phase + state[PHASE_INTEGRAL]
        row[7] = a_A
        state[RING_LENGTH] += 1


def take_commands(i: int, h: float, omega: float, state: Array, waiting: Array) -> None:
    """Let every command whose delay is over take the place of the one that acts.

    The oscillator goes on at the command's frequency, its rounding so far taken off.

    Parameters
    ----------
    i
        Number of the step.
    h
        The step [s].
    omega
        The oscillator's nominal frequency [rad/s].
    state
        (STATE,): the command that acts.
    waiting
        (r, COMMAND): those on their way.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.board_reading import take_commands
    >>> from hrg_cli.physics.electronics import COMMAND, MAIN, OSCILLATOR_COS, RING_LENGTH, STATE
    >>> state, waiting = np.zeros(STATE), np.zeros((2, COMMAND))
    >>> state[OSCILLATOR_COS], state[RING_LENGTH], waiting[0, :2] = 1.0, 1, (20, 0.3)
    >>> acting = []
    >>> for i in (19, 20):
    ...     take_commands(i, 1e-4, 1000.0, state, waiting)
    ...     acting.append(float(state[MAIN]))
    >>> acting
    [0.0, 0.3]
    """
    while state[RING_LENGTH] > 0 and waiting[int(state[RING_FIRST]), 0] <= i:
        at = int(state[RING_FIRST])
        for k in range(1, COMMAND):
            state[ACTING + k - 1] = waiting[at, k]
        step = (omega + state[FREQUENCY]) * h
        state[STEP_COS], state[STEP_SIN] = math.cos(step), math.sin(step)
        # rounding of the turns so far
        norm = 1 / math.sqrt(state[OSCILLATOR_COS] ** 2 + state[OSCILLATOR_SIN] ** 2)
        state[OSCILLATOR_COS] *= norm
        state[OSCILLATOR_SIN] *= norm
        state[RING_FIRST] = (at + 1) % len(waiting)
        state[RING_LENGTH] -= 1


def read(x: float, y: float, settings: BoardSettings, state: Array) -> None:
    """Both displacements through the converter, into the sums of the window's least squares.

    Parameters
    ----------
    x, y
        Displacements.
    settings
        Step and limit of the converter.
    state
        (STATE,): oscillator and sums.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.board_reading import read
    >>> from hrg_cli.physics.electronics import OSCILLATOR_COS, STATE, SUM_X_COS, BoardSettings
    >>> state = np.zeros(STATE)
    >>> state[OSCILLATOR_COS] = 1.0
    >>> read(0.37, 0.0, BoardSettings(adc_step=0.25), state)
    >>> float(state[SUM_X_COS])
    0.25
    """
    x = round_to_step(x, settings.adc_step, settings.adc_limit)
    y = round_to_step(y, settings.adc_step, settings.adc_limit)
    c, s = state[OSCILLATOR_COS], state[OSCILLATOR_SIN]
    state[SUM_COS2] += c * c
    state[SUM_COS_SIN] += c * s
    state[SUM_SIN2] += s * s
    state[SUM_X_COS] += x * c
    state[SUM_X_SIN] += x * s
    state[SUM_Y_COS] += y * c
    state[SUM_Y_SIN] += y * s
    state[STEPS_DONE] += 1


def demodulate_window(settings: BoardSettings, state: Array) -> None:
    """The window's envelopes against the oscillator by least squares, into the low pass.

    The sums begin anew, and a board that multiplexes drives next.

    Parameters
    ----------
    settings
        The low pass, and how long the board drives.
    state
        (STATE,): sums and filtered envelopes.

    Examples
    --------
    Least squares need no whole period: five of eight steps show the envelope 0.8 + 0.1j, which is
    0.8 cos ωt − 0.1 sin ωt.

    >>> import math
    >>> import numpy as np
    >>> from hrg_cli.physics.board_reading import demodulate_window, read
    >>> from hrg_cli.physics.electronics import OSCILLATOR_COS, OSCILLATOR_SIN, STATE, X_COS, X_SIN
    >>> from hrg_cli.physics.electronics import BoardSettings
    >>> state = np.zeros(STATE)
    >>> for i in range(5):
    ...     c, s = math.cos(math.pi * i / 4), math.sin(math.pi * i / 4)
    ...     state[OSCILLATOR_COS], state[OSCILLATOR_SIN] = c, s
    ...     read(0.8 * c - 0.1 * s, 0.0, BoardSettings(), state)
    >>> demodulate_window(BoardSettings(filter_share=0.5), state)
    >>> state[[X_COS, X_SIN]].round(9).tolist()
    [0.8, 0.1]
    """
    cc, cs, ss = state[SUM_COS2], state[SUM_COS_SIN], state[SUM_SIN2]
    # A window of whole periods has cs = 0 at the nominal frequency only; the oscillator follows the
    # wave away from it.
    det = cc * ss - cs**2
    # The first window is taken whole: a low pass that began at zero would look like a wave that
    # grows.
    share = settings.filter_share if state[FILTERED] == 1 else 1.0
    xc, xs, yc, ys = state[SUM_X_COS], state[SUM_X_SIN], state[SUM_Y_COS], state[SUM_Y_SIN]
    state[X_COS] += share * ((xc * ss - xs * cs) / det - state[X_COS])
    state[X_SIN] += share * (-(xs * cc - xc * cs) / det - state[X_SIN])
    state[Y_COS] += share * ((yc * ss - ys * cs) / det - state[Y_COS])
    state[Y_SIN] += share * (-(ys * cc - yc * cs) / det - state[Y_SIN])
    state[FILTERED] = 1
    for k in range(SUM_COS2, STEPS_DONE + 1):
        state[k] = 0
    if settings.driving_steps > 0:
        state[DRIVING] = 1


def follow_axis(electrical_rad: float, state: Array) -> float:
    """e_A by its angle, on the side where it was.

    (mθ, φ) and (mθ + π, φ + π) are one wave; the loops need the one that goes on.

    Parameters
    ----------
    electrical_rad
        mθ, up to π.
    state
        (STATE,): e_A as last seen, which is replaced, and the envelopes.

    Returns
    -------
    float
        Phase of the wave against the oscillator [rad].

    Examples
    --------
    A wave at 90° that goes on to 91° is seen at −89°:

    >>> import math
    >>> import numpy as np
    >>> from hrg_cli.physics.board_reading import follow_axis
    >>> from hrg_cli.physics.electronics import AXIS_COS, AXIS_SIN, STATE, Y_COS
    >>> state = np.zeros(STATE)
    >>> state[AXIS_SIN], state[Y_COS] = 1.0, 1.0
    >>> phase = follow_axis(math.radians(-89.0), state)
    >>> seen = math.degrees(math.atan2(state[AXIS_SIN], state[AXIS_COS]))
    >>> round(seen, 9), abs(phase) < 1e-9
    (91.0, True)
    """
    cos, sin = math.cos(electrical_rad), math.sin(electrical_rad)
    if cos * state[AXIS_COS] + sin * state[AXIS_SIN] < 0:
        cos, sin = -cos, -sin
    state[AXIS_COS], state[AXIS_SIN] = cos, sin
    return math.atan2(
        cos * state[X_SIN] + sin * state[Y_SIN], cos * state[X_COS] + sin * state[Y_COS]
    )


def regulate_on_board(
    a_A: float,
    a_B: float,
    on: bool,
    quadrature_loop: int,
    gains: Gains,
    settings: BoardSettings,
    state: Array,
) -> tuple[float, float, float]:
    """a_ΦA, a_ΦB and the spring's rate σ of proportional and integral loops, once a window.

    The integrals go on while the drive is on.

    Parameters
    ----------
    a_A, a_B
        The wave as the board sees it.
    on
        Whether the drive acts.
    quadrature_loop
        LOOP_OFF, LOOP_FORCE or LOOP_SPRING.
    gains
        Set point and gains.
    settings
        From one command to the next, and what the spring's loop takes for r.
    state
        (STATE,): the integrals.

    Returns
    -------
    tuple of float
        a_ΦA and a_ΦB, amplitudes per second, and σ, rad/s.

    Examples
    --------
    A spring by the product of the channels acts on r·(a_A/set amplitude)². A wave of half the
    amplitude is corrected by a quarter:

    >>> import numpy as np
    >>> from hrg_cli.physics.board_reading import regulate_on_board
    >>> from hrg_cli.physics.electronics import STATE, BoardSettings
    >>> from hrg_cli.physics.loop_values import LOOP_SPRING, Gains
    >>> gains = Gains(1.0, 0.0, 0.0, 0.0, 4.0, 0.0, 1.0, 0.0, 1.0, 0.0)
    >>> for product in (False, True):
    ...     settings = BoardSettings(phase_product=product)
    ...     found = regulate_on_board(
    ...         0.5, 0.05, True, LOOP_SPRING, gains, settings, np.zeros(STATE)
    ...     )
    ...     print(round(float(found[2]), 9))
    0.4
    0.1
    """
    error = gains.amplitude - a_A
    main = gains.feed_forward + gains.amplitude_gain_1_s * error + state[AMPLITUDE_INTEGRAL]
    quadrature, spring, signal = 0.0, 0.0, 0.0
    if quadrature_loop == LOOP_FORCE:
        signal = a_B
        quadrature = -gains.quadrature_gain_1_s * a_B - state[QUADRATURE_INTEGRAL]
    elif quadrature_loop == LOOP_SPRING:
        # a_A a_B is what a product of the channels gives without a division; over the set amplitude
        # squared it is r while the amplitude holds.
        signal = a_A * a_B / gains.amplitude**2 if settings.phase_product else a_B / a_A
        spring = gains.quadrature_gain_1_s * signal + state[QUADRATURE_INTEGRAL]
        quadrature = -spring * a_A
    if on:
        interval = settings.interval_s
        state[AMPLITUDE_INTEGRAL] += gains.amplitude_integral_1_s2 * error * interval
        state[QUADRATURE_INTEGRAL] += gains.quadrature_integral_1_s2 * signal * interval
    return main, quadrature, spring
