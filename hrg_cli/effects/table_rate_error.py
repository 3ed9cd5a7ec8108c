"""Scale error of the table's rate.

Physics: the true rate is (1 + ε) times the logged one.
Equation: mθ̇ = −K(1 + ε)Ω: exactly a change of the scale factor   (PHYSICS E2).
Size: 1 … 10 ppm. Mistaken for: the scale factor, in every experiment on that table. What separates
it: whole turns counted by an optical mark.
"""

import numpy as np

from ..physics.plant import Environment, SlowState
from ..physics.resonator import J
from .effect import Array, Effect, Parameter, Values


def environment(p: Values, env: Environment) -> None:
    """True rate = (1 + ε) logged."""
    env.rate_rad_s = env.rate_rad_s * (1 + p["relative"])


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """K ε Ω J u."""
    return (
        state.mechanics.scale_factor
        * p["relative"]
        * state.rate_rad_s[..., None]
        * np.einsum("ij,...j->...i", J, u)
    )


EFFECT = Effect(
    name="table_rate_error",
    family="bench",
    page=__doc__,
    parameters=(Parameter("relative", "1", 1e-4, "relative error ε of the table's rate"),),
    mistaken_for=("scale factor", "clock_error"),
    next_experiment=(
        "count whole turns of the table by an optical mark over a long run; nothing else tells it"
        " from the scale factor"
    ),
    environment=environment,
    slow=slow,
    same_as_base="the scale factor: exactly the same in every run on that table",
    same_as_parameter="scale_factor",
    shown_by=("known scale factor",),
)
