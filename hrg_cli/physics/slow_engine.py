"""The slow engine: the envelopes' equation of `slow_motion`, turned into samples.

Both engines follow the same physics to second order in the small rates over ω. Samples between the
steps come from the cubic through values and derivatives.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .coefficients import Coefficients
from .fast_engine import CHUNK
from .plant import Block, Control, Environment, Plant, Samples
from .resonator import J, exponentiate, find_solvent
from .slow_motion import EnvelopeMotion, Memory, PlantAt, SlowTerms, take_row

Array = np.ndarray
_STEP_ANGLE = 0.05
"""|largest rate| × step."""
_LONGEST_STEP_S = 0.02
_LONGEST_STEP_PERIODS = 10.0
_SWITCHED_STEP_S = 0.001
_CORNER_ERROR = 1e-6
"""Angle by which a step may miss a corner of the environment."""


def run(
    environment: Environment,
    plant_at: PlantAt,
    control: Control,
    terms: SlowTerms,
    start: Array,
    step_s: float,
    count: int,
    start_angle_rad: float = 0.0,
    averaged: bool = False,
    followed: list[EnvelopePath] | None = None,
) -> Iterator[Block]:
    """The samples of a run from the envelopes' equation, as `fast_engine.run` makes them sample by
    sample.

    Parameters
    ----------
    environment
        The world on its grid.
    plant_at
        The linear plant in any environment, as the effects may change it.
    control
        Drive and loops.
    terms
        The effects' slow terms.
    start
        Envelopes u(0), (2,) complex.
    step_s
        From one sample to the next.
    count
        Samples.
    start_angle_rad
        mθ at the start, which tells the sign of e_A.
    averaged
        The equation averaged over a period, without what is of second order in the slow rates over
        ω.
    followed
        Paths of the same motion, which then is not followed again; an empty list is filled with
        them.

    Returns
    -------
    iterator of Block
        Blocks of at most `CHUNK` samples, in order.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import hold_value, make_environment
    >>> from hrg_cli.physics.plant import Control, ThermalCourses, make_linear_plant
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.physics.slow_engine import run
    >>> from hrg_cli.physics.slow_motion import SlowTerms
    >>> world = make_environment(hold_value(20.0), hold_value(0.0), 0.0, 1.0, 0.001)
    >>> def plant_at(there):
    ...     return make_linear_plant(Mechanics(100.0, 0.5), ThermalCourses(), there)
    >>> start = np.array([1.0, 0j])
    >>> block = next(run(world, plant_at, Control(), SlowTerms(), start, 0.001, 1000))
    >>> bool(abs(block.envelopes(np.array([999]))[0, 0] - np.exp(-0.5 * 0.999)) < 1e-3)
    True
    """
    motion = EnvelopeMotion(environment, plant_at, control, terms, averaged)
    stride = count_step_samples(environment, motion.plant, control, step_s)
    chunks = [(first, min(CHUNK, count - first)) for first in range(0, count, CHUNK)]

    def follow_all() -> Iterator[EnvelopePath]:
        memory = Memory(np.zeros(2), np.array([np.cos(start_angle_rad), np.sin(start_angle_rad)]))
        u = np.asarray(start, complex)
        for first, n in chunks:
            t = (first + np.arange(-(-n // stride) + 1) * stride) * step_s
            path, u = follow(motion, t, stride * step_s, u, memory)
            yield path

    if followed is not None and not followed:
        followed.extend(follow_all())
    for (first, n), path in zip(chunks, followed or follow_all(), strict=True):
        yield sample(path, motion, terms, (first + np.arange(n)) * step_s, stride)


@dataclass
class EnvelopePath:
    """The envelopes at the nodes of one chunk, one step of h seconds apart."""

    time_s: Array
    """(m,)"""
    h: float
    generators: Array
    """(m, 2, 2) L"""
    envelopes: Array
    """(m, 2)"""
    slope: Array
    """(m, 2) du/dt"""
    force: Array
    """(m, 2) on the envelopes, before `drive_matrix`."""
    command: Array
    """(m, 2) a_ΦA and a_ΦB."""
    phase_rad: Array
    """(m,)"""
    jumps: list[tuple[int, float, Array]]
    """(cell, instant, change (2,))"""


def follow(
    motion: EnvelopeMotion, t: Array, h: float, u: Array, memory: Memory
) -> tuple[EnvelopePath, Array]:
    """The path of one chunk from node to node.

    Parameters
    ----------
    motion
        The envelopes' equation.
    t
        Nodes [s], (m,), evenly apart.
    h
        Their distance.
    u
        Envelopes at the first, (2,).
    memory
        What the loops remember; it goes on.

    Returns
    -------
    tuple
        The path, and u at the last node (2,).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import hold_value, make_environment
    >>> from hrg_cli.physics.plant import Control, ThermalCourses, make_linear_plant
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.physics.slow_engine import follow
    >>> from hrg_cli.physics.slow_motion import EnvelopeMotion, Memory, SlowTerms
    >>> world = make_environment(hold_value(20.0), hold_value(0.0), 0.0, 1.0, 0.001)
    >>> def plant_at(there):
    ...     return make_linear_plant(Mechanics(100.0, 0.5), ThermalCourses(), there)
    >>> motion = EnvelopeMotion(world, plant_at, Control(), SlowTerms())
    >>> memory = Memory(np.zeros(2), np.array([1.0, 0.0]))
    >>> path, last = follow(motion, np.array([0.0, 0.5, 1.0]), 0.5, np.array([1.0, 0j]), memory)
    >>> bool(abs(abs(last[0]) - np.exp(-0.5)) < 1e-6)
    True
    """
    count, steps = len(t), len(t) - 1
    L, corrections = motion.build_generators(t)
    halves = (
        motion.compute_propagator(t[:-1], h / 2),
        motion.compute_propagator(t[:-1] + h / 2, h / 2),
    )
    middle = motion.build_generators(t[:-1] + h / 2)[1]
    at_nodes, at_middles = motion.find_state(t), motion.find_state(t[:-1] + h / 2)
    path = EnvelopePath(
        t,
        h,
        L,
        envelopes=np.empty((count, 2), complex),
        slope=np.empty((count, 2), complex),
        force=np.zeros((count, 2), complex),
        command=np.zeros((count, 2)),
        phase_rad=np.zeros(count),
        jumps=[],
    )
    for k in range(count):
        now = take_row(at_nodes, k)
        du, action, path.phase_rad[k] = motion.look(now, u, memory, corrections[k])
        path.envelopes[k], path.slope[k] = u, L[k] @ u + du
        if action is not None:
            path.force[k], path.command[k] = action.force, action.command
        if k == steps:
            break

        switched = motion.switches[(motion.switches > t[k]) & (motion.switches < t[k + 1])]
        if len(switched):
            u = motion.step_across(t[k], t[k + 1], switched, u, memory)
        elif motion.lively:
            moments = now, take_row(at_middles, k), take_row(at_nodes, k + 1)
            beside = corrections[k], middle[k], corrections[k + 1]
            u = motion.step(h, moments, (halves[0][k], halves[1][k]), beside, u, memory)
        else:
            u = halves[1][k] @ (halves[0][k] @ u)

        for instant, jump in motion.jumps:
            if t[k] < instant <= t[k + 1]:
                path.jumps.append((k, instant, jump))
                # The step went through as if nothing had been felt; the jump follows by the linear
                # motion, whose error is the step's own.
                u = u + exponentiate(L[k], t[k + 1] - instant) @ jump
    return path, u


def sample(
    path: EnvelopePath, motion: EnvelopeMotion, terms: SlowTerms, times: Array, stride: int
) -> Block:
    """The samples along a path, as the read-out sees them.

    Parameters
    ----------
    path
        One chunk's nodes.
    motion
        The envelopes' equation.
    terms
        The effects' slow terms, of which those of the read-out act here.
    times
        Times of the samples [s], (n,), the first at the path's first node.
    stride
        Samples from node to node.

    Returns
    -------
    Block
        Samples, commands (2, n) and the true envelopes.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.environment import hold_value, make_environment
    >>> from hrg_cli.physics.plant import Control, ThermalCourses, make_linear_plant
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.physics.slow_engine import follow, sample
    >>> from hrg_cli.physics.slow_motion import EnvelopeMotion, Memory, SlowTerms
    >>> world = make_environment(hold_value(20.0), hold_value(0.0), 0.0, 1.0, 0.001)
    >>> def plant_at(there):
    ...     return make_linear_plant(Mechanics(100.0, 0.0), ThermalCourses(), there)
    >>> motion = EnvelopeMotion(world, plant_at, Control(), SlowTerms())
    >>> memory = Memory(np.zeros(2), np.array([1.0, 0.0]))
    >>> path, _ = follow(motion, np.array([0.0, 0.01]), 0.01, np.array([1.0, 0j]), memory)
    >>> seen = sample(path, motion, SlowTerms(), np.array([0.0, 0.005]), 2)
    >>> seen.samples.z[0].round(6).tolist()
    [1.0, -1.0]
    """
    # Samples count from the chunk's first node, `stride` of them to a step.
    cell, part = np.divmod(np.arange(len(times)), stride)
    x = (part / stride)[:, None]

    def between(values: Array) -> Array:
        return np.asarray(values[cell] * (1 - x) + values[cell + 1] * x)

    envelopes = _interpolate(path, times, cell, x)
    drives, commands = between(path.force), between(path.command)
    state = replace(
        motion.find_state(times),
        drive=drives,
        forced=np.any(commands != 0, axis=1).astype(float),
        phase_rad=path.phase_rad[cell],
    )
    seen = envelopes
    for term in terms.readout:
        seen = term(seen, state)
    omega_r = motion.plant.mechanics.omega_rad_s
    turn = np.exp(1j * np.mod(omega_r * times, 2 * np.pi))[:, None]
    q = (seen * turn).T
    samples = Samples(
        times,
        q.real,
        -q.imag,
        (drives * turn).T,
        state.temperature_degc,
        state.rate_rad_s,
        functools.partial(_velocity, envelopes, between(path.slope), turn, omega_r),
    )
    return Block(samples, commands.T, envelopes.__getitem__)


def _velocity(u: Array, slope: Array, turn: Array, omega: float) -> Array:
    """ż/ω (2, n) of z = Re[u e^{jωt}]: Re[(ju + u̇/ω) e^{jωt}]."""
    return np.asarray(((1j * u + slope / omega) * turn).real.T)


def _interpolate(path: EnvelopePath, times: Array, cell: Array, x: Array) -> Array:
    """The envelopes (n, 2) at times: cubics, broken at the jumps; cell (n,) and part of it (n, 1)
    of each time."""
    u, L, h = path.envelopes, path.generators, path.h
    values = _hermite(u, path.slope * h, cell, x)
    for k, instant, jump in path.jumps:
        end, bent = _undo_jump(path, k, exponentiate(L[k], path.time_s[k + 1] - instant) @ jump)
        own = cell == k
        values[own] = _hermite(end, bent * h, cell[own], x[own])
        late = own & (times >= instant)
        values[late] += np.einsum("nij,j->ni", exponentiate(L[k], times[late] - instant), jump)
    return values


def _undo_jump(path: EnvelopePath, k: int, gained: Array) -> tuple[Array, Array]:
    """Envelopes and slope (m, 2) to where cell k would have ended without its jump, which `gained`
    (2,) by then: the cubic is drawn to there, and what jumps goes on from it."""
    u, slope, L = path.envelopes, path.slope, path.generators
    end, bent = u.copy(), slope.copy()
    end[k + 1] -= gained
    bent[k + 1] = L[k + 1] @ end[k + 1] + slope[k + 1] - L[k + 1] @ u[k + 1]
    return end, bent


def _hermite(path: Array, step: Array, cell: Array, x: Array) -> Array:
    """The cubic through the values and the derivatives (times the step) at both ends of each cell,
    at 0 ≤ x < 1."""
    a, b, da, db = path[cell], path[cell + 1], step[cell], step[cell + 1]
    return a + x * (da + x * (3 * (b - a) - 2 * da - db + x * (2 * (a - b) + da + db)))


def count_step_samples(
    environment: Environment, plant: Plant, control: Control, step_s: float
) -> int:
    """Samples a slow step: a power of two, so that a chunk holds whole steps.

    As many as the fastest rate, the environment's corners and the drive's log allow.

    Parameters
    ----------
    environment
        The world on its grid.
    plant
        The resonator on that grid.
    control
        Drive and loops.
    step_s
        From one sample to the next.

    Returns
    -------
    int
        1, 2, 4 … up to `CHUNK`.

    Examples
    --------
    >>> from hrg_cli.physics.environment import hold_value, make_environment
    >>> from hrg_cli.physics.plant import Control, ThermalCourses, make_linear_plant
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.physics.slow_engine import count_step_samples
    >>> world = make_environment(hold_value(20.0), hold_value(0.0), 0.0, 1.0, 0.001)
    >>> plant = make_linear_plant(Mechanics(1000.0, 0.5), ThermalCourses(), world)
    >>> count_step_samples(world, plant, Control(), 1e-4)
    128
    """
    table = Coefficients(environment, plant)
    t = np.asarray(environment.time_s, float)
    L = find_solvent(
        table.damping(t) - table.turning(t)[:, None, None] * J,
        table.stiffness(t),
        plant.mechanics.omega_rad_s,
    )
    fastest = float(np.abs(L).sum(-1).max())
    if control.forced:
        fastest = max(fastest, control.amplitude_gain_1_s, control.quadrature_gain_1_s)
    longest = max(_LONGEST_STEP_S, _LONGEST_STEP_PERIODS / plant.mechanics.frequency_hz)
    longest = min(
        longest,
        _STEP_ANGLE / max(fastest, 1e-9),
        np.sqrt(8 * _CORNER_ERROR / max(table.corner, 1e-9)),
    )
    if len(control.on_off):
        longest = min(longest, _SWITCHED_STEP_S)
    if len(control.log) > 2:
        slopes = np.diff(control.log[:, 1:], axis=0) / np.diff(control.log[:, :1], axis=0)
        bend = float(np.abs(np.diff(slopes, axis=0)).max()) / control.main_amplitude
        longest = min(longest, np.sqrt(8 * _CORNER_ERROR / max(bend, 1e-9)))
    return int(2 ** np.clip(np.floor(np.log2(max(longest / step_s, 1.0))), 0, np.log2(CHUNK)))
