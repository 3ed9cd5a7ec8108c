"""Saturation of the read-out amplifier or converter.

Physics: the signal is clipped at ± level; only waves whose amplitude in a channel exceeds it are
changed. Equation: describing function of the clipped channel, C → C·N(|C|), N = (2/π)[asin x + x
√(1 − x²)], x = level/|C| < 1, else 1 (PHYSICS R8; the describing function is textbook). Size: level
at 0.8 … 1 of the amplitude. The parameter is 1/level, so that 0 means none. Mistaken for: a
negative cubic of the pick-off. What separates it: an amplitude sweep: it vanishes sharply below the
level; odd harmonics; the histogram of the converter's codes.
"""

import numpy as np

from ..physics.plant import Readout, SlowState
from .effect import Array, Effect, Parameter, Runs, Values

DEPTHS = (3e-1, 1e-1, 3e-2, 1e-2, 3e-3, 1e-3)
"""Depths of the levels tried below the largest amplitude seen in a channel, as parts of it: what a
level takes goes with its depth to the power 3/2, and one tried a factor √3 off has the shape of the
true one to four fifths of χ² at least."""


def readout(p: Values, readout: Readout) -> None:
    """Clip at ± level."""
    if p["inverse_level"] > 0:
        level = 1 / p["inverse_level"]
        readout.after.append(lambda block, y: np.clip(y, -level, level))


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u_k N(|u_k|)."""
    return u * compute_kept(np.abs(u), max(p["inverse_level"], 0.0))


def compute_kept(amplitude: Array, inverse_level: float) -> Array:
    """N of oscillations: the part of the fundamental that is left of one clipped at a level.

    Parameters
    ----------
    amplitude
        (…), the signals' unit.
    inverse_level
        1 over the level.

    Returns
    -------
    ndarray
        (…), from 0 to 1.

    Examples
    --------
    Of one below the level, and one far above it, which is a square wave of 4/π of it:

    >>> import numpy as np
    >>> from hrg_cli.effects.saturation import compute_kept
    >>> (compute_kept(np.array([0.9, 100.0]), 1.0) * [1, 100]).round(3).tolist()
    [1.0, 1.273]
    """
    x = 1 / np.maximum(amplitude * inverse_level, 1.0)
    return (2 / np.pi) * (np.arcsin(x) + x * np.sqrt(np.maximum(1 - x**2, 0.0)))


def list_levels(runs: Runs) -> list[Values]:
    """Levels below the largest amplitude that these runs show."""
    # no quantile: a clip of some σ lasts as few rows as lie above one
    largest = float(np.abs(runs.envelope)[runs.weight > 0].max())
    return [{"inverse_level": 1 / ((1 - depth) * largest)} for depth in DEPTHS]


EFFECT = Effect(
    name="saturation",
    family="read-out",
    page=__doc__,
    parameters=(
        Parameter(
            "inverse_level",
            "amplitude-1",
            1.05,
            "1 over the level at which the signal is clipped",
            amplitude_power=-1,
            minimum=0.0,
            sets_in=True,
        ),
    ),
    mistaken_for=("pickoff_nonlinearity",),
    next_experiment=(
        "ring-downs from below and from above the level: clipping stops sharply, a cubic pick-off"
        " does not"
    ),
    readout=readout,
    slow_readout=slow_readout,
    makes_harmonics=True,
    starts=list_levels,
)
