"""Phase error of the quadrature drive.

Physics: the force that nulls the quadrature is late by Δφ_B; part of it then turns the wave.
Equation: 2θ̇ = +δω sin ζ·Δφ_B with the quadrature held at zero; F_B → F_B e^{−jΔφ_B}   (PHYSICS C1; seed A (8), third term).
Size: 1 mrad … 10 mrad. Mistaken for: damping split. What separates it: the quadrature loop switched
off; a test tone in the loop.
"""

import numpy as np

from ..physics.plant import Control, SlowState
from .effect import Array, Effect, Parameter, Values, find_frame, project


def control(p: Values, control: Control) -> None:
    """Δφ_B."""
    control.quadrature_phase_error_rad += p["phase_rad"]


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """(e^{−jΔφ_B} − 1) (F·e_B) e_B."""
    e_B = find_frame(u, state.phase_rad)[2]
    return (np.exp(-1j * p["phase_rad"]) - 1) * project(state.drive, e_B) * e_B


EFFECT = Effect(
    name="quadrature_drive_phase_error",
    family="control",
    page=__doc__,
    parameters=(Parameter("phase_rad", "rad", 5e-3, "lag Δφ_B of the quadrature force"),),
    mistaken_for=("damping split", "drive_gain_mismatch"),
    next_experiment=(
        "the same forced run with the quadrature loop off, or a test tone in the quadrature loop"
    ),
    control=control,
    slow=slow,
    shown_by=("drive",),
)
