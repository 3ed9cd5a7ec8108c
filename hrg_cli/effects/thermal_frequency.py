"""Frequency that follows temperature.

Physics: Young's modulus depends on temperature, f = f₀ (1 + α (T − T₀)).
Equation: φ̇ = ω α (T − T₀), the split in rad/s stays   (PHYSICS M9).
Size: +85 … 95 ppm/K for fused silica. Mistaken for: ageing, cubic stiffness (in a ring-down that
warms up), hysteresis, lag. What separates it: a temperature cycle.
"""

from ..physics.plant import Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values, make_reference_temperature


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """ω → ω (1 + α ΔT), the split as it was."""
    plant.stiffness = plant.retune_stiffness(
        p["relative_1_k"] * (env.temperature_degc - p["reference_temperature_degc"])
    )


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """jω α ΔT u."""
    change = (
        state.mechanics.omega_rad_s
        * p["relative_1_k"]
        * (state.temperature_degc - p["reference_temperature_degc"])
    )
    return 1j * change[..., None] * u


def slow_rate(p: Values, u: Array, state: SlowState) -> Array:
    """jω α dT/dt u: while the frequency moves, aω^½ stays."""
    change = state.mechanics.omega_rad_s * p["relative_1_k"] * state.temperature_rate_degc_s
    return 1j * change[..., None] * u


EFFECT = Effect(
    name="thermal_frequency",
    family="resonator",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter("relative_1_k", "K-1", 1e-6, "relative change of frequency per kelvin"),
        make_reference_temperature(),
    ),
    mistaken_for=("ageing", "cubic_stiffness", "thermal_hysteresis"),
    next_experiment="a temperature cycle, up and down, at constant amplitude",
    plant=plant,
    slow=slow,
    slow_rate=slow_rate,
    scales="frequency_hz",
)
