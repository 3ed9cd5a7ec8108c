"""Damping that drifts in time.

Physics: the vacuum or the suspension changes during the run, ν = ν₀ + ν̇ t + κ t².
Equation: d ln a/dt = −ν̇ t − κ t², t from the run's start   (PHYSICS M11, §6 ν_t); of what grows in
proportion, κ = ν̇²/2ν₀.
Size: 1e-3 … 1e-1 of ν over a run. Mistaken for: nonlinear damping (curvature of ln a in a², not in
t), thermal damping on one ramp. What separates it: ring-downs from two amplitudes at one
temperature.
"""

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from ..physics.resonator import Mechanics
from .bent_laws import make_bend
from .effect import Array, Effect, Parameter, Values, size_bend

BEND = "bend_1_s3"
"""Name of the bend."""


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """N += (ν̇ t + κ t²) I."""
    plant.damping = plant.damping + _change(p, env.time_s)[:, None, None] * np.eye(2)


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−(ν̇ t + κ t²) u."""
    return -_change(p, state.time_s)[..., None] * u


def _change(p: Values, time_s: Array) -> Array:
    return time_s * (p["slope_1_s2"] + p.get(BEND, 0.0) * time_s)


def size_next_order(p: Values, mechanics: Mechanics) -> dict[str, float]:
    """κ = ν̇²/2ν, as of a damping that grows in proportion.

    Parameters
    ----------
    p
        Values of the effect's parameters.
    mechanics
        The linear resonator.

    Returns
    -------
    dict
        [1/s³].

    Examples
    --------
    >>> from hrg_cli.effects.damping_drift import size_next_order
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> size_next_order({"slope_1_s2": 0.5}, Mechanics(5000.0, 0.25))
    {'bend_1_s3': 0.5}
    """
    return {BEND: size_bend(p["slope_1_s2"], mechanics.damping_rate_1_s)}


EFFECT = Effect(
    name="damping_drift",
    family="resonator",
    page=__doc__,
    parameters=(
        Parameter("slope_1_s2", "s-2", 1e-3, "change of ν per second"),
        make_bend(BEND, "s-3", 1e-4, "bend of ν per second squared"),
    ),
    mistaken_for=("nonlinear_damping", "thermal_damping"),
    next_experiment=(
        "ring-downs from two amplitudes at one temperature: a drift follows time, nonlinear damping"
        " follows a²"
    ),
    plant=plant,
    slow=slow,
    acts_on="velocity",
    size_next_order=size_next_order,
)
