"""Rotation of the drive electrodes against the pick-off.

Physics: the forcers stand at an angle ρ (physical) from the pick-off electrodes.
Equation: F → rotation of F by the electrical angle mρ; mθ̇ = ν mρ with the amplitude held: a constant rate   (PHYSICS C5).
Size: 1 mrad → 0.65 °/h at Q = 1e7. Mistaken for: rate bias, the Earth's rate. What separates it: a
free ring-down against a forced run; the axis turned over.
"""

import numpy as np

from ..physics.plant import Control, SlowState
from .effect import Array, Effect, Parameter, Values


def control(p: Values, control: Control) -> None:
    """The matrix from commanded to real force."""
    cos, sin = np.cos(p["electrical_angle_rad"]), np.sin(p["electrical_angle_rad"])
    control.drive_matrix = np.array([[cos, -sin], [sin, cos]]) @ control.drive_matrix


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """(rotation − 1) F."""
    cos, sin = np.cos(p["electrical_angle_rad"]), np.sin(p["electrical_angle_rad"])
    return np.einsum("ij,...j->...i", np.array([[cos - 1, -sin], [sin, cos - 1]]), state.drive)


EFFECT = Effect(
    name="drive_rotation",
    family="control",
    page=__doc__,
    parameters=(
        Parameter(
            "electrical_angle_rad",
            "rad",
            0.01,
            "electrical angle mρ from the pick-off to the drive electrodes",
        ),
    ),
    mistaken_for=("rate_bias",),
    next_experiment=(
        "a free ring-down beside the forced run, or the forced run with the axis turned over"
    ),
    control=control,
    slow=slow,
    shown_by=("drive",),
)
