"""A gyro's electronics: loops that act on what a board knows of the wave, for the fast engine.

At every step the board reads both displacements (with noise, through a converter of finite bits).
Over a window of whole periods it demodulates them by least squares against its own oscillator,
filters the envelopes, and takes from them amplitude, quadrature, angle and phase. From these: an
amplitude loop (proportional and integral), a phase-locked loop that moves the oscillator, a
quadrature loop by force or spring. Commands act after a delay, held until the next; force is made
at the oscillator's phase by a converter of finite bits that saturates. With time-multiplexing the
board reads for some periods and drives for some, its force stronger in proportion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .plant import Control
from .resonator import Mechanics

Array = np.ndarray
STATE, SETTINGS, COMMAND = 40, 20, 8


@dataclass(frozen=True)
class Electronics:
    """The board: times in periods of the nominal frequency, force in amplitude a second."""

    periods_per_update: int = 16
    delay_periods: float = 0.0
    filter_hz: float = 0.0
    """Corner of the low pass on the demodulated envelopes; 0: none."""
    phase_loop_hz: float = 1.0
    """Natural frequency of the phase-locked loop, damping 1/√2."""
    adc_step: float = 0.0
    adc_limit: float = 0.0
    drive_step: float = 0.0
    drive_limit: float = 0.0
    drive_periods: int = 0
    """Periods of driving after each window of reading; 0: both at once."""
    phase_product: bool = False
    """The spring follows a_A a_B = a_C a_S sin(φ_C − φ_S) over the set amplitude squared, not
    a_B/a_A."""


class Board(NamedTuple):
    """The board as the compiled loop takes it; `kind` 0: neither board nor noise, 1: noise alone,
    2: loops on the board."""

    kind: int
    settings: Array
    """(SETTINGS,)"""
    state: Array
    """(STATE,)"""
    waiting: Array
    """(r, COMMAND): commands on their way, a ring: step from which it acts, main, quadrature, cos,
    sin, spring, frequency, amplitude."""


def board(
    e: Electronics | None,
    control: Control,
    mechanics: Mechanics,
    h: float,
    phase_rad: float,
    angle_rad: float,
    noisy: bool,
) -> Board:
    """The board at t = 0, locked to the wave (phase φ, electrical angle mθ); without electronics
    only its oscillator runs."""
    omega = mechanics.omega_rad_s
    state, settings = np.zeros(STATE), np.zeros(SETTINGS)
    state[0:2] = math.cos(phase_rad), math.sin(phase_rad)
    state[2:4] = math.cos(omega * h), math.sin(omega * h)
    if e is None:
        return Board(int(noisy), settings, state, np.zeros((1, COMMAND)))
    period = 2 * np.pi / (omega * h)
    reading, driving = round(e.periods_per_update * period), round(e.drive_periods * period)
    interval = (reading + driving) * h
    natural = 2 * np.pi * e.phase_loop_hz
    settings[:14] = (
        reading,
        driving,
        round(e.delay_periods * period),
        interval,
        1 - math.exp(-2 * np.pi * e.filter_hz * interval) if e.filter_hz else 1.0,
        math.sqrt(2.0) * natural,
        natural**2,
        omega,
        e.adc_step,
        e.adc_limit,
        e.drive_step,
        e.drive_limit,
        1 + (driving and reading / driving),
        float(e.phase_product),
    )
    state[18:20] = math.cos(angle_rad), math.sin(angle_rad)
    state[22] = mechanics.damping_rate_1_s * control.main_amplitude
    state[24:26] = state[18:20]
    state[28] = control.main_amplitude
    depth = int(settings[2] // max(reading + driving, 1)) + 3
    return Board(2, settings, state, np.zeros((depth, COMMAND)))


def turn_oscillator(state: Array) -> None:
    """One step of the oscillator."""
    c, s = state[0], state[1]
    state[0] = c * state[2] - s * state[3]
    state[1] = s * state[2] + c * state[3]


def rounded(value: float, step: float, limit: float) -> float:
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
    kinds: Array,
    gains: Array,
    settings: Array,
    state: Array,
    waiting: Array,
) -> None:
    """One reading of the board at step i; at a window's end the loops put a new command on its way.
    Acts on `state`.

    state: oscillator (0, 1), its step (2, 3), normal matrix and sums (4 … 10), steps read (11), 1
    while driving (12), filtered envelopes (13 … 16), 1 once filled (17), e_A (18, 19), integrals of
    amplitude, quadrature and phase loop (20, 21, 29), command that acts (22 … 28: main, quadrature,
    cos, sin, spring, frequency, amplitude), ring's first and length (30, 31).
    """
    size = len(waiting)
    while state[31] > 0 and waiting[int(state[30]), 0] <= i:
        at = int(state[30])
        for k in range(1, 8):
            state[21 + k] = waiting[at, k]
        step = (settings[7] + state[27]) * h
        state[2], state[3] = math.cos(step), math.sin(step)
        norm = 1 / math.sqrt(state[0] ** 2 + state[1] ** 2)
        state[0] *= norm
        state[1] *= norm
        state[30] = (at + 1) % size
        state[31] -= 1
    if state[12] == 1:
        state[11] += 1
        if state[11] >= settings[1]:
            state[11], state[12] = 0, 0
        return
    x, y = rounded(x, settings[8], settings[9]), rounded(y, settings[8], settings[9])
    c, s = state[0], state[1]
    state[4] += c * c
    state[5] += c * s
    state[6] += s * s
    state[7] += x * c
    state[8] += x * s
    state[9] += y * c
    state[10] += y * s
    state[11] += 1
    if state[11] < settings[0]:
        return
    det = state[4] * state[6] - state[5] ** 2
    share = settings[4] if state[17] == 1 else 1.0
    state[13] += share * ((state[7] * state[6] - state[8] * state[5]) / det - state[13])
    state[14] += share * (-(state[8] * state[4] - state[7] * state[5]) / det - state[14])
    state[15] += share * ((state[9] * state[6] - state[10] * state[5]) / det - state[15])
    state[16] += share * (-(state[10] * state[4] - state[9] * state[5]) / det - state[16])
    state[17] = 1
    for k in range(4, 12):
        state[k] = 0
    if settings[1] > 0:
        state[12] = 1
    cr, ci, sr, si = state[13], state[14], state[15], state[16]
    s0, s1 = cr * cr + ci * ci + sr * sr + si * si, cr * cr + ci * ci - sr * sr - si * si
    s2, s3 = 2 * (cr * sr + ci * si), 2 * (ci * sr - cr * si)
    s12 = math.sqrt(s1 * s1 + s2 * s2)
    a_A = math.sqrt((s0 + s12) / 2)
    if not a_A > 0.0:
        return
    a_B = s3 / (2 * a_A)
    half = math.atan2(s2, s1) / 2
    cos, sin = math.cos(half), math.sin(half)
    if cos * state[18] + sin * state[19] < 0:
        cos, sin = -cos, -sin
    state[18], state[19] = cos, sin
    phase = math.atan2(cos * ci + sin * si, cos * cr + sin * sr)
    state[29] += settings[6] * phase * settings[3]
    error = gains[0] - a_A
    main = gains[1] + gains[2] * error + state[20]
    quadrature, spring, signal = 0.0, 0.0, 0.0
    if kinds[2] == 1:
        quadrature = -gains[4] * a_B - state[21]
    elif kinds[2] == 2:
        signal = a_A * a_B / gains[0] ** 2 if settings[13] == 1 else a_B / a_A
        spring = gains[4] * signal + state[21]
        quadrature = -spring * a_A
    if on:
        state[20] += gains[3] * error * settings[3]
        if kinds[2] == 1:
            state[21] += gains[5] * a_B * settings[3]
        elif kinds[2] == 2:
            state[21] += gains[5] * signal * settings[3]
    if state[31] >= size:
        return
    at = int(state[30] + state[31]) % size
    waiting[at, 0] = i + 1 + settings[2]
    waiting[at, 1], waiting[at, 2], waiting[at, 3], waiting[at, 4] = main, quadrature, cos, sin
    waiting[at, 5], waiting[at, 6], waiting[at, 7] = spring, settings[5] * phase + state[29], a_A
    state[31] += 1
