"""What the wave's own motion fills of a piece of demodulated rows: polynomials about the turns of
both modes.

At a constant rate both envelopes are sums of two exponentials, u(t) = a e^{λ₁t} + b e^{λ₂t}, whose
turns differ by the beat 2√((δω/2)² + (KΩ)²). A polynomial alone holds a beat of less than some
three quarters of a turn a piece; rows of a lock-in at 1 Hz hold ten turns of a table at 10°/s.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray

DEGREE = 5
"""Of the polynomial by which the envelope may move within a piece."""

FAR = 0.3
"""Half the angle [rad] that the modes turn against each other from a piece's middle to its ends,
from which a polynomial leaves more than 1e-8 of the wave, J₆(0.3)."""

LASTING = 0.9
"""Part of its size that a mode keeps from row to row: what keeps less is noise that follows no
row."""

MUCH = 10.0
"""Times more of the piece's power than polynomials alone that the turns must take off what these
leave: noise behind a filter has modes of its own, which take several times."""

LINEAR = 0.1
"""(a_A² − a_B²)/(a_A² + a_B²) above which an ellipse has a phase."""

LEAST_LEFT = 0.3
"""Part of a bin's noise that the motion must leave for the bin to tell anything."""


def make_polynomials(rows: int) -> Array:
    """Orthonormal polynomials over a piece.

    Parameters
    ----------
    rows
        Of the piece.

    Returns
    -------
    ndarray
        (rows, `DEGREE` + 1).

    Examples
    --------
    >>> from hrg_cli.formats.row_motion import make_polynomials
    >>> basis = make_polynomials(64)
    >>> basis.shape, round(float(basis[:, 3] @ basis[:, 3]), 9)
    ((64, 6), 1.0)
    """
    places = np.linspace(-1, 1, rows)
    return np.asarray(np.linalg.qr(np.polynomial.legendre.legvander(places, DEGREE))[0])


def find_turns(u: Array) -> Array:
    """Turns of both modes a row, of the matrix P by which rows follow one another, u_{k+1} = P u_k.

    Parameters
    ----------
    u
        (channel, rows), complex.

    Returns
    -------
    ndarray
        (2,) rad; empty where there is one channel, or no two modes that last.

    Examples
    --------
    A wave that turns by 0.2 rad a row:

    >>> import numpy as np
    >>> from hrg_cli.formats.row_motion import find_turns
    >>> angle = 0.2 * np.arange(64)
    >>> wave = np.exp(0.4j) * np.stack([np.cos(angle), np.sin(angle)])
    >>> sorted(find_turns(wave).round(9).tolist())
    [-0.2, 0.2]
    """
    if len(u) < 2:
        return np.zeros(0)
    values = np.linalg.eigvals(np.linalg.lstsq(u[:, :-1].T, u[:, 1:].T)[0])
    return np.angle(values) if np.abs(values).min() > LASTING else np.zeros(0)


def find_basis(u: Array, polynomials: Array) -> Array:
    """Orthonormal functions that the motion of a piece is a sum of.

    Parameters
    ----------
    u
        (channel, rows), complex, its mean turn taken off.
    polynomials
        (rows, k) of `make_polynomials`, which serve alone where the modes hardly turn.

    Returns
    -------
    ndarray
        (rows, k) real, or (rows, 2 k) complex.

    Examples
    --------
    Three turns of the wave within a piece leave nothing beside it:

    >>> import numpy as np
    >>> from hrg_cli.formats.row_motion import find_basis, make_polynomials
    >>> angle = 2 * np.pi * 3 / 64 * np.arange(64)
    >>> wave = np.stack([np.cos(angle), np.sin(angle)]).astype(complex)
    >>> basis = find_basis(wave, make_polynomials(64))
    >>> bool(np.abs(wave - (wave @ basis.conj()) @ basis.T).max() < 1e-9)
    True
    """
    rows, turns = len(polynomials), find_turns(u)
    if not len(turns) or abs(turns[0] - turns[1]) * rows / 4 < FAR:
        return polynomials
    row = np.arange(rows) - (rows - 1) / 2
    about = [polynomials * np.exp(1j * turn * row)[:, None] for turn in turns]
    turned = np.asarray(np.linalg.qr(np.concatenate(about, axis=1))[0])
    gained = _measure_rest(u, polynomials) > MUCH * _measure_rest(u, turned)
    return turned if gained else polynomials


def _measure_rest(u: Array, basis: Array) -> float:
    """Power of envelopes (channel, rows) beside a basis."""
    return float(np.sum(np.abs(u - (u @ basis.conj()) @ basis.T) ** 2))


def find_phase(u: Array, turning: bool) -> Array:
    """Phase of the oscillation at every row: of a wave that turns half the angle of uᵀu = (a_A² −
    a_B²) e^{2jφ}, which the turn leaves as it is; of one that does not, or nearly a circle, that of
    the stronger channel.

    Parameters
    ----------
    u
        (channel, rows), complex.
    turning
        Whether the wave turns.

    Returns
    -------
    ndarray
        (rows,) rad, without jumps where the wave turns.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.row_motion import find_phase
    >>> angle = 1.2 * np.arange(9)
    >>> bool(np.ptp(find_phase(np.stack([np.cos(angle), np.sin(angle)]), True)) < 1e-9)
    True
    """
    power = np.abs(u) ** 2
    if turning:
        square = np.sum(u**2, axis=0)
        if np.median(np.abs(square)) > LINEAR * np.median(power.sum(axis=0)):
            return np.asarray(np.unwrap(np.angle(square)) / 2)
    return np.asarray(np.angle(u[np.argmax(power.sum(axis=1))]))


def find_noise_left(basis: Array, window: Array) -> Array | float:
    """Part of white noise's power in every bin of a windowed piece that the motion leaves.

    Of the row vector W of a bin, the window times e^{−jωk}, it is 1 − |W Q|²/|W|²; of real parts
    the mean of those at ω and −ω.

    Parameters
    ----------
    basis
        Q, (rows, k) orthonormal.
    window
        (rows,), of power 1.

    Returns
    -------
    ndarray or float
        (rows // 2 + 1,), NaN where less than `LEAST_LEFT` is; 1 for plain polynomials, which take
        the lowest bins alone.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.row_motion import find_noise_left
    >>> tone = np.exp(2j * np.pi * 8 * np.arange(64) / 64)[:, None] / 8
    >>> find_noise_left(tone, np.ones(64) / 8)[[4, 8]].round(9).tolist()
    [1.0, 0.5]
    """
    if not np.iscomplexobj(basis):
        return 1.0
    taken = np.sum(np.abs(np.fft.fft(window[:, None] * basis, axis=0)) ** 2, axis=1)
    bins = np.arange(len(window) // 2 + 1)
    left = 1 - (taken[bins] + taken[-bins]) / 2
    return np.where(left > LEAST_LEFT, left, np.nan)
