"""Damping that drifts in time.

Physics: the vacuum or the suspension changes during the run, ν = ν₀ + ν̇ t.
Equation: d ln a/dt = −ν̇ t, t from the run's start   (PHYSICS M11, §6 ν_t).
Size: 1e-3 … 1e-1 of ν over a run. Mistaken for: nonlinear damping (curvature of ln a in a², not in
t), thermal damping on one ramp. What separates it: ring-downs from two amplitudes at one
temperature.
"""

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """N += ν̇ t I."""
    plant.damping = plant.damping + (p["slope_1_s2"] * env.time_s)[:, None, None] * np.eye(2)


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−ν̇ t u."""
    return -p["slope_1_s2"] * state.time_s[..., None] * u


EFFECT = Effect(
    name="damping_drift",
    family="resonator",
    page=__doc__,
    parameters=(Parameter("slope_1_s2", "s-2", 1e-3, "change of ν per second"),),
    mistaken_for=("nonlinear_damping", "thermal_damping"),
    next_experiment=(
        "ring-downs from two amplitudes at one temperature: a drift follows time, nonlinear damping"
        " follows a²"
    ),
    plant=plant,
    slow=slow,
    acts_on="velocity",
)
