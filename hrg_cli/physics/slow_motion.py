"""The right-hand side of the envelopes' equation u' = L(t) u + control + slow terms of the effects,
and one step of it.

L is the solvent of the second-order equation (`resonator.find_solvent`). The linear part is stepped
by its exact exponential, the rest by the Runge–Kutta rule of fourth order around it (Lawson).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from .control import Drive, compute_drive, find_axes, is_on
from .plant import Control, Environment, Plant, SlowState
from .resonator import J, average_generator, exponentiate, find_solvent

Array = np.ndarray
SlowTerm = Callable[[Array, SlowState], Array]
"""(u (..., 2), state) -> du/dt (..., 2), or the measured u."""
PlantAt = Callable[[Environment], Plant]
_DERIVATIVE_S = 1e-3


@dataclass
class SlowTerms:
    """The effects' slow terms: of the environment (true from logged), of the motion and of the
    read-out."""

    environment: Sequence[Callable[[SlowState], SlowState]] = ()
    motion: Sequence[SlowTerm] = ()
    readout: Sequence[SlowTerm] = ()
    jumps: Sequence[Callable[[SlowState], tuple[float, Array]]] = ()
    """Instants at which the envelopes jump."""


class _Clock:
    """The environment as an effect may see it at any times: temperature with its slope and branch,
    rate and turned angle."""

    def __init__(self, environment: Environment, plant: Plant) -> None:
        self._t, self._T = (
            np.asarray(environment.time_s, float),
            np.asarray(environment.temperature_degc, float),
        )
        self._rate = np.asarray(environment.rate_rad_s, float)
        steps = np.diff(self._t)
        self._slope = np.diff(self._T) / np.where(steps > 0, steps, np.inf)
        signs = np.sign(self._slope)
        last = np.maximum.accumulate(np.where(signs != 0, np.arange(len(signs)), -1))
        self._branch = np.where(last >= 0, signs[np.maximum(last, 0)], 0.0)
        self._angle = np.concatenate(
            [[0.0], np.cumsum(steps * (self._rate[1:] + self._rate[:-1]) / 2)]
        )
        self._plant, self._begun_s = plant, environment.begun_s

    def find_state(self, t: Array) -> SlowState:
        """What of the environment an effect's slow term may look at, at times t."""
        rate = np.interp(t, self._t, self._rate)
        cell = np.clip(np.searchsorted(self._t, t, side="right") - 1, 0, len(self._slope) - 1)
        angle = self._angle[cell] + (t - self._t[cell]) * (self._rate[cell] + rate) / 2
        omega_r = self._plant.mechanics.omega_rad_s
        temperature = np.interp(t, self._t, self._T)
        nothing = np.zeros(len(t))
        return SlowState(
            self._plant.mechanics, t, temperature, self._slope[cell], self._branch[cell], rate,
            angle, np.zeros((len(t), 2), complex), nothing, nothing, omega_r,
            begun_s=self._begun_s,
        )  # fmt: skip


@dataclass
class Memory:
    """What the loops remember: their two integrals and the last e_A."""

    integral: Array
    near: Array


class EnvelopeMotion:
    """The right-hand side u' = L u + control + slow terms in its environment, and one step of
    it."""

    def __init__(
        self,
        environment: Environment,
        plant_at: PlantAt,
        control: Control,
        terms: SlowTerms,
        averaged: bool = False,
    ) -> None:
        self._plant_at, self._control, self._terms = plant_at, control, terms
        self._averaged = averaged
        self.plant = plant_at(environment)
        self._clock = _Clock(environment, self.plant)
        self._feed = self.plant.mechanics.damping_rate_1_s
        self.lively = control.forced or len(terms.motion) > 0
        self.switches = np.unique(control.on_off) if control.forced else np.zeros(0)
        self.jumps = [jump(self._clock.find_state(np.zeros(1))) for jump in terms.jumps]
        self.jumps = sorted(
            ((at, np.reshape(change, 2)) for at, change in self.jumps if at > 0),
            key=lambda one: one[0],
        )

    def find_state(self, t: Array) -> SlowState:
        """What the effects see at times t, the environment made true by theirs; nothing of the wave
        or the drive yet."""
        state = self._clock.find_state(t)
        for change in self._terms.environment:
            state = change(state)
        return state

    def build_generators(self, t: Array) -> tuple[Array, Array]:
        """L (n, 2, 2) at times t, and the matrix by which a force's envelope is corrected, f + C f.

        With frequency and damping that move, L² + 2ΓL gains L' − (KΩ)'J = −N' + jW'/2ω. A force
        enters as (2jω_r + 2Γ + L)⁻¹(2jωf − f'), f' ≈ KΩJ f + j(ω − ω_r) f: f turns with the wave.
        """
        omega_r = self.plant.mechanics.omega_rad_s
        matrices = []
        for moment in (t, t - _DERIVATIVE_S, t + _DERIVATIVE_S):
            state = self.find_state(moment)
            there = self._plant_at(
                Environment(
                    moment,
                    state.temperature_degc,
                    state.rate_rad_s,
                    state.temperature_degc,
                    state.rate_rad_s,
                )
            )
            matrices.append(
                (
                    there.damping,
                    there.stiffness,
                    (there.scale_factor * state.rate_rad_s)[:, None, None] * J,
                )
            )
        (N, W, turning), before, after = matrices
        if self._averaged:
            return average_generator(N - turning, W, omega_r), np.zeros_like(W, complex)
        L = find_solvent(N - turning, W, omega_r)
        omega = np.sqrt((W[:, 0, 0] + W[:, 1, 1]) / 2)[:, None, None]
        moved = (1j * (after[1] - before[1]) / (2 * omega) - (after[0] - before[0])) / (
            2 * _DERIVATIVE_S
        )
        L = L - moved / (2j * omega)
        return L, -(2 * N - turning + L - 1j * (omega - omega_r) * np.eye(2)) / (2j * omega)

    def compute_propagator(self, t: Array, h: float) -> Array:
        """The linear motion from t to t + h (n, 2, 2): Magnus, fourth order, (L₁+L₂)/2 + (√3
        h/12)[L₂, L₁] at the Gauss points."""
        # The Gauss points of a step lie h/2√3 on either side of its middle.
        offset = h / (2 * np.sqrt(3))
        L1, L2 = (
            self.build_generators(t + h / 2 - offset)[0],
            self.build_generators(t + h / 2 + offset)[0],
        )
        return exponentiate((L1 + L2) / 2 + np.sqrt(3) * h / 12 * (L2 @ L1 - L1 @ L2), h)

    def _beside(
        self, on: bool, moment: SlowState, correction: Array, u: Array, integral: Array, near: Array
    ) -> tuple[Array, Array, Drive | None]:
        """du/dt beside L u, the integrals' change, and the drive."""
        now = float(moment.time_s[0])
        action = compute_drive(self._control, self._feed, u, integral, near, now) if on else None
        du = action.du + correction @ action.du if action else np.zeros(2, complex)
        if self._terms.motion:
            force = action.force if action else np.zeros(2, complex)
            phase = np.angle(near @ u)
            state = replace(
                moment, drive=force[None], forced=np.array([float(on)]), phase_rad=np.array([phase])
            )
            for term in self._terms.motion:
                du = du + term(u[None], state)[0]
        # Off, the integrals keep what they held: the drive comes back as it went.
        return du, action.integral_rate if action else np.zeros(2), action

    def look(
        self, moment: SlowState, u: Array, memory: Memory, correction: Array
    ) -> tuple[Array, Drive | None, float]:
        """du/dt beside L u, the drive and the wave's phase at a node."""
        _, _, memory.near, _, turn = find_axes(u, memory.near)
        if not self.lively:
            return np.zeros(2, complex), None, float(np.angle(turn))
        on = is_on(self._control, float(moment.time_s[0]))
        du, _, action = self._beside(on, moment, correction, u, memory.integral, memory.near)
        return du, action, float(np.angle(turn))

    def step(
        self,
        h: float,
        moments: Sequence[SlowState],
        halves: Sequence[Array],
        corrections: Sequence[Array],
        u: Array,
        memory: Memory,
    ) -> Array:
        """u after h, the drive on or off throughout: the fourth-order Runge–Kutta rule around two
        half exponentials, integrals too."""
        I, near = memory.integral, memory.near
        begin, middle, end = zip(moments, corrections)
        on = is_on(self._control, float(moments[1].time_s[0]))
        E1, E2 = halves
        k1, i1, _ = self._beside(on, *begin, u, I, near)
        base = E1 @ u
        k2, i2, _ = self._beside(on, *middle, base + h / 2 * (E1 @ k1), I + h / 2 * i1, near)
        k3, i3, _ = self._beside(on, *middle, base + h / 2 * k2, I + h / 2 * i2, near)
        k4, i4, _ = self._beside(on, *end, E2 @ (base + h * k3), I + h * i3, near)
        memory.integral = I + h / 6 * (i1 + 2 * i2 + 2 * i3 + i4)
        return E2 @ (base + h / 6 * (E1 @ k1) + h / 3 * (k2 + k3)) + h / 6 * k4

    def step_across(
        self, start: float, stop: float, switches: Array, u: Array, memory: Memory
    ) -> Array:
        """u after a step within which the drive is switched."""
        edges = np.concatenate([[start], switches, [stop]])
        for a, b in pairwise(edges):
            h = b - a
            t = a + h * np.array([0.0, 0.5, 1.0])
            _, corrections = self.build_generators(t)
            states = self.find_state(t)
            halves = self.compute_propagator(a + h * np.array([0.0, 0.5]), h / 2)
            u = self.step(
                h,
                [take_row(states, k) for k in range(3)],
                list(halves),
                list(corrections),
                u,
                memory,
            )
        return u


def take_row(state: SlowState, k: int) -> SlowState:
    """One time's state, every column of length 1.

    Parameters
    ----------
    state
        A state over n times.
    k
        The row, 0 to n − 1.

    Returns
    -------
    SlowState
        What an effect's slow term takes at that time.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.plant import SlowState
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.physics.slow_motion import take_row
    >>> t = np.array([0.0, 1.0])
    >>> rest = (20 + t, 0 * t, 0 * t, 0 * t, 0 * t, np.zeros((2, 2), complex), 0 * t, 0 * t, 6283.0)
    >>> take_row(SlowState(Mechanics(1000.0, 0.5), t, *rest), 1).temperature_degc.tolist()
    [21.0]
    """
    at = slice(k, k + 1)
    return SlowState(
        state.mechanics,
        state.time_s[at],
        state.temperature_degc[at],
        state.temperature_rate_degc_s[at],
        state.branch[at],
        state.rate_rad_s[at],
        state.table_angle_rad[at],
        state.drive[at],
        state.forced[at],
        state.phase_rad[at],
        state.omega_r_rad_s,
        begun_s=state.begun_s,
    )
