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

import numpy as np

from . import fast_loop
from .coefficients import Coefficients, analytic, state_of, velocity
from .electronics import Electronics, board
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
    """Samples at n·step_s, n < count, in chunks of `CHUNK`; with `electronics` the loops act on
    what the board knows.

    start: envelopes (2,) at t = 0 against the mean frequency of `plant.mechanics`. start_angle_rad:
    electrical angle mθ near which the loops take the wave's at first; (mθ, φ) and (mθ + π, φ + π)
    are one wave, but a parasitic force is coherent with φ.
    """
    mechanics = plant.mechanics
    omega = mechanics.omega_rad_s
    nonlinear = bool(np.any(plant.polynomial)) or plant.extra is not None
    steps_a_period = (
        _STEPS_A_PERIOD_NONLINEAR if nonlinear else _STEPS_A_PERIOD if control.forced else 0.0
    )
    substeps = max(1, math.ceil(steps_a_period * mechanics.frequency_hz * step_s))
    h = step_s / substeps
    table = Coefficients(environment, plant)
    memory = np.zeros(12)
    z0, w0 = state_of(table, np.zeros(1), start[None], omega)
    n0 = table.damping(np.zeros(1))[0]
    memory[0:2] = z0[0]
    memory[2:4] = (table.omega(np.zeros(1))[0] * w0[0] - n0 @ z0[0]) / omega
    memory[6:8] = math.cos(start_angle_rad), math.sin(start_angle_rad)
    knot_stride = table.knot_stride(h)
    advance = fast_loop.compiled(plant.extra)
    gains = np.array(
        [
            control.main_amplitude,
            mechanics.damping_rate_1_s * control.main_amplitude,
            control.amplitude_gain_1_s,
            control.amplitude_integral_1_s2,
            control.quadrature_gain_1_s,
            control.quadrature_integral_1_s2,
            math.cos(control.main_phase_error_rad),
            math.sin(control.main_phase_error_rad),
            math.cos(control.quadrature_phase_error_rad),
            math.sin(control.quadrature_phase_error_rad),
        ]
    )
    drive_kind, loop_kind = (
        ("force", "parametric").index(control.drive),
        ("off", "finite", "spring").index(control.quadrature_loop),
    )
    kinds = np.array([int(control.forced), drive_kind, loop_kind])
    drive_matrix = np.asarray(control.drive_matrix, complex)
    parasitic = np.asarray(control.parasitic_force, complex)
    off = np.asarray(control.on_off, float).reshape(-1, 2)
    off = off[np.argsort(off[:, 0], kind="stable")] if len(off) else off
    polynomial = np.asarray(plant.polynomial, float)
    assert len(polynomial) == len(POLYNOMIAL)
    e_A = np.array([math.cos(start_angle_rad), math.sin(start_angle_rad)])
    source = NoiseSource(
        noise or Noise(),
        mechanics,
        h,
        substeps,
        count * substeps,
        random or np.random.default_rng(),
        electronics is not None,
    )
    desk = board(
        electronics,
        control,
        mechanics,
        h,
        float(np.angle(e_A @ start)),
        start_angle_rad,
        source.electronic,
    )

    def samples(first: int, n: int) -> tuple[Array, ...]:
        """Displacement, velocity, drive, command and read-out noise (2, n) of the next n
        samples."""
        knots = table.knots(first * substeps, n * substeps, h, knot_stride)
        propagators, local = table.propagators(knots, h, omega)
        rows = fast_loop.Rows(
            np.empty((2, n)),
            np.empty((2, n)),
            np.zeros((2, n), complex),
            np.zeros((2, n)),
            np.zeros((2, n)),
        )
        motion = fast_loop.Motion(
            first * substeps, n, substeps, h, omega, knots - first * substeps, propagators, local
        )
        forces = fast_loop.Forces(polynomial, nonlinear, *source.kicks(n * substeps))
        commanded = control.logged((first * substeps + np.arange(n * substeps)) * h)
        loops = fast_loop.Loops(kinds, gains, drive_matrix, parasitic, off, commanded)
        advance(
            memory,
            motion,
            forces,
            loops,
            desk,
            source.electronics(first * substeps, n * substeps),
            rows,
        )
        return rows.z, rows.v, rows.drive, rows.command, rows.noise

    # (samples done when the knock is felt, its state there), in time order
    knocks = sorted(
        ((math.floor(at / step_s) + 1, at, change) for at, change in plant.kicks if at >= 0),
        key=lambda knock: knock[1],
    )
    for first in range(0, count, CHUNK):
        n = min(CHUNK, count - first)
        parts, done = [], first
        while knocks and knocks[0][0] <= first + n:
            after, instant, change = knocks.pop(0)
            if after > done:
                parts.append(samples(done, after - done))
                done = after
            memory[:4] += _carried(table, instant, after * step_s, change, omega)
        if done < first + n:
            parts.append(samples(done, first + n - done))
        z, v, drive, command, noisy = (
            parts[0]
            if len(parts) == 1
            else (np.concatenate(rows, axis=1) for rows in zip(*parts, strict=True))
        )
        del parts
        t = np.arange(first, first + n) * step_s
        seen = noisy if source.readout else None
        samples_of = Samples(
            t,
            z,
            v,
            drive,
            table.temperature(t),
            table.rate(t),
            functools.partial(_velocity, table, t, z, v, omega),
            seen,
        )
        yield Block(samples_of, command, functools.partial(_envelopes, table, t, z, v, omega))


def _velocity(table: Coefficients, t: Array, z: Array, v: Array, omega: float) -> Array:
    """ż/ω (2, n) with the reference's ω."""
    return velocity(table, t, z, v) / omega


def _carried(table: Coefficients, start: float, stop: float, change: Array, scale: float) -> Array:
    """The state (z, p/scale) that a jump of the velocity leaves a part of a sample later (4,)."""
    part = stop - start
    propagator, _ = table.propagators(
        np.array([start / part]) if part > 0 else np.zeros(1), part, scale
    )
    return propagator[0] @ np.array([0.0, 0.0, change[0] / scale, change[1] / scale])


def _envelopes(table: Coefficients, t: Array, z: Array, v: Array, omega: float, at: Array) -> Array:
    return (
        analytic(table, t[at], z[:, at].T, v[:, at].T, omega)
        * np.exp(-1j * np.mod(omega * t[at], 2 * np.pi))[:, None]
    )
