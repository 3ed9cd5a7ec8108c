"""The parabola through three values side by side, whose lowest place lies between the places that
were tried."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Parabola:
    """A parabola that is bent up, over steps from the middle of its three places."""

    lowest: float
    """Its lowest place, in steps from the middle one."""
    bend: float
    """Its second derivative, by the square of a step."""


def fit_parabola(before: float, here: float, after: float) -> Parabola | None:
    """The parabola through values f₋, f₀, f₊ a step apart, lowest at (f₋ − f₊)/2(f₋ − 2f₀ + f₊).

    Parameters
    ----------
    before, here, after
        Values at −1, 0 and 1 step; of a highest place, their negatives.

    Returns
    -------
    Parabola or None
        None where the values bend down or not at all, or one is no number: there is no lowest
        place.

    Examples
    --------
    >>> from hrg_cli.fitting.parabola import fit_parabola
    >>> fit_parabola(*((x - 0.25) ** 2 for x in (-1, 0, 1)))
    Parabola(lowest=0.25, bend=2.0)
    >>> fit_parabola(0.0, 1.0, 0.0) is None
    True
    """
    bend = before - 2 * here + after
    return Parabola(float((before - after) / (2 * bend)), float(bend)) if bend > 0 else None


def find_peak_offset(power: np.ndarray) -> float:
    """How far the peak of a line lies from its highest bin, by the parabola through the logarithms.

    Parameters
    ----------
    power
        Of that bin and its neighbours, (3,).

    Returns
    -------
    float
        In bins; 0 where a power is 0, or where they have no peak.

    Examples
    --------
    A line of Gaussian shape, a fifth of a bin above the middle one:

    >>> import numpy as np
    >>> from hrg_cli.fitting.parabola import find_peak_offset
    >>> round(find_peak_offset(np.exp(-((np.array([-1.0, 0.0, 1.0]) - 0.2) ** 2))), 9)
    0.2
    """
    parabola = fit_parabola(*-np.log(power)) if power.min() > 0 else None
    return parabola.lowest if parabola else 0.0
