"""Damping split that follows temperature.

Physics: coating and mount lose unevenly around the rim, and each with its own temperature.
Equation: νδμ R(2mθ_μ) → … + (T − T₀)(d_c R(0) + d_s R(π/2)); mθ̇ and d ln a/dt as those of a
damping
split   (PHYSICS M1, M9).
Size: 1e-7 … 1e-4 1/s per K. Mistaken for: a constant damping split in runs of one temperature, a
gain mismatch that follows temperature; a constant quadrature offset r₀ of the read-out is the same
where the frequency split moves, 2r₀ of its slope a quarter turn on. What separates it: several
temperatures, at rates of both signs.
"""

from ..physics.plant import Environment, Plant, SlowState
from ..physics.resonator import split_matrix
from .effect import (
    REFERENCE_TEMPERATURE,
    Array,
    Effect,
    Parameter,
    Values,
    make_reference_temperature,
)


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """N += ΔT (d_c R(0) + d_s R(π/2))."""
    slope = split_matrix(p["cos_1_s_k"], p["sin_1_s_k"])
    warmer = env.temperature_degc - p[REFERENCE_TEMPERATURE]
    plant.damping = plant.damping + warmer[:, None, None] * slope


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−ΔT (d_c R(0) + d_s R(π/2)) u."""
    slope = split_matrix(p["cos_1_s_k"], p["sin_1_s_k"])
    return -(state.temperature_degc - p[REFERENCE_TEMPERATURE])[..., None] * (u @ slope)


EFFECT = Effect(
    name="damping_split_temperature",
    family="resonator",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter("cos_1_s_k", "s-1 K-1", 1e-4, "slope of νδμ cos 2mθ_μ"),
        Parameter("sin_1_s_k", "s-1 K-1", 1e-4, "slope of νδμ sin 2mθ_μ"),
        make_reference_temperature(),
    ),
    mistaken_for=("mismatch_temperature", "thermal_damping"),
    next_experiment="runs at rates of both signs and several wave angles, at several temperatures",
    plant=plant,
    slow=slow,
    acts_on="velocity",
)
