"""Anisotropic cubic stiffness: a quartic potential with four-fold symmetry in the electrical angle.

Physics: V = (h/4) Re[(X + jY)⁴ e^{−4jmθ₈}]: electrodes or an uneven rim stiffen some directions
with displacement.
Equation: φ̇ = (3h/8ω) a² cos 4m(θ − θ₈), ȧ_B = (3h/8ω) a³ sin 4m(θ − θ₈): 8θ for m = 2   (PHYSICS M5).
The parameters are (3h/8ω) cos 4mθ₈ and (3h/8ω) sin 4mθ₈, rad/s at unit amplitude. Size: 1 … 10 % of
the isotropic cubic. Mistaken for: pick-off cubic (8θ of the angle itself), second order of the
frequency split (not ∝ a²). What separates it: ring-downs at five angles or more and at two
amplitudes.
"""

import numpy as np

from ..physics.plant import POLYNOMIAL, Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """z'' −= h (cos 4mθ₈ ∇Re + sin 4mθ₈ ∇Im)(x + jy)⁴/4."""
    factor = 8 * plant.mechanics.omega_rad_s / 3
    plant.polynomial[POLYNOMIAL.index("quartic_c")] -= factor * p["cos_rad_s"]
    plant.polynomial[POLYNOMIAL.index("quartic_s")] -= factor * p["sin_rad_s"]


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """j[(3h/8ω) cos·F + (3h/8ω) sin·G]·4/3, F and G the fundamental of the two gradients."""
    c, s = u[..., 0], u[..., 1]
    c2, s2 = np.abs(c) ** 2, np.abs(s) ** 2
    c_part = c2 * c - 2 * s2 * c - s**2 * np.conj(c)
    s_part = s2 * s - 2 * c2 * s - c**2 * np.conj(s)
    F, G = np.stack([c_part, s_part], -1), np.stack([-s_part, c_part], -1)
    return 1j * (p["cos_rad_s"] * F + p["sin_rad_s"] * G)


EFFECT = Effect(
    name="anisotropic_cubic_stiffness",
    family="resonator",
    page=__doc__,
    parameters=(
        Parameter(
            "cos_rad_s", "rad s-1", 3e-3, "(3h/8ω) cos 4mθ₈ at unit amplitude", amplitude_power=-2
        ),
        Parameter(
            "sin_rad_s", "rad s-1", 3e-3, "(3h/8ω) sin 4mθ₈ at unit amplitude", amplitude_power=-2
        ),
    ),
    mistaken_for=("pickoff_nonlinearity",),
    next_experiment="ring-downs at five wave angles or more and at two amplitudes",
    plant=plant,
    slow=slow,
    nonlinear_force=True,
    part_of=("cubic_stiffness", "inertial_nonlinearity"),
)
