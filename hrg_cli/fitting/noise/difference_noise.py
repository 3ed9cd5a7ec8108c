"""White noise of even values beside their own course, from the differences of neighbours."""

from __future__ import annotations

from math import comb

import numpy as np

Array = np.ndarray
MEDIAN = 0.6745
"""Median of |x| of a normal number, over its standard deviation."""


def measure_difference_noise(values: Array, order: int) -> Array:
    """Standard deviation of white noise by differences of an order k.

    Those of white noise have C(2k, k) times its variance, a course of degree below k leaves none;
    the median bears rows at which the course jumps.

    Parameters
    ----------
    values
        (..., n), evenly spaced.
    order
        k, below n.

    Returns
    -------
    ndarray
        (...), in the unit of the values.

    Examples
    --------
    Noise of 0.01 beside a parabola:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.difference_noise import measure_difference_noise
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(2000)
    >>> round(float(measure_difference_noise(np.linspace(0, 1, 2000) ** 2 + noise, 4)), 3)
    0.01
    """
    rough = np.median(np.abs(np.diff(values, n=order)), axis=-1)
    return np.asarray(rough / (MEDIAN * np.sqrt(comb(2 * order, order))))
