"""Gain of the drive.

Physics: the forcers of C and S both act 1 + g times as hard as the commands say (volts taken for
forces, an amplifier off its calibration).
Equation: F → F + g F; the amplitude is held where (1 + g) F = ν a, so that a driven run alone shows
ν/(1 + g) for the damping   (PHYSICS C3, its part that is common to both channels).
Size: 1 % → a damping 1 % off; no drift. Mistaken for: damping (the same in a run of one
amplitude). What separates it: a free ring-down against a forced run.
"""

from ..physics.plant import Control, SlowState
from .effect import Array, Effect, Parameter, Values


def control(p: Values, control: Control) -> None:
    """The matrix from commanded to real force."""
    control.drive_matrix = (1 + p["gain"]) * control.drive_matrix


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """g F."""
    return p["gain"] * state.drive


EFFECT = Effect(
    name="drive_gain",
    family="control",
    page=__doc__,
    parameters=(Parameter("gain", "1", 0.01, "relative excess of both forces over the commands"),),
    mistaken_for=("damping",),
    next_experiment="a free ring-down beside the forced runs: it decays by the damping alone",
    control=control,
    slow=slow,
    shown_by=("drive",),
)
