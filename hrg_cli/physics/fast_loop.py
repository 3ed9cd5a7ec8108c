"""The fast engine's loop over the samples: kick, exact step, loops of the control; compiled by
numba where it is installed."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .board_reading import (
    demodulate_window,
    find_passed_part,
    follow_axis,
    read,
    regulate_on_board,
    round_to_step,
    take_commands,
    take_reading,
    turn_oscillator,
)
from .compilation import bound, compile_all
from .electronics import LOOPS_ON_BOARD, OSCILLATOR_COS, OSCILLATOR_SIN, SILENT, Board
from .loop_forces import (
    command_ideally,
    compute_spring_pull,
    find_board_command,
    find_stokes,
    make_force,
    reach_mode,
    regulate,
    see_envelopes,
)
from .loop_values import (
    DAMPING,
    FORCE_X_COS,
    FORCE_X_SIN,
    FORCE_Y_COS,
    FORCE_Y_SIN,
    LOOP_SPRING,
    OMEGA,
    PX,
    PY,
    TURNING,
    Disturbance,
    Forces,
    Loops,
    Motion,
    Rows,
    X,
    Y,
)
from .plant import Acceleration

Array = np.ndarray


def _no_extra(_t: float, _x: float, _y: float, _vx: float, _vy: float) -> tuple[float, float]:
    return 0.0, 0.0


_extra: Any = _no_extra


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


def _accelerate(
    t: float, x: float, y: float, px: float, py: float, turning: float, h: float, polynomial: Array
) -> tuple[float, float]:
    """Acceleration by what is not linear in the middle of a kick of length h: at the velocity p +
    KΩJz half a kick later."""
    vx, vy = px + turning * y, py - turning * x
    ax, ay = _acceleration(t, x, y, vx, vy, polynomial)
    return _acceleration(t, x, y, vx + 0.5 * h * ax, vy + 0.5 * h * ay, polynomial)


def _find_knot(i: int, knot: int, knots: Array) -> int:
    """The knot before step i, from an earlier one."""
    while knot + 2 < len(knots) and i >= knots[knot + 1]:
        knot += 1
    return knot


def _interpolate(knot: int, f: float, table: Array, out: Array) -> None:
    """The coefficients (k,) a part f of the way from a knot's to the next one's, of a table
    (m, k)."""
    for k in range(len(out)):
        out[k] = table[knot, k] + f * (table[knot + 1, k] - table[knot, k])


def _velocity(
    x: float, y: float, px: float, py: float, held: tuple[float, float], local: Array
) -> tuple[float, float]:
    """Velocity over ω from the momentum in amplitudes per second, less `held`, what of it is the
    sampled force's."""
    d, omega = DAMPING, local[OMEGA]
    vx = px + local[d] * x + local[d + 1] * y - held[0]
    vy = py + local[d + 2] * x + local[d + 3] * y - held[1]
    return vx / omega, vy / omega


def advance(
    memory: Array,
    motion: Motion,
    forces: Forces,
    loops: Loops,
    board: Board,
    disturbance: Disturbance,
    rows: Rows,
) -> None:
    """The samples of `motion` into `rows`, step by step (kick–drift–kick, seed A (3) with the
    forces).

    Parameters
    ----------
    memory
        (MEMORY,): position, momentum and held force, from which it goes on; changed.
    motion
        Where the block begins, its steps and their propagators.
    forces
        What bends the plant, and the drawn thermal and drive noise.
    loops
        Gains, drive and times at which they are off.
    board
        The electronics, and their state, which is changed.
    disturbance
        Read-out noise of the block.
    rows
        What is written: position, velocity, drive, commands, noise.

    Examples
    --------
    `fast_engine.run` prepares them, and gives the rows as envelopes:

    >>> import numpy as np
    >>> from hrg_cli.physics.environment import hold_value, make_environment
    >>> from hrg_cli.physics.fast_engine import run
    >>> from hrg_cli.physics.plant import Control, ThermalCourses, make_linear_plant
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> world = make_environment(hold_value(20.0), hold_value(0.0), 0.0, 1.0, 0.001)
    >>> plant = make_linear_plant(Mechanics(100.0, 0.5), ThermalCourses(), world)
    >>> block = next(run(world, plant, Control(), np.array([1.0, 0j]), 0.001, 1000))
    >>> bool(abs(block.envelopes(np.array([999]))[0, 0] - np.exp(-0.5 * 0.999)) < 1e-3)
    True
    """
    # Fields of a tuple are taken once: in the loop each would be counted as a reference.
    first, substeps, h, scale = motion.first, motion.substeps, motion.h, motion.scale
    knots, table = motion.knots, motion.local
    exact = motion.propagators.reshape(len(knots), 16)
    polynomial, thermal, rough = forces.polynomial, forces.thermal, forces.rough
    gains, off, kind, commanded = loops.gains, loops.off, loops.quadrature_loop, loops.commanded
    drive_matrix, parasitic = loops.drive_matrix, loops.parasitic
    settings, state, waiting = board.settings, board.state, board.waiting
    z, v, drive, command_rows, noise = rows.z, rows.v, rows.drive, rows.command, rows.noise

    x, y, px, py = memory[X], memory[Y], memory[PX], memory[PY]
    gx = memory[FORCE_X_COS] + 1j * memory[FORCE_X_SIN]
    gy = memory[FORCE_Y_COS] + 1j * memory[FORCE_Y_SIN]
    step, local = exact[0].copy(), table[0].copy()
    P = step.reshape(4, 4)
    knot, gap = 0, 0
    for i in range(motion.samples * substeps):
        t = (first + i) * h
        if len(knots) > 1:
            knot = _find_knot(i, knot, knots)
            f = (i - knots[knot]) / (knots[knot + 1] - knots[knot])
            _interpolate(knot, f, exact, step)
            _interpolate(knot, f, table, local)
        omega = local[OMEGA]

        ax, ay = 0.0, 0.0
        if forces.nonlinear:
            ax, ay = _accelerate(t, x, y, scale * px, scale * py, local[TURNING], h, polynomial)

        noise_x, noise_y, rough_x, rough_y = 0.0, 0.0, 0j, 0j
        if board.kind != SILENT:
            noise_x, noise_y, rough_x, rough_y = _disturbed(
                i, disturbance, state[OSCILLATOR_COS], state[OSCILLATOR_SIN]
            )

        on = False
        if loops.forced:
            while gap < len(off) and t >= off[gap, 1]:
                gap += 1
            on = not (gap < len(off) and t >= off[gap, 0])
            if board.kind == LOOPS_ON_BOARD:
                take_reading(
                    first + i,
                    x + noise_x,
                    y + noise_y,
                    h,
                    on,
                    kind,
                    gains,
                    settings,
                    state,
                    waiting,
                )

        fx, fy, hx, hy, main, quadrature, sampled = 0j, 0j, 0j, 0j, 0.0, 0.0, 0.0
        if on:
            # the loops look at the middle of the kick
            angle = omega * h
            # What of u' the momentum holds of a force that is sampled once a step: ωh·cot ωh, 1 for
            # short steps.
            sampled = angle / math.tan(angle)
            ux, uy = see_envelopes(x, y, scale * px, scale * py, gx, gy, angle, sampled, local)
            if board.kind == LOOPS_ON_BOARD:
                command = find_board_command(state)
            else:
                command = command_ideally(i, ux, uy, h, kind, gains, commanded, memory)
            main, quadrature = command.main, command.quadrature

            fx, fy = make_force(command, ux, uy, loops.parametric, kind, gains)
            hx, hy = reach_mode(
                fx,
                fy,
                command.turn,
                rough_x,
                rough_y,
                drive_matrix,
                parasitic,
                settings,
                state,
            )
            if kind == LOOP_SPRING:
                sx, sy = compute_spring_pull(x, y, omega, command)
                ax -= sx
                ay -= sy
            pull, push = hx.imag, hy.imag
            if board.kind == LOOPS_ON_BOARD:
                pull = round_to_step(pull, settings.drive_step, settings.drive_limit)
                push = round_to_step(push, settings.drive_step, settings.drive_limit)
                # The clipped sine's fundamental is what the envelope feels, and what is taken off
                # the momentum.
                hx *= find_passed_part(abs(hx), settings.drive_limit)
                hy *= find_passed_part(abs(hy), settings.drive_limit)
            ax -= 2 * omega * pull
            ay -= 2 * omega * push
        gx, gy = hx, hy

        # At t = 0 nothing was kicked yet: the kick there is half a one, and the momentum takes on
        # what a force that has always acted would hold in it.
        at_start = first + i == 0
        if at_start:
            px += sampled * gx.real / scale
            py += sampled * gy.real / scale
        kick = h / scale
        if i % substeps == 0:
            m = i // substeps
            mx, my = px, py
            if not at_start:
                mx, my = px + 0.5 * kick * ax, py + 0.5 * kick * ay
            held = (sampled * gx.real, sampled * gy.real)
            z[0, m], z[1, m] = x, y
            v[0, m], v[1, m] = _velocity(x, y, scale * mx, scale * my, held, local)
            drive[0, m], drive[1, m] = fx, fy
            command_rows[0, m], command_rows[1, m] = main, quadrature
        if at_start:
            kick *= 0.5
        px += kick * ax
        py += kick * ay
        if len(thermal) > 0:
            px += thermal[i, 0]
            py += thermal[i, 1]
        if on and len(rough) > 0:
            px += rough[i, 0]
            py += rough[i, 1]

        if board.kind != SILENT:
            # A recorded sample is the mean of its substeps.
            noise[0, i // substeps] += noise_x / substeps
            noise[1, i // substeps] += noise_y / substeps
            turn_oscillator(state)
        x, y, px, py = (
            P[0, 0] * x + P[0, 1] * y + P[0, 2] * px + P[0, 3] * py,
            P[1, 0] * x + P[1, 1] * y + P[1, 2] * px + P[1, 3] * py,
            P[2, 0] * x + P[2, 1] * y + P[2, 2] * px + P[2, 3] * py,
            P[3, 0] * x + P[3, 1] * y + P[3, 2] * px + P[3, 3] * py,
        )
    memory[X], memory[Y], memory[PX], memory[PY] = x, y, px, py
    memory[FORCE_X_COS], memory[FORCE_X_SIN] = gx.real, gx.imag
    memory[FORCE_Y_COS], memory[FORCE_Y_SIN] = gy.real, gy.imag


PARTS = (
    *(round_to_step, find_passed_part, turn_oscillator, find_stokes),
    *(take_commands, read, demodulate_window, follow_axis, regulate_on_board, take_reading),
    *(_disturbed, _find_knot, _interpolate, _velocity),
    *(regulate, command_ideally, find_board_command, see_envelopes),
    *(make_force, compute_spring_pull, reach_mode),
)
"""What `advance` calls whatever acceleration it is compiled with, callees first."""
WITH_ACCELERATION = (_acceleration, _accelerate, advance)
_CONTROL = (regulate, command_ideally, find_board_command, see_envelopes, make_force)
OPENED = frozenset(f.__name__ for f in (find_stokes, *_CONTROL, compute_spring_pull, reach_mode))
"""Written into the loop where they are called: as calls they would cost it a quarter."""


@functools.lru_cache(maxsize=16)
def compile_loop(extra: Acceleration | None) -> Callable[..., None]:
    """The loop over steps with an acceleration of the caller's inside.

    Parameters
    ----------
    extra
        (t, x, y, vx, vy) -> (ax, ay); None: there is none.

    Returns
    -------
    callable
        `advance`, compiled (and kept on disk where nothing of the caller's is inside), or plain
        Python where numba is not installed.

    Examples
    --------
    >>> from hrg_cli.physics.fast_loop import compile_loop
    >>> compile_loop(None) is compile_loop(None)
    True
    """
    try:
        from numba import njit
    except ImportError:
        bent = bound(_acceleration, _extra=extra or _no_extra)
        return bound(advance, _accelerate=bound(_accelerate, _acceleration=bent))
    inner = _no_extra if extra is None else extra
    compiled_extra = inner if hasattr(inner, "py_func") else njit(inner)
    if extra is None:
        kept = functools.partial(njit, cache=True)
        try:
            return _loop_of(kept, PARTS + WITH_ACCELERATION, _extra=compiled_extra)["advance"]
        except RuntimeError:  # no folder to cache in
            pass
    return _loop_of(njit, WITH_ACCELERATION, _extra=compiled_extra, **_parts())["advance"]


@functools.lru_cache(maxsize=1)
def _parts() -> dict[str, Any]:
    """The parts compiled once, whatever acceleration the loop is bound with."""
    from numba import njit

    try:
        return _loop_of(functools.partial(njit, cache=True), PARTS)
    except RuntimeError:  # no folder to cache in
        return _loop_of(njit, PARTS)


_loop_of = functools.partial(compile_all, opened=OPENED)
