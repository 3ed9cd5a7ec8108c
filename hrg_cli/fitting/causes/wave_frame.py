"""Envelopes as reals, and the directions in which a wave can differ from another: along it, its
phase, its angle, its quadrature."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def to_reals(u: Array) -> Array:
    """Complex envelopes as reals: Re C, Re S, Im C, Im S.

    Parameters
    ----------
    u
        (..., 2), complex.

    Returns
    -------
    ndarray
        (..., 4).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.wave_frame import to_reals
    >>> to_reals(np.array([1 + 2j, 3 + 4j])).tolist()
    [1.0, 3.0, 2.0, 4.0]
    """
    return np.concatenate([u.real, u.imag], axis=-1)


def to_complex(x: Array) -> Array:
    """Complex envelopes of reals: the inverse of `to_reals`.

    Parameters
    ----------
    x
        (..., 4): Re C, Re S, Im C, Im S.

    Returns
    -------
    ndarray
        (..., 2), complex.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.wave_frame import to_complex
    >>> to_complex(np.array([1.0, 3.0, 2.0, 4.0])).tolist()
    [(1+2j), (3+4j)]
    """
    return x[..., :2] + 1j * x[..., 2:]


def make_real_matrix(L: Array) -> Array:
    """The real matrix that does to `to_reals` vectors what a complex one does to envelopes.

    Parameters
    ----------
    L
        (..., 2, 2), complex.

    Returns
    -------
    ndarray
        (..., 4, 4).

    Examples
    --------
    A turn of the phase by 90° is a turn in the plane of Re and Im:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.wave_frame import make_real_matrix, to_reals
    >>> u = np.array([1.0 + 0j, 2.0])
    >>> (make_real_matrix(1j * np.eye(2)) @ to_reals(u)).tolist() == to_reals(1j * u).tolist()
    True
    """
    top = np.concatenate([L.real, -L.imag], axis=-1)
    return np.concatenate([top, np.concatenate([L.imag, L.real], axis=-1)], axis=-2)


def find_directions(u: Array) -> Array:
    """Unit changes of envelopes along which two waves can differ.

    For a line u = a e^{jφ}(cos mθ, sin mθ) they are u/a, ju/a, w and jw with w = e^{jφ}(−sin mθ,
    cos mθ): relative amplitude, phase, wave angle and ellipticity. Of an ellipse the last two are
    across it, w = J ū e^{2jφ}, with φ from uᵀu = (a_A² − a_B²) e^{2jφ}; a circle has no φ, and
    e^{2jφ} is 1.

    Parameters
    ----------
    u
        (..., 2), complex envelopes.

    Returns
    -------
    ndarray
        (..., 4, 2), complex, of length one.

    Examples
    --------
    A small turn of a line is along the third, at any phase of the oscillation:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.wave_frame import find_directions
    >>> def line(angle):
    ...     return 2 * np.exp(0.7j) * np.array([np.cos(angle), np.sin(angle)])
    >>> turn = (line(0.3001) - line(0.2999)) / 4e-4
    >>> np.abs((find_directions(line(0.3)) @ turn.conj()).real).round(6).tolist()
    [0.0, 0.0, 1.0, 0.0]
    """
    size = np.sqrt(np.sum(np.abs(u) ** 2, axis=-1, keepdims=True))
    along = u / np.where(size > 0, size, 1.0)
    square = np.sum(u**2, axis=-1, keepdims=True)
    flat = np.abs(square)
    turn = np.where(flat > 0, square, 1.0) / np.where(flat > 0, flat, 1.0)
    across = turn * np.stack([-np.conj(along[..., 1]), np.conj(along[..., 0])], axis=-1)
    return np.stack([along, 1j * along, across, 1j * across], axis=-2)
