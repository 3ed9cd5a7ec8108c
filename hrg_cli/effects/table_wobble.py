"""Wobble of the table: eccentric encoder.

Physics: the encoder's angle is wrong once a turn of the *table*, ψ = ∫Ω dt; the wave turns K/m
times as fast, so this is no harmonic of θ.
Equation: Ω_true = Ω (1 + s cos ψ − c sin ψ), an angle error s sin ψ + c cos ψ   (PHYSICS E3).
Size: 1 … 20 arcsec. Mistaken for: harmonics of the wave angle in a short run. What separates it:
several turns, several start angles of the wave.
"""

import numpy as np

from ..physics.plant import Environment, SlowState
from ..physics.resonator import J
from .effect import Array, Effect, Parameter, Values


def environment(p: Values, env: Environment) -> None:
    """The true rate; the log stays."""
    steps = np.diff(env.time_s) * (env.rate_rad_s[1:] + env.rate_rad_s[:-1]) / 2
    angle = np.concatenate([[0.0], np.cumsum(steps)])
    env.rate_rad_s = env.rate_rad_s * (
        1 + p["sin_rad"] * np.cos(angle) - p["cos_rad"] * np.sin(angle)
    )


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """K Ω (s cos ψ − c sin ψ) J u."""
    error = state.rate_rad_s * (
        p["sin_rad"] * np.cos(state.table_angle_rad) - p["cos_rad"] * np.sin(state.table_angle_rad)
    )
    return state.mechanics.scale_factor * error[..., None] * np.einsum("ij,...j->...i", J, u)


EFFECT = Effect(
    name="table_wobble",
    family="bench",
    page=__doc__,
    needs=("half a turn",),
    parameters=(
        Parameter("sin_rad", "rad", 3e-4, "angle error ∝ sin of the table's angle"),
        Parameter("cos_rad", "rad", 3e-4, "angle error ∝ cos of the table's angle"),
    ),
    mistaken_for=("harmonics of the wave angle",),
    next_experiment="several turns of the table from several start angles of the wave",
    environment=environment,
    slow=slow,
)
