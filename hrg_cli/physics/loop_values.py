"""What the fast engine's loop is given and fills: arrays and numbers, as numba takes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

Array = np.ndarray

# Places in the loop's memory (MEMORY,), which goes from one block of samples to the next: state
# (momentum over `Motion.scale`), integrals of the ideal loops, their last e_A, last force.
X, Y, PX, PY = 0, 1, 2, 3
AMPLITUDE_INTEGRAL, QUADRATURE_INTEGRAL, AXIS_COS, AXIS_SIN = 4, 5, 6, 7
FORCE_X_COS, FORCE_X_SIN, FORCE_Y_COS, FORCE_Y_SIN = 8, 9, 10, 11
MEMORY = 12

# Places in a row of `Motion.local`: ω, N row by row, KΩ, and of p = Re[G q] the matrices (Im G)⁻¹
# and Re G.
OMEGA, DAMPING, TURNING, INVERSE, REAL = 0, 1, 5, 6, 10

LOOP_OFF, LOOP_FORCE, LOOP_SPRING = 0, 1, 2
"""Kinds of the quadrature loop."""


class Motion(NamedTuple):
    """Steps to make and the linear motion over them: knots (step numbers), exact propagators and
    what the loops need there."""

    first: int
    """Number of the first step since t = 0."""
    samples: int
    substeps: int
    """Steps a sample."""
    h: float
    """Length of a step."""
    scale: float
    """ω by which the momentum is divided."""
    knots: Array
    """(m,)"""
    propagators: Array
    """(m, 4, 4)"""
    local: Array
    """(m, 14), by the places named above."""


class Forces(NamedTuple):
    """Kicks that no loop makes: polynomial terms (9,), whether these or a further acceleration act,
    and random ones a step (n, 2).

    `thermal` act always, `rough` (of the drive's electronics) while the drive is on; changes of the
    momentum over `scale`, empty for none.
    """

    polynomial: Array
    nonlinear: bool
    thermal: Array
    rough: Array


class Gains(NamedTuple):
    """The loops' set point and gains, and the phase errors of both forces as cosine and sine."""

    amplitude: float
    feed_forward: float
    """a_ΦA that holds the set amplitude against the mean damping."""
    amplitude_gain_1_s: float
    amplitude_integral_1_s2: float
    quadrature_gain_1_s: float
    quadrature_integral_1_s2: float
    main_cos: float
    main_sin: float
    quadrature_cos: float
    quadrature_sin: float


class Loops(NamedTuple):
    """The control: whether and how it drives, its gains, drive matrix (2, 2), parasitic force (2,),
    intervals without drive (g, 2), and a_ΦA, a_ΦB a step (n, 2) where a log is replayed, else
    empty."""

    forced: bool
    parametric: bool
    quadrature_loop: int
    gains: Gains
    drive_matrix: Array
    parasitic: Array
    off: Array
    commanded: Array


class Disturbance(NamedTuple):
    """Electronic noise over the same steps: white (n, 2), and knots of 1/f envelopes (k, 8) with
    their stride and first step.

    Columns of the knots: read-out C, S in phase and in quadrature, then the drive's likewise.
    Without noise the arrays are empty.
    """

    white: Array
    knots: Array
    stride: int
    first: int


class Rows(NamedTuple):
    """What is kept of every sample: displacement, velocity over ω, force, command, read-out noise,
    (2, n) each."""

    z: Array
    v: Array
    drive: Array
    command: Array
    noise: Array
