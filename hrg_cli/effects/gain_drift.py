"""Gain of the pick-off that drifts in time, both channels alike.

Physics: amplifiers, references or the polarising voltage warm up or settle; both channels read
(1 + ġ t + ½ g̈ t²) times the motion.
Equation: u_m = (1 + ġ t + ½ g̈ t²) u, t from the run's start: an apparent damping −ġ − g̈ t and no
other trace   (PHYSICS §8).
Size: 1e-3 … 1e-1 over a run. Mistaken for: in free runs the slope is exactly a part of ν and the
curvature exactly a drift of the damping. What separates it: a driven run, whose force tells what is
lost; where the resonator is nonlinear, its frequency tells the true amplitude.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import Array, Effect, Parameter, Values


def gain(p: Values, time_s: Array) -> Array:
    """1 + ġ t + ½ g̈ t² (...)."""
    t = np.asarray(time_s, float)
    return 1 + t * (p["slope_1_s"] + 0.5 * p["curvature_1_s2"] * t)


def readout(p: Values, readout: Readout) -> None:
    """y times the gain, sample by sample."""

    def step(block: Samples, y: Array) -> Array:
        return y * gain(p, block.time_s)

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u times the gain."""
    return u * gain(p, state.time_s)[..., None]


EFFECT = Effect(
    name="gain_drift",
    family="read-out",
    page=__doc__,
    parameters=(
        Parameter("slope_1_s", "s-1", 1e-3, "relative change of both gains a second"),
        Parameter("curvature_1_s2", "s-2", 1e-3, "change of that a second"),
    ),
    mistaken_for=("damping", "damping_drift"),
    next_experiment=(
        "a driven run at the amplitude that is read: the drive that it takes tells the true one"
    ),
    readout=readout,
    slow_readout=slow_readout,
)
