"""Phase (delay) mismatch of the two pick-off channels.

Physics: the channels' filters delay C and S differently; a delay δt is a phase ψ = ω δt of the
envelope.
Equation: C → C e^{+jψ/2}, S → S e^{−jψ/2}, E = ½jψ R(0); δr = (ψ/2) sin 2mθ   (PHYSICS R4).
Size: 1e-5 … 1e-3 rad. Mistaken for: frequency split (rotating at one rate), finite quadrature gain.
What separates it: rotation with both signs, or the wave at 45° of the pattern with the split known.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import Array, Effect, Parameter, Values


def readout(p: Values, readout: Readout) -> None:
    """Each channel turned by ±ψ/2 in phase: y cos + (v/ω) sin."""
    half = p["phase_rad"] / 2

    def step(block: Samples, y: Array) -> Array:
        sign = np.array([[1.0], [-1.0]])
        return y * np.cos(half) + sign * np.sin(half) * block.v_over_omega

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """(C e^{jψ/2}, S e^{−jψ/2})."""
    return u * np.exp(0.5j * p["phase_rad"] * np.array([1.0, -1.0]))


EFFECT = Effect(
    name="phase_mismatch",
    family="read-out",
    page=__doc__,
    parameters=(Parameter("phase_rad", "rad", 1e-3, "phase of C against S"),),
    mistaken_for=("frequency split", "finite_quadrature_gain"),
    next_experiment=(
        "ring-downs on the table at +Ω and −Ω: a delay's quadrature stands still in θ, a frequency"
        " split's grows in time"
    ),
    readout=readout,
    slow_readout=slow_readout,
    shown_by=("another rate",),
)
