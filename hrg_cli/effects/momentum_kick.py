"""A knock: momentum given at one instant.

Physics: something hits the case or the suspension; the velocity changes by Δż at t_k, the displacement does not.
Equation: with z = Re U, ż = −ω Im U, U = u e^{jωt}, the envelopes jump by Δu = −j (Δż/ω) e^{−jωt_k}   (PHYSICS §8): two real numbers and
the instant. Amplitude, quadrature, angle and phase jump together, in proportions that the phase at t_k gives.
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
    plant.kicks.append((p["time_s"], plant.mechanics.omega_rad_s * velocity_over_omega(p)))


def slow_jump(p: Values, state: SlowState) -> tuple[float, Array]:
    """(t_k, −j (Δż/ω) e^{−jω_r t_k}) in the run that was struck."""
    jump = -1j * velocity_over_omega(p) * np.exp(-1j * state.omega_r_rad_s * p["time_s"])
    if state.run is None or p[RUN] == OF_EVERY_RUN:
        return p["time_s"], jump
    return p["time_s"], (state.run == p[RUN])[..., None] * jump


def instants(runs: Runs) -> list[Values]:
    """Where the envelopes of one row to the next jump by more than noise and their own curvature, the clearest first."""
    step = _filter(SIDE)
    found: list[tuple[float, int, float]] = []
    for number, (t, u, weight) in enumerate(zip(runs.time_s, runs.envelope, runs.weight, strict=True)):
        last = int(np.count_nonzero(weight))
        if last < 8 * SIDE:
            continue
        window = np.lib.stride_tricks.sliding_window_view(u, 2 * SIDE + 1, axis=0) @ step
        inside = np.lib.stride_tricks.sliding_window_view(weight, 2 * SIDE + 1)
        z2 = np.sum(np.abs(window) ** 2, axis=-1) * inside[:, SIDE] ** 2 / (step @ step)
        z2 = np.where((inside > 0).all(axis=1), z2, 0.0)
        # what the rows' own curvature does everywhere is no jump
        z2 = z2 / max(1.0, float(np.median(z2[z2 > 0])) / MEDIAN) if np.any(z2 > 0) else z2
        for k in map(int, np.flatnonzero((z2 > _threshold(runs.weight)) & (z2 == _largest_near(z2)))):
            found.append((float(z2[k]), number, _instant(t, u, k + SIDE, window[k])))
    return [{"time_s": time_s, RUN: float(number)} for _, number, time_s in sorted(found, reverse=True)[:MOST]]


MEDIAN = 3.3567
"""Of χ² with the four reals of a jump."""


def _threshold(weight: Array) -> float:
    """x with rows · P(χ²₄ > x) = CHANCE, P = e^{−x/2}(1 + x/2)."""
    rows, x = max(1, int(np.count_nonzero(weight))), 40.0
    for _ in range(20):
        x = 2 * float(np.log(rows * (1 + x / 2) / CHANCE))
    return x


def _filter(side: int) -> Array:
    """Weights (2·side + 1,) that give a step's size at the middle row beside a cubic: half of the step is in that row."""
    x = np.arange(-side, side + 1) / side
    design = np.column_stack([x**0, x, x**2, x**3, np.sign(x) / 2])
    return np.linalg.pinv(design)[-1]


def _largest_near(z2: Array) -> Array:
    """Largest value within a window's half, (n,)."""
    padded = np.pad(z2, 2 * SIDE)
    return np.max(np.lib.stride_tricks.sliding_window_view(padded, 4 * SIDE + 1), axis=-1)


def _instant(t: Array, u: Array, k: int, jump: Array) -> float:
    """The instant within row k, whose mean holds the part of the jump that comes before its end."""
    x, rows = np.arange(-SIDE, 0), u[k - SIDE : k]
    before = np.polynomial.polynomial.polyval(0, np.polynomial.polynomial.polyfit(x, rows.real, 2) + 0j)
    before = before + 1j * np.polynomial.polynomial.polyval(0, np.polynomial.polynomial.polyfit(x, rows.imag, 2))
    part = float(np.clip(np.real(np.sum(np.conj(jump) * (u[k] - before))) / np.sum(np.abs(jump) ** 2), 0, 1))
    return float(t[k] + (0.5 - part) * (t[k + 1] - t[k - 1]) / 2)


EFFECT = Effect(
    name="momentum_kick",
    family="bench",
    page=__doc__,
    parameters=(
        Parameter("c_velocity_over_omega", "amplitude", 1e-3, "velocity that C was given, over ω", amplitude_power=1),
        Parameter("s_velocity_over_omega", "amplitude", 1e-3, "velocity that S was given, over ω", amplitude_power=1),
        Parameter("time_s", "s", 0.5, "instant of the knock", fitted=False),
        Parameter(RUN, "1", 0.0, "number of the run that was struck, from 0; −1: every run", neutral=OF_EVERY_RUN, fitted=False),
    ),
    mistaken_for=("dropped_samples",),
    next_experiment="an accelerometer on the case, or the same run again: a knock comes once",
    plant=plant,
    slow_jump=slow_jump,
    starts=instants,
)
