"""Frequency split that follows temperature.

Physics: an uneven rim or mount changes the two stiffness axes differently with temperature.
Equation: δω R(2mθ_ω) → … + (T − T₀)(s_c R(0) + s_s R(π/2)); ṙ and φ̇ as those of a split   (PHYSICS M9).
Size: 1e-4 … 1e-2 rad/s per K (a good shell: none). Mistaken for: a constant split in runs of one
temperature, ageing. What separates it: ring-downs at several temperatures.
"""

from ..physics.plant import Environment, Plant, SlowState
from ..physics.resonator import split_matrix
from .effect import Array, Effect, Parameter, Values, make_reference_temperature


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """W += 2ω ΔT (s_c R(0) + s_s R(π/2))."""
    slope = split_matrix(p["cos_rad_s_k"], p["sin_rad_s_k"])
    change = env.temperature_degc - p["reference_temperature_degc"]
    plant.stiffness = (
        plant.stiffness + 2 * plant.mechanics.omega_rad_s * change[:, None, None] * slope
    )


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """jΔT (s_c R(0) + s_s R(π/2)) u."""
    slope = split_matrix(p["cos_rad_s_k"], p["sin_rad_s_k"])
    return 1j * (state.temperature_degc - p["reference_temperature_degc"])[..., None] * (u @ slope)


def slow_rate(p: Values, u: Array, state: SlowState) -> Array:
    """j dT/dt (s_c R(0) + s_s R(π/2)) u."""
    slope = split_matrix(p["cos_rad_s_k"], p["sin_rad_s_k"])
    return 1j * state.temperature_rate_degc_s[..., None] * (u @ slope)


EFFECT = Effect(
    name="split_temperature",
    family="resonator",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter("cos_rad_s_k", "rad s-1 K-1", 3e-3, "slope of δω cos 2mθ_ω"),
        Parameter("sin_rad_s_k", "rad s-1 K-1", 3e-3, "slope of δω sin 2mθ_ω"),
        make_reference_temperature(),
    ),
    mistaken_for=("ageing", "thermal_gradient"),
    next_experiment=(
        "ring-downs at three wave angles and several temperatures, each at constant temperature"
    ),
    plant=plant,
    slow=slow,
    slow_rate=slow_rate,
)
