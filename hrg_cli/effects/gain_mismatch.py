"""Gain mismatch of the two pick-off channels.

Physics: amplifiers or gaps of C and S differ, so that the channels measure (1 + g/2) C and (1 −
g/2) S.
Equation: E = (g/2) R(0); δθ = −(g/4) sin 4θ, δ ln a = (g/2) cos 4θ   (PHYSICS R1).
Size: 1e-4 … 1e-2. Mistaken for: damping split at 22.5° in every run of one rate (gauge theorem:
(I+E) L (I+E)⁻¹ gives the same data), drive non-orthogonality. What separates it: rotation with both
signs, because its rate error is proportional to Ω.
"""

import numpy as np

from ..physics.plant import Readout, SlowState
from .effect import Array, Effect, Parameter, Values


def readout(p: Values, readout: Readout) -> None:
    """C (1 + g/2), S (1 − g/2), sample by sample."""
    g = p["gain"]
    readout.steps.append(lambda block, y: np.stack([(1 + g / 2) * y[0], (1 - g / 2) * y[1]]))


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u + (g/2) R(0) u."""
    return u * np.array([1 + p["gain"] / 2, 1 - p["gain"] / 2])


EFFECT = Effect(
    name="gain_mismatch",
    family="read-out",
    page=__doc__,
    parameters=(Parameter("gain", "1", 2e-3, "relative gain of C over S"),),
    mistaken_for=("damping split", "drive_nonorthogonality"),
    next_experiment=(
        "ring-downs on the rotating table at +Ω and −Ω: its rate error changes sign with Ω, the"
        " split's does not"
    ),
    readout=readout,
    slow_readout=slow_readout,
    shown_by=("another rate",),
)
