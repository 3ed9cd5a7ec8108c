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


def fit_even(y: Array, basis: WindowBasis) -> tuple[Array, Array]:
    """Envelope (rows, F) and residual sum of squares (rows,) of one channel's windows (rows, samples): one matrix product."""
    q = y @ basis.orthonormal
    fit = q @ basis.triangle
    residual2 = np.einsum("ij,ij->i", y, y) - np.einsum("ij,ij->i", q, q)
    return fit[:, 0::2] - 1j * fit[:, 1::2], np.maximum(residual2, 0.0)


def fit_uneven(
    time_s: Array, y: Array, window: Array, centre_s: Array, width_s: float, frequency_hz: tuple[float, ...], nuisance_hz: tuple[float, ...], moving: bool
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
    """Envelopes (rows, F) of one channel against the reference, e^{−jω_r t_k} = `turn` (rows, F), freed from their slope's drag.

    The slope in the local frame comes from rows ± `NEIGHBOURS`: U1 = (U_{k+h} e^{−jΔhT} − U_{k−h} e^{jΔhT})/2hT, Δ = ω_local − ω_r;
    then U ← U − (α U1 + β U1*) with U1 turned back to the window's own phase. Rows at the ends use their neighbour's slope.
    """
    u = envelope * turn
    rows = len(u)
    h = min(NEIGHBOURS, (rows - 1) // 2)
    if h < 1 or not (alpha.any() or beta.any()):
        return u
    ahead = np.exp(-1j * local_less_reference_rad_s * h * window_s)
    slope = np.empty_like(u)
    slope[h : rows - h] = (u[2 * h :] * ahead - u[: rows - 2 * h] * ahead.conj()) / (2 * h * window_s)
    slope[:h], slope[rows - h :] = slope[h], slope[rows - h - 1]
    slope[~np.isfinite(slope)] = 0.0
    if u.shape[1] == 1 and len(alpha) == 1:
        return u - (alpha[0, 0, 0] * slope + beta[0, 0, 0] * (slope * turn.conj() * turn.conj()).conj())
    own = slope * turn.conj()
    return u - turn * (np.einsum("rab,rb->ra", np.broadcast_to(alpha, (rows, *alpha.shape[1:])), own) + np.einsum("rab,rb->ra", np.broadcast_to(beta, (rows, *beta.shape[1:])), own.conj()))


def pooled_variance(residual2: Array, freedom: Array) -> Array:
    """Variance a sample (rows,) pooled over neighbouring rows until `POOL_FREEDOM` degrees of freedom; rows that are not finite stay so.

    A row far above its neighbours (a burst, a clipped top, lost samples) keeps its own variance and does not spoil theirs.
    """
    freedom = np.broadcast_to(np.asarray(freedom, float), residual2.shape)
    group = pool_rows(float(np.median(freedom)))
    starts = np.arange(0, len(residual2), group)
    if len(starts) > 1 and len(residual2) - starts[-1] < group / 2:
        starts = starts[:-1]
    counts = np.diff(np.append(starts, len(residual2)))
    finite = np.isfinite(residual2)
    weight = np.where(finite, freedom, 0.0)
    sums = np.where(finite, residual2, 0.0)
    own = sums / np.maximum(freedom, 1)
    far = 4 + 40 / np.maximum(freedom, 1)
    total = np.add.reduceat(sums, starts) / np.maximum(np.add.reduceat(weight, starts), 1)
    spread = np.repeat(total, counts)
    excess = finite & (own > far * spread)
    for _ in range(8):
        if not excess.any():
            break
        total = np.add.reduceat(np.where(excess, 0.0, sums), starts) / np.maximum(np.add.reduceat(np.where(excess, 0.0, weight), starts), 1)
        spread = np.repeat(total, counts)
        more = finite & (own > far * spread)
        if (more == excess).all():
            break
        excess = more
    return np.where(finite, np.where(excess, own, spread), np.nan)


def pool_rows(freedom: float) -> int:
    """Rows pooled where each has so many degrees of freedom."""
    return max(1, int(np.ceil(POOL_FREEDOM / max(1.0, freedom))))
