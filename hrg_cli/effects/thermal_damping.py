"""Damping that follows temperature.

Physics: thermo-elastic and coating losses depend on temperature, ν = ν₀ (1 + β (T − T₀) + γ (T − T₀)²).
Equation: d ln a/dt = −ν₀ (β (T − T₀) + γ (T − T₀)²)   (PHYSICS M9, M10); of ν₀ exp β(T − T₀), γ = β²/2.
Size: 1e-3 … 1e-2 per K. Mistaken for: drift of the damping in time, nonlinear damping (in a
ring-down that warms up). What separates it: a temperature cycle.
"""

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from ..physics.resonator import Mechanics
from .bent_laws import make_bend
from .effect import Array, Effect, Parameter, Values, make_reference_temperature, size_bend

BEND = "relative_1_k2"
"""Name of the bend."""


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """N += ν (β ΔT + γ ΔT²) I."""
    change = plant.mechanics.damping_rate_1_s * _relative(p, env.temperature_degc)
    plant.damping = plant.damping + change[:, None, None] * np.eye(2)


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−ν (β ΔT + γ ΔT²) u."""
    change = state.mechanics.damping_rate_1_s * _relative(p, state.temperature_degc)
    return -change[..., None] * u


def _relative(p: Values, temperature_degc: Array) -> Array:
    warmer = temperature_degc - p["reference_temperature_degc"]
    return warmer * (p["relative_1_k"] + p.get(BEND, 0.0) * warmer)


def size_next_order(p: Values, _: Mechanics) -> dict[str, float]:
    """γ = β²/2, as of a damping that grows in proportion.

    Parameters
    ----------
    p
        Values of the effect's parameters.
    _
        The linear resonator.

    Returns
    -------
    dict
        [1/K²].

    Examples
    --------
    >>> from hrg_cli.effects.thermal_damping import size_next_order
    >>> size_next_order({"relative_1_k": 0.5}, None)
    {'relative_1_k2': 0.125}
    """
    return {BEND: size_bend(p["relative_1_k"], 1.0)}


EFFECT = Effect(
    name="thermal_damping",
    family="resonator",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter("relative_1_k", "K-1", 5e-3, "relative change of the damping per kelvin"),
        make_bend(BEND, "K-2", 2e-5, "relative bend of the damping per kelvin squared"),
        make_reference_temperature(),
    ),
    mistaken_for=("damping_drift", "nonlinear_damping"),
    next_experiment="ring-downs at several temperatures, each at constant temperature",
    plant=plant,
    slow=slow,
    acts_on="velocity",
    scales="damping_rate_1_s",
    size_next_order=size_next_order,
)
