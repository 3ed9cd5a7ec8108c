"""Gain of a channel, or of both, that changes at an instant.

Physics: a range is switched, a contact or the polarising voltage gives way: from t_k on a channel
reads (1 + g) times the motion, which itself goes on undisturbed.
Equation: C → (1 + g_C) C, S → (1 + g_S) S for t > t_k   (PHYSICS R1, from an instant on).
Size: 1e-4 … 1e-1. The parameters are the relative steps of the two channels. Mistaken for: a knock
along the wave's line, which changes the motion as well; a run put together from two. What separates
it: both channels keep their phase, where a knock turns them alike; a gain of one channel is a gain
mismatch from there on; where the resonator is nonlinear its frequency tells that the amplitude
stayed.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import Array, Effect, Parameter, Values
from .envelope_jumps import find_own_runs, find_part_after, list_instants, make_run_parameter


def _read_steps(p: Values) -> Array:
    """Relative steps of the gain (2,)."""
    return np.array([p["c_gain"], p["s_gain"]])


def readout(p: Values, readout: Readout) -> None:
    """y (1 + g) from t_k on, sample by sample."""

    def step(block: Samples, y: Array) -> Array:
        return y * (1 + _read_steps(p)[:, None] * (np.asarray(block.time_s) > p["time_s"]))

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u (1 + g r), r the part of a row's length after t_k, in the run that it happens in."""
    part = find_part_after(np.asarray(state.time_s), p["time_s"]) * find_own_runs(p, state)
    return u * (1 + part[..., None] * _read_steps(p))


EFFECT = Effect(
    name="gain_step",
    family="read-out",
    page=__doc__,
    parameters=(
        Parameter("c_gain", "1", 1e-3, "relative step of the gain of C"),
        Parameter("s_gain", "1", 1e-3, "relative step of the gain of S"),
        Parameter("time_s", "s", 0.5, "instant of the step", fitted=False, required=True),
        make_run_parameter(),
    ),
    mistaken_for=("momentum_kick",),
    next_experiment="the same run with a test tone added to both channels before the amplifiers",
    readout=readout,
    slow_readout=slow_readout,
    starts=list_instants,
)
