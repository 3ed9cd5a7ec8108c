"""Least-squares bases of a demodulation window: cos, sin of one or two frequencies, a constant, and t·cos, t·sin where asked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class WindowBasis:
    """A basis at fixed times about the window's centre, made orthonormal: q = y @ `orthonormal`, coefficients = q @ `triangle`.

    `orthonormal` (n, k), `triangle` (k, signals): the first rows of R⁻¹, transposed; the coefficients are those of cos, sin of each
    frequency in turn. `covariance` (signals, signals) is theirs for unit sample noise; `condition` that of the basis with columns scaled to one.
    """

    orthonormal: Array
    triangle: Array
    covariance: Array
    condition: float

    @property
    def freedom(self) -> int:
        """Degrees of freedom left in a window."""
        return self.orthonormal.shape[0] - self.orthonormal.shape[1]


def columns(tau_s: Array, frequency_hz: tuple[float, ...], moving: bool = False) -> Array:
    """(n, k): cos, sin of each frequency at times from the centre, a constant, and with `moving` t·cos, t·sin (t in half windows)."""
    parts = []
    for f in frequency_hz:
        parts += [np.cos(2 * np.pi * f * tau_s), np.sin(2 * np.pi * f * tau_s)]
    waves = len(parts)
    parts.append(np.ones_like(tau_s))
    if moving:
        scaled = tau_s / max(np.abs(tau_s).max(), 1e-300)
        parts += [scaled * part for part in parts[:waves]]
    return np.stack(parts, -1)


def window_basis(samples: int, sample_rate_hz: float, frequency_hz: tuple[float, ...], moving: bool = False) -> WindowBasis:
    """The basis of a window of evenly spaced samples about its centre."""
    tau = (np.arange(samples) - (samples - 1) / 2) / sample_rate_hz
    matrix = columns(tau, frequency_hz, moving)
    if samples < matrix.shape[1]:
        return WindowBasis(np.zeros((samples, matrix.shape[1])), np.zeros((matrix.shape[1], 2 * len(frequency_hz))), np.zeros((0, 0)), float("inf"))
    norm = np.sqrt((matrix**2).sum(0))
    norm[norm == 0] = 1.0
    singular = np.linalg.svd(matrix / norm, compute_uv=False)
    condition = float(singular[0] / singular[-1]) if singular[-1] > 0 else float("inf")
    if condition > 1e12:
        return WindowBasis(np.zeros_like(matrix), np.zeros((matrix.shape[1], 2 * len(frequency_hz))), np.zeros((0, 0)), condition)
    q, r = np.linalg.qr(matrix)
    inverse = np.linalg.inv(r)[: 2 * len(frequency_hz)]
    return WindowBasis(np.ascontiguousarray(q), np.ascontiguousarray(inverse.T), inverse @ inverse.T, condition)
