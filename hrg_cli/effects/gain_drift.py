"""Gain of the pick-off that drifts in time, both channels alike.

Physics: amplifiers, references or the polarising voltage warm up or settle; both channels read (1 +
½ g̈ t²) times the motion. A gain that grows evenly, 1 + ġ t, is exactly another ν in a free run and
needs no page of its own.
Equation: u_m = (1 + ½ g̈ t²) u, t from the run's start: an apparent damping −g̈ t and no other
trace   (PHYSICS §8).
Size: 1e-3 … 1e-1 over a run. Mistaken for: in free runs it is exactly a drift of the damping. What
separates it: a driven run, whose force tells what is lost; where the resonator is nonlinear, its
frequency tells the true amplitude.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import Array, Effect, Parameter, Values


def _compute_gain(p: Values, time_s: Array) -> Array:
    """1 + ½ g̈ t² (...)."""
    return 1 + 0.5 * p["curvature_1_s2"] * np.asarray(time_s, float) ** 2


def readout(p: Values, readout: Readout) -> None:
    """y times the gain, sample by sample."""

    def step(block: Samples, y: Array) -> Array:
        return y * _compute_gain(p, block.time_s)

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u times the gain."""
    return u * _compute_gain(p, state.time_s)[..., None]


EFFECT = Effect(
    name="gain_drift",
    family="read-out",
    page=__doc__,
    parameters=(
        Parameter("curvature_1_s2", "s-2", 1e-3, "second derivative of both channels' gain"),
    ),
    mistaken_for=("damping_drift", "nonlinear_damping"),
    next_experiment=(
        "a driven run at the amplitude that is read: the drive that it takes tells the true one"
    ),
    readout=readout,
    slow_readout=slow_readout,
)
