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


def measure_noise_of_means(time_s: Array, integral: Array, order: int) -> Array:
    """Standard deviation of the white noise of means over steps, however uneven, from the integral.

    The divided differences of order k + 1 of an integral I = ∫f dt leave none of an f of degree
    below k: they are Σ_m W_m h_m f̄_m of the means f̄_m over the steps h_m, whose noise they have
    √Σ(W_m h_m)² times. Means over even steps give `measure_difference_noise` of order k.

    Parameters
    ----------
    time_s
        Ends of the steps (n,), increasing, s.
    integral
        To these (..., n).
    order
        k, below n − 1.

    Returns
    -------
    ndarray
        (...), in the unit of the means.

    Examples
    --------
    Steps of 2 and 3 s in turn; of a slope alone nothing is left, and of noise its size:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.difference_noise import measure_noise_of_means
    >>> t = np.concatenate([[0.0], np.cumsum(np.tile([2.0, 3.0], 1000))])
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(2000)
    >>> walk = np.concatenate([[0.0], np.cumsum(noise * np.diff(t))])
    >>> both = np.stack([t**2, t**2 + walk])
    >>> measure_noise_of_means(t, both, 4).round(3).tolist()
    [0.0, 0.01]
    """
    instants = np.lib.stride_tricks.sliding_window_view(time_s, order + 2)
    apart = instants[:, :, None] - instants[:, None, :] + np.eye(order + 2)
    weight = 1 / np.prod(apart, axis=-1)
    of_steps = np.cumsum(weight, axis=-1)[:, :-1] * np.diff(instants)
    unit = np.linalg.norm(of_steps, axis=-1)
    values = np.lib.stride_tricks.sliding_window_view(integral, order + 2, axis=-1)
    rough = np.abs(np.sum(weight * values, axis=-1)) / unit
    return np.asarray(np.median(rough, axis=-1) / MEDIAN)
