"""What neighbouring windows tell, past windows that hold no number.

A window without a number (a sample that is not finite, a gap) has no envelope, and the windows
beside it would have neither slope nor bend: their pull, some ten σ where the wave turns, would stay
in their coefficients. Few such windows in a row are bridged by the cubic spline through the others,
in the frame that turns with them; many end a stretch as a recording's end does. A window of few
samples is no better neighbour than one of none: it has the motion of those beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ..medians import find_median

Array = np.ndarray
Motion = tuple[Array, ...]

MOST_BRIDGED = 4
"""Windows without a number in a row that are bridged."""


def find_local_median(values: Array, reach: int) -> Array:
    """Medians of the rows about each, mirrored at the ends.

    Parameters
    ----------
    values
        (n,), more than `reach`.
    reach
        Rows on either side.

    Returns
    -------
    ndarray
        (n,).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.neighbours import find_local_median
    >>> find_local_median(np.array([1.0, 1.0, 50.0, 2.0, 2.0, 2.0]), 1).tolist()
    [1.0, 1.0, 2.0, 2.0, 2.0, 2.0]
    """
    padded = np.pad(values, reach, mode="reflect")
    rows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return np.asarray(find_median(rows, axis=1))


def estimate_from_neighbours(
    motion: Callable[[Array], Motion | None],
    u: Array,
    local_less_reference_rad_s: Array | float,
    window_s: float,
    sure: Array | None = None,
) -> Motion | None:
    """What a function finds of envelopes, past windows that hold no number.

    Parameters
    ----------
    motion
        Makes of envelopes (channels, rows, F) arrays of their shape; None where it finds nothing.
    u
        Envelopes (channels, rows, F) in reference phase, NaN in windows without a number.
    local_less_reference_rad_s
        By what the local frame turns, of each tone (F,), or one, rad/s.
    window_s
        From row to row.
    sure
        Rows (n,) that tell the motion; None: all that hold a number. The others have that of the
        nearest row that does, if it is beside them.

    Returns
    -------
    tuple of ndarray or None
        As u each: 0 in stretches of which nothing is found; None where nothing is found at all.

    Examples
    --------
    The slope of a straight line, past one window without a number:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.neighbours import estimate_from_neighbours
    >>> u = np.arange(9.0)[None, :, None] * (1 + 0j)
    >>> u[0, 4] = np.nan
    >>> (slope,) = estimate_from_neighbours(lambda one: (np.gradient(one, axis=1),), u, 0.0, 1.0)
    >>> slope.real[0, :, 0].round(9).tolist()
    [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    """
    finite = np.isfinite(u).all(axis=(0, 2))
    known = finite if sure is None else finite & sure
    if known.all():
        return motion(u)
    # from window to window envelopes turn by how far the frequency is from the reference: in a
    # frame that turns as well, the spline sees what is slow
    turn = np.exp(1j * np.multiply(local_less_reference_rad_s, window_s))
    found: list[Array] | None = None
    for rows in find_stretches(known):
        part = motion(bridge_unknown(u[:, rows], known[rows], turn))
        if part is None:
            continue
        if found is None:
            found = [np.zeros(u.shape, one.dtype) for one in part]
        beside = [k for k in (rows.start - 1, rows.stop) if 0 <= k < len(finite) and finite[k]]
        for whole, one in zip(found, part, strict=True):
            whole[:, rows] = one
            for k in beside:
                whole[:, k] = _carry_on(whole, k, rows, turn)
    return None if found is None else tuple(found)


def _carry_on(motion: Array, row: int, rows: slice, turn: Array | complex) -> Array:
    """What is found (channels, F) of the row beside a stretch: what its last row has, in a frame
    that turns on; a doubt, which is real, as it is."""
    last = min(max(row, rows.start), rows.stop - 1)
    value = motion[:, last]
    return value * np.asarray(turn) ** (row - last) if np.iscomplexobj(motion) else value


def find_stretches(known: Array) -> Iterator[slice]:
    """Rows from known ones to known ones, with no more than `MOST_BRIDGED` unknown ones in a row
    between.

    Parameters
    ----------
    known
        (n,) bool.

    Returns
    -------
    Iterator of slice
        Of rows, in order, none of them empty.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.neighbours import find_stretches
    >>> known = np.ones(30, bool)
    >>> known[5:8] = known[15:25] = False
    >>> list(find_stretches(known))
    [slice(0, 15, None), slice(25, 30, None)]
    """
    rows = np.flatnonzero(known)
    if not len(rows):
        return
    # n unknown rows lie between known ones that are n + 1 apart
    ends = np.flatnonzero(np.diff(rows) > MOST_BRIDGED + 1)
    for first, last in zip(
        np.concatenate([rows[:1], rows[ends + 1]]),
        np.concatenate([rows[ends], rows[-1:]]),
        strict=True,
    ):
        yield slice(int(first), int(last) + 1)


def bridge_unknown(u: Array, known: Array, turn: Array | complex) -> Array:
    """Envelopes with the unknown rows between the others filled in, in a frame that turns with
    them.

    They are filled by the line through two rows, the parabola through three, else the spline.

    Parameters
    ----------
    u
        Envelopes (channels, n, F).
    known
        (n,) bool, the first and the last of them True.
    turn
        e^{jΔT} by which the frame turns a row, of each tone (F,), or one.

    Returns
    -------
    ndarray
        As u.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.neighbours import bridge_unknown
    >>> u = np.exp(0.5j * np.arange(10))[None, :, None]
    >>> known = np.arange(10) != 4
    >>> filled = bridge_unknown(np.where(known[:, None], u, np.nan), known, np.exp(0.5j))
    >>> float(np.abs(filled - u).max().round(9))
    0.0
    """
    from scipy.interpolate import CubicSpline

    if known.all():
        return u
    rows = np.arange(u.shape[1])
    frame = np.asarray(turn) ** rows[:, None]
    through = CubicSpline(rows[known], (u / frame)[:, known], axis=1)
    filled = u.copy()
    filled[:, ~known] = through(rows[~known]) * frame[~known]
    return filled
