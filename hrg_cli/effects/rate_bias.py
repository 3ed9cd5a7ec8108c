"""Constant error of the logged rate: Earth rate left out, misaligned axis.

Physics: the true rate is the logged one plus b.
Equation: mθ̇ = −K(Ω + b)   (PHYSICS E1).
Size: 1e-9 … 1e-3 rad/s. Mistaken for: drive rotation in a forced run, circulatory damping. What
separates it: the axis turned over; free runs.
"""

import numpy as np

from ..physics.plant import Environment, SlowState
from ..physics.resonator import J
from .effect import Array, Effect, Parameter, Values


def environment(p: Values, env: Environment) -> None:
    """True rate = logged + b."""
    env.rate_rad_s = env.rate_rad_s + p["rate_rad_s"]


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """K b J u."""
    return state.mechanics.scale_factor * p["rate_rad_s"] * np.einsum("ij,...j->...i", J, u)


EFFECT = Effect(
    name="rate_bias",
    family="bench",
    page=__doc__,
    parameters=(Parameter("rate_rad_s", "rad s-1", 1e-3, "true rate less logged rate"),),
    mistaken_for=("drive_rotation",),
    next_experiment=(
        "the same run with the axis turned over: an external rate changes sign, a drift of the gyro"
        " does not"
    ),
    environment=environment,
    slow=slow,
)
