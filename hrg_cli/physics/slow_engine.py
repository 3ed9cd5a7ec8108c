"""The slow engine: the envelopes' equation u' = L(t) u + control + slow terms of the effects, turned into samples.

L is the solvent of the second-order equation (`resonator.solvent`), so both engines follow the same physics to second order in
the small rates over ω. The linear part is stepped by its exact exponential, the rest by the Runge–Kutta rule of fourth order
around it (Lawson); samples between the steps come from the cubic through values and derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .control import Drive, drive, is_on, principal
from .fast_engine import CHUNK, Coefficients
from .plant import Block, Control, Environment, Plant, Samples, SlowState
from .resonator import J, exponential, solvent

Array = np.ndarray
SlowTerm = Callable[[Array, SlowState], Array]
"""(u (..., 2), state) -> du/dt (..., 2), or the measured u."""
_STEP_ANGLE = 0.05
"""|largest rate| × step."""
_LONGEST_STEP_S = 0.02


@dataclass
class SlowTerms:
    """The effects' slow terms: of the environment (true from logged), of the motion and of the read-out."""

    environment: Sequence[Callable[[SlowState], SlowState]] = ()
    motion: Sequence[SlowTerm] = ()
    readout: Sequence[SlowTerm] = ()


class _Clock:
    """The environment as an effect may see it at any times: temperature with its slope and branch, rate and turned angle."""

    def __init__(self, environment: Environment, plant: Plant, control: Control) -> None:
        self._t, self._T, self._rate = (np.asarray(a, float) for a in (environment.time_s, environment.temperature_degc, environment.rate_rad_s))
        steps = np.diff(self._t)
        self._slope = np.diff(self._T) / np.where(steps > 0, steps, np.inf)
        signs = np.sign(self._slope)
        last = np.maximum.accumulate(np.where(signs != 0, np.arange(len(signs)), -1))
        self._branch = np.where(last >= 0, signs[np.maximum(last, 0)], 0.0)
        self._angle = np.concatenate([[0.0], np.cumsum(steps * (self._rate[1:] + self._rate[:-1]) / 2)])
        self._plant, self._control = plant, control

    def state(self, t: Array, force: Array, forced: Array, phase: Array) -> SlowState:
        """Everything an effect's slow term may look at, at times t."""
        rate = np.interp(t, self._t, self._rate)
        cell = np.clip(np.searchsorted(self._t, t, side="right") - 1, 0, len(self._slope) - 1)
        angle = self._angle[cell] + (t - self._t[cell]) * (self._rate[cell] + rate) / 2
        omega_r = self._plant.mechanics.omega_rad_s
        temperature = np.interp(t, self._t, self._T)
        return SlowState(
            self._plant.mechanics, t, temperature, self._slope[cell], self._branch[cell], rate, angle, force, forced, phase, omega_r
        )  # fmt: skip


def run(
    environment: Environment, plant_at: Callable[[Environment], Plant], control: Control, terms: SlowTerms, start: Array, step_s: float, count: int
) -> Iterator[Block]:
    """As `fast_engine.run`, from the envelopes. plant_at: the linear plant of any environment (true temperature and rate may differ from the logged)."""
    plant = plant_at(environment)
    clock = _Clock(environment, plant, control)
    omega_r = plant.mechanics.omega_rad_s
    stride = _stride(environment, plant, control, step_s)
    h = stride * step_s
    u, integral, near = np.asarray(start, complex), np.zeros(2), np.array([1.0, 0.0])
    feed = plant.mechanics.damping_rate_1_s

    def generators(t: Array) -> Array:
        state = clock.state(t, np.zeros((len(t), 2)), np.zeros(len(t)), np.zeros(len(t)))
        for change in terms.environment:
            state = change(state)
        local = Environment(t, state.temperature_degc, state.rate_rad_s, state.temperature_degc, state.rate_rad_s)
        there = plant_at(local)
        damping = there.damping - (there.scale_factor * local.rate_rad_s)[:, None, None] * J
        return solvent(damping, there.stiffness, omega_r)

    lively = control.forced or len(terms.motion) > 0

    def beside(t: float, u: Array, integral: Array, near: Array) -> tuple[Array, Array, Drive | None]:
        """du/dt beside L u, the integrals' change, and the drive."""
        on = is_on(control, t)
        action = drive(control, feed, u, integral, near) if on else None
        du = action.du if action else np.zeros(2, complex)
        if terms.motion:
            turn = principal(u, near)[4] if np.any(u) else 1.0 + 0j
            force = action.force if action else np.zeros(2, complex)
            state = clock.state(np.array([t]), force[None], np.array([float(on)]), np.array([np.angle(turn)]))
            for change in terms.environment:
                state = change(state)
            for term in terms.motion:
                du = du + term(u[None], state)[0]
        return du, action.integral_rate if action else np.zeros(2), action

    for first in range(0, count, CHUNK):
        n = min(CHUNK, count - first)
        steps = -(-n // stride)
        t = (first + np.arange(steps + 1) * stride) * step_s
        nodes = generators(t)
        first_half, second_half = exponential(generators(t[:-1] + h / 4), h / 2), exponential(generators(t[:-1] + 3 * h / 4), h / 2)
        path, slope = np.empty((steps + 1, 2), complex), np.empty((steps + 1, 2), complex)
        force, command, phase = np.zeros((steps + 1, 2), complex), np.zeros((steps + 1, 2)), np.zeros(steps + 1)
        for k in range(steps + 1):
            k1, i1, action = beside(t[k], u, integral, near) if lively else (0.0, 0.0, None)
            if lively and np.any(u):
                _, _, near, _, turn = principal(u, near)
                phase[k] = np.angle(turn)
            path[k], slope[k] = u, nodes[k] @ u + k1
            if action is not None:
                force[k], command[k] = action.force, action.command
            if k == steps:
                break
            E1, E2 = first_half[k], second_half[k]
            if not lively:
                u = E2 @ (E1 @ u)
                continue
            middle = t[k] + h / 2
            base = E1 @ u
            k2, i2, _ = beside(middle, base + h / 2 * (E1 @ k1), integral + h / 2 * i1, near)
            k3, i3, _ = beside(middle, base + h / 2 * k2, integral + h / 2 * i2, near)
            k4, i4, _ = beside(t[k + 1], E2 @ (base + h * k3), integral + h * i3, near)
            u = E2 @ (base + h / 6 * (E1 @ k1) + h / 3 * (k2 + k3)) + h / 6 * k4
            integral = integral + h / 6 * (i1 + 2 * i2 + 2 * i3 + i4)
        times = (first + np.arange(n)) * step_s
        cell, part = np.divmod(np.arange(n), stride)
        x = (part / stride)[:, None]
        values = _hermite(path, slope * h, cell, x)
        drives = force[cell] * (1 - x) + force[cell + 1] * x
        commands = command[cell] * (1 - x) + command[cell + 1] * x
        state = clock.state(times, drives, np.any(commands != 0, axis=1).astype(float), phase[cell])
        for change in terms.environment:
            state = change(state)
        seen = values
        for term in terms.readout:
            seen = term(seen, state)
        turn = np.exp(1j * np.mod(omega_r * times, 2 * np.pi))[:, None]
        q = (seen * turn).T
        samples = Samples(times, q.real, -q.imag, (drives * turn).T, state.temperature_degc, state.rate_rad_s)
        yield Block(samples, commands.T, values.__getitem__)
        if first + n < count:
            u = path[-1]


def _hermite(path: Array, step: Array, cell: Array, x: Array) -> Array:
    """The cubic through the values and the derivatives (times the step) at both ends of each cell, at 0 ≤ x < 1."""
    a, b, da, db = path[cell], path[cell + 1], step[cell], step[cell + 1]
    return a + x * (da + x * (3 * (b - a) - 2 * da - db + x * (2 * (a - b) + da + db)))


def _stride(environment: Environment, plant: Plant, control: Control, step_s: float) -> int:
    """Samples a slow step: a power of two, so that a chunk holds whole steps."""
    table = Coefficients(environment, plant)
    t = np.asarray(environment.time_s, float)
    L = solvent(table.damping(t) - table.turning(t)[:, None, None] * J, table.stiffness(t), plant.mechanics.omega_rad_s)
    fastest = float(np.abs(L).sum(-1).max())
    if control.forced:
        fastest = max(fastest, control.amplitude_gain_1_s, control.quadrature_gain_1_s)
    longest = min(_LONGEST_STEP_S, _STEP_ANGLE / max(fastest, 1e-9))
    return int(2 ** np.clip(np.floor(np.log2(max(longest / step_s, 1.0))), 0, np.log2(CHUNK)))
