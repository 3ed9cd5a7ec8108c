"""Non-orthogonality of the drive electrodes.

Physics: each forcer also pushes ε/2 of its force along the other axis.
Equation: F → F + (ε/2) R(π/2) F; m = 2: 2θ̇ = (ε/2) ν cos 4θ with the amplitude held   (PHYSICS C4).
Size: 1 mrad. Mistaken for: damping split, gain mismatch of the pick-off. What separates it: a free
ring-down against a forced run.
"""

import numpy as np

from ..physics.plant import Control, SlowState
from .effect import Array, Effect, Parameter, Values


def control(p: Values, control: Control) -> None:
    """The matrix from commanded to real force."""
    control.drive_matrix = (
        np.array([[1.0, p["angle_rad"] / 2], [p["angle_rad"] / 2, 1.0]]) @ control.drive_matrix
    )


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """(ε/2) R(π/2) F."""
    return p["angle_rad"] / 2 * state.drive[..., ::-1]


EFFECT = Effect(
    name="drive_nonorthogonality",
    family="control",
    page=__doc__,
    parameters=(Parameter("angle_rad", "rad", 0.01, "electrical angle ε missing to 90°"),),
    mistaken_for=("damping split", "gain_mismatch"),
    next_experiment="a free ring-down beside the forced runs: the drive's drift is absent there",
    control=control,
    slow=slow,
    shown_by=("drive",),
)
