"""A plant in its environment as functions of time: coefficients, exact propagators of the linear
motion, envelopes of a state.

State of the fast engine: displacement z and momentum p = z' − KΩJz, for which the Euler term is
gone (`fast_engine`).
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import HrgError
from .plant import Environment, Plant
from .resonator import IDENTITY, J, find_solvent

Array = np.ndarray
_CHORD_ERROR_1_S = 1e-9
_LONGEST_STRIDE = 1024


def _need_finite(rates: Array, time_s: Array, temperature_degc: Array) -> None:
    """HrgError: at some time damping, stiffness or rotation is no finite number, as where the
    stiffness is not positive."""
    wrong = np.flatnonzero(~np.isfinite(rates).all(axis=1))
    if len(wrong):
        raise HrgError(
            f"plant: at {time_s[wrong[0]]:.6g} s, {temperature_degc[wrong[0]]:.6g} °C, its damping,"
            " frequency or rotation is no finite number; correct the device, its change with"
            " temperature, or the environment"
        )


class Coefficients:
    """N, W, K, Ω and temperature of a plant in its environment, at any times; linear between the
    grid's rows."""

    def __init__(self, environment: Environment, plant: Plant) -> None:
        self._t = np.asarray(environment.time_s, float)
        k = len(self._t)
        self._n = np.broadcast_to(plant.damping, (k, 2, 2)).reshape(k, 4)
        self._w = np.broadcast_to(plant.stiffness, (k, 2, 2)).reshape(k, 4)
        self._k = np.broadcast_to(plant.scale_factor, (k,))
        self._rate = np.broadcast_to(environment.rate_rad_s, (k,))
        self._temperature = np.broadcast_to(environment.temperature_degc, (k,))
        # W has the unit of ω²; over 2ω it is a rate like N and KΩ, so one bound serves all.
        mean_omega = np.sqrt((self._w[:, 0] + self._w[:, 3]) / 2)
        rates = np.column_stack(
            [self._n, self._w / (2 * mean_omega[:, None]), self._k * self._rate]
        )
        _need_finite(rates, self._t, self._temperature)
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
        out = np.empty((len(t), 4))
        out[:] = values[0]
        for place in np.flatnonzero(np.any(values != values[0], axis=0)).tolist():
            out[:, place] = np.interp(t, self._t, values[:, place])
        return out.reshape(-1, 2, 2)

    def choose_knot_stride(self, h: float) -> int:
        """Steps between knots, so that the chord of the exponential errs by less than
        `_CHORD_ERROR_1_S` per second."""
        if not self.moving:
            return _LONGEST_STRIDE
        return int(
            np.clip(
                math.sqrt(8 * _CHORD_ERROR_1_S / h**3) / max(self._slope, 1e-300),
                1,
                _LONGEST_STRIDE,
            )
        )

    def list_knots(self, first: int, steps: int, h: float, stride: int) -> Array:
        """Step numbers at which exponentials are made: multiples of `stride` and both sides of each
        corner of the environment."""
        if not self.moving:
            return np.array([first])
        start, stop = first // stride, (first + steps) // stride + 1
        regular = np.arange(start, stop + 1) * stride
        inside = self._t[(self._t >= (regular[0] - 1) * h) & (self._t <= (regular[-1] + 1) * h)]
        # A propagator stands for the middle of its step, (k + ½)h: the knots beside a corner are
        # the steps whose middles lie on either side of it.
        corner = np.floor(inside / h - 0.5).astype(int)
        everything = np.unique(np.concatenate([regular, corner, corner + 1]))
        return everything[(everything >= regular[0]) & (everything <= regular[-1])]

    def compute_propagators(self, knots: Array, h: float, scale: float) -> tuple[Array, Array]:
        """exp(hA) (m, 4, 4) of the state (z, p/scale) at the middle of the step of each knot, and
        what the loop needs there (m, 14).

        That is ω, N, KΩ and, of p = Re[G q], (Im G)⁻¹ and Re G: the analytic signal q = z − j (Im
        G)⁻¹ (p − Re G z) as `compute_analytic` has it.
        """
        t = (knots + 0.5) * h
        N, W, k = self.damping(t), self.stiffness(t), self.turning(t)[:, None, None]
        A = np.empty((len(t), 4, 4))
        A[:, :2, :2] = k * J
        A[:, :2, 2:] = scale * IDENTITY
        # p = z' − kJz: J² = −I makes the centrifugal +k², and damping acts on z' = p + kJz.
        A[:, 2:, :2] = -(W + k**2 * IDENTITY + 2 * k * N @ J) / scale
        A[:, 2:, 2:] = -2 * N + k * J
        G = _momentum_matrix(self, t, scale)
        mean = np.sqrt((W[:, 0, 0] + W[:, 1, 1]) / 2)
        local = np.column_stack(
            [
                mean,
                N.reshape(-1, 4),
                k[:, 0, 0],
                np.linalg.inv(G.imag).reshape(-1, 4),
                G.real.reshape(-1, 4),
            ]
        )
        return _exponential(A * h), local


def compute_analytic(table: Coefficients, t: Array, z: Array, w: Array, omega_r: float) -> Array:
    """The analytic signal of a state, exact for the linear resonator.

    z = Re q, p = Re[(jω_r + L − kJ) q] with L the solvent (PHYSICS §5); solved for q.

    Parameters
    ----------
    table
        The plant in its environment.
    t
        Times [s], (n,).
    z, w
        Displacement and `v_over_omega`, (n, 2).
    omega_r
        ω_r [rad/s].

    Returns
    -------
    ndarray
        q = u e^{jω_r t}, (n, 2) complex.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.coefficients import Coefficients, compute_analytic, compute_state
    >>> from hrg_cli.physics.environment import hold_value, make_environment
    >>> from hrg_cli.physics.plant import ThermalCourses, make_linear_plant
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> world = make_environment(hold_value(20.0), hold_value(1.0), 0.0, 1.0, 0.001)
    >>> plant = make_linear_plant(Mechanics(100.0, 0.5), ThermalCourses(), world)
    >>> table = Coefficients(world, plant)
    >>> t, q = np.zeros(1), np.array([[1.0 + 0.5j, 0.2j]])
    >>> bool(np.allclose(compute_analytic(table, t, *compute_state(table, t, q, 628.0), 628.0), q))
    True
    """
    G = _momentum_matrix(table, t, omega_r)
    p = table.omega(t)[:, None] * w - np.einsum("nij,nj->ni", table.damping(t), z)
    imaginary = np.linalg.solve(G.imag, (p - np.einsum("nij,nj->ni", G.real, z))[..., None])[..., 0]
    return z - 1j * imaginary


def compute_state(table: Coefficients, t: Array, q: Array, omega_r: float) -> tuple[Array, Array]:
    """Displacement and `v_over_omega` of an analytic signal: the inverse of `compute_analytic`.

    Parameters
    ----------
    table
        The plant in its environment.
    t
        Times [s], (n,).
    q
        u e^{jω_r t}, (n, 2) complex.
    omega_r
        ω_r [rad/s].

    Returns
    -------
    tuple of ndarray
        z and w, (n, 2) each.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.coefficients import Coefficients, compute_state
    >>> from hrg_cli.physics.environment import hold_value, make_environment
    >>> from hrg_cli.physics.plant import ThermalCourses, make_linear_plant
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> world = make_environment(hold_value(20.0), hold_value(0.0), 0.0, 1.0, 0.001)
    >>> gyro = Mechanics(100.0, 0.0)
    >>> table = Coefficients(world, make_linear_plant(gyro, ThermalCourses(), world))
    >>> z, w = compute_state(table, np.zeros(1), np.array([[0j, 1j]]), gyro.omega_rad_s)
    >>> z.round(9).tolist(), w.round(9).tolist()
    ([[0.0, 0.0]], [[0.0, -1.0]])
    """
    p = np.einsum("nij,nj->ni", _momentum_matrix(table, t, omega_r), q).real
    return q.real, (p + np.einsum("nij,nj->ni", table.damping(t), q.real)) / table.omega(t)[:, None]


def compute_velocity(table: Coefficients, t: Array, z: Array, w: Array) -> Array:
    """ż in the instrument's axes: ωw − Nz + KΩJz.

    Parameters
    ----------
    table
        The plant in its environment.
    t
        Times [s], (n,).
    z, w
        Displacement and `v_over_omega`, (2, n).

    Returns
    -------
    ndarray
        (2, n), displacement unit/s.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.coefficients import Coefficients, compute_velocity
    >>> from hrg_cli.physics.environment import hold_value, make_environment
    >>> from hrg_cli.physics.plant import ThermalCourses, make_linear_plant
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> world = make_environment(hold_value(20.0), hold_value(1.0), 0.0, 1.0, 0.001)
    >>> gyro = Mechanics(100.0, 0.0, scale_factor=0.5)
    >>> table = Coefficients(world, make_linear_plant(gyro, ThermalCourses(), world))
    >>> z = np.array([[1.0], [0.0]])
    >>> compute_velocity(table, np.zeros(1), z, 0 * z).round(9).ravel().tolist()
    [0.0, -0.5]
    """
    turned = np.einsum("nij,jn->in", table.turning(t)[:, None, None] * J - table.damping(t), z)
    return np.asarray(table.omega(t) * w + turned)


def _momentum_matrix(table: Coefficients, t: Array, omega_r: float) -> Array:
    turning = table.turning(t)[:, None, None] * J
    return (
        1j * omega_r * IDENTITY
        + find_solvent(table.damping(t) - turning, table.stiffness(t), omega_r)
        - turning
    )


def _exponential(A: Array) -> Array:
    """exp(A) (m, n, n) by a Taylor series of order 14 after halving; exact to rounding. HrgError: A
    is not finite."""
    norm = float(np.abs(A).sum(-1).max())
    if not np.isfinite(norm):
        raise HrgError(
            "the resonator's equations of motion hold numbers that are not finite; look for a"
            " frequency, damping, split or rate out of all proportion"
        )
    # Below a norm of ½ the remainder of order 15, ½¹⁵/15!, is 2e-17.
    halvings = max(0, math.ceil(math.log2(norm / 0.5))) if norm > 0.5 else 0
    A = A / 2**halvings
    unit = np.eye(A.shape[-1])
    P = unit + A / 14
    for order in range(13, 0, -1):
        P = unit + A @ P / order
    for _ in range(halvings):
        P = P @ P
    return P
