"""Gain of the pick-off that follows temperature, both channels alike.

Physics: the gap, the polarising voltage or the amplifiers drift with temperature; both channels
read (1 + g (T − T₀)) times the motion.
Equation: u_m = (1 + g (T − T₀)) u: an apparent damping −g dT/dt and no other trace   (PHYSICS §8).
Size: 1e-5 … 1e-3 per K. Mistaken for: thermal damping, damping drift, ageing on one ramp. What
separates it: it follows dT/dt, thermal damping T itself: a ramp up and one down through the same
temperatures; where the resonator is nonlinear, its frequency tells the true amplitude.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import (
    REFERENCE_TEMPERATURE,
    Array,
    Effect,
    Parameter,
    Values,
    make_reference_temperature,
)


def readout(p: Values, readout: Readout) -> None:
    """y (1 + g (T − T₀)), sample by sample."""

    def step(block: Samples, y: Array) -> Array:
        return y * (1 + p["relative_1_k"] * (block.temperature_degc - p[REFERENCE_TEMPERATURE]))

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u + g (T − T₀) u."""
    return (
        u
        + p["relative_1_k"]
        * (np.asarray(state.temperature_degc) - p[REFERENCE_TEMPERATURE])[..., None]
        * u
    )


EFFECT = Effect(
    name="gain_temperature",
    family="read-out",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter("relative_1_k", "K-1", 1e-3, "relative gain of both channels per kelvin"),
        make_reference_temperature("temperature at which the gain is 1"),
    ),
    mistaken_for=("thermal_damping", "damping_drift"),
    next_experiment=(
        "ring-downs on a temperature ramp up and on one down: the apparent damping of a gain"
        " changes its sign with the ramp"
    ),
    readout=readout,
    slow_readout=slow_readout,
)
