"""Envelopes as reals, and the directions in which a wave can differ from another: along it, its
phase, its angle, its quadrature."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def to_reals(u: Array) -> Array:
    """(..., 2) complex as (..., 4) reals: Re C, Re S, Im C, Im S."""
    return np.concatenate([u.real, u.imag], axis=-1)


def to_complex(x: Array) -> Array:
    """Inverse of `to_reals`."""
    return x[..., :2] + 1j * x[..., 2:]


def real_matrix(L: Array) -> Array:
    """Complex (..., 2, 2) as the real (..., 4, 4) that acts on `to_reals` vectors."""
    top = np.concatenate([L.real, -L.imag], axis=-1)
    return np.concatenate([top, np.concatenate([L.imag, L.real], axis=-1)], axis=-2)


def find_directions(u: Array) -> Array:
    """Unit changes (..., 4, 2) of envelopes u (..., 2): in relative amplitude, phase, angle (across
    the wave) and ellipticity."""
    size = np.sqrt(np.sum(np.abs(u) ** 2, axis=-1, keepdims=True))
    along = u / np.where(size > 0, size, 1.0)
    across = np.stack([-np.conj(along[..., 1]), np.conj(along[..., 0])], axis=-1)
    return np.stack([along, 1j * along, across, 1j * across], axis=-2)
