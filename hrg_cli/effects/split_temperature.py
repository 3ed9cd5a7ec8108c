"""Frequency split that follows temperature.

Physics: an uneven rim or mount changes the two stiffness axes differently with temperature.
Equation: δω R(2mθ_ω) → … + (T − T₀)(s_c R(0) + s_s R(π/2)) + (T − T₀)²(e_c R(0) + e_s R(π/2)); ṙ and φ̇
as those of a split   (PHYSICS M9). The bend is −β²δω/2 along the split where its axis turns by β a
kelvin.
Size: 1e-4 … 1e-2 rad/s per K (a good shell: none). Mistaken for: a constant split in runs of one
temperature, ageing. What separates it: ring-downs at several temperatures.
"""

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from ..physics.resonator import Mechanics
from .bent_laws import make_bend, read_split
from .effect import Array, Effect, Parameter, Values, make_reference_temperature, size_bend

SLOPE = ("cos_rad_s_k", "sin_rad_s_k")
"""Names of the slope's components."""
BEND = ("cos_rad_s_k2", "sin_rad_s_k2")
"""Names of the bend's components."""


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """W += 2ω ΔT (s_c R(0) + s_s R(π/2)) + 2ω ΔT² (e_c R(0) + e_s R(π/2))."""
    warmer = (env.temperature_degc - p["reference_temperature_degc"])[:, None, None]
    change = warmer * (read_split(p, SLOPE) + warmer * read_split(p, BEND))
    plant.stiffness = plant.stiffness + 2 * plant.mechanics.omega_rad_s * change


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """jΔT (s_c R(0) + s_s R(π/2)) u + jΔT² (e_c R(0) + e_s R(π/2)) u."""
    warmer = (state.temperature_degc - p["reference_temperature_degc"])[..., None]
    return 1j * warmer * (u @ read_split(p, SLOPE) + warmer * (u @ read_split(p, BEND)))


def slow_rate(p: Values, u: Array, state: SlowState) -> Array:
    """j dT/dt (s_c R(0) + s_s R(π/2)) u + 2jΔT dT/dt (e_c R(0) + e_s R(π/2)) u."""
    warmer = (state.temperature_degc - p["reference_temperature_degc"])[..., None]
    change = state.temperature_rate_degc_s[..., None]
    return 1j * change * (u @ read_split(p, SLOPE) + 2 * warmer * (u @ read_split(p, BEND)))


def size_next_order(p: Values, mechanics: Mechanics) -> dict[str, float]:
    """|s|²/2δω of either component of the bend: that of a turn, or of a growth in proportion.

    Parameters
    ----------
    p
        Values of the effect's parameters.
    mechanics
        The linear resonator.

    Returns
    -------
    dict
        [rad/s/K²].

    Examples
    --------
    >>> from hrg_cli.effects.split_temperature import size_next_order
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(5000.0, 1.0, frequency_split_rad_s=0.1)
    >>> size_next_order({"cos_rad_s_k": 0.0, "sin_rad_s_k": 0.01}, gyro)
    {'cos_rad_s_k2': 0.0005, 'sin_rad_s_k2': 0.0005}
    """
    slope = float(np.hypot(p[SLOPE[0]], p[SLOPE[1]]))
    return dict.fromkeys(BEND, size_bend(slope, mechanics.frequency_split_rad_s))


EFFECT = Effect(
    name="split_temperature",
    family="resonator",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter(SLOPE[0], "rad s-1 K-1", 3e-3, "slope of δω cos 2mθ_ω"),
        Parameter(SLOPE[1], "rad s-1 K-1", 3e-3, "slope of δω sin 2mθ_ω"),
        make_bend(BEND[0], "rad s-1 K-2", 1e-5, "bend of δω cos 2mθ_ω per kelvin squared"),
        make_bend(BEND[1], "rad s-1 K-2", 1e-5, "bend of δω sin 2mθ_ω per kelvin squared"),
        make_reference_temperature(),
    ),
    mistaken_for=("ageing", "thermal_gradient"),
    next_experiment=(
        "ring-downs at three wave angles and several temperatures, each at constant temperature"
    ),
    plant=plant,
    slow=slow,
    slow_rate=slow_rate,
    size_next_order=size_next_order,
)
