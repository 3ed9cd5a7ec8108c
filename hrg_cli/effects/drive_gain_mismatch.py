"""Gain mismatch of the two drive channels.

Physics: the forcers of C and S have gains 1 + g/2 and 1 − g/2.
Equation: F → F + (g/2) R(0) F; m = 2: 2θ̇ = −(g/2) ν sin 4θ with the amplitude held   (PHYSICS C3).
Size: 1 % → 1.6 °/h at Q = 1e7. Mistaken for: damping split (correlation 0.993 in a forced run).
What separates it: a free ring-down against a forced run.
"""

import numpy as np

from ..physics.plant import Control, SlowState
from .effect import Array, Effect, Parameter, Values


def control(p: Values, control: Control) -> None:
    """The matrix from commanded to real force."""
    control.drive_matrix = np.diag([1 + p["gain"] / 2, 1 - p["gain"] / 2]) @ control.drive_matrix


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """(g/2) R(0) F."""
    return state.drive * np.array([p["gain"] / 2, -p["gain"] / 2])


EFFECT = Effect(
    name="drive_gain_mismatch",
    family="control",
    page=__doc__,
    parameters=(Parameter("gain", "1", 0.01, "relative gain of the C forcer over S"),),
    mistaken_for=("damping split", "electrode_nonorthogonality"),
    next_experiment="a free ring-down beside the forced runs: the drive's drift is absent there",
    control=control,
    slow=slow,
    shown_by=("drive",),
)
