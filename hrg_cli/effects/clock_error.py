"""Error of the sample clock.

Physics: the true time between samples is (1 + ε) times the nominal one, so every rate comes out (1
+ ε) times too large.
Equation: du/dt → (1 + ε) du/dt, with the oscillation itself: f, ν, δω, KΩ all × (1 + ε)   (PHYSICS R12).
Size: 1e-8 … 5e-5. Mistaken for: a change of frequency, damping and scale factor together; exactly
so, when the clock alone times everything. What separates it: an external clock, or a frequency
known otherwise.
"""

import numpy as np

from ..physics.plant import Readout, SlowState
from ..physics.resonator import build_generator
from .effect import Array, Effect, Parameter, Values


def readout(p: Values, readout: Readout) -> None:
    """The converter's clock."""
    readout.clock_error += p["relative"]


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """ε (L + jω_r) u."""
    L = build_generator(state.mechanics, state.rate_rad_s, state.omega_r_rad_s / (2 * np.pi))
    return p["relative"] * (np.einsum("...ij,...j->...i", L, u) + 1j * state.omega_r_rad_s * u)


EFFECT = Effect(
    name="clock_error",
    family="read-out",
    page=__doc__,
    parameters=(Parameter("relative", "1", 1e-6, "relative error ε of the time between samples"),),
    mistaken_for=("table_rate_error", "scale factor", "frequency"),
    next_experiment=(
        "time the runs by an external clock, or record a reference tone of known frequency beside"
        " the channels"
    ),
    readout=readout,
    slow=slow,
    same_as_base=(
        "frequency, damping and scale factor together, as long as one clock times everything"
    ),
    shown_by=("known scale factor",),
)
