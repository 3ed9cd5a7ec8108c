"""Least-squares fits of many windows at once, and what follows: drag of the envelope's slope, pooled noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .basis import WindowBasis

Array = np.ndarray

NEIGHBOURS = 4
"""Windows on either side between which the envelope's slope is taken; it adds 0.02 % to the variance at one period a window."""

CACHE_SAMPLES = 1 << 15
"""Samples turned to floats at once, so that they stay in the processor's cache."""

POOL_FREEDOM = 400
"""Degrees of freedom pooled for a standard deviation, so that error/σ is not a heavy-tailed t."""


@dataclass(frozen=True)
class Fits:
    """Windows fitted about their centres at the local frequencies. Rows that could not be fitted hold NaN.

    envelope (channel, rows, F) = p − jq; residual2 (channel, rows) sums of squares; freedom, samples (rows,) or numbers;
    variance (rows or 1, 2F) of p, q for unit noise; alpha, beta (rows or 1, F, F): `basis.drag`; left (rows,) or a number: `WindowBasis.left`.
    """

    envelope: Array
    residual2: Array
    freedom: Array
    samples: Array
    variance: Array
    alpha: Array
    beta: Array
    left: Array


def fit_even(raw: Array, basis: WindowBasis) -> tuple[Array, Array]:
    """Envelope (rows, F) and residual sum of squares (rows,) of one channel's windows (rows, samples), in raw units.

    One matrix product for each stretch that fits the cache; the residual is |y|² less the power in the orthonormal basis.
    """
    rows, samples = raw.shape
    at_once = max(1, CACHE_SAMPLES // samples)
    q = np.empty((rows, basis.orthonormal.shape[1]))
    square = np.empty(rows)
    for start in range(0, rows, at_once):
        y = raw[start : start + at_once].astype(float)
        with np.errstate(invalid="ignore"):
            np.matmul(y, basis.orthonormal, out=q[start : start + at_once])
            if samples < 64:
                np.einsum("ij,ij->i", y, y, out=square[start : start + at_once])
            else:
                square[start : start + at_once] = (y[:, None, :] @ y[:, :, None])[:, 0, 0]
    with np.errstate(invalid="ignore"):
        fit = q @ basis.triangle
        return fit[:, 0::2] - 1j * fit[:, 1::2], np.maximum(square - np.einsum("ij,ij->i", q, q), 0.0)


def slopes(u: Array, local_less_reference_rad_s: Array, window_s: float) -> Array | None:
    """Slope of the envelopes u (channel, rows, F) in the local frame, from rows ± `NEIGHBOURS`; None with fewer than three rows.

    U1 = (u_{k+h} e^{−jΔhT} − u_{k−h} e^{jΔhT})/2hT, Δ = ω_local − ω_r, in reference phase. Rows at the ends use their neighbour's; 0 where unknown.
    """
    rows = u.shape[1]
    h = min(NEIGHBOURS, (rows - 1) // 2)
    if h < 1:
        return None
    ahead = np.exp(-1j * local_less_reference_rad_s * h * window_s) / (2 * h * window_s)
    slope = np.empty_like(u)
    slope[:, h : rows - h] = u[:, 2 * h :] * ahead - u[:, : rows - 2 * h] * ahead.conj()
    slope[:, :h], slope[:, rows - h :] = slope[:, h : h + 1], slope[:, rows - h - 1 : rows - h]
    if not np.isfinite(slope.sum()):
        slope[~np.isfinite(slope)] = 0.0
    return slope


def undrag(u: Array, slope: Array, turn: Array, alpha: Array, beta: Array) -> None:
    """Take the drag of the slope out of the envelopes u, in place: U ← U − (α U1 + β U1*), U = u e^{jω_r t_k} and `turn` = e^{−jω_r t_k}."""
    if u.shape[2] == 1 and len(alpha) == 1:
        if abs(alpha[0, 0, 0]) > 1e-6 * abs(beta[0, 0, 0]):
            u -= alpha[0, 0, 0] * slope
        u -= np.conj(slope) * (beta[0, 0, 0] * turn * turn)
        return
    own = slope * turn.conj()
    u -= turn * ((alpha[None] * own[:, :, None, :]).sum(-1) + (beta[None] * own.conj()[:, :, None, :]).sum(-1))


def drag_noise(alpha: Array, beta: Array, window_s: float) -> float:
    """Factor by which `undrag` raises the standard deviation: √(1 + 2(|α|² + |β|²)/(2hT)²)."""
    strength = float((np.abs(alpha) ** 2 + np.abs(beta) ** 2).mean(0).sum(-1).max()) if alpha.size else 0.0
    return float(np.sqrt(1 + 2 * strength / (2 * NEIGHBOURS * window_s) ** 2))


def pooled_variance(residual2: Array, freedom: Array) -> Array:
    """Variance a sample (rows,) pooled over neighbouring rows until `POOL_FREEDOM` degrees of freedom; rows that are not finite stay so.

    A row far above its neighbours (a burst, a clipped top, lost samples) keeps its own variance and does not spoil theirs.
    """
    group = pool_rows(float(freedom if np.ndim(freedom) == 0 else np.median(freedom)))
    starts = np.arange(0, len(residual2), group)
    if len(starts) > 1 and len(residual2) - starts[-1] < group / 2:
        starts = starts[:-1]
    counts = np.diff(np.append(starts, len(residual2)))
    if np.ndim(freedom) == 0 and np.isfinite(residual2.sum()):
        level = np.add.reduceat(residual2, starts) / (counts * freedom)
        if not (np.maximum.reduceat(residual2, starts) > (4 * freedom + 40) * level).any():
            return np.repeat(level, counts)
    freedom = np.broadcast_to(np.asarray(freedom, float), residual2.shape)
    finite = np.isfinite(residual2)
    sums, weight = np.where(finite, residual2, 0.0), np.where(finite, freedom, 0.0)
    excess = np.zeros(len(residual2), bool)
    for _ in range(8):
        total = np.add.reduceat(np.where(excess, 0.0, sums), starts) / np.maximum(np.add.reduceat(np.where(excess, 0.0, weight), starts), 1)
        spread = np.repeat(total, counts)
        more = finite & (sums > (4 * freedom + 40) * spread)
        if (more == excess).all():
            break
        excess = more
    return np.where(finite, np.where(excess, sums / np.maximum(freedom, 1), spread), np.nan)


def pool_rows(freedom: float) -> int:
    """Rows pooled where each has so many degrees of freedom."""
    return max(1, int(np.ceil(POOL_FREEDOM / max(1.0, freedom))))
