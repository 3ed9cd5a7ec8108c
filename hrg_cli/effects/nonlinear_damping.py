"""Damping that grows with a power of the displacement, by default its square.

Physics: z'' = … − 2ν₂|z|² v (gap squeeze film, contact, nonlinear loss); another `power` p: z'' = …
− 2c|z|^p v (p = 1: drag that grows with the swing).
Equation: u' = −ν₂[½(u†u) u − ¼(uᵀu) u*]; d ln a_A/dt = −ν₂(a_A² + 3a_B²)/4, d ln a_B/dt = −ν₂(3a_A² + a_B²)/4   (PHYSICS M6);
of any power, u' = 2jc⟨|z|^p v e^{−jτ}⟩ over a period, z = Re u e^{jτ}, v = Re ju e^{jτ}, so
u' = −c[⟨|z|^p⟩ u − ⟨|z|^p e^{−2jτ}⟩ u*], which is −c N_p a^p u for a_B = 0,
N_p = 2⟨|cos|^p sin²⟩ = 2Γ((p+1)/2)/√π(p+2)Γ(p/2+1), N₂ = ¼. The parameter is the damping c N_p it
adds at unit amplitude (ν₂/4 for p = 2). A negative power stands for a regulator, which knows the
amplitude and not the instant: z'' = … − 2c ρ^p v, ρ² = |z|² + |v|²/ω² = u†u, u' = −c ρ^p u. With c
< 0 it is a supply that no log tells of: of constant power for p = −2, a constant push for p = −1.
Size: 1e-4 … 1e-2 of ν. Mistaken for: drift of the damping in time or with temperature, cubic of the
pick-off. What separates it: a long ring-down: curvature of ln a in a², not in t; ring-downs from
two amplitudes.
"""

import functools
import math

import numpy as np

from ..physics.plant import POLYNOMIAL, Acceleration, Environment, Plant, SlowState
from .effect import Array, Effect, Parameter, Values, find_displacement, find_invariants

_EVEN = np.pi * (np.arange(16) + 0.5) / 16
TURNS, WEIGHTS = np.cos(_EVEN + np.sin(_EVEN)), (1 + np.cos(_EVEN)) / 16
"""cos x over half a turn of x = 2τ + arg uᵀu, in which |z|² = ½(u†u + |uᵀu| cos x) is even, and
shares of the mean; closest about x = π, where |z|^p of a line has its cusp."""


def compute_mean(power: float) -> float:
    """N_p = 2⟨|cos|^p sin²⟩.

    Parameters
    ----------
    power
        p.

    Returns
    -------
    float
        1 of p = 0.

    Examples
    --------
    >>> from hrg_cli.effects.nonlinear_damping import compute_mean
    >>> round(compute_mean(0.0), 12), round(compute_mean(2.0), 12)
    (1.0, 0.25)
    """
    # by logarithms: a fit may try a power whose factorials no float holds
    ratio = math.exp(math.lgamma((power + 1) / 2) - math.lgamma(power / 2 + 1))
    return 2 * ratio / (math.sqrt(math.pi) * (power + 2))


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """z'' −= 2c|z|^p v."""
    if p["power"] == 2:
        plant.polynomial[POLYNOMIAL.index("r2_v")] -= 8 * p["damping_1_s"]
        return
    half = p["power"] / 2
    if half < 0:
        plant.accelerate(
            _make_regulated_friction(2 * p["damping_1_s"], plant.mechanics.omega_rad_s**2, half)
        )
    else:
        plant.accelerate(_make_friction(2 * p["damping_1_s"] / compute_mean(p["power"]), half))


@functools.lru_cache(maxsize=16)
def _make_regulated_friction(supply: float, stiffness: float, half: float) -> Acceleration:
    """−supply ρ^{2·half} v, ρ² = |z|² + |v|²/stiffness; one object for equal values, so that it is
    compiled once for all runs."""

    def acceleration(t: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
        loss = supply * (x * x + y * y + (vx * vx + vy * vy) / stiffness) ** half
        return -loss * vx, -loss * vy

    return acceleration


@functools.lru_cache(maxsize=16)
def _make_friction(factor: float, half: float) -> Acceleration:
    """−factor |z|^{2·half} v; one object for equal values."""

    def acceleration(t: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
        loss = factor * (x * x + y * y) ** half
        return -loss * vx, -loss * vy

    return acceleration


def _mean(over_turns: Array) -> Array:
    return np.sum(WEIGHTS * over_turns, axis=-1, keepdims=True)


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−ν₂[½(u†u) u − ¼(uᵀu) u*] for the square, −c(u†u)^{p/2} u for a negative power, else the mean
    over a period."""
    if p["power"] < 0:
        return (
            -p["damping_1_s"]
            * np.sum(np.abs(u) ** 2, axis=-1, keepdims=True) ** (p["power"] / 2)
            * u
        )
    size, square = find_invariants(find_displacement(u, state))
    if p["power"] != 2:
        flat = np.abs(square)
        swing = ((size + flat * TURNS) / 2) ** (p["power"] / 2)
        direction = square / np.where(flat > 0, flat, 1.0)
        return (
            -p["damping_1_s"]
            / compute_mean(p["power"])
            * (_mean(swing) * u - _mean(swing * TURNS) * direction * np.conj(u))
        )
    return -p["damping_1_s"] * (2 * size * u - square * np.conj(u))


EFFECT = Effect(
    name="nonlinear_damping",
    family="resonator",
    page=__doc__,
    parameters=(
        Parameter(
            "damping_1_s",
            "s-1",
            1e-3,
            "damping ν₂/4 added at unit amplitude",
            amplitude_power=-2,
            minimum=0.0,
        ),
        Parameter("power", "1", 2.0, "power p of the amplitude", neutral=2.0, fitted=False),
    ),
    mistaken_for=("damping_drift", "thermal_damping", "pickoff_nonlinearity"),
    next_experiment=(
        "ring-downs from two amplitudes at one temperature: this damping follows a², a drift"
        " follows time"
    ),
    plant=plant,
    slow=slow,
    nonlinear_force=True,
    acts_on="velocity",
)
