"""Hysteresis of the frequency over a temperature cycle.

Physics: after heating the frequency is h higher than after cooling at the same temperature,
whatever the speed.
Equation: f → f (1 + h·b), b = +1 on the rising branch, −1 on the falling one   (PHYSICS E6; the play's width taken as small).
Size: 1e-7 … 1e-6 (1 … 5 % of the thermal change). Mistaken for: lag and gradient (proportional to
the ramp's speed). What separates it: a cycle at two ramp speeds.
"""

from ..physics.plant import Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values, find_branch


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """ω (1 + h b)."""
    plant.stiffness = plant.retune_stiffness(p["relative"] * find_branch(env.temperature_degc))


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """jω h b u."""
    return 1j * (state.mechanics.omega_rad_s * p["relative"] * state.branch)[..., None] * u


EFFECT = Effect(
    name="thermal_hysteresis",
    family="bench",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter(
            "relative", "1", 3e-7, "half the relative difference of frequency between the branches"
        ),
    ),
    mistaken_for=("thermal_lag", "thermal_gradient"),
    next_experiment=(
        "a temperature cycle up and down at two ramp speeds: hysteresis does not depend on the"
        " speed"
    ),
    plant=plant,
    slow=slow,
    shown_by=("temperature cycle",),
)
