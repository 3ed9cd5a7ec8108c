"""Damping that grows with displacement squared.

Physics: z'' = … − 2ν₂|z|² v (gap squeeze film, contact, nonlinear loss).
Equation: u' = −ν₂[½(u†u) u − ¼(uᵀu) u*]; d ln a_A/dt = −ν₂(a_A² + 3a_B²)/4, d ln a_B/dt = −ν₂(3a_A² + a_B²)/4   (PHYSICS M6).
The parameter is the damping ν₂/4 it adds at unit amplitude.
Size: 1e-4 … 1e-2 of ν.
Mistaken for: drift of the damping in time or with temperature, cubic of the pick-off. What separates it: a long ring-down: curvature of
ln a in a², not in t; ring-downs from two amplitudes.
"""

import numpy as np

from ..physics.plant import POLYNOMIAL, Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """z'' −= 2ν₂|z|² v."""
    plant.polynomial[POLYNOMIAL.index("r2_v")] -= 8 * p["damping_1_s"]


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−ν₂[½(u†u) u − ¼(uᵀu) u*]."""
    size, square = np.sum(np.abs(u) ** 2, axis=-1, keepdims=True), np.sum(u**2, axis=-1, keepdims=True)
    return -p["damping_1_s"] * (2 * size * u - square * np.conj(u))


EFFECT = Effect(
    name="nonlinear_damping",
    family="resonator",
    page=__doc__,
    parameters=(Parameter("damping_1_s", "s-1", 1e-3, "damping ν₂/4 added at unit amplitude", amplitude_power=-2),),
    mistaken_for=("damping_drift", "thermal_damping", "pickoff_nonlinearity"),
    next_experiment="ring-downs from two amplitudes at one temperature: this damping follows a², a drift follows time",
    plant=plant,
    slow=slow,
)
