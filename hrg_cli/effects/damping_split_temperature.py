"""Damping split that follows temperature.

Physics: coating and mount lose unevenly around the rim, and each with its own temperature.
Equation: νδμ R(2mθ_μ) → … + (T − T₀)(d_c R(0) + d_s R(π/2)) + (T − T₀)²(e_c R(0) + e_s R(π/2)); mθ̇
and d ln a/dt as those of a damping split   (PHYSICS M1, M9). An axis that turns with the
temperature, D = νδμ e^{2jmθ_μ} e^{jβ(T − T₀)}, has the bend −β²D/2 beside the slope jβD, and one
that grows in proportion β²D/2.
Size: 1e-7 … 1e-4 1/s per K. Mistaken for: a constant damping split in runs of one temperature, a
gain mismatch that follows temperature; a constant quadrature offset r₀ of the read-out is the same
where the frequency split moves, 2r₀ of its slope a quarter turn on. What separates it: several
temperatures, at rates of both signs.
"""

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from ..physics.resonator import Mechanics
from .bent_laws import make_bend, read_split
from .effect import (
    REFERENCE_TEMPERATURE,
    Array,
    Effect,
    Parameter,
    Values,
    make_reference_temperature,
    size_bend,
)

SLOPE = ("cos_1_s_k", "sin_1_s_k")
"""Names of the slope's components."""
BEND = ("cos_1_s_k2", "sin_1_s_k2")
"""Names of the bend's components."""


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """N += ΔT (d_c R(0) + d_s R(π/2)) + ΔT² (e_c R(0) + e_s R(π/2))."""
    warmer = (env.temperature_degc - p[REFERENCE_TEMPERATURE])[:, None, None]
    plant.damping = plant.damping + warmer * (read_split(p, SLOPE) + warmer * read_split(p, BEND))


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−ΔT (d_c R(0) + d_s R(π/2)) u − ΔT² (e_c R(0) + e_s R(π/2)) u."""
    warmer = (state.temperature_degc - p[REFERENCE_TEMPERATURE])[..., None]
    return -warmer * (u @ read_split(p, SLOPE) + warmer * (u @ read_split(p, BEND)))


def size_next_order(p: Values, mechanics: Mechanics) -> dict[str, float]:
    """|d|²/2νδμ of either component of the bend: that of a turn, or of a growth in proportion.

    Parameters
    ----------
    p
        Values of the effect's parameters.
    mechanics
        The linear resonator.

    Returns
    -------
    dict
        [1/s/K²].

    Examples
    --------
    >>> from hrg_cli.effects.damping_split_temperature import size_next_order
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(5000.0, 1.0, damping_split_1_s=0.1)
    >>> size_next_order({"cos_1_s_k": 0.0, "sin_1_s_k": 0.01}, gyro)
    {'cos_1_s_k2': 0.0005, 'sin_1_s_k2': 0.0005}
    """
    slope = float(np.hypot(p[SLOPE[0]], p[SLOPE[1]]))
    return dict.fromkeys(BEND, size_bend(slope, mechanics.damping_split_1_s))


EFFECT = Effect(
    name="damping_split_temperature",
    family="resonator",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter(SLOPE[0], "s-1 K-1", 1e-4, "slope of νδμ cos 2mθ_μ"),
        Parameter(SLOPE[1], "s-1 K-1", 1e-4, "slope of νδμ sin 2mθ_μ"),
        make_bend(BEND[0], "s-1 K-2", 1e-6, "bend of νδμ cos 2mθ_μ per kelvin squared"),
        make_bend(BEND[1], "s-1 K-2", 1e-6, "bend of νδμ sin 2mθ_μ per kelvin squared"),
        make_reference_temperature(),
    ),
    mistaken_for=("mismatch_temperature", "thermal_damping"),
    next_experiment="runs at rates of both signs and several wave angles, at several temperatures",
    plant=plant,
    slow=slow,
    acts_on="velocity",
    size_next_order=size_next_order,
)
