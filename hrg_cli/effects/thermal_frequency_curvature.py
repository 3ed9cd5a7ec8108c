"""Frequency that bends with temperature.

Physics: the temperature coefficient of Young's modulus is itself one of temperature,
f = f₀ (1 + α (T − T₀) + β (T − T₀)²); α is `thermal_frequency`, this is β.
Equation: φ̇ = ω β (T − T₀)², the split in rad/s stays   (PHYSICS M9).
Size: some −4e-8 per K² for fused silica. Mistaken for: thermal hysteresis and lag in one cycle,
ageing. What separates it: runs at three temperatures or more, well apart.
"""

from ..physics.plant import Environment, Plant, SlowState
from .effect import (
    REFERENCE_TEMPERATURE,
    Array,
    Effect,
    Parameter,
    Values,
    make_reference_temperature,
)


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """ω → ω (1 + β ΔT²), the split as it was."""
    warmer = env.temperature_degc - p[REFERENCE_TEMPERATURE]
    plant.stiffness = plant.retune_stiffness(p["relative_1_k2"] * warmer**2)


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """jω β ΔT² u."""
    warmer = state.temperature_degc - p[REFERENCE_TEMPERATURE]
    change = state.mechanics.omega_rad_s * p["relative_1_k2"] * warmer**2
    return 1j * change[..., None] * u


def slow_rate(p: Values, u: Array, state: SlowState) -> Array:
    """2jω β ΔT dT/dt u: while the frequency moves, aω^½ stays."""
    warmer = state.temperature_degc - p[REFERENCE_TEMPERATURE]
    change = 2 * p["relative_1_k2"] * warmer * state.temperature_rate_degc_s
    return 1j * state.mechanics.omega_rad_s * change[..., None] * u


EFFECT = Effect(
    name="thermal_frequency_curvature",
    family="resonator",
    page=__doc__,
    needs=("temperature",),
    bends="thermal_frequency",
    parameters=(
        Parameter("relative_1_k2", "K-2", 1e-8, "relative bend of frequency per kelvin squared"),
        make_reference_temperature(),
    ),
    mistaken_for=("thermal_hysteresis", "ageing", "cubic_stiffness"),
    next_experiment="runs at three temperatures or more, well apart, at constant amplitude",
    plant=plant,
    slow=slow,
    slow_rate=slow_rate,
)
