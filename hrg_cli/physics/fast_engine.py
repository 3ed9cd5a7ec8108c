"""The fast engine: the second-order equations of motion, sample by sample, for any length in constant memory.

With k = KΩ the momentum p = z' − kJz turns the equation of `plant.Plant` into one without the Euler term (PHYSICS M14 is inside):
    z' = p + kJz,    p' = −(W + k² + 2kNJ) z + (−2N + kJ) p + acceleration
The linear part is stepped by its exact 4 × 4 exponential (coefficients at the middle of the step), so frequency, splits,
damping and rotation carry no splitting error at any sampling rate. Polynomial terms, a further acceleration and the drive are
kicks of p at the samples (half a kick, exact step, half a kick): second order in (kick rate · step). Where the environment
moves, exponentials are made at knots and interpolated linearly in between, with an error below 1e-9 1/s.

Numba compiles the loop where it is installed; without it the same function runs as plain Python.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from types import FunctionType
from typing import Any

import numpy as np

from .plant import POLYNOMIAL, Acceleration, Block, Control, Environment, Plant, Samples
from .resonator import IDENTITY, J, solvent

Array = np.ndarray

CHUNK = 65536
"""Samples made at a time, whatever the caller's block size: so the samples do not depend on it."""
_CHORD_ERROR_1_S = 1e-9
_STEPS_A_PERIOD = 4.0
_STEPS_A_PERIOD_NONLINEAR = 12.0
"""Kicks are sampled forces: the harmonics of nonlinear ones must not fold onto the resonance."""


def run(environment: Environment, plant: Plant, control: Control, start: Array, step_s: float, count: int) -> Iterator[Block]:
    """Samples at n·step_s, n < count, in chunks of `CHUNK`.

    start: envelopes (2,) at t = 0 against the mean frequency of `plant.mechanics`.
    """
    mechanics = plant.mechanics
    omega = mechanics.omega_rad_s
    nonlinear = bool(np.any(plant.polynomial)) or plant.extra is not None
    steps_a_period = _STEPS_A_PERIOD_NONLINEAR if nonlinear else _STEPS_A_PERIOD if control.forced else 0.0
    substeps = max(1, math.ceil(steps_a_period * mechanics.frequency_hz * step_s))
    h = step_s / substeps
    table = Coefficients(environment, plant)
    memory = np.zeros(12)
    z0, w0 = state_of(table, np.zeros(1), start[None], omega)
    n0 = table.damping(np.zeros(1))[0]
    memory[0:2] = z0[0]
    memory[2:4] = (table.omega(np.zeros(1))[0] * w0[0] - n0 @ z0[0]) / omega
    memory[6] = 1.0
    knot_stride = table.knot_stride(h)
    advance = _compiled(plant.extra)
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
    drive_kind, loop_kind = ("force", "parametric").index(control.drive), ("off", "finite", "spring").index(control.quadrature_loop)
    kinds = np.array([int(control.forced), drive_kind, loop_kind])
    drive_matrix = np.asarray(control.drive_matrix, complex)
    parasitic = np.asarray(control.parasitic_force, complex)
    off = np.asarray(control.on_off, float).reshape(-1, 2)
    off = off[np.argsort(off[:, 0], kind="stable")] if len(off) else off
    polynomial = np.asarray(plant.polynomial, float)
    assert len(polynomial) == len(POLYNOMIAL)
    for first in range(0, count, CHUNK):
        n = min(CHUNK, count - first)
        knots = table.knots(first * substeps, n * substeps, h, knot_stride)
        propagators, local = table.propagators(knots, h, omega)
        z, v, drive, command = np.empty((2, n)), np.empty((2, n)), np.zeros((2, n), complex), np.zeros((2, n))
        advance(
            memory, knots - first * substeps, propagators, local, n, substeps, h, first * substeps, omega, polynomial, nonlinear,
            kinds, gains, drive_matrix, parasitic, off, z, v, drive, command,
        )  # fmt: skip
        t = np.arange(first, first + n) * step_s
        samples = Samples(t, z, v, drive, table.temperature(t), table.rate(t))
        yield Block(samples, command, functools.partial(_envelopes, table, t, z, v, omega))


def _envelopes(table: Coefficients, t: Array, z: Array, v: Array, omega: float, at: Array) -> Array:
    return analytic(table, t[at], z[:, at].T, v[:, at].T, omega) * np.exp(-1j * np.mod(omega * t[at], 2 * np.pi))[:, None]


class Coefficients:
    """N, W, K, Ω and temperature of a plant in its environment, at any times; linear between the grid's rows."""

    def __init__(self, environment: Environment, plant: Plant) -> None:
        self._t = np.asarray(environment.time_s, float)
        k = len(self._t)
        self._n = np.broadcast_to(plant.damping, (k, 2, 2)).reshape(k, 4)
        self._w = np.broadcast_to(plant.stiffness, (k, 2, 2)).reshape(k, 4)
        self._k = np.broadcast_to(plant.scale_factor, (k,))
        self._rate = np.broadcast_to(environment.rate_rad_s, (k,))
        self._temperature = np.broadcast_to(environment.temperature_degc, (k,))
        mean_omega = np.sqrt((self._w[:, 0] + self._w[:, 3]) / 2)
        rates = np.column_stack([self._n, self._w / (2 * mean_omega[:, None]), self._k * self._rate])
        steps = np.diff(self._t)
        slopes = np.diff(rates, axis=0) / np.where(steps > 0, steps, np.inf)[:, None]
        self._slope = float(np.abs(slopes).max()) if slopes.size else 0.0
        self.corner = float(np.abs(np.diff(slopes, axis=0)).max()) if len(slopes) > 1 else 0.0
        """Largest bend of any coefficient between two rows of the grid, 1/s²."""
        self.moving = bool(np.ptp(rates, axis=0).any()) if k else False

    def damping(self, t: Array) -> Array:
        """N (n, 2, 2)."""
        return self._matrix(t, self._n)

    def stiffness(self, t: Array) -> Array:
        """W (n, 2, 2)."""
        return self._matrix(t, self._w)

    def turning(self, t: Array) -> Array:
        """KΩ (n,)."""
        return self._row(t, self._k) * self.rate(t)

    def rate(self, t: Array) -> Array:
        """Ω (n,)."""
        return self._row(t, self._rate)

    def temperature(self, t: Array) -> Array:
        """True temperature (n,)."""
        return self._row(t, self._temperature)

    def omega(self, t: Array) -> Array:
        """Mean frequency √(tr W/2) (n,)."""
        w = self.stiffness(t)
        return np.sqrt((w[:, 0, 0] + w[:, 1, 1]) / 2)

    def _row(self, t: Array, values: Array) -> Array:
        if len(values) == 0 or not np.any(values != values[0]):
            return np.full(len(t), values[0])
        return np.interp(t, self._t, values)

    def _matrix(self, t: Array, values: Array) -> Array:
        return np.stack([self._row(t, values[:, i]) for i in range(4)], -1).reshape(-1, 2, 2)

    def knot_stride(self, h: float) -> int:
        """Steps between knots, so that the chord of the exponential errs by less than `_CHORD_ERROR_1_S` a second."""
        if not self.moving:
            return CHUNK
        return int(min(1024, max(1, math.sqrt(8 * _CHORD_ERROR_1_S / h) / (self._slope * math.sqrt(h)) / math.sqrt(h))))

    def knots(self, first: int, steps: int, h: float, stride: int) -> Array:
        """Step numbers at which exponentials are made: multiples of `stride` and both sides of each corner of the environment."""
        if not self.moving:
            return np.array([first])
        start, stop = first // stride, (first + steps) // stride + 1
        regular = np.arange(start, stop + 1) * stride
        inside = self._t[(self._t >= (regular[0] - 1) * h) & (self._t <= (regular[-1] + 1) * h)]
        corner = np.floor(inside / h - 0.5).astype(int)
        everything = np.unique(np.concatenate([regular, corner, corner + 1]))
        return everything[(everything >= regular[0]) & (everything <= regular[-1])]

    def propagators(self, knots: Array, h: float, scale: float) -> tuple[Array, Array]:
        """exp(hA) (m, 4, 4) of the state (z, p/scale) at the middle of the step of each knot; ω, N and KΩ there (m, 6)."""
        t = (knots + 0.5) * h
        N, W, k = self.damping(t), self.stiffness(t), self.turning(t)[:, None, None]
        A = np.empty((len(t), 4, 4))
        A[:, :2, :2] = k * J
        A[:, :2, 2:] = scale * IDENTITY
        A[:, 2:, :2] = -(W + k**2 * IDENTITY + 2 * k * N @ J) / scale
        A[:, 2:, 2:] = -2 * N + k * J
        local = np.column_stack([np.sqrt((W[:, 0, 0] + W[:, 1, 1]) / 2), N.reshape(-1, 4), k[:, 0, 0]])
        return _exponential(A * h), local


def analytic(table: Coefficients, t: Array, z: Array, w: Array, omega_r: float) -> Array:
    """u e^{jω_r t} (n, 2) of displacement z (n, 2) and `v_over_omega` w (n, 2): exact for the linear resonator.

    z = Re q, p = Re[(jω_r + L − kJ) q] with L the solvent; solved for q.
    """
    G = _momentum_matrix(table, t, omega_r)
    p = table.omega(t)[:, None] * w - np.einsum("nij,nj->ni", table.damping(t), z)
    imaginary = np.linalg.solve(G.imag, (p - np.einsum("nij,nj->ni", G.real, z))[..., None])[..., 0]
    return z - 1j * imaginary


def state_of(table: Coefficients, t: Array, q: Array, omega_r: float) -> tuple[Array, Array]:
    """Displacement and `v_over_omega` (n, 2) of the analytic signal q = u e^{jω_r t} (n, 2): the inverse of `analytic`."""
    p = np.einsum("nij,nj->ni", _momentum_matrix(table, t, omega_r), q).real
    return q.real, (p + np.einsum("nij,nj->ni", table.damping(t), q.real)) / table.omega(t)[:, None]


def _momentum_matrix(table: Coefficients, t: Array, omega_r: float) -> Array:
    turning = table.turning(t)[:, None, None] * J
    return 1j * omega_r * IDENTITY + solvent(table.damping(t) - turning, table.stiffness(t), omega_r) - turning


def _exponential(A: Array) -> Array:
    """exp(A) (m, n, n) by a Taylor series of order 14 after halving; exact to rounding."""
    norm = float(np.abs(A).sum(-1).max())
    halvings = max(0, math.ceil(math.log2(norm / 0.5))) if norm > 0.5 else 0
    A = A / 2**halvings
    unit = np.eye(A.shape[-1])
    P = unit + A / 14
    for order in range(13, 0, -1):
        P = unit + A @ P / order
    for _ in range(halvings):
        P = P @ P
    return P


def _no_extra(t: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
    return 0.0, 0.0


_extra: Any = _no_extra


def _acceleration(t: float, x: float, y: float, vx: float, vy: float, c: Array) -> tuple[float, float]:
    """The terms of `plant.POLYNOMIAL` with coefficients c, plus the further acceleration."""
    r2, v2, zv = x * x + y * y, vx * vx + vy * vy, x * vx + y * vy
    along_z = c[0] * r2 + c[1] * r2 * r2 + c[2] * v2 + c[4] * zv
    along_v = c[3] * zv + c[5] * r2 + c[6] * v2
    qa, qb = x * x * x - 3 * x * y * y, 3 * x * x * y - y * y * y
    ax, ay = _extra(t, x, y, vx, vy)
    return ax + along_z * x + along_v * vx + c[7] * qa + c[8] * qb, ay + along_z * y + along_v * vy - c[7] * qb + c[8] * qa


def _advance(  # type: ignore[no-untyped-def]
    memory, knots, propagators, local, n, substeps, h, first, scale, polynomial, nonlinear,
    kinds, gains, drive_matrix, parasitic, off, z, v, drive, command,
):  # fmt: skip
    """n samples of `substeps` steps; `memory`: x, y, p_x, p_y (over scale), two loop integrals, the last e_A and force."""
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
                    P[a, b] = propagators[at, a, b] + f * (propagators[at + 1, a, b] - propagators[at, a, b])
            for a in range(6):
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
        if forced:
            while gap < len(off) and t >= off[gap, 1]:
                gap += 1
            if not (gap < len(off) and t >= off[gap, 0]):
                # The loops look at the middle of the kick, as expected from the last one. There the momentum holds the force's
                # part of u' too, by a factor that sampling makes ωh·cot ωh; left inside, it would ripple at 2ω through the gains.
                angle = omega * h
                sampled = angle / math.tan(angle)
                step = math.cos(angle) + 1j * math.sin(angle)
                gx, gy = gx * step, gy * step
                wx = (scale * px - angle * gx.imag - sampled * gx.real + q[1] * x + q[2] * y) / omega
                wy = (scale * py - angle * gy.imag - sampled * gy.real + q[3] * x + q[4] * y) / omega
                ux, uy = x - 1j * wx, y - 1j * wy
                s0, s1 = x * x + wx * wx + y * y + wy * wy, x * x + wx * wx - y * y - wy * wy
                s2, s3 = 2 * (x * y + wx * wy), 2 * (x * wy - wx * y)
                s12 = math.sqrt(s1 * s1 + s2 * s2)
                a_A = math.sqrt((s0 + s12) / 2)
                if a_A > 0.0 and s12 > 0.0:
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
                    error = gains[0] - a_A
                    main = gains[1] + gains[2] * error + memory[4]
                    memory[4] += gains[3] * error * h
                    if kinds[2] == 1:
                        quadrature = -gains[4] * a_B - memory[5]
                        memory[5] += gains[5] * a_B * h
                    elif kinds[2] == 2:
                        spring = gains[4] * a_B / a_A + memory[5]
                        memory[5] += gains[5] * a_B / a_A * h
                        quadrature = -spring * a_A
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
                    hx = drive_matrix[0, 0] * fx + drive_matrix[0, 1] * fy + parasitic[0] * turn
                    hy = drive_matrix[1, 0] * fx + drive_matrix[1, 1] * fy + parasitic[1] * turn
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
        x, y, px, py = (
            P[0, 0] * x + P[0, 1] * y + P[0, 2] * px + P[0, 3] * py,
            P[1, 0] * x + P[1, 1] * y + P[1, 2] * px + P[1, 3] * py,
            P[2, 0] * x + P[2, 1] * y + P[2, 2] * px + P[2, 3] * py,
            P[3, 0] * x + P[3, 1] * y + P[3, 2] * px + P[3, 3] * py,
        )
    memory[0], memory[1], memory[2], memory[3] = x, y, px, py
    memory[8], memory[9], memory[10], memory[11] = gx.real, gx.imag, gy.real, gy.imag


@functools.lru_cache(maxsize=16)
def _compiled(extra: Acceleration | None) -> Callable[..., None]:
    """The loop with `extra` inside: compiled (and kept on disk where nothing of the caller's is inside), or plain Python."""
    try:
        from numba import njit
    except ImportError:
        return _bound(_advance, _acceleration=_bound(_acceleration, _extra=extra or _no_extra))
    inner = _no_extra if extra is None else extra
    compiled_extra = inner if hasattr(inner, "py_func") else njit(inner)
    if extra is None:
        try:
            return _bind_and_compile(njit(cache=True), compiled_extra)
        except RuntimeError:  # no folder to cache in
            pass
    return _bind_and_compile(njit, compiled_extra)


def _bind_and_compile(jit: Any, extra: Any) -> Callable[..., None]:
    return jit(_bound(_advance, _acceleration=jit(_bound(_acceleration, _extra=extra))))


def _bound(function: Any, **names: Any) -> Any:
    """A copy of the function in whose globals some names stand for others."""
    copy = FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__)
    copy.__qualname__, copy.__module__ = function.__qualname__, function.__module__
    return copy
