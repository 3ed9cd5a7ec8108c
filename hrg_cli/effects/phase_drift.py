"""Phase between the channels that drifts in time.

Physics: the delay of one channel's electronics changes while they warm up: C is seen earlier and S
later by a phase that grows, ψ = ψ̇ t. Equation: C → C e^{+jψ̇t/2}, S → S e^{−jψ̇t/2}, t from the
run's start. Of a resonator at rest on the table this adds the generator
(jψ̇/2) R(0): exactly a frequency split of ψ̇/2 along C and S; under rotation K Ω J turns with e^{jψ̇t}, what no split does   (PHYSICS §8).
Size: 1e-7 … 1e-3 rad/s. Mistaken for: frequency split (exactly, without other anisotropy), phase
mismatch over a short run. What separates it: rotation; long runs.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import Array, Effect, Parameter, Values


def readout(p: Values, readout: Readout) -> None:
    """Each channel turned by ±ψ̇t/2 in phase: y cos + (v/ω) sin, sample by sample."""

    def step(block: Samples, y: Array) -> Array:
        half = np.array([[0.5], [-0.5]]) * p["slope_rad_s"] * block.time_s
        return y * np.cos(half) + block.v_over_omega * np.sin(half)

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """(C e^{jψ̇t/2}, S e^{−jψ̇t/2})."""
    return u * np.exp(
        0.5j * p["slope_rad_s"] * np.asarray(state.time_s)[..., None] * np.array([1.0, -1.0])
    )


EFFECT = Effect(
    name="phase_drift",
    family="read-out",
    page=__doc__,
    parameters=(
        Parameter("slope_rad_s", "rad s-1", 1e-3, "change of the phase of C against S per second"),
    ),
    mistaken_for=("frequency split", "phase_mismatch"),
    next_experiment=(
        "long ring-downs on the rotating table: the drift turns what rotation does, a frequency"
        " split adds to it"
    ),
    readout=readout,
    slow_readout=slow_readout,
)
