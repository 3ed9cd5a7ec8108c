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


@dataclass(frozen=True)
class Electronics:
    """The board: times in periods of the nominal frequency, force in amplitude per second."""

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


SILENT, NOISY, LOOPS_ON_BOARD = 0, 1, 2
"""Kinds of `Board`: neither board nor noise, noise alone, loops that act on what the board
knows."""


class BoardSettings(NamedTuple):
    """What does not change during a run: lengths in steps, times in s."""

    reading_steps: int = 0
    driving_steps: int = 0
    """0: the board reads and drives at once."""
    delay_steps: int = 0
    interval_s: float = 0.0
    """From one command to the next."""
    filter_share: float = 0.0
    """Part of a window's new envelopes that the low pass takes at once."""
    phase_gain_1_s: float = 0.0
    phase_integral_1_s2: float = 0.0
    omega_rad_s: float = 0.0
    """The oscillator's nominal frequency."""
    adc_step: float = 0.0
    adc_limit: float = 0.0
    drive_step: float = 0.0
    drive_limit: float = 0.0
    drive_share: float = 1.0
    """Force while driving over the mean force that is commanded."""
    phase_product: bool = False


class Board(NamedTuple):
    """The board as the compiled loop takes it; `kind`: SILENT, NOISY or LOOPS_ON_BOARD."""

    kind: int
    settings: BoardSettings
    state: Array
    """(STATE,), by the places named below."""
    waiting: Array
    """(r, COMMAND): commands on their way, a ring: step from which it acts, main, quadrature, cos,
    sin, spring, frequency, amplitude."""


# Places in `Board.state`. A compiled loop changes numbers in an array; names keep them apart.
OSCILLATOR_COS, OSCILLATOR_SIN, STEP_COS, STEP_SIN = 0, 1, 2, 3
SUM_COS2, SUM_COS_SIN, SUM_SIN2 = 4, 5, 6
"""Normal matrix of a window's least squares."""
SUM_X_COS, SUM_X_SIN, SUM_Y_COS, SUM_Y_SIN = 7, 8, 9, 10
STEPS_DONE, DRIVING = 11, 12
"""Steps since reading (or driving) began; 1 while it drives."""
X_COS, X_SIN, Y_COS, Y_SIN, FILTERED = 13, 14, 15, 16, 17
"""Filtered envelopes; 1 once there are any."""
AXIS_COS, AXIS_SIN = 18, 19
"""Direction e_A of the wave as last seen."""
AMPLITUDE_INTEGRAL, QUADRATURE_INTEGRAL, PHASE_INTEGRAL = 20, 21, 29
ACTING = 22
"""First place of the command that acts, in the order of `waiting` without its step."""
MAIN, QUADRATURE, COMMAND_COS, COMMAND_SIN, SPRING, FREQUENCY, AMPLITUDE = (
    22,
    23,
    24,
    25,
    26,
    27,
    28,
)
RING_FIRST, RING_LENGTH = 30, 31
STATE, COMMAND = 32, 8


def start_board(
    e: Electronics | None,
    control: Control,
    mechanics: Mechanics,
    h: float,
    phase_rad: float,
    angle_rad: float,
    noisy: bool,
) -> Board:
    """The board at t = 0, locked to the wave; without electronics only its oscillator runs.

    Parameters
    ----------
    e
        The electronics; None: the loops act on the true wave.
    control
        The loops' set point.
    mechanics
        The resonator, whose frequency is the oscillator's nominal one.
    h
        The engine's step [s].
    phase_rad, angle_rad
        φ and the electrical angle mθ of the wave.
    noisy
        Whether read-out or drive are noisy.

    Returns
    -------
    Board
        As the compiled loop takes it.

    Examples
    --------
    >>> from hrg_cli.physics.electronics import LOOPS_ON_BOARD, Electronics, start_board
    >>> from hrg_cli.physics.plant import Control
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> e = Electronics(periods_per_update=8, delay_periods=2.0)
    >>> made = start_board(e, Control(forced=True), Mechanics(1000.0, 0.5), 1e-4, 0.0, 0.0, False)
    >>> made.kind == LOOPS_ON_BOARD, made.settings.reading_steps, made.settings.delay_steps
    (True, 80, 20)
    """
    omega = mechanics.omega_rad_s
    state = np.zeros(STATE)
    state[OSCILLATOR_COS], state[OSCILLATOR_SIN] = math.cos(phase_rad), math.sin(phase_rad)
    state[STEP_COS], state[STEP_SIN] = math.cos(omega * h), math.sin(omega * h)
    if e is None:
        return Board(NOISY if noisy else SILENT, BoardSettings(), state, np.zeros((1, COMMAND)))

    settings = _settings(e, omega, h)
    state[AXIS_COS], state[AXIS_SIN] = math.cos(angle_rad), math.sin(angle_rad)
    # until the first window ends the wave is held as it is
    state[MAIN] = mechanics.damping_rate_1_s * control.main_amplitude
    state[COMMAND_COS], state[COMMAND_SIN] = state[AXIS_COS], state[AXIS_SIN]
    state[AMPLITUDE] = control.main_amplitude
    window = settings.reading_steps + settings.driving_steps
    depth = settings.delay_steps // max(window, 1) + 3
    return Board(LOOPS_ON_BOARD, settings, state, np.zeros((depth, COMMAND)))


def _settings(e: Electronics, omega: float, h: float) -> BoardSettings:
    """Periods as whole steps of h seconds, corners as shares of a window."""
    steps_a_period = 2 * np.pi / (omega * h)
    reading = round(e.periods_per_update * steps_a_period)
    driving = round(e.drive_periods * steps_a_period)
    interval = (reading + driving) * h
    natural = 2 * np.pi * e.phase_loop_hz
    return BoardSettings(
        reading_steps=reading,
        driving_steps=driving,
        delay_steps=round(e.delay_periods * steps_a_period),
        interval_s=interval,
        filter_share=1 - math.exp(-2 * np.pi * e.filter_hz * interval) if e.filter_hz else 1.0,
        phase_gain_1_s=math.sqrt(2.0) * natural,
        phase_integral_1_s2=natural**2,
        omega_rad_s=omega,
        adc_step=float(e.adc_step),
        adc_limit=float(e.adc_limit),
        drive_step=float(e.drive_step),
        drive_limit=float(e.drive_limit),
        drive_share=1 + reading / driving if driving else 1.0,
        phase_product=e.phase_product,
    )
