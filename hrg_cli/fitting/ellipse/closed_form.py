"""The global least-squares solution of seed B's eight equations (1), without iteration.

For a given ψ the best envelope is the mean of the two demodulated sidebands, u = (z⁻e^{jψ} +
z⁺e^{−jψ})/2, and what is left is d = (z⁺e^{−jψ} − z⁻e^{jψ})/2 twice over. |d|² is least where Re Σ
z⁺z⁻* e^{−2jψ} is greatest:
    ψ = ½ arg Σ z⁺ z⁻*   (sum over both channels; PHYSICS §3)
Any u is an ellipse, so no further constraint remains and A, B, θ, φ follow from the Stokes formulas
of `physics.ellipse`.
"""

import numpy as np

from ...physics import ellipse
from ...physics.signals import find_sidebands

Array = np.ndarray
CHUNK_ROWS = 8192
"""Rows solved together, so that the intermediate arrays stay in the processor's cache."""


def split(
    signals: Array, carrier_phase_rad: float | Array | None = None
) -> tuple[Array, Array, Array]:
    """Envelopes u (n, 2), carrier phase ψ (n) and misfit rms (n) of eight signals (n, 8); ψ is
    estimated where it is not given.

    ψ estimated lies in (−π/2, π/2]; (u, ψ) and (−u, ψ + π) are the same signals. The rms is
    √(Σr²/8).
    """
    lower, upper = find_sidebands(signals)
    if carrier_phase_rad is None:
        cross = upper * np.conj(lower)
        psi = np.angle(cross[..., 0] + cross[..., 1]) / 2
    else:
        psi = np.broadcast_to(np.asarray(carrier_phase_rad, float), signals.shape[:-1])
    turn = np.exp(1j * psi)[..., None]
    from_lower, from_upper = lower * turn, upper * np.conj(turn)
    half_difference = (from_upper - from_lower) / 2
    power = half_difference.real**2 + half_difference.imag**2
    misfit = np.sqrt(power[..., 0] + power[..., 1]) / 2
    return (from_lower + from_upper) / 2, psi, misfit


def closed_form(signals: Array, carrier_phase_rad: float | None = None) -> tuple[Array, Array]:
    """x = (A, B, θ, φ, ψ) (n, 5) with A ≥ |B|, θ ∈ (−π/2, π/2] electrical, and the misfit rms (n),
    of eight signals (n, 8)."""
    x, misfit = np.empty((len(signals), 5)), np.empty(len(signals))
    for start in range(0, len(signals), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        u, x[rows, 4], misfit[rows] = split(signals[rows], carrier_phase_rad)
        for column, values in enumerate(ellipse.find_wave(u, 1)):
            x[rows, column] = values
    return x, misfit


def choose_canonical(x: Array, carrier_known: bool = False) -> Array:
    """The one of the sixteen equivalent solutions with A ≥ |B|, θ ∈ (−π/2, π/2], and ψ ∈ (−π/2,
    π/2] unless it is known."""
    A, B, theta, phi, psi = np.moveaxis(np.asarray(x, float), -1, 0)
    if not carrier_known:
        # −½ < ψ/π − half_turns ≤ ½, and (u, ψ) → (−u, ψ + π) takes φ along.
        half_turns = np.ceil(psi / np.pi - 0.5)
        phi, psi = phi - np.pi * half_turns, psi - np.pi * half_turns
    return np.stack(
        [*ellipse.find_wave(ellipse.compute_envelopes(A, B, theta, phi, 1), 1), psi], axis=-1
    )
