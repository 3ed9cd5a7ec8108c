"""Response to temperature's rate of change: gradients across the shell.

Physics: while the temperature changes, the shell is not at one temperature; frequency and split
answer to dT/dt, each with its own ratio.
Equation: φ̇ = ω γ dT/dt, δω R(2mθ_ω) → … + dT/dt (g_c R(0) + g_s R(π/2))   (PHYSICS E4).
Size: γ 1e-7 … 1e-5 s/K. Mistaken for: lag of the thermometer (one time constant for all),
hysteresis. What separates it: soak steps, two ramp speeds.
"""

from ..physics.environment import compute_slope
from ..physics.plant import Environment, Plant, SlowState
from ..physics.resonator import split_matrix
from .effect import Array, Effect, Parameter, Values


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """ω (1 + γ dT/dt), W += 2ω dT/dt (g_c R(0) + g_s R(π/2))."""
    rate = compute_slope(env.temperature_degc, env.time_s)
    split = split_matrix(p["split_cos_rad_k"], p["split_sin_rad_k"])
    plant.stiffness = (
        plant.retune_stiffness(p["frequency_s_k"] * rate)
        + 2 * plant.mechanics.omega_rad_s * rate[:, None, None] * split
    )


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """j dT/dt (ω γ + g_c R(0) + g_s R(π/2)) u."""
    split = split_matrix(p["split_cos_rad_k"], p["split_sin_rad_k"])
    turned = state.mechanics.omega_rad_s * p["frequency_s_k"] * u + u @ split
    return 1j * state.temperature_rate_degc_s[..., None] * turned


EFFECT = Effect(
    name="thermal_gradient",
    family="bench",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter("frequency_s_k", "s K-1", 1e-6, "relative frequency per kelvin per second"),
        Parameter("split_cos_rad_k", "rad K-1", 1e-3, "split δω cos 2mθ_ω per kelvin per second"),
        Parameter("split_sin_rad_k", "rad K-1", 1e-3, "split δω sin 2mθ_ω per kelvin per second"),
    ),
    mistaken_for=("thermal_lag", "thermal_hysteresis"),
    next_experiment="temperature in soak steps, or ramps at two speeds",
    plant=plant,
    slow=slow,
    shown_by=("temperature cycle",),
)
