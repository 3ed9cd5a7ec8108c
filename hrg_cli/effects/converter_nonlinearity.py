"""Converter whose codes are not even: an error at mid-scale, few bits.

Physics: at mid-scale all bits of a converter change at once, there its largest differential error
sits: codes too wide are a dead zone, missing ones a jump. Few bits without dither are the same at
every code. Both channels have the same converter. Equation: y → sign(y)·max(|y| − h, 0), then the
nearest multiple of the step q. With amplitude A of a channel its fundamental is A·N(A): for q = 0
and h > 0 N = 1 − (2/π)[asin x + x √(1 − x²)], x = min(h/A, 1); for h < 0 N = 1 + (4/π)|h|/A; for q
> 0 each code begins at y_i = max(h + (i − ½) q, 0) and N = (4q/πA) Σ √(1 − (y_i/A)²) over y_i < A
(describing functions, textbook; of a wave without noise: noise above q/2 dithers the codes away).
The harmonics go with h, not with a³: relatively they grow as the wave dies (PHYSICS §8, R11). Size:
1e-5 … 1e-2 of the amplitude. Mistaken for: a cubic of the pick-off, a tone, saturation. What
separates it: its harmonics do not shrink as a³; the histogram of the codes.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import Array, Effect, Parameter, Values

MOST_CODES = 1000
"""Codes in an amplitude from which even ones do nothing: N is off by (2/π²)(q/A)^{3/2} at most,
6e-6."""


def readout(p: Values, readout: Readout) -> None:
    """The converter's codes, after noise."""
    h, q = p["mid_scale"], p["step"]

    def step(block: Samples, y: Array) -> Array:
        y = np.sign(y) * np.maximum(np.abs(y) - h, 0.0)
        return q * np.rint(y / q) if q > 0 else y

    readout.after.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u_k N(|u_k|)."""
    h, q, size = p["mid_scale"], max(p["step"], 0.0), np.abs(u)
    A = np.where(size > 0, size, 1.0)
    N = _crossing(h, A)
    coarse = (q > 0) & (size < MOST_CODES * q)
    if np.any(coarse):
        N = np.where(coarse, _codes(h, q, A), N)
    return np.where(size > 0, u * N, u)


def _crossing(h: float, A: Array) -> Array:
    """N of the error at mid-scale alone."""
    if h <= 0:
        return 1 - 4 / np.pi * h / A
    x = np.minimum(h / A, 1.0)
    return 1 - 2 / np.pi * (np.arcsin(x) + x * np.sqrt(1 - x**2))


def _codes(h: float, q: float, A: Array) -> Array:
    """N of codes of step q that begin at y_i."""
    largest = min(float(np.max(A)), MOST_CODES * q)
    total = np.zeros_like(A)
    for i in range(1, int((largest - h) / q + 1.5)):
        begins = max(h + (i - 0.5) * q, 0.0)
        total += np.sqrt(np.maximum(1 - (begins / A) ** 2, 0.0))
    return 4 * q / (np.pi * A) * total


EFFECT = Effect(
    name="converter_nonlinearity",
    family="read-out",
    page=__doc__,
    parameters=(
        Parameter(
            "mid_scale",
            "amplitude",
            3e-4,
            "half width of a dead zone at mid-scale; negative: half of a jump",
            amplitude_power=1,
        ),
        Parameter(
            "step",
            "amplitude",
            1e-2,
            "step of the codes; 0: none",
            amplitude_power=1,
            fitted=False,
            minimum=0.0,
        ),
    ),
    mistaken_for=("pickoff_nonlinearity", "saturation"),
    next_experiment=(
        "the histogram of the raw codes, and a ring-down to small amplitude: these harmonics do not"
        " die with the cube of it"
    ),
    readout=readout,
    slow_readout=slow_readout,
    makes_harmonics=True,
)
