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


def split_envelopes(
    signals: Array, carrier_phase_rad: float | Array | None = None
) -> tuple[Array, Array, Array]:
    """Envelopes, carrier phase and misfit of eight signals; the phase is estimated where it is not
    given.

    Estimated, ψ = ½ arg Σ z⁺z⁻* lies in (−π/2, π/2]; (u, ψ) and (−u, ψ + π) are the same signals.

    Parameters
    ----------
    signals
        Of both channels' side bands (n, 8).
    carrier_phase_rad
        ψ, one or (n,); None: it is estimated.

    Returns
    -------
    u : ndarray
        (n, 2), complex, of channels C and S.
    psi : ndarray
        (n,), rad.
    misfit : ndarray
        (n,), √(Σr²/8), unit of the signals.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.closed_form import split_envelopes
    >>> from hrg_cli.physics.signals import make_signals
    >>> u, psi, misfit = split_envelopes(make_signals(np.array([[1.0, 0.1, 0.3, 0.2, 0.4]])))
    >>> psi.round(9).tolist(), bool(misfit[0] < 1e-15), round(float((np.abs(u) ** 2).sum()), 9)
    ([0.4], True, 1.01)
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


def solve_closed_form(
    signals: Array, carrier_phase_rad: float | None = None
) -> tuple[Array, Array]:
    """Wave parameters and misfit of eight signals, the global least-squares solution.

    Parameters
    ----------
    signals
        Of both channels' side bands (n, 8).
    carrier_phase_rad
        ψ where it is known; None: it is estimated.

    Returns
    -------
    x : ndarray
        A, B, θ, φ, ψ (n, 5), A ≥ |B|, θ ∈ (−π/2, π/2] electrical.
    misfit : ndarray
        (n,), √(Σr²/8), unit of the signals.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.closed_form import solve_closed_form
    >>> from hrg_cli.physics.signals import make_signals
    >>> x, misfit = solve_closed_form(make_signals(np.array([[1.0, 0.1, 0.3, 0.2, 0.4]])))
    >>> x.round(9).tolist(), bool(misfit[0] < 1e-15)
    ([[1.0, 0.1, 0.3, 0.2, 0.4]], True)
    """
    x, misfit = np.empty((len(signals), 5)), np.empty(len(signals))
    for start in range(0, len(signals), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        u, x[rows, 4], misfit[rows] = split_envelopes(signals[rows], carrier_phase_rad)
        for column, values in enumerate(ellipse.find_wave(u, 1)):
            x[rows, column] = values
    return x, misfit


def choose_canonical(x: Array, carrier_known: bool = False) -> Array:
    """The one of the sixteen equivalent solutions with A ≥ |B|, θ ∈ (−π/2, π/2], and ψ ∈ (−π/2,
    π/2] unless it is known.

    Parameters
    ----------
    x
        A, B, θ (electrical), φ, ψ (n, 5).
    carrier_known
        Whether ψ stays as it is.

    Returns
    -------
    ndarray
        (n, 5).

    Examples
    --------
    Semi-axes exchanged, the carrier half a turn on:

    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.closed_form import choose_canonical
    >>> from hrg_cli.physics.signals import make_signals
    >>> x = np.array([[0.1, -1.0, 0.3, 0.2, 0.4 + np.pi]])
    >>> same = choose_canonical(x)
    >>> same.round(3).tolist(), np.allclose(make_signals(same), make_signals(x))
    ([[1.0, -0.1, -1.271, 1.771, 0.4]], True)
    """
    A, B, theta, phi, psi = np.moveaxis(np.asarray(x, float), -1, 0)
    if not carrier_known:
        # −½ < ψ/π − half_turns ≤ ½, and (u, ψ) → (−u, ψ + π) takes φ along.
        half_turns = np.ceil(psi / np.pi - 0.5)
        phi, psi = phi - np.pi * half_turns, psi - np.pi * half_turns
    return np.stack(
        [*ellipse.find_wave(ellipse.compute_envelopes(A, B, theta, phi, 1), 1), psi], axis=-1
    )
