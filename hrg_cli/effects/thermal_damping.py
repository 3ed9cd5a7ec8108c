"""Damping that follows temperature.

Physics: thermo-elastic and coating losses depend on temperature, ν = ν₀ (1 + β (T − T₀)).
Equation: d ln a/dt = −ν₀ β (T − T₀)   (PHYSICS M9, M10).
Size: 1e-3 … 1e-2 per K. Mistaken for: drift of the damping in time, nonlinear damping (in a
ring-down that warms up). What separates it: a temperature cycle.
"""

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values, make_reference_temperature


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """N += ν β ΔT I."""
    change = (
        plant.mechanics.damping_rate_1_s
        * p["relative_1_k"]
        * (env.temperature_degc - p["reference_temperature_degc"])
    )
    plant.damping = plant.damping + change[:, None, None] * np.eye(2)


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−ν β ΔT u."""
    change = (
        state.mechanics.damping_rate_1_s
        * p["relative_1_k"]
        * (state.temperature_degc - p["reference_temperature_degc"])
    )
    return -change[..., None] * u


EFFECT = Effect(
    name="thermal_damping",
    family="resonator",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter("relative_1_k", "K-1", 5e-3, "relative change of the damping per kelvin"),
        make_reference_temperature(),
    ),
    mistaken_for=("damping_drift", "nonlinear_damping"),
    next_experiment="ring-downs at several temperatures, each at constant temperature",
    plant=plant,
    slow=slow,
    acts_on="velocity",
    scales="damping_rate_1_s",
)
