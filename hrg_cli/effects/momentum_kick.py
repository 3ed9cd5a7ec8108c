"""A knock: momentum given at one instant.

Physics: something hits the case or the suspension; the velocity changes by Δż at t_k, the displacement does not.
Equation: with z = Re U, ż = −ω Im U, U = u e^{jωt}, the envelopes jump by Δu = −j (Δż/ω) e^{−jωt_k}   (PHYSICS §8): two real numbers and
the instant, which the rows of a measurement know to a part of their length and the jump's own phase to a part of a period: t_k is
`time_s` and `phase_rad`/ω. Amplitude, quadrature, angle and phase jump together, in proportions that the phase at t_k gives.
Size: 1e-4 … 1 of the amplitude. The parameters are Δż/ω, the amplitude that the knock gives a resonator at rest.
Mistaken for: lost samples (they turn both channels alike: θ and a_B stay), a run put together from two. What separates it: the motion
before and after is that of one resonator; a counter of samples, an accelerometer on the case.
"""

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from .effect import OF_EVERY_RUN, RUN, Array, Effect, Parameter, Runs, Values

SIDE = 4
"""Rows on either side by which a jump is judged."""
CHANCE = 1e-3
"""Chance that one of all rows of runs without a knock is taken for one."""
MOST = 4
"""Instants tried, the clearest first."""


def velocity_over_omega(p: Values) -> Array:
    """Δż/ω (2,)."""
    return np.array([p["c_velocity_over_omega"], p["s_velocity_over_omega"]])


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """ż += Δż at t_k, ω that of the resonator."""
    omega = plant.mechanics.omega_rad_s
    plant.kicks.append((p["time_s"] + p["phase_rad"] / omega, omega * velocity_over_omega(p)))


def slow_jump(p: Values, state: SlowState) -> tuple[float, Array]:
    """(t_k, −j (Δż/ω) e^{−jω_r t_k}) in the run that was struck."""
    instant = p["time_s"] + p["phase_rad"] / state.mechanics.omega_rad_s
    jump = -1j * velocity_over_omega(p) * np.exp(-1j * state.omega_r_rad_s * instant)
    if state.run is None or p[RUN] == OF_EVERY_RUN:
        return instant, jump
    return instant, (state.run == p[RUN])[..., None] * jump


def instants(runs: Runs) -> list[Values]:
    """Where the envelopes of one row to the next jump by more than noise and their own curvature, the clearest first."""
    found: list[tuple[float, int, float]] = []
    threshold = _threshold(runs.weight)
    for number, (t, u, weight) in enumerate(zip(runs.time_s, runs.envelope, runs.weight, strict=True)):
        rows = np.flatnonzero(weight)
        if len(rows) < 8 * SIDE:
            continue
        t, weight = t[rows], weight[rows]
        turn = _mean_turn(t, u[rows])
        u = u[rows] * np.exp(-1j * turn * t)[:, None]
        jump, size = _jumps(t, u)
        z2 = np.sum(np.abs(jump) ** 2, axis=-1) * weight[SIDE:-SIDE] ** 2 / size
        # what the rows' own curvature does everywhere is no jump
        z2 = z2 / max(1.0, float(np.median(z2)) / MEDIAN)
        for k in map(int, np.flatnonzero((z2 > threshold) & (z2 == _largest_near(z2)))):
            near = _instant(t, u, k + SIDE, jump[k])
            found.append((float(z2[k]), number, _in_phase(near, jump[k], 2 * np.pi * runs.reference_frequency_hz, turn)))
    return [{"time_s": time_s, RUN: float(number)} for _, number, time_s in sorted(found, reverse=True)[:MOST]]


MEDIAN = 3.3567
"""Of χ² with the four reals of a jump."""


def _threshold(weight: Array) -> float:
    """x with rows · P(χ²₄ > x) = CHANCE, P = e^{−x/2}(1 + x/2)."""
    rows, x = max(1, int(np.count_nonzero(weight))), 40.0
    for _ in range(20):
        x = 2 * float(np.log(rows * (1 + x / 2) / CHANCE))
    return x


def _mean_turn(t: Array, u: Array) -> float:
    """Mean rate at which the envelopes' phase turns, rad/s."""
    return float(np.sum(np.angle(np.sum(np.conj(u[:-1]) * u[1:], axis=-1))) / (t[-1] - t[0]))


def _in_phase(near: float, jump: Array, omega_r: float, turn: float) -> float:
    """The instant next to `near` at which a jump e^{−j·turn·t} Δu is a velocity: j e^{jω_r t} Δu is real in both channels.

    A row knows the instant to a part of its length, the jump's phase knows it to a part of a period, half periods apart.
    """
    phase = float(np.angle(np.sum(jump**2))) / 2 + (omega_r + turn) * near + np.pi / 2
    return float(near - (np.mod(phase + np.pi / 2, np.pi) - np.pi / 2) / (omega_r + turn))


def _jumps(t: Array, u: Array) -> tuple[Array, Array]:
    """Jump of both envelopes (n − 2·SIDE, 2) at every row beside a cubic through its neighbours, and its variance for rows of variance 1.

    The row itself, which holds a part of the jump, does not count.
    """
    around = np.delete(np.arange(2 * SIDE + 1), SIDE)
    x = (np.lib.stride_tricks.sliding_window_view(t, 2 * SIDE + 1) - t[SIDE:-SIDE, None])[:, around]
    x = x / np.abs(x).max(axis=1, keepdims=True)
    step = np.linalg.pinv(np.stack([x**0, x, x**2, x**3, np.sign(x) / 2], axis=-1))[:, -1]
    windows = np.lib.stride_tricks.sliding_window_view(u, 2 * SIDE + 1, axis=0)[..., around]
    return np.einsum("ncw,nw->nc", windows, step), np.sum(step**2, axis=1)


def _largest_near(z2: Array) -> Array:
    """Largest value within a window's half, (n,)."""
    padded = np.pad(z2, 2 * SIDE)
    return np.max(np.lib.stride_tricks.sliding_window_view(padded, 4 * SIDE + 1), axis=-1)


def _instant(t: Array, u: Array, k: int, jump: Array) -> float:
    """The instant within row k, whose mean holds the part of the jump that comes before its end."""
    x, rows = t[k - SIDE : k] - t[k], u[k - SIDE : k]
    before = np.linalg.lstsq(np.column_stack([x**0, x, x**2]), rows, rcond=None)[0][0]
    part = float(np.clip(np.real(np.sum(np.conj(jump) * (u[k] - before))) / np.sum(np.abs(jump) ** 2), 0, 1))
    return float(t[k] + (0.5 - part) * (t[k + 1] - t[k - 1]) / 2)


EFFECT = Effect(
    name="momentum_kick",
    family="bench",
    page=__doc__,
    parameters=(
        Parameter("c_velocity_over_omega", "amplitude", 1e-3, "velocity that C was given, over ω", amplitude_power=1),
        Parameter("s_velocity_over_omega", "amplitude", 1e-3, "velocity that S was given, over ω", amplitude_power=1),
        Parameter("phase_rad", "rad", 1.0, "phase of the oscillation from time_s to the knock", fitted=False, fitted_then=True),
        Parameter("time_s", "s", 0.5, "instant of the knock", fitted=False),
        Parameter(RUN, "1", 0.0, "number of the run that was struck, from 0; −1: every run", neutral=OF_EVERY_RUN, fitted=False),
    ),
    mistaken_for=("dropped_samples",),
    next_experiment="an accelerometer on the case, or the same run again: a knock comes once",
    plant=plant,
    slow_jump=slow_jump,
    starts=instants,
)
