"""Stiffness lowered by rotation: the centrifugal term.

Physics: in the rotating frame the stiffness loses k_c Ω²; the rotation's own second order,
+K²Ω²/2ω, is in the base model.
Equation: φ̇ = −k_c Ω²/2ω   (PHYSICS M13).
Size: k_c of the order of 1; 0.06 mHz at 500 °/s for 5 kHz. Mistaken for: frequency by temperature,
when runs of different rates differ in temperature. What separates it: rate steps within a run.
"""

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """W −= k_c Ω² I."""
    plant.stiffness = plant.stiffness - (p["coefficient"] * env.rate_rad_s**2)[
        :, None, None
    ] * np.eye(2)


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−j k_c Ω²/2ω u."""
    return (
        -1j
        * (p["coefficient"] * state.rate_rad_s**2 / (2 * state.mechanics.omega_rad_s))[..., None]
        * u
    )


EFFECT = Effect(
    name="centrifugal_stiffness",
    family="resonator",
    page=__doc__,
    parameters=(Parameter("coefficient", "1", 1.0, "k_c of ω² − k_c Ω²"),),
    mistaken_for=("thermal_frequency",),
    next_experiment="a ring-down with steps of the rate within the run",
    plant=plant,
    slow=slow,
    shown_by=("rate steps",),
)
