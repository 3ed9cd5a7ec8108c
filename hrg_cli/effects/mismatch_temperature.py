"""Gain mismatch of the two channels that follows temperature.

Physics: the two channels' gaps or amplifiers drift apart with temperature, C reads 1 + g (T − T₀)/2
and S 1 − g (T − T₀)/2.
Equation: E = (g/2)(T − T₀) R(0): δθ = −(g/4)(T − T₀) sin 4θ, δ ln a = (g/2)(T − T₀) cos 4θ for m = 2   (PHYSICS R1 and §8: the gauge
theorem's gain, which moves with T). Size: 1e-5 … 1e-3 per K. Mistaken for: the damping split's own
dependence on temperature, split_temperature, a constant gain mismatch in runs of one temperature.
What separates it: it moves with dT/dt in a run that does not rotate; rotation with both signs at
two temperatures.
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
    """C (1 + g ΔT/2), S (1 − g ΔT/2), sample by sample."""

    def step(block: Samples, y: Array) -> Array:
        half = p["relative_1_k"] / 2 * (block.temperature_degc - p[REFERENCE_TEMPERATURE])
        return np.stack([y[0] * (1 + half), y[1] * (1 - half)])

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u + (g/2)(T − T₀) R(0) u."""
    warmer = np.asarray(state.temperature_degc) - p[REFERENCE_TEMPERATURE]
    return u + p["relative_1_k"] / 2 * warmer[..., None] * (np.array([1.0, -1.0]) * u)


EFFECT = Effect(
    name="mismatch_temperature",
    family="read-out",
    page=__doc__,
    needs=("temperature",),
    parameters=(
        Parameter("relative_1_k", "K-1", 1e-3, "relative gain of C over S per kelvin"),
        make_reference_temperature("temperature at which the gains are equal"),
    ),
    mistaken_for=("gain_mismatch", "split_temperature"),
    next_experiment="ring-downs on a temperature ramp, and at +Ω and −Ω at both of its ends",
    readout=readout,
    slow_readout=slow_readout,
)
