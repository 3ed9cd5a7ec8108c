"""The fast engine: the second-order equations of motion, sample by sample, for any length in
constant memory.

With k = KΩ the momentum p = z' − kJz turns the equation of `plant.Plant` into one without the Euler
term (PHYSICS M14 is inside):
    z' = p + kJz,    p' = −(W + k² + 2kNJ) z + (−2N + kJ) p + acceleration
The linear part is stepped by its exact 4 × 4 exponential (coefficients at the middle of the step),
so frequency, splits, damping and rotation carry no splitting error at any sampling rate. Polynomial
terms, a further acceleration and the drive are kicks of p at the samples (half a kick, exact step,
half a kick): second order in (kick rate · step). Where the environment moves, exponentials are made
at knots and interpolated linearly in between, with an error below 1e-9 1/s. A knock at an instant
between two samples is a jump of p there, carried to the next sample by the exact exponential.

Numba compiles the loop where it is installed; without it the same function runs as plain Python.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from . import fast_loop
from .coefficients import Coefficients, compute_analytic, compute_state, compute_velocity
from .electronics import Electronics, start_board
from .loop_values import (
    AXIS_COS,
    AXIS_SIN,
    MEMORY,
    PX,
    PY,
    Forces,
    Gains,
    Loops,
    Motion,
    Rows,
    X,
    Y,
)
from .noise import Noise
from .noise_source import NoiseSource
from .plant import POLYNOMIAL, Block, Control, Environment, Plant, Samples

Array = np.ndarray

CHUNK = 65536
"""Samples made at a time, whatever the caller's block size: so the samples do not depend on it."""
_STEPS_A_PERIOD = 4.0
_STEPS_A_PERIOD_NONLINEAR = 12.0
"""Kicks are sampled forces: the harmonics of nonlinear ones must not fold onto the resonance."""


def run(
    environment: Environment,
    plant: Plant,
    control: Control,
    start: Array,
    step_s: float,
    count: int,
    start_angle_rad: float = 0.0,
    *,
    electronics: Electronics | None = None,
    noise: Noise | None = None,
    random: np.random.Generator | None = None,
) -> Iterator[Block]:
    """The samples of a run from the second-order motion, sample by sample.

    Parameters
    ----------
    environment
        The world on its grid.
    plant
        The resonator on that grid.
    control
        Drive and loops.
    start
        Envelopes (2,) at t = 0 against the mean frequency of `plant.mechanics`.
    step_s
        From one sample to the next.
    count
        Samples, at n·step_s, n < count.
    start_angle_rad
        Electrical angle mθ near which the loops take the wave's at first: (mθ, φ) and (mθ + π, φ +
        π) are one wave, but a parasitic force is coherent with φ.
    electronics
        With it the loops act on what the board knows, else on the true wave.
    noise
        Brownian force and electronic noise; by default none.
    random
        Their draws.

    Returns
    -------
    iterator of Block
        Chunks of at most `CHUNK` samples, in order.

    Examples
    --------
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
    engine = _Engine(
        environment, plant, control, start, step_s, count, start_angle_rad, electronics,
        noise or Noise(), random or np.random.default_rng(),
    )  # fmt: skip
    knocks = _knocks(plant, step_s)
    for first in range(0, count, CHUNK):
        yield engine.make_block(
            first, engine.make_samples(first, min(CHUNK, count - first), knocks)
        )


class _Knock(NamedTuple):
    """A jump of the velocity (2,) between two samples; `felt`: samples done when it is."""

    felt: int
    time_s: float
    change: Array


def _knocks(plant: Plant, step_s: float) -> list[_Knock]:
    """The plant's knocks in the order of time."""
    found = [
        _Knock(math.floor(at / step_s) + 1, at, change) for at, change in plant.kicks if at >= 0
    ]
    return sorted(found, key=lambda knock: knock.time_s)


class _Engine:
    """One run: its plant in its environment, its control, and what goes on from one block of
    samples to the next (state, board, noise)."""

    def __init__(
        self, environment: Environment, plant: Plant, control: Control, start: Array, step_s: float,
        count: int, start_angle_rad: float, electronics: Electronics | None, noise: Noise,
        random: np.random.Generator,
    ) -> None:  # fmt: skip
        mechanics = plant.mechanics
        self.omega, self.step_s = mechanics.omega_rad_s, step_s
        self.control, self.loops = control, _loops(control, mechanics.damping_rate_1_s)
        self.nonlinear = bool(np.any(plant.polynomial)) or plant.extra is not None
        self.polynomial = np.asarray(plant.polynomial, float)
        assert len(self.polynomial) == len(POLYNOMIAL)

        self.substeps = _substeps(self.nonlinear, control.forced, mechanics.frequency_hz * step_s)
        self.h = step_s / self.substeps
        self.table = Coefficients(environment, plant)
        self.stride = self.table.choose_knot_stride(self.h)
        self.advance = fast_loop.compile_loop(plant.extra)

        e_A = np.array([math.cos(start_angle_rad), math.sin(start_angle_rad)])
        self.memory = self._memory(start, e_A)
        self.source = NoiseSource(
            noise,
            mechanics,
            self.h,
            self.substeps,
            count * self.substeps,
            random,
            electronics is not None,
        )
        self.board = start_board(
            electronics, control, mechanics, self.h, float(np.angle(e_A @ start)), start_angle_rad,
            self.source.electronic,
        )  # fmt: skip

    def _memory(self, start: Array, e_A: Array) -> Array:
        """The loop's memory at t = 0, for envelopes (2,) and the side of e_A (2,)."""
        begin = np.zeros(1)
        z0, w0 = compute_state(self.table, begin, start[None], self.omega)
        N = self.table.damping(begin)[0]
        memory = np.zeros(MEMORY)
        memory[X : Y + 1] = z0[0]
        memory[PX : PY + 1] = (self.table.omega(begin)[0] * w0[0] - N @ z0[0]) / self.omega
        memory[AXIS_COS], memory[AXIS_SIN] = e_A
        return memory

    def make_samples(self, first: int, n: int, knocks: list[_Knock]) -> Rows:
        """The next n samples; the knocks felt among them are taken off the list."""
        parts, done = [], first
        while knocks and knocks[0].felt <= first + n:
            knock = knocks.pop(0)
            if knock.felt > done:
                parts.append(self._between_knocks(done, knock.felt - done))
                done = knock.felt
            # By the linear motion a jump is carried on its own and added, whatever else the wave
            # does.
            self.memory[X : PY + 1] += _carried(
                self.table, knock.time_s, knock.felt * self.step_s, knock.change, self.omega
            )
        if done < first + n:
            parts.append(self._between_knocks(done, first + n - done))
        if len(parts) == 1:
            return parts[0]
        return Rows(*(np.concatenate(rows, axis=1) for rows in zip(*parts, strict=True)))

    def _between_knocks(self, first: int, n: int) -> Rows:
        """The next n samples by the compiled loop."""
        step, steps = first * self.substeps, n * self.substeps
        knots = self.table.list_knots(step, steps, self.h, self.stride)
        propagators, local = self.table.compute_propagators(knots, self.h, self.omega)
        rows = Rows(
            z=np.empty((2, n)),
            v=np.empty((2, n)),
            drive=np.zeros((2, n), complex),
            command=np.zeros((2, n)),
            noise=np.zeros((2, n)),
        )
        commanded = self.control.interpolate_log((step + np.arange(steps)) * self.h)
        self.advance(
            self.memory,
            Motion(step, n, self.substeps, self.h, self.omega, knots - step, propagators, local),
            Forces(self.polynomial, self.nonlinear, *self.source.draw_kicks(steps)),
            self.loops._replace(commanded=commanded),
            self.board,
            self.source.draw_electronics(step, steps),
            rows,
        )
        return rows

    def make_block(self, first: int, rows: Rows) -> Block:
        """The rows with their times and environment; velocity and envelopes are made when asked
        for."""
        t = np.arange(first, first + rows.z.shape[1]) * self.step_s
        of_state = self.table, t, rows.z, rows.v, self.omega
        samples = Samples(
            t,
            rows.z,
            rows.v,
            rows.drive,
            self.table.temperature(t),
            self.table.rate(t),
            functools.partial(_velocity, *of_state),
            rows.noise if self.source.readout else None,
        )
        return Block(samples, rows.command, functools.partial(_envelopes, *of_state))


def _substeps(nonlinear: bool, forced: bool, periods_a_sample: float) -> int:
    """Steps a sample, so many that the kicks' harmonics stay apart."""
    a_period = _STEPS_A_PERIOD_NONLINEAR if nonlinear else _STEPS_A_PERIOD if forced else 0.0
    return max(1, math.ceil(a_period * periods_a_sample))


def _loops(control: Control, damping_rate_1_s: float) -> Loops:
    """The control as the loop takes it, without a log's rows."""
    off = np.asarray(control.on_off, float).reshape(-1, 2)
    gains = Gains(
        amplitude=float(control.main_amplitude),
        feed_forward=float(damping_rate_1_s * control.main_amplitude),
        amplitude_gain_1_s=float(control.amplitude_gain_1_s),
        amplitude_integral_1_s2=float(control.amplitude_integral_1_s2),
        quadrature_gain_1_s=float(control.quadrature_gain_1_s),
        quadrature_integral_1_s2=float(control.quadrature_integral_1_s2),
        main_cos=math.cos(control.main_phase_error_rad),
        main_sin=math.sin(control.main_phase_error_rad),
        quadrature_cos=math.cos(control.quadrature_phase_error_rad),
        quadrature_sin=math.sin(control.quadrature_phase_error_rad),
    )
    return Loops(
        forced=control.forced,
        parametric=control.drive == "parametric",
        quadrature_loop=("off", "finite", "spring").index(control.quadrature_loop),
        gains=gains,
        drive_matrix=np.asarray(control.drive_matrix, complex),
        parasitic=np.asarray(control.parasitic_force, complex),
        off=off[np.argsort(off[:, 0], kind="stable")],
        commanded=np.zeros((0, 2)),
    )


def _velocity(table: Coefficients, t: Array, z: Array, v: Array, omega: float) -> Array:
    """ż/ω (2, n) with the reference's ω."""
    return compute_velocity(table, t, z, v) / omega


def _carried(table: Coefficients, start: float, stop: float, change: Array, scale: float) -> Array:
    """The state (z, p/scale) that a jump of the velocity leaves a part of a sample later (4,)."""
    part = stop - start
    propagator, _ = table.compute_propagators(
        np.array([start / part]) if part > 0 else np.zeros(1), part, scale
    )
    return propagator[0] @ np.array([0.0, 0.0, change[0] / scale, change[1] / scale])


def _envelopes(table: Coefficients, t: Array, z: Array, v: Array, omega: float, at: Array) -> Array:
    return (
        compute_analytic(table, t[at], z[:, at].T, v[:, at].T, omega)
        * np.exp(-1j * np.mod(omega * t[at], 2 * np.pi))[:, None]
    )
