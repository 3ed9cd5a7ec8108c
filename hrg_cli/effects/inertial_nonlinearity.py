"""Inertial (geometric) nonlinearity: the spherical pendulum and its kin.

Physics: a mass on a sphere of radius ℓ: z'' = −ω² z − |v|² z/ℓ² + ω²|z|² z/2ℓ² (the constraint's
reaction, to third order). Equation: u' = j(ω/ℓ²)[⅛ (u†u) u − 3/16 (uᵀu) u*]; φ̇ = −ω(a_A² +
a_B²)/16ℓ² with a_B = 0, Airy's precession mθ̇ = ±⅜ ω a_A a_B/ℓ² (PHYSICS §7); to second order u' +=
j(ω/ℓ⁴)[7S² u/128 − 69|q|² u/1024 − 13 S q u*/512], S = u†u, q = uᵀu. The parameter is 1/ℓ². Size:
pendulum: (amplitude/length)²; shells: 1e-4 … 1e-2 of (1/gap)². Mistaken for: cubic stiffness (same
pull, a third of the precession and of opposite sign relative to it), frequency drift. What
separates it: frequency pull and precession together: their ratio.
"""

import numpy as np

from ..physics.plant import POLYNOMIAL, Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values, find_displacement, find_invariants


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """z'' += (−|v|² + ½ω²|z|²) z/ℓ²."""
    curvature = p["inverse_length_squared"]
    plant.polynomial[POLYNOMIAL.index("v2_z")] -= curvature
    plant.polynomial[POLYNOMIAL.index("r2_z")] += plant.mechanics.omega_rad_s**2 * curvature / 2


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """j(ω/ℓ²)[(w†w/4 − u†u/8) u − (wᵀw/8 + uᵀu/16) u*], w the velocity's envelopes, and the second
    order."""
    (fast, turning), u = find_invariants(u), find_displacement(u, state)
    size, square = find_invariants(u)
    curvature = p["inverse_length_squared"]
    first = (fast / 4 - size / 8) * u - (turning / 8 + square / 16) * np.conj(u)
    own, mirrored = 7 * size**2 / 128 - 69 * np.abs(square) ** 2 / 1024, 13 * size * square / 512
    return (
        1j
        * state.mechanics.omega_rad_s
        * curvature
        * (first + curvature * (own * u - mirrored * np.conj(u)))
    )


EFFECT = Effect(
    name="inertial_nonlinearity",
    family="resonator",
    page=__doc__,
    parameters=(
        Parameter(
            "inverse_length_squared", "amplitude-2", 1e-5, "1/ℓ²", amplitude_power=-2, minimum=0.0
        ),
    ),
    mistaken_for=("cubic_stiffness", "thermal_frequency"),
    next_experiment=(
        "ring-downs of different quadrature at one amplitude: precession against pull tells it from"
        " the elastic cubic"
    ),
    plant=plant,
    slow=slow,
    acts_on="velocity",
    nonlinear_force=True,
)
