"""Non-orthogonality of the pick-off electrodes.

Physics: the electrodes of S do not stand at 90°/m from those of C; each channel sees ε/2 of the
other.
Equation: E = (ε/2) R(π/2); m = 2: δθ = (ε/4) cos 4θ, δ ln a = (ε/2) sin 4θ   (PHYSICS R2).
Size: 0.05 … 1 mrad. Mistaken for: damping split at 0 or 45° in every run of one rate, drive gain
mismatch. What separates it: rotation with both signs.
"""

from ..physics.plant import Readout, SlowState
from .effect import Array, Effect, Parameter, Values


def readout(p: Values, readout: Readout) -> None:
    """C + (ε/2) S, S + (ε/2) C, sample by sample."""
    half = p["angle_rad"] / 2
    readout.steps.append(lambda block, y: y + half * y[::-1])


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u + (ε/2) R(π/2) u."""
    return u + p["angle_rad"] / 2 * u[..., ::-1]


EFFECT = Effect(
    name="electrode_nonorthogonality",
    family="read-out",
    page=__doc__,
    parameters=(Parameter("angle_rad", "rad", 1e-3, "electrical angle ε missing to 90°"),),
    mistaken_for=("damping split", "drive_gain_mismatch"),
    next_experiment=(
        "ring-downs on the rotating table at +Ω and −Ω: their rate error changes sign with Ω, the"
        " split's does not"
    ),
    readout=readout,
    slow_readout=slow_readout,
    shown_by=("another rate",),
)
