"""Cubic nonlinearity of the capacitive pick-off, and its fifth order where it shows.

Physics: the gap's capacitance is not linear in displacement; each channel measures c + γ c³ + ε c⁵ (γ
in 1/amplitude²; for amplitudes in units of the gap γ = ε = 1 for a charge 2c/(1 − c²), 3 and 5 for the
literal read-out of seed B; an amplifier's tanh has γ = −1/3, ε = 2/15).
Equation: C → C (1 + ¾γ|C|² + ⅝ε|C|⁴); m = 2: δθ = −(3γ/32) a² sin 8θ, amplitude × (1 + (3γ/16) a² (3 + cos 8θ))   (PHYSICS R7).
Size: γ a² of 1e-4 … 1e-2. Mistaken for: anisotropic cubic stiffness (8θ), second order of the
frequency split (8θ, but not proportional to a²). What separates it: two amplitudes; the third
harmonic of the raw signal, γ|C|³/4, which a linear pick-off does not have.
"""

import numpy as np

from ..physics.plant import Readout, SlowState
from ..physics.resonator import Mechanics
from .effect import Array, Effect, Parameter, Values

FIFTH = "quintic"
"""Name of the fifth order's parameter; reports in which it was not fitted do not have it."""


def readout(p: Values, readout: Readout) -> None:
    """y + γ y³ + ε y⁵ in each channel."""
    gamma, epsilon = p["cubic"], p.get(FIFTH, 0.0)
    readout.steps.append(lambda block, y: y * (1 + y**2 * (gamma + epsilon * y**2)))


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u_k (1 + ¾γ|u_k|² + ⅝ε|u_k|⁴): the parts of cos³ and cos⁵ that are cos."""
    squared = np.abs(u) ** 2
    return u * (1 + squared * (0.75 * p["cubic"] + 0.625 * p.get(FIFTH, 0.0) * squared))


def size_next_order(p: Values, _: Mechanics) -> dict[str, float]:
    """ε = γ², as of a charge 2c/(1 − c²); of a literal read-out 5γ²/9, of a tanh 6γ²/5.

    Parameters
    ----------
    p
        Values of the effect's parameters.
    _
        The linear resonator.

    Returns
    -------
    dict
        [1/amplitude⁴].

    Examples
    --------
    >>> from hrg_cli.effects.pickoff_nonlinearity import size_next_order
    >>> size_next_order({"cubic": 0.5}, None)
    {'quintic': 0.25}
    """
    return {FIFTH: p["cubic"] ** 2}


EFFECT = Effect(
    name="pickoff_nonlinearity",
    family="read-out",
    page=__doc__,
    parameters=(
        Parameter("cubic", "amplitude-2", 2e-3, "γ of c + γ c³", amplitude_power=-2),
        Parameter(
            FIFTH,
            "amplitude-4",
            1e-5,
            "ε of ε c⁵ beside it",
            amplitude_power=-4,
            fitted=False,
            higher_order=True,
        ),
    ),
    mistaken_for=("anisotropic_cubic_stiffness", "saturation"),
    next_experiment=(
        "ring-downs at two amplitudes or a longer one, sampled fast enough to see the third"
        " harmonic of the raw signal"
    ),
    readout=readout,
    slow_readout=slow_readout,
    makes_harmonics=True,
    size_next_order=size_next_order,
)
