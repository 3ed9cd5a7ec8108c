"""Least-squares bases of a demodulation window: cos, sin of the wanted frequencies, nuisance terms,
and t·cos, t·sin where asked.

y(τ) = Σ_a [p_a cos ω_a τ + q_a sin ω_a τ] + constant + nuisance tones (+ τ·(…)), τ from the
window's centre; envelope U_a = p_a − j q_a. A window without the τ terms is pulled by the
envelope's slope U1: ΔU = α U1 + β U1*, of the order U1/2ω whatever its length; every window by the
curvature U2, about U2·T²/24. `Pull` holds these and what slope or curvature leave in the residual.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Pull:
    """What an unmodelled motion M (slope U1 or curvature U2) does to a window: ΔU = α M + β M*, and
    (p, q)ᵀ·left·(p, q) with M = p − jq to the residual's sum of squares. alpha, beta (rows or 1, F,
    F); left (rows or 1, 2F, 2F)."""

    alpha: Array
    beta: Array
    left: Array


@dataclass(frozen=True)
class WindowBasis:
    """The basis of one evenly sampled window, orthonormal: q = y @ `orthonormal` (n, k),
    coefficients p, q = q @ `triangle` (k, 2F).

    `sloping` (n, 2F): what t·cos, t·sin add to it, where they stand in it already what t²·cos,
    t²·sin do; empty where the samples are too few. `bent`: the curvature's pull, its residual taken
    off `sloping` too.
    `variance` (2F,): of p_0, q_0, p_1, … for unit sample noise; `slope` and `curvature`: their
    pulls. `condition`: of the basis with its columns scaled to one.
    """

    orthonormal: Array
    sloping: Array
    triangle: Array
    variance: Array
    slope: Pull
    curvature: Pull
    bent: Pull
    condition: float

    @property
    def freedom(self) -> int:
        """Degrees of freedom left in a window."""
        return self.orthonormal.shape[0] - self.orthonormal.shape[1]


def build_columns(
    tau_s: Array,
    frequency_hz: tuple[float, ...],
    nuisance_hz: tuple[float, ...] = (),
    moving: bool = False,
    scale_s: float = 1.0,
) -> Array:
    """Basis (n, k) at times from the centre: the wanted pairs, a constant, nuisance pairs, and with
    `moving` (τ/scale)·the wanted pairs."""
    wanted = build_pairs(tau_s, frequency_hz)
    parts = [wanted, np.ones((len(tau_s), 1)), build_pairs(tau_s, nuisance_hz)]
    if moving:
        parts.append(tau_s[:, None] / scale_s * wanted)
    return np.concatenate(parts, -1)


def build_pairs(tau_s: Array, frequency_hz: tuple[float, ...]) -> Array:
    """cos, sin of each frequency in turn, (n, 2F)."""
    phase = 2 * np.pi * np.multiply.outer(tau_s, np.asarray(frequency_hz, float))
    return np.stack([np.cos(phase), np.sin(phase)], -1).reshape(len(tau_s), 2 * len(frequency_hz))


def build_rotations(time_s: Array, frequency_hz: Array) -> Array:
    """e^{2πjft} (frequencies, times) on an even grid of frequencies, by doubling: one product a
    value instead of a sine and a cosine."""
    out = np.empty((len(frequency_hz), len(time_s)), complex)
    out[0] = np.exp(2j * np.pi * frequency_hz[0] * time_s)
    if len(frequency_hz) > 1:
        # The error of `jump` doubles with each doubling, no faster than that of the phase 2πft
        # itself.
        jump, filled = np.exp(2j * np.pi * (frequency_hz[1] - frequency_hz[0]) * time_s), 1
        while filled < len(out):
            more = min(filled, len(out) - filled)
            np.multiply(out[:more], jump, out=out[filled : filled + more])
            filled, jump = filled + more, jump * jump
    return out


def compute_pull(coefficients: Array, left: Array) -> Pull:
    """The pull of a motion whose unit (p, q) put `coefficients` (..., 2F, 2F) into (p, q) and
    `left` into the residual."""
    m00, m01 = coefficients[..., 0::2, 0::2], coefficients[..., 0::2, 1::2]
    m10, m11 = coefficients[..., 1::2, 0::2], coefficients[..., 1::2, 1::2]
    return Pull((m00 + m11 + 1j * (m01 - m10)) / 2, (m00 - m11 - 1j * (m10 + m01)) / 2, left)


def build_window_basis(
    samples: int,
    sample_rate_hz: float,
    frequency_hz: tuple[float, ...],
    nuisance_hz: tuple[float, ...] = (),
    moving: bool = False,
) -> WindowBasis | None:
    """The basis of a window of evenly spaced samples about its centre; None where it is singular or
    has more columns than samples."""
    tau = (np.arange(samples) - (samples - 1) / 2) / sample_rate_hz
    matrix = build_columns(tau, frequency_hz, nuisance_hz, moving, samples / sample_rate_hz / 2)
    norm = np.sqrt((matrix**2).sum(0))
    if samples < matrix.shape[1] or norm.min() < 1e-9:
        return None
    singular = np.linalg.svd(matrix / norm, compute_uv=False)
    if singular[-1] < 1e-10 * singular[0]:
        return None
    q, r = np.linalg.qr(matrix)
    inverse = np.linalg.inv(r)[: 2 * len(frequency_hz)]
    tones = 2 * len(frequency_hz)
    pulls = []
    for motion in (tau[:, None] * matrix[:, :tones], tau[:, None] ** 2 / 2 * matrix[:, :tones]):
        taken = q.T @ motion
        pulls.append(
            compute_pull((inverse @ taken)[None], (motion.T @ motion - taken.T @ taken)[None])
        )
    sloping = _sloping(q, motion if moving else tau[:, None] * matrix[:, :tones])
    taken = sloping.T @ motion
    return WindowBasis(
        np.ascontiguousarray(q),
        sloping,
        np.ascontiguousarray(inverse.T),
        (inverse**2).sum(1),
        pulls[0],
        pulls[1],
        replace(pulls[1], left=pulls[1].left - taken.T @ taken),
        float(singular[0] / singular[-1]),
    )


def _sloping(q: Array, motion: Array) -> Array:
    """Orthonormal columns (n, 2F) that span a motion off the basis q; none (n, 0) where less than
    two degrees of freedom would be left, or the motion is of the basis."""
    off = motion - q @ (q.T @ motion)
    size = np.linalg.norm(motion, axis=0)
    own, triangle = np.linalg.qr(off / np.where(size > 0, size, 1.0))
    # Columns that are 1e-3 apart from the basis would carry the noise a thousandfold.
    if len(q) < q.shape[1] + motion.shape[1] + 2 or np.abs(np.diag(triangle)).min() < 1e-3:
        return np.empty((len(q), 0))
    return np.ascontiguousarray(own)
