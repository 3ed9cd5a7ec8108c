"""Least-squares fits of many windows at once, and what follows: drag of the envelope's slope,
pooled noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..medians import find_median
from .basis import Pull, WindowBasis
from .neighbours import find_local_median

Array = np.ndarray


KNOWN = 1e-3
"""Part of itself to which the motion's share of a residual is known."""

POOL_KNOWN = 64
"""How many times more rows are pooled where a known motion is taken out of the residual."""

BESIDE, MOVED = 8, 4.0
"""Rows on either side that tell the motion's share of one, and how many times that a row's residual
may be: uneven samples hold it unequally."""

CACHE_SAMPLES = 1 << 16
"""Samples turned to floats at once, so that they stay in the processor's cache."""

LOST = 1e-9
"""Part of the sum of squares below which a residual is not left to the difference of two sums:
rounding would be 1e-6 of it and more."""

POOL_FREEDOM = 400
"""Degrees of freedom pooled for a standard deviation, so that error/σ is not a heavy-tailed t."""


@dataclass(frozen=True)
class Fits:
    """Windows fitted about their centres at the local frequencies. Rows that could not be fitted
    hold NaN.

    envelope (channel, rows, F) = p − jq; residual2 (channel, rows) sums of squares; freedom,
    samples (rows,) or numbers; variance (rows or 1, 2F) of p, q for unit noise; slope, curvature:
    their pulls.
    """

    envelope: Array
    residual2: Array
    freedom: Array
    samples: Array
    variance: Array
    slope: Pull
    curvature: Pull
    apart: bool = False
    """Whether the residual is free of the slope, or of the curvature where the slope is fitted."""


def fit_even(raw: Array, basis: WindowBasis, apart: bool = False) -> tuple[Array, Array]:
    """Envelopes and residuals of one channel's evenly sampled windows.

    One matrix product for each stretch that fits the cache; the residual is |y|² less the power in
    the orthonormal basis q, and where that difference has lost its digits (below `LOST` of |y|²)
    the sum of (y − Qq)² itself, while the stretch is in the cache.

    Parameters
    ----------
    raw
        Windows (rows, samples), in raw units.
    basis
        Of a window.
    apart
        Whether what the envelope's slope (its curvature, where the slope is fitted) puts into the
        residual is taken out of it, by columns of its own; the envelope stays that of the basis
        without them.

    Returns
    -------
    envelope : ndarray
        (rows, F), p − jq of each tone, raw unit.
    residual2 : ndarray
        (rows,), sum of squares that is left, raw unit².

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.basis import build_window_basis
    >>> from hrg_cli.fitting.samples.windows import fit_even
    >>> tau = (np.arange(20) - 9.5) / 1000
    >>> y = 0.3 * np.cos(2 * np.pi * 90 * tau) + 0.1 * np.sin(2 * np.pi * 90 * tau) + 5
    >>> envelope, left = fit_even(y[None], build_window_basis(20, 1000.0, (90.0,)))
    >>> envelope.round(12).tolist(), bool(left[0] < 1e-25)
    ([[(0.3-0.1j)]], True)
    """
    rows, samples = raw.shape
    # Raw samples are read from memory once: the second pass finds them in the cache.
    at_once = max(1, CACHE_SAMPLES // samples)
    whole, own = basis.orthonormal, basis.orthonormal.shape[1]
    if apart:
        whole = np.concatenate([whole, basis.sloping], axis=1)
    q = np.empty((rows, whole.shape[1]))
    left = np.empty(rows)
    with np.errstate(invalid="ignore"):
        for start in range(0, rows, at_once):
            y = raw[start : start + at_once].astype(float)
            part, rest = q[start : start + at_once], left[start : start + at_once]
            np.matmul(y, whole, out=part)
            square = _sum_squares(y)
            np.subtract(square, _sum_squares(part), out=rest)
            # |y|² − |q|² of a clean recording is a difference of nearly equal numbers: below 1e-9
            # of |y|² it holds seven digits at most, and the noise comes from it.
            if (rest < LOST * square).any():
                y -= part @ whole.T
                rest[:] = _sum_squares(y)
        # p and −q side by side are p − jq as they stand
        fit = q[:, :own] @ (basis.triangle * np.tile([1.0, -1.0], len(basis.variance) // 2))
    return fit.view(complex), left


def _sum_squares(y: Array) -> Array:
    """Σ y² of every row (rows,)."""
    return np.asarray(
        (y * y) @ np.ones(y.shape[1])
        if y.shape[1] < 64
        else (y[:, None, :] @ y[:, :, None])[:, 0, 0]
    )


def sum_energy(u: Array) -> float:
    """Sum Σ|u|² of complex values, in this thread: a BLAS shares so short a sum among threads that
    then wait for each other.

    Parameters
    ----------
    u
        Complex, of any shape.

    Returns
    -------
    float
        Their unit squared.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.windows import sum_energy
    >>> sum_energy(np.array([[3 + 4j, 1j]]))
    26.0
    """
    parts = np.ascontiguousarray(u).view(float).ravel()
    return float(np.einsum("i,i->", parts, parts))


def pool_variance(residual2: Array, freedom: Array, known: Array | None = None) -> Array:
    """Variances a sample, pooled over neighbouring rows until there are `POOL_FREEDOM` degrees of
    freedom.

    A row far above its neighbours (a burst, a clipped top, lost samples) keeps its own variance and
    does not spoil theirs. The motion's share is known to `KNOWN` of itself; it is taken out of the
    pooled values, over `POOL_KNOWN` times as many rows, since motion times noise scatters more than
    noise alone. Beside a jump a row's slope is the jump's, not its own: a share that stands as far
    above the neighbours is not taken out.

    Parameters
    ----------
    residual2
        Sums of squares (rows,) that the windows' fits leave.
    freedom
        Degrees of freedom, one number or (rows,).
    known
        The motion's share of the sums of squares (rows,); None: there is none.

    Returns
    -------
    ndarray
        (rows,); rows that are not finite stay so.

    Examples
    --------
    Windows of 40 degrees of freedom and unit noise, one of them with a burst:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.windows import pool_variance
    >>> left = np.full(20, 40.0)
    >>> left[7] = 4000.0
    >>> pool_variance(left, np.array(40)).tolist()[5:10]
    [1.0, 1.0, 100.0, 1.0, 1.0]
    """
    group = count_pooled_rows(float(freedom if np.ndim(freedom) == 0 else find_median(freedom))) * (
        1 if known is None else POOL_KNOWN
    )
    starts = np.arange(0, len(residual2), group)
    if len(starts) > 1 and len(residual2) - starts[-1] < group / 2:
        starts = starts[:-1]
    counts = np.diff(np.append(starts, len(residual2)))
    # the way of nearly all blocks: windows alike and no burst among them, where sums do without
    # sorting
    if np.ndim(freedom) == 0 and np.isfinite(residual2.sum()):
        level = np.add.reduceat(residual2, starts) / (counts * freedom)
        most = residual2 if known is None else np.maximum(residual2, known)
        if not (np.maximum.reduceat(most, starts) > _find_limit(freedom) * level).any():
            if known is not None:
                share = np.add.reduceat(known, starts) / (counts * freedom)
                level = _subtract_motion(level, share)
            return np.repeat(level, counts)
    freedom = np.broadcast_to(np.asarray(freedom, float), residual2.shape)
    finite = np.isfinite(residual2)
    sums, weight = np.where(finite, residual2, 0.0), np.where(finite, freedom, 0.0)
    middle = _find_lower_medians(
        np.where(finite, residual2 / np.maximum(freedom, 1), np.inf), starts, counts
    )
    limit = _find_limit(freedom) * np.repeat(np.where(np.isfinite(middle), middle, 0.0), counts)
    if known is not None:
        # what a jump makes of a few rows' share is not in the median of those beside them
        usual = find_local_median(np.where(np.isfinite(known), known, 0.0), BESIDE)
        limit = limit + MOVED * usual
    excess = finite & (sums > limit)
    total = np.add.reduceat(np.where(excess, 0.0, sums), starts) / np.maximum(
        np.add.reduceat(np.where(excess, 0.0, weight), starts), 1
    )
    if known is not None:
        share = np.where(finite & ~excess & (known <= limit), known, 0.0)
        share = np.add.reduceat(share, starts) / np.maximum(
            np.add.reduceat(np.where(excess, 0.0, weight), starts), 1
        )
        total = _subtract_motion(total, share)
    spread = np.repeat(total, counts)
    return np.where(finite, np.where(excess, sums / np.maximum(freedom, 1), spread), np.nan)


def _find_lower_medians(values: Array, starts: Array, counts: Array) -> Array:
    """The lower median (groups,) of the finite values of each group, which a burst in one half of
    it does not reach; not finite where none is."""
    widest = int(counts.max())
    # a table (group, row in it), short groups filled with NaN: all medians are taken at once
    table = np.full(len(starts) * widest, np.nan)
    place = np.repeat(np.arange(len(starts)) * widest - starts, counts) + np.arange(len(values))
    table[place] = values
    table = np.sort(table.reshape(len(starts), -1), axis=1)
    return np.asarray(
        table[np.arange(len(starts)), np.maximum(0, np.isfinite(table).sum(1) - 1) // 2]
    )


def _find_limit(freedom: Array) -> Array:
    """χ² of so many degrees that less than one row in 10¹⁰ exceeds."""
    return 4 * freedom + 40


def _subtract_motion(level: Array, share: Array) -> Array:
    """Variances of pools without the motion's share, which is known to `KNOWN` of itself."""
    return np.asarray(np.maximum(level - share, KNOWN * np.minimum(share, level)))


def count_pooled_rows(freedom: float) -> int:
    """Number of rows that are pooled where each has so many degrees of freedom.

    Parameters
    ----------
    freedom
        Of a row.

    Returns
    -------
    int
        One at least.

    Examples
    --------
    >>> from hrg_cli.fitting.samples.windows import count_pooled_rows
    >>> [count_pooled_rows(freedom) for freedom in (17.0, 400.0, 1e5)]
    [24, 1, 1]
    """
    return max(1, int(np.ceil(POOL_FREEDOM / max(1.0, freedom))))
