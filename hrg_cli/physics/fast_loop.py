"""The fast engine's loop over the samples: kick, exact step, loops of the control; compiled by
numba where it is installed."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np

from .electronics import Board, look, passed, rounded, turn_oscillator
from .plant import Acceleration

Array = np.ndarray


def _no_extra(_t: float, _x: float, _y: float, _vx: float, _vy: float) -> tuple[float, float]:
    return 0.0, 0.0


_extra: Any = _no_extra


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
    propagators: Array
    local: Array


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


class Loops(NamedTuple):
    """The control: kinds (driven, drive, quadrature loop), gains (10,), drive matrix, parasitic
    force, intervals without drive, and a_ΦA, a_ΦB a step (n, 2) where a log is replayed, else
    empty."""

    kinds: Array
    gains: Array
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


def _disturbed(
    i: int, d: Disturbance, cos: float, sin: float
) -> tuple[float, float, complex, complex]:
    """Read-out noise of both channels at step i of the block, and the drive's envelope noise, 1/f
    parts at the oscillator's phase."""
    nx, ny, fx, fy = 0.0, 0.0, 0j, 0j
    if len(d.white) > 0:
        nx, ny = d.white[i, 0], d.white[i, 1]
    if len(d.knots) > 0:
        at = (i - d.first) / d.stride
        k = int(at)
        f = at - k
        e0 = d.knots[k, 0] + f * (d.knots[k + 1, 0] - d.knots[k, 0])
        e1 = d.knots[k, 1] + f * (d.knots[k + 1, 1] - d.knots[k, 1])
        e2 = d.knots[k, 2] + f * (d.knots[k + 1, 2] - d.knots[k, 2])
        e3 = d.knots[k, 3] + f * (d.knots[k + 1, 3] - d.knots[k, 3])
        nx += e0 * cos - e1 * sin
        ny += e2 * cos - e3 * sin
        fx = (
            d.knots[k, 4]
            + f * (d.knots[k + 1, 4] - d.knots[k, 4])
            + 1j * (d.knots[k, 5] + f * (d.knots[k + 1, 5] - d.knots[k, 5]))
        )
        fy = (
            d.knots[k, 6]
            + f * (d.knots[k + 1, 6] - d.knots[k, 6])
            + 1j * (d.knots[k, 7] + f * (d.knots[k + 1, 7] - d.knots[k, 7]))
        )
    return nx, ny, fx, fy


def _acceleration(
    t: float, x: float, y: float, vx: float, vy: float, c: Array
) -> tuple[float, float]:
    """The terms of `plant.POLYNOMIAL` with coefficients c, plus the further acceleration."""
    r2, v2, zv = x * x + y * y, vx * vx + vy * vy, x * vx + y * vy
    along_z = c[0] * r2 + c[1] * r2 * r2 + c[2] * v2 + c[4] * zv
    along_v = c[3] * zv + c[5] * r2 + c[6] * v2
    qa, qb = x * x * x - 3 * x * y * y, 3 * x * x * y - y * y * y
    ax, ay = _extra(t, x, y, vx, vy)
    return ax + along_z * x + along_v * vx + c[7] * qa + c[
        8
    ] * qb, ay + along_z * y + along_v * vy - c[7] * qb + c[8] * qa


def advance(
    memory: Array,
    motion: Motion,
    forces: Forces,
    loops: Loops,
    board: Board,
    disturbance: Disturbance,
    rows: Rows,
) -> None:
    """The samples of `motion`; `memory`: x, y, p_x, p_y (over scale), two loop integrals, the last
    e_A and force."""
    first, n, substeps, h, scale = (
        motion.first,
        motion.samples,
        motion.substeps,
        motion.h,
        motion.scale,
    )
    knots, propagators, local = motion.knots, motion.propagators, motion.local
    polynomial, nonlinear, thermal = forces.polynomial, forces.nonlinear, forces.thermal
    kinds, gains, drive_matrix, parasitic, off, commanded = (
        loops.kinds,
        loops.gains,
        loops.drive_matrix,
        loops.parasitic,
        loops.off,
        loops.commanded,
    )
    replayed = len(commanded) > 0
    z, v, drive, command = rows.z, rows.v, rows.drive, rows.command
    brownian, rough = len(thermal) > 0, len(forces.rough) > 0
    settings, state = board.settings, board.state
    x, y, px, py = memory[0], memory[1], memory[2], memory[3]
    gx, gy = memory[8] + 1j * memory[9], memory[10] + 1j * memory[11]
    moving = len(knots) > 1
    P = propagators[0].copy()
    q = local[0].copy()
    at, gap = 0, 0
    forced = kinds[0] == 1
    for i in range(n * substeps):
        t = (first + i) * h
        if moving:
            while at + 2 < len(knots) and i >= knots[at + 1]:
                at += 1
            f = (i - knots[at]) / (knots[at + 1] - knots[at])
            for a in range(4):
                for b in range(4):
                    P[a, b] = propagators[at, a, b] + f * (
                        propagators[at + 1, a, b] - propagators[at, a, b]
                    )
            for a in range(len(q)):
                q[a] = local[at, a] + f * (local[at + 1, a] - local[at, a])
        omega = q[0]
        ax, ay = 0.0, 0.0
        if nonlinear:
            vx, vy = scale * px + q[5] * y, scale * py - q[5] * x
            ax, ay = _acceleration(t, x, y, vx, vy, polynomial)
            ax, ay = _acceleration(t, x, y, vx + 0.5 * h * ax, vy + 0.5 * h * ay, polynomial)
        fx, fy, hx, hy = 0j, 0j, 0j, 0j
        sampled = 0.0
        main, quadrature = 0.0, 0.0
        noise_x, noise_y, rough_x, rough_y, on = 0.0, 0.0, 0j, 0j, False
        if board.kind > 0:
            noise_x, noise_y, rough_x, rough_y = _disturbed(i, disturbance, state[0], state[1])
        if forced:
            while gap < len(off) and t >= off[gap, 1]:
                gap += 1
            on = not (gap < len(off) and t >= off[gap, 0])
            if board.kind == 2:
                look(
                    first + i,
                    x + noise_x,
                    y + noise_y,
                    h,
                    on,
                    kinds,
                    gains,
                    settings,
                    state,
                    board.waiting,
                )
            if on:
                # The loops look at the middle of the kick, as expected from the last one. There the
                # momentum holds the force's part of u' too, by a factor that sampling makes ωh·cot
                # ωh; left inside, it would ripple at 2ω through the gains.
                angle = omega * h
                sampled = angle / math.tan(angle)
                step = math.cos(angle) + 1j * math.sin(angle)
                gx, gy = gx * step, gy * step
                ex = scale * px - angle * gx.imag - sampled * gx.real - q[10] * x - q[11] * y
                ey = scale * py - angle * gy.imag - sampled * gy.real - q[12] * x - q[13] * y
                # not p/ω: of a split resonator that would ripple at 2ω, too
                wx, wy = q[6] * ex + q[7] * ey, q[8] * ex + q[9] * ey
                ux, uy = x - 1j * wx, y - 1j * wy
                s0, s1 = x * x + wx * wx + y * y + wy * wy, x * x + wx * wx - y * y - wy * wy
                s2, s3 = 2 * (x * y + wx * wy), 2 * (x * wy - wx * y)
                s12 = math.sqrt(s1 * s1 + s2 * s2)
                a_A = math.sqrt((s0 + s12) / 2)
                if board.kind == 2:
                    main, quadrature = state[22], state[23]
                    cos, sin, spring = state[24], state[25], state[26]
                    turn = state[0] + 1j * state[1]
                    late = gains[6] - 1j * gains[7]
                    acting = settings[12] if settings[1] == 0 or state[12] == 1 else 0.0
                    if kinds[1] == 0:
                        fx, fy = turn * late * main * cos, turn * late * main * sin
                    else:
                        pump = turn * turn * late * (main / state[28])
                        fx, fy = pump * ux.conjugate(), pump * uy.conjugate()
                    if kinds[2] == 1:
                        side = -1j * turn * (gains[8] - 1j * gains[9]) * quadrature
                        fx -= side * sin
                        fy += side * cos
                    elif kinds[2] == 2:
                        c2, s2e = cos * cos - sin * sin, 2 * cos * sin
                        ax -= 2 * omega * spring * (-s2e * x + c2 * y)
                        ay -= 2 * omega * spring * (c2 * x + s2e * y)
                    hx = (drive_matrix[0, 0] * fx + drive_matrix[0, 1] * fy) * acting + (
                        parasitic[0] + rough_x
                    ) * turn
                    hy = (drive_matrix[1, 0] * fx + drive_matrix[1, 1] * fy) * acting + (
                        parasitic[1] + rough_y
                    ) * turn
                    ax -= 2 * omega * rounded(hx.imag, settings[10], settings[11])
                    ay -= 2 * omega * rounded(hy.imag, settings[10], settings[11])
                    hx, hy = hx * passed(abs(hx), settings[11]), hy * passed(abs(hy), settings[11])
                elif a_A > 0.0 and s12 > 0.0:
                    a_B = s3 / (2 * a_A)
                    if s1 > 0:
                        cos = math.sqrt((1 + s1 / s12) / 2)
                        sin = s2 / s12 / (2 * cos)
                    else:
                        sin = math.sqrt((1 - s1 / s12) / 2)
                        cos = s2 / s12 / (2 * sin)
                    if cos * memory[6] + sin * memory[7] < 0:
                        cos, sin = -cos, -sin
                    memory[6], memory[7] = cos, sin
                    turn = (cos * ux + sin * uy) / a_A
                    if replayed:
                        main, quadrature = commanded[i, 0], commanded[i, 1]
                    else:
                        error = gains[0] - a_A
                        main = gains[1] + gains[2] * error + memory[4]
                        memory[4] += gains[3] * error * h
                        if kinds[2] == 1:
                            quadrature = -gains[4] * a_B - memory[5]
                            memory[5] += gains[5] * a_B * h
                        elif kinds[2] == 2:
                            quadrature = -gains[4] * a_B - memory[5] * a_A
                            memory[5] += gains[5] * a_B / a_A * h
                    if kinds[2] == 2:
                        spring = -quadrature / a_A
                        c2, s2e = s1 / s12, s2 / s12
                        ax -= 2 * omega * spring * (-s2e * x + c2 * y)
                        ay -= 2 * omega * spring * (c2 * x + s2e * y)
                    late = gains[6] - 1j * gains[7]
                    if kinds[1] == 0:
                        fx, fy = turn * late * main * cos, turn * late * main * sin
                    else:
                        pump = turn * turn * late * (main / a_A)
                        fx, fy = pump * ux.conjugate(), pump * uy.conjugate()
                    if kinds[2] == 1:
                        side = -1j * turn * (gains[8] - 1j * gains[9]) * quadrature
                        fx -= side * sin
                        fy += side * cos
                    hx = (
                        drive_matrix[0, 0] * fx
                        + drive_matrix[0, 1] * fy
                        + (parasitic[0] + rough_x) * turn
                    )
                    hy = (
                        drive_matrix[1, 0] * fx
                        + drive_matrix[1, 1] * fy
                        + (parasitic[1] + rough_y) * turn
                    )
                    ax -= 2 * omega * hx.imag
                    ay -= 2 * omega * hy.imag
        gx, gy = hx, hy
        if first + i == 0:
            px += sampled * gx.real / scale
            py += sampled * gy.real / scale
        kick = h / scale
        if i % substeps == 0:
            m = i // substeps
            mx, my = px + 0.5 * kick * ax, py + 0.5 * kick * ay
            if first + i == 0:
                mx, my = px, py
            z[0, m], z[1, m] = x, y
            v[0, m] = (scale * mx + q[1] * x + q[2] * y - sampled * gx.real) / omega
            v[1, m] = (scale * my + q[3] * x + q[4] * y - sampled * gy.real) / omega
            drive[0, m], drive[1, m] = fx, fy
            command[0, m], command[1, m] = main, quadrature
        if first + i == 0:
            kick *= 0.5
        px += kick * ax
        py += kick * ay
        if brownian:
            px += thermal[i, 0]
            py += thermal[i, 1]
        if rough and on:
            px += forces.rough[i, 0]
            py += forces.rough[i, 1]
        if board.kind > 0:
            rows.noise[0, i // substeps] += noise_x / substeps
            rows.noise[1, i // substeps] += noise_y / substeps
            turn_oscillator(state)
        x, y, px, py = (
            P[0, 0] * x + P[0, 1] * y + P[0, 2] * px + P[0, 3] * py,
            P[1, 0] * x + P[1, 1] * y + P[1, 2] * px + P[1, 3] * py,
            P[2, 0] * x + P[2, 1] * y + P[2, 2] * px + P[2, 3] * py,
            P[3, 0] * x + P[3, 1] * y + P[3, 2] * px + P[3, 3] * py,
        )
    memory[0], memory[1], memory[2], memory[3] = x, y, px, py
    memory[8], memory[9], memory[10], memory[11] = gx.real, gx.imag, gy.real, gy.imag


@functools.lru_cache(maxsize=16)
def compiled(extra: Acceleration | None) -> Callable[..., None]:
    """The loop with `extra` inside: compiled (and kept on disk where nothing of the caller's is
    inside), or plain Python."""
    try:
        from numba import njit
    except ImportError:
        return _bound(advance, _acceleration=_bound(_acceleration, _extra=extra or _no_extra))
    inner = _no_extra if extra is None else extra
    compiled_extra = inner if hasattr(inner, "py_func") else njit(inner)
    if extra is None:
        try:
            return _bind_and_compile(njit(cache=True), compiled_extra)
        except RuntimeError:  # no folder to cache in
            pass
    return _bind_and_compile(njit, compiled_extra)


def _bind_and_compile(jit: Any, extra: Any) -> Callable[..., None]:
    return jit(
        _bound(advance, _acceleration=jit(_bound(_acceleration, _extra=extra)), **_board_parts())
    )


@functools.lru_cache(maxsize=1)
def _board_parts() -> dict[str, Any]:
    """What the loop calls of the board and its noise, compiled once whatever acceleration it is
    bound with."""
    from numba import njit

    def made(jit: Any) -> dict[str, Any]:
        convert = jit(rounded)
        parts = {
            "_disturbed": _disturbed,
            "passed": passed,
            "turn_oscillator": turn_oscillator,
            "look": _bound(look, rounded=convert),
        }
        return {"rounded": convert} | {name: jit(part) for name, part in parts.items()}

    try:
        return made(njit(cache=True))
    except RuntimeError:  # no folder to cache in
        return made(njit)


def _bound(function: Any, **names: Any) -> Any:
    """A copy of the function in whose globals some names stand for others."""
    copy = FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__)
    copy.__qualname__, copy.__module__ = function.__qualname__, function.__module__
    return copy
