"""The driven motion without causes, row by row: the rule of `slow_prediction.Rule` and the drive of
`slow_equation.RungeKuttaStage`, a run after another in scalars, compiled by numba where it is
installed.

A gross misfit is marched thousands of times, in a rule whose every row hangs on the one before.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...physics.compilation import compile_all

Array = np.ndarray


class Instants(NamedTuple):
    """What a row, or a step's middle, of every run knows of itself."""

    L: Array
    """(R, n, 2, 2)"""
    main: Array
    """Commands as logged, amplitude/s (R, n)."""
    quadrature: Array
    phase_rad: Array
    """The phase that the wave's is taken near to (R, n)."""
    held: Array
    """Amplitude that is held where none is logged, NaN elsewhere (R, n), and its slope."""
    held_slope: Array
    turned: Array
    """Turn of the commands' frame in angle and phase, rad (R, n, 2)."""
    follow_1_s: float
    """Rate at which a held amplitude is followed."""


class Constants(NamedTuple):
    """The force's second order (2, 2) and its lead."""

    second: Array
    lead: complex


class RuleSteps(NamedTuple):
    """Length of every step (R, n − 1), what the run's steady part makes of half of it, what the
    rule misses of a turn (R, n − 1, 2, 2), and jumps (R, n − 1, 2)."""

    h: Array
    half: Array
    righted: Array
    jumps: Array


def _turn_drive(
    c: complex, s: complex, v0: complex, v1: complex, of: Instants, r: int, k: int
) -> tuple[complex, complex]:
    """The drive along the axes of envelopes (c, s) that move as (v0, v1) do."""
    # mθ of the main axis: tan 2mθ = 2 Re(C S*)/(|C|² − |S|²)
    electrical = 0.5 * math.atan2(
        2 * (c.real * s.real + c.imag * s.imag),
        c.real * c.real + c.imag * c.imag - s.real * s.real - s.imag * s.imag,
    )
    cos, sin = math.cos(electrical), math.sin(electrical)
    wave = cos * c + sin * s

    # (mθ, φ) and (mθ + π, φ + π) are one wave: the one whose phase is near the measured one
    near = of.phase_rad[r, k]
    if wave.real * math.cos(near) + wave.imag * math.sin(near) < 0:
        cos, sin, wave = -cos, -sin, -wave

    size = math.hypot(wave.real, wave.imag)
    turn = wave / size if size > 0 else wave
    main = of.main[r, k]
    if not math.isnan(of.held[r, k]):
        lost = (of.L[r, k, 0, 0] * v0 + of.L[r, k, 0, 1] * v1) * cos + (
            of.L[r, k, 1, 0] * v0 + of.L[r, k, 1, 1] * v1
        ) * sin
        # ȧ_A = loss + force, solved for the force that gives the measured slope; a slow pull on
        # top of it to where a_A was measured
        loss = lost.real * turn.real + lost.imag * turn.imag
        main = of.held_slope[r, k] - loss + of.follow_1_s * (of.held[r, k] - size)

    # loops that act late, or look askew, push along axes beside the wave's
    angle, phase = of.turned[r, k, 0], of.turned[r, k, 1]
    if angle != 0 or phase != 0:
        x, y = math.cos(angle), math.sin(angle)
        cos, sin = x * cos - y * sin, x * sin + y * cos
        turn = turn * complex(math.cos(phase), math.sin(phase))

    # e^{jφ}(a_ΦA e_A − j a_ΦB e_B), with e_B = (−sin, cos) of the angle
    across = 1j * of.quadrature[r, k]
    return turn * (main * cos + across * sin), turn * (main * sin - across * cos)


def _slope(
    c: complex, s: complex, of: Instants, r: int, k: int, shared: Constants
) -> tuple[complex, complex]:
    """dv/dt = Lv + (1 + second) f."""
    f0, f1 = _turn_drive(c, s, c, s, of, r, k)
    if shared.lead != 0:
        f0, f1 = _turn_drive(c + shared.lead * f0, s + shared.lead * f1, c, s, of, r, k)
    second = shared.second
    return (
        of.L[r, k, 0, 0] * c + of.L[r, k, 0, 1] * s + f0 + second[0, 0] * f0 + second[0, 1] * f1,
        of.L[r, k, 1, 0] * c + of.L[r, k, 1, 1] * s + f1 + second[1, 0] * f0 + second[1, 1] * f1,
    )


def _carry(E: Array, c: complex, s: complex) -> tuple[complex, complex]:
    """Envelopes behind half a step of the steady part."""
    return E[0, 0] * c + E[0, 1] * s, E[1, 0] * c + E[1, 1] * s


def march(
    rows: Instants, middles: Instants, steps: RuleSteps, shared: Constants, out: Array
) -> None:
    """Fill the motion behind its start by Runge and Kutta's rule, the steady part taken exactly.

    Parameters
    ----------
    rows, middles
        What the rows and the steps' middles know of themselves.
    steps
        Their lengths, the steady part's half steps, what rights the turn, and jumps.
    shared
        The force's second order and lead.
    out
        (R, n, 2) complex; its first rows are the start, all others are filled in place.

    Examples
    --------
    A wave whose main drive of 0.1 per second makes up for a damping of 0.1 1/s stays as it is, and
    without it decays:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.fast_march import Constants, Instants, RuleSteps, march
    >>> def at(count, main):
    ...     none, turned = np.zeros((1, count)), np.zeros((1, count, 2))
    ...     L = np.tile(-0.1 * np.eye(2, dtype=complex), (1, count, 1, 1))
    ...     return Instants(L, none + main, none, none, none + np.nan, none, turned, 0.0)
    >>> half = np.tile(np.eye(2, dtype=complex), (1, 10, 1, 1))
    >>> steps = RuleSteps(np.full((1, 10), 0.5), half, half, np.zeros((1, 10, 2), complex))
    >>> for main in (0.1, 0.0):
    ...     motion = np.ones((1, 11, 2)) * np.array([1.0 + 0j, 0.0])
    ...     march(at(11, main), at(10, main), steps, Constants(np.zeros((2, 2)), 0j), motion)
    ...     print(motion[0, -1, 0].real.round(5))
    1.0
    0.60653
    """
    # the classical rule's slopes of weights 1, 2, 2, 1, each carried by the steady part over what
    # is left of the step (Lawson 1967): at its start two halves, in its middle one, at its end none
    for r in range(out.shape[0]):
        for k in range(out.shape[1] - 1):
            h, E = steps.h[r, k], steps.half[r, k]
            c, s = out[r, k, 0], out[r, k, 1]
            a0, a1 = _slope(c, s, rows, r, k, shared)
            x, y = _carry(E, c + h / 2 * a0, s + h / 2 * a1)
            b0, b1 = _slope(x, y, middles, r, k, shared)
            x, y = _carry(E, c, s)
            d0, d1 = _slope(x + h / 2 * b0, y + h / 2 * b1, middles, r, k, shared)
            x, y = _carry(E, x + h * d0, y + h * d1)
            e0, e1 = _slope(x, y, rows, r, k + 1, shared)
            x, y = _carry(E, c + h / 6 * a0, s + h / 6 * a1)
            x, y = _carry(E, x + h / 3 * (b0 + d0), y + h / 3 * (b1 + d1))
            x, y = _carry(steps.righted[r, k], x + h / 6 * e0, y + h / 6 * e1)
            out[r, k + 1, 0] = x + steps.jumps[r, k, 0]
            out[r, k + 1, 1] = y + steps.jumps[r, k, 1]


@functools.lru_cache(maxsize=1)
def compile_march() -> Callable[[Instants, Instants, RuleSteps, Constants, Array], None] | None:
    """The march compiled, and kept on disk where there is a folder for it.

    Returns
    -------
    callable or None
        `march`; None without numba.

    Examples
    --------
    >>> from importlib.util import find_spec
    >>> from hrg_cli.fitting.causes.fast_march import compile_march
    >>> (compile_march() is None) == (find_spec("numba") is None)
    True
    """
    try:
        from numba import njit
    except ImportError:
        return None
    try:
        return _march_of(functools.partial(njit, cache=True))["march"]
    except RuntimeError:  # no folder to cache in
        return _march_of(njit)["march"]


_march_of = functools.partial(
    compile_all, functions=(_turn_drive, _slope, _carry, march), opened=()
)
