"""A motion taken to another one near it: by its phase, angle and size where the change is large,
and by the slopes of its steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .wave_frame import make_real_matrix, to_complex, to_reals

Array = np.ndarray
LARGEST_GROWTH = 1.0
"""Change of ln(amplitude) at once: a linear change beyond it says little of the size."""


def find_slope(function: Callable[[Array], Array], u: Array) -> Array:
    """∂function/∂u of envelopes, by central differences.

    Parameters
    ----------
    function
        Of envelopes (..., 2), complex, row by row; it is asked for all changes of them at once, one
        before the other along a first axis.
    u
        (..., 2), where.

    Returns
    -------
    ndarray
        (..., 4, 4) over reals (`to_reals`).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.turned_motion import find_slope
    >>> np.diag(find_slope(lambda u: 3 * u, np.array([1.0 + 0j, 2.0]))).round(6).tolist()
    [3.0, 3.0, 3.0, 3.0]
    """
    # at 1e-4 of the wave central differences leave 1e-8 of the slope by curvature, 1e-12 by
    # rounding
    size = 1e-4 * np.maximum(np.sqrt(np.sum(np.abs(u) ** 2, -1, keepdims=True)), 1e-300)
    units = to_complex(np.eye(4)).reshape(4, *(1,) * (u.ndim - 1), 2)
    ahead, behind = np.split(function(np.concatenate([u + size * units, u - size * units])), 2)
    return np.moveaxis(to_reals((ahead - behind) / (2 * size)), 0, -1)


def turn_motion(u: Array, change: Array, step: Array) -> tuple[Array, Array]:
    """A motion after a change that is not small beside it, and its steps' propagators there.

    A change δu = (ρ + jφ) u + θ Ju + rest, J the quarter turn of the plane, becomes
    e^{ρ + jφ} R(θ)(u + rest). A drive along the wave turns with it, so that a step's propagator P
    becomes S' P S⁻¹, S = e^{ρ + jφ} R(θ) at the row before and S' at the row after.

    Parameters
    ----------
    u, change
        (R, n, 2), complex.
    step
        (R, n − 1, 4, 4) over reals.

    Returns
    -------
    tuple
        The motion (R, n, 2) and the propagators (R, n − 1, 4, 4).

    Examples
    --------
    A phase that runs half a turn off keeps the amplitude, which a plain sum would double:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.turned_motion import turn_motion
    >>> wave = np.array([[[1.0 + 0j, 0.0], [1.0, 0.0]]])
    >>> off = np.pi * 1j * wave * np.array([[[0.0], [1.0]]])
    >>> motion, _ = turn_motion(wave, off, np.eye(4)[None, None])
    >>> motion[0, :, 0].round(9).real.tolist()
    [1.0, -1.0]
    """
    square = np.sum(np.abs(u) ** 2, axis=-1)
    square = np.where(square > 0, square, 1.0)
    along = np.sum(np.conj(u) * change, axis=-1) / square
    quarter = np.stack([-u[..., 1], u[..., 0]], axis=-1)
    angle = np.real(np.sum(np.conj(quarter) * change, axis=-1)) / square
    rest = change - along[..., None] * u - angle[..., None] * quarter
    log = np.clip(along.real, -LARGEST_GROWTH, LARGEST_GROWTH) + 1j * along.imag
    there, back = _turn(log, angle), _turn(-log, -angle)
    moved = (there @ (u + rest)[..., None])[..., 0]
    return moved, make_real_matrix(there)[:, 1:] @ step @ make_real_matrix(back)[:, :-1]


def _turn(log: Array, angle: Array) -> Array:
    """e^{log} R(angle), (..., 2, 2)."""
    cos, sin = np.cos(angle), np.sin(angle)
    plane = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], axis=-2)
    return np.exp(log)[..., None, None] * plane
