"""Quadrature cross-talk between the pick-off channels.

Physics: stray coupling through a capacitance adds to each channel the other one turned by 90° of
phase.
Equation: E = j(ε_q/2) R(π/2); δr = −(ε_q/2) cos 2mθ   (PHYSICS R5).
Size: 1e-5 … 1e-3.
Mistaken for: frequency split (rotating at one rate). What separates it: rotation with both signs.
"""

from ..physics.plant import Readout, SlowState
from .effect import Array, Effect, Parameter, Values


def readout(p: Values, readout: Readout) -> None:
    """y + (ε_q/2)·(v/ω of the other channel)."""
    half = p["coupling"] / 2
    readout.steps.append(lambda block, y: y + half * block.v_over_omega[::-1])


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u + j(ε_q/2) R(π/2) u."""
    return u + 0.5j * p["coupling"] * u[..., ::-1]


EFFECT = Effect(
    name="quadrature_crosstalk",
    family="read-out",
    page=__doc__,
    parameters=(Parameter("coupling", "1", 1e-3, "part of the other channel, 90° ahead"),),
    mistaken_for=("frequency split",),
    next_experiment=(
        "ring-downs on the table at +Ω and −Ω: cross-talk's quadrature stands still in θ, a"
        " frequency split's grows in time"
    ),
    readout=readout,
    slow_readout=slow_readout,
    shown_by=("another rate",),
)
