"""Isotropic cubic stiffness (Duffing).

Physics: the spring hardens or softens with displacement, z'' = … − κ|z|² z.
Equation: u' = (jκ/8ω)[2(u†u) u + (uᵀu) u*]; φ̇ = 3κ(a_A² + a_B²)/8ω, 2θ̇ = −κ a_A a_B/4ω   (PHYSICS M4),
and to second order, for the fundamental of the motion, u' += −(jκ²/ω³)[S² u/32 − 3|q|² u/256 + 5 S
q u*/128], S = u†u, q = uᵀu: a line is slower by 15κ²a⁴/256ω³ (Lindstedt), a circle by κ²(a_A² +
a_B²)²/32ω³ (exact: Ω² = ω² + κr²). The parameter is the frequency pull 3κ/8ω in rad/s at unit
amplitude. Size: 0.01 … 10 mHz at the working amplitude. Mistaken for: temperature drift of the
frequency, inertial nonlinearity (same pull, another precession). What separates it: two amplitudes
with quadrature present.
"""

import numpy as np

from ..physics.plant import POLYNOMIAL, Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values, find_invariants


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """z'' −= κ|z|² z with κ = 8ω/3 times the pull."""
    plant.polynomial[POLYNOMIAL.index("r2_z")] -= (
        8 * plant.mechanics.omega_rad_s / 3 * p["pull_rad_s"]
    )


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """(j pull/3)[2(u†u) u + (uᵀu) u*] and the second order, κ²/ω³ = 64 pull²/9ω."""
    size, square = find_invariants(u)
    first = p["pull_rad_s"] / 3 * (2 * size * u + square * np.conj(u))
    own, mirrored = size**2 / 32 - 3 * np.abs(square) ** 2 / 256, 5 * size * square / 128
    second = (
        64
        * p["pull_rad_s"] ** 2
        / (9 * state.mechanics.omega_rad_s)
        * (own * u + mirrored * np.conj(u))
    )
    return 1j * (first - second)


EFFECT = Effect(
    name="cubic_stiffness",
    family="resonator",
    page=__doc__,
    parameters=(
        Parameter(
            "pull_rad_s",
            "rad s-1",
            0.01,
            "frequency pull 3κ/8ω at unit amplitude",
            amplitude_power=-2,
        ),
    ),
    mistaken_for=("thermal_frequency", "inertial_nonlinearity"),
    next_experiment=(
        "ring-downs from two amplitudes at one temperature, with the quadrature loop off so that"
        " quadrature is present"
    ),
    plant=plant,
    slow=slow,
    nonlinear_force=True,
)
