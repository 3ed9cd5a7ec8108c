"""Scale factor that follows temperature.

Physics: the rim's geometry, and with it the mode's shape, changes with temperature,
K = K₀ (1 + κ (T − T₀)).
Equation: mθ̇ = −K₀ (1 + κ (T − T₀)) Ω   (PHYSICS M9).
Size: 1e-7 … 1e-4 per K. Mistaken for: the table's rate error, the scale factor in runs of one
temperature. What separates it: the same rate at several temperatures.
"""

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from ..physics.resonator import J
from .effect import (
    REFERENCE_TEMPERATURE,
    Array,
    Effect,
    Parameter,
    Values,
    make_reference_temperature,
)


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """K += K₀ κ ΔT."""
    warmer = env.temperature_degc - p[REFERENCE_TEMPERATURE]
    plant.scale_factor = (
        plant.scale_factor + plant.mechanics.scale_factor * p["relative_1_k"] * warmer
    )


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """K₀ κ ΔT Ω J u."""
    change = (
        state.mechanics.scale_factor
        * p["relative_1_k"]
        * (state.temperature_degc - p[REFERENCE_TEMPERATURE])
        * state.rate_rad_s
    )
    return change[..., None] * np.einsum("ij,...j->...i", J, u)


EFFECT = Effect(
    name="scale_factor_temperature",
    family="resonator",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter("relative_1_k", "K-1", 1e-5, "relative change of the scale factor per kelvin"),
        make_reference_temperature(),
    ),
    mistaken_for=("scale factor", "table_rate_error"),
    next_experiment="the same rates, of both signs, at several temperatures",
    plant=plant,
    slow=slow,
)
