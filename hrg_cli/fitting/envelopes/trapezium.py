"""Integrals over uneven rows, as the laws of one mode and the rate's turning need them."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def integrate(values: Array, time_s: Array) -> Array:
    """∫ of values (..., n) from the first row on, by the trapezium rule with its end correction
    (Euler–Maclaurin): h(f₀ + f₁)/2 − h²(f₁′ − f₀′)/12 a step.

    Parameters
    ----------
    values
        The integrand at the rows, (..., n).
    time_s
        Times of the rows, rising, (n,).

    Returns
    -------
    ndarray
        The integral from the first row to each, (..., n), in the integrand's unit times s.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.trapezium import integrate
    >>> integrate(np.array([0.0, 2.0, 4.0]), np.array([0.0, 1.0, 2.0])).tolist()
    [0.0, 1.0, 4.0]
    """
    step = np.diff(time_s)
    slope = np.gradient(values, time_s, axis=-1)
    trapezium = (values[..., 1:] + values[..., :-1]) / 2 * step
    pieces = trapezium - np.diff(slope, axis=-1) * step**2 / 12
    return np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(pieces, axis=-1)], axis=-1)
