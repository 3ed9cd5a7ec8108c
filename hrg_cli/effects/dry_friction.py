"""Dry friction: a force of constant size against the motion.

Physics: a suspension that rubs, a joint or knife edge of a pendulum, a loose electrode: force
−f·ż/|ż|, f an acceleration. Equation: averaged over a period, u' = −(f/ω) G [u/2 − Q (uᵀu) u*],
with the arithmetic–geometric mean M: G = 1/M(a_A, |a_B|) and Q (a_A² − a_B²)² = Σ 2^{n−1} c_n², n ≥
1, c_n the differences of that mean (complete elliptic integrals). So ȧ_A = −(f/ω) a_A ⟨sin²/ρ⟩ and
ȧ_B = −(f/ω) a_B ⟨cos²/ρ⟩, ρ² = a_A² sin² + a_B² cos²: a line swings down by 2f/(πω) per second
whatever its amplitude, a circle by f/2ω. The quadrature of a slim ellipse dies ln(4a_A/|a_B|) − 1
times as fast as the main wave, relatively: the ellipse narrows; it does not turn. Size: 1e-4 … 1e-1
of ν a. Source: the averaging of Krylov and Bogoliubov; the mean of Gauss for the elliptic integrals
(textbook). Mistaken for: nonlinear damping of a negative power (a constant pull is the power −1,
but narrows nothing), drift of the damping. What separates it: the end of a ring-down, which is
straight in a, not in ln a, and then stops; damping ∝ a² bends ln a the other way.
"""

import functools
import math

import numpy as np

from ..physics.plant import Acceleration, Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values

SLIM = 1e-12
"""Least ratio |a_B|/a_A in the mean, below which a line is a line to rounding."""
ROUNDS = 8
"""Steps of the arithmetic–geometric mean, which doubles its digits at each."""


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """z'' −= f v/|v|, f = πω/2 times the slope of a line's amplitude."""
    size = math.pi / 2 * plant.mechanics.omega_rad_s * p["slope_1_s"]
    if size != 0:
        plant.accelerate(_make_friction(size))


@functools.lru_cache(maxsize=16)
def _make_friction(size: float) -> Acceleration:
    """−size v/|v|; one object a size, so that it is compiled once for all runs."""

    def acceleration(t: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
        speed = math.sqrt(vx * vx + vy * vy)
        if speed == 0.0:
            return 0.0, 0.0
        return -size * vx / speed, -size * vy / speed

    return acceleration


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−(π/2)·slope·G [u/2 − Q (uᵀu) u*]."""
    # friction knows no size of the motion: over its own, a run that has died away is no exception
    size = np.linalg.norm(u, axis=-1, keepdims=True)
    u = u / np.where(size > 0, size, 1.0)
    square = np.sum(u**2, axis=-1, keepdims=True)
    main = np.sqrt((1 + np.abs(square)) / 2)
    side = np.abs(np.imag(u[..., :1] * np.conj(u[..., 1:]))) / main
    G, Q = compute_means(main, np.maximum(side, SLIM * main))
    return -np.pi / 2 * p["slope_1_s"] * G * (u / 2 - Q * square * np.conj(u))


def compute_means(a: Array, b: Array) -> tuple[Array, Array]:
    """Means of 1/ρ over a turn of an ellipse, ρ² = a² sin² + b² cos².

    G = 1/M(a, b) = ⟨1/ρ⟩, and Q with ⟨sin²/ρ⟩, ⟨cos²/ρ⟩ = G(½ ∓ Q(a² − b²)).

    Parameters
    ----------
    a, b
        Half axes (...) in any unit, a ≥ b > 0.

    Returns
    -------
    tuple of ndarray
        G in 1/unit and Q in 1/unit².

    Examples
    --------
    A circle of radius 2:

    >>> import numpy as np
    >>> from hrg_cli.effects.dry_friction import compute_means
    >>> G, _ = compute_means(np.array(2.0), np.array(2.0))
    >>> float(G)
    0.5
    """
    # every difference after the first is taken over a² − b², so that a circle is no exception
    over = 1 / (2 * (a + b))
    gap, Q, weight = a**2 - b**2, over**2, 1.0
    x, y = (a + b) / 2, np.sqrt(a * b)
    for _ in range(ROUNDS):
        # c' = c²/4x' with c' the next difference
        x, y, over = (x + y) / 2, np.sqrt(x * y), over**2 * gap / (2 * (x + y))
        weight *= 2
        Q = Q + weight * over**2
    return 1 / x, Q


EFFECT = Effect(
    name="dry_friction",
    family="resonator",
    page=__doc__,
    parameters=(
        Parameter(
            "slope_1_s",
            "amplitude s-1",
            1e-3,
            "amplitude that a line loses per second, 2f/πω",
            amplitude_power=1,
            minimum=0.0,
        ),
    ),
    mistaken_for=("nonlinear_damping", "damping_drift"),
    next_experiment=(
        "a ring-down to the very end: dry friction is straight in the amplitude and stops, every"
        " other damping has a tail"
    ),
    plant=plant,
    slow=slow,
    nonlinear_force=True,
    acts_on="velocity",
)
