"""Least-squares fits of many windows at once: one shared basis at even times, batched normal equations at uneven times.

Both give a `Fits`; `signals` turns it to the reference frequency, takes out the drag of the envelope's slope, and adds standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .basis import WindowBasis, columns, drag, pairs

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
    variance (rows or 1, 2F) of p, q for unit noise; alpha, beta (rows or 1, F, F): `basis.drag`.
    """

    envelope: Array
    residual2: Array
    freedom: Array
    samples: Array
    variance: Array
    alpha: Array
    beta: Array


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
        np.matmul(y, basis.orthonormal, out=q[start : start + at_once])
        if samples < 64:
            np.einsum("ij,ij->i", y, y, out=square[start : start + at_once])
        else:
            square[start : start + at_once] = (y[:, None, :] @ y[:, :, None])[:, 0, 0]
    fit = q @ basis.triangle
    return fit[:, 0::2] - 1j * fit[:, 1::2], np.maximum(square - np.einsum("ij,ij->i", q, q), 0.0)


def fit_uneven(
    time_s: Array,
    y: Array,
    window: Array,
    centre_s: Array,
    width_s: float,
    frequency_hz: tuple[float, ...],
    nuisance_hz: tuple[float, ...],
    moving: bool,
) -> Fits:
    """Windows at true times: `window` (n,) is each sample's row in `centre_s`, not decreasing; y (channels, n).

    A window with fewer samples than unknowns + 1, or whose samples do not separate the unknowns, holds NaN.
    """
    rows, tones = len(centre_s), 2 * len(frequency_hz)
    tau = time_s - centre_s[window]
    basis = columns(tau, frequency_hz, nuisance_hz, moving, width_s / 2)
    k = basis.shape[1]
    right = np.concatenate([y.T, tau[:, None] * pairs(tau, frequency_hz)], 1)
    present, starts, samples_present = np.unique(window, return_index=True, return_counts=True)
    samples = np.zeros(rows, int)
    samples[present] = samples_present
    gram, cross, square = np.zeros((rows, k, k)), np.zeros((rows, k, right.shape[1])), np.zeros((rows, len(y)))
    if len(present):
        for a in range(k):
            gram[present, a, a:] = np.add.reduceat(basis[:, a : a + 1] * basis[:, a:], starts, axis=0)
            gram[:, a:, a] = gram[:, a, a:]
            cross[present, a] = np.add.reduceat(basis[:, a : a + 1] * right, starts, axis=0)
        square[present] = np.add.reduceat(y.T**2, starts, axis=0)
    values = np.linalg.eigvalsh(gram)
    good = (samples > k) & (values[:, 0] > 1e-6 * values[:, -1])
    gram[~good] = np.eye(k)
    inverse = np.linalg.inv(gram)
    fit = inverse @ cross
    residual2 = np.maximum(square - np.einsum("rkc,rkc->rc", fit[:, :, : len(y)], cross[:, :, : len(y)]), 0.0)
    envelope = np.moveaxis(fit[:, 0:tones:2, : len(y)] - 1j * fit[:, 1:tones:2, : len(y)], -1, 0).copy()
    envelope[:, ~good] = np.nan
    residual2[~good] = np.nan
    alpha, beta = drag(fit[:, :tones, len(y) :])
    still = 0.0 if moving else 1.0
    return Fits(
        envelope, residual2.T, np.maximum(samples - k, 1), samples, np.einsum("rkk->rk", inverse)[:, :tones], still * alpha, still * beta
    )


def to_reference(envelope: Array, turn: Array, local_less_reference_rad_s: Array, window_s: float, alpha: Array, beta: Array) -> Array:
    """Envelopes (channel, rows, F) against the reference, e^{−jω_r t_k} = `turn` (rows, F), freed from their slope's drag.

    The slope in the local frame comes from rows ± `NEIGHBOURS`: U1 = (U_{k+h} e^{−jΔhT} − U_{k−h} e^{jΔhT})/2hT, Δ = ω_local − ω_r;
    then U ← U − (α U1 + β U1*) with U1 turned back to the window's own phase. Rows at the ends use their neighbour's slope.
    """
    u = envelope * turn
    rows = u.shape[1]
    h = min(NEIGHBOURS, (rows - 1) // 2)
    if h < 1 or not (alpha.any() or beta.any()):
        return u
    ahead = np.exp(-1j * local_less_reference_rad_s * h * window_s) / (2 * h * window_s)
    slope = np.empty_like(u)
    slope[:, h : rows - h] = u[:, 2 * h :] * ahead - u[:, : rows - 2 * h] * ahead.conj()
    slope[:, :h], slope[:, rows - h :] = slope[:, h : h + 1], slope[:, rows - h - 1 : rows - h]
    if not np.isfinite(slope.sum()):
        slope[~np.isfinite(slope)] = 0.0
    if u.shape[2] == 1 and len(alpha) == 1:
        if abs(alpha[0, 0, 0]) > 1e-6 * abs(beta[0, 0, 0]):
            u -= alpha[0, 0, 0] * slope
        u -= np.conj(slope) * (beta[0, 0, 0] * turn * turn)
        return u
    own = slope * turn.conj()
    u -= turn * ((alpha[None] * own[:, :, None, :]).sum(-1) + (beta[None] * own.conj()[:, :, None, :]).sum(-1))
    return u


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
