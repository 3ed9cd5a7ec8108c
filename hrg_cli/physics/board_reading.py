"""What the board of `electronics` does at a step: it reads, demodulates at a window's end, and sends a
command on its way. Every function is compiled into the fast engine's loop and acts on the board's
state, by the places that `electronics` names."""

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
from .loop_forces import stokes_of
from .loop_values import LOOP_FORCE, LOOP_SPRING, Gains

Array = np.ndarray


def turn_oscillator(state: Array) -> None:
    """One step of the oscillator."""
    c, s = state[OSCILLATOR_COS], state[OSCILLATOR_SIN]
    state[OSCILLATOR_COS] = c * state[STEP_COS] - s * state[STEP_SIN]
    state[OSCILLATOR_SIN] = s * state[STEP_COS] + c * state[STEP_SIN]


def round_to_step(value: float, step: float, limit: float) -> float:
    """A converter: nearest step, clipped at ± limit; 0 leaves either out."""
    if step > 0:
        value = step * math.floor(value / step + 0.5)
    if limit > 0:
        value = min(max(value, -limit), limit)
    return value


def passed(amplitude: float, limit: float) -> float:
    """Part of a sine's fundamental that clipping at ± limit lets through: (2/π)(arcsin x + x√(1 −
    x²)), x = limit/amplitude."""
    if limit <= 0 or amplitude <= limit:
        return 1.0
    x = limit / amplitude
    return 2 / math.pi * (math.asin(x) + x * math.sqrt(1 - x * x))


def look(
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

    x, y: displacements with their noise; on: whether the drive acts, without which no integral goes
    on.
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

    s0, s1, s2, s3 = stokes_of(state[X_COS] + 1j * state[X_SIN], state[Y_COS] + 1j * state[Y_SIN])
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
    """Every command whose delay is over by step i takes the place of the one that acts; the
    oscillator goes on at its frequency."""
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
    """Both displacements through the converter, into the sums of the window's least squares."""
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
    """The window's envelopes against the oscillator by least squares, into the low pass; the sums
    begin anew, and a board that multiplexes drives next."""
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
    """e_A by its angle, on the side where it was; the phase of the wave against the oscillator."""
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
    """a_ΦA, a_ΦB and the spring's rate σ of proportional and integral loops, once a window; the
    integrals go on while the drive is on."""
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
