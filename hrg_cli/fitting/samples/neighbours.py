"""What neighbouring windows tell, past windows that hold no number.

A window without a number (a sample that is not finite, a gap) has no envelope, and the windows
beside it would have neither slope nor bend: their pull, some ten σ where the wave turns, would stay
in their coefficients. Few such windows in a row are bridged by the cubic spline through the others,
in the frame that turns with them; many end a stretch as a recording's end does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

Array = np.ndarray
Motion = tuple[Array, ...]

MOST_BRIDGED = 4
"""Windows without a number in a row that are bridged."""


def find_local_median(values: Array, reach: int) -> Array:
    """Median (n,) of the rows ± `reach` about each, mirrored at the ends."""
    padded = np.pad(values, reach, mode="reflect")
    rows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return np.asarray(np.median(rows, axis=1))


def estimate_from_neighbours(
    motion: Callable[[Array], Motion | None],
    u: Array,
    local_less_reference_rad_s: Array | float,
    window_s: float,
) -> Motion | None:
    """What `motion` finds of envelopes u (channel, rows, F), each an array of their shape: 0 in
    stretches of which it finds nothing; None where it finds nothing at all."""
    known = np.isfinite(u).all(axis=(0, 2))
    if known.all():
        return motion(u)
    found: list[Array] | None = None
    for rows in find_stretches(known):
        turn = np.exp(1j * np.multiply(local_less_reference_rad_s, window_s))
        part = motion(bridge_unknown(u[:, rows], known[rows], turn))
        if part is None:
            continue
        if found is None:
            found = [np.zeros(u.shape, one.dtype) for one in part]
        for whole, one in zip(found, part, strict=True):
            whole[:, rows] = one
    return None if found is None else tuple(found)


def find_stretches(known: Array) -> Iterator[slice]:
    """Rows (n,) from known ones to known ones, with no more than `MOST_BRIDGED` unknown ones in a
    row between."""
    rows = np.flatnonzero(known)
    if not len(rows):
        return
    ends = np.flatnonzero(np.diff(rows) > MOST_BRIDGED + 1)
    for first, last in zip(
        np.concatenate([rows[:1], rows[ends + 1]]),
        np.concatenate([rows[ends], rows[-1:]]),
        strict=True,
    ):
        yield slice(int(first), int(last) + 1)


def bridge_unknown(u: Array, known: Array, turn: Array | complex) -> Array:
    """The rows u (channel, n, F) with the unknown ones between the others filled in, in a frame that
    turns by `turn` a row: by the line through two, the parabola through three, else the spline."""
    from scipy.interpolate import CubicSpline

    if known.all():
        return u
    rows = np.arange(u.shape[1])
    frame = np.asarray(turn) ** rows[:, None]
    through = CubicSpline(rows[known], (u / frame)[:, known], axis=1)
    filled = u.copy()
    filled[:, ~known] = through(rows[~known]) * frame[~known]
    return filled
