"""The eight signals of the amplitude-modulated (carrier) read-out, seed B (1), and their complex
form.

The electrodes multiply the displacement by the carrier −sin(ω_c t + ψ); the cosine (a) and sine (b)
coefficients at the difference and sum frequencies ω_c ∓ ω are, in the order a_c⁻, a_c⁺, b_c⁻, b_c⁺,
a_s⁻, a_s⁺, b_s⁻, b_s⁺ (columns z₁ … z₈):
    z^- = −b⁻ + j a⁻ = u e^{−jψ},    z^+ = −b⁺ − j a⁺ = u e^{+jψ},
    u = (C0, S0) = e^{jφ}(A e_A − j B e_B)
with e_A = (cos θ, sin θ), e_B = (−sin θ, cos θ): seed B's wave angle θ is the electrical one, m
times the physical angle, and its ellipse is the project's envelope. The product's factor ½ is not
in the coefficients: A and B are the displacement's amplitudes.
"""

import numpy as np

Array = np.ndarray


def make_signals(x: Array) -> Array:
    """F(x), seed B (1): the eight signals of a wave under a carrier, with the signs of PHYSICS §3.

    Parameters
    ----------
    x
        (A, B, θ, φ, ψ), (..., 5): amplitudes in the signals' unit, angles in rad; θ is the
        electrical angle.

    Returns
    -------
    ndarray
        (..., 8): a_c⁻, a_c⁺, b_c⁻, b_c⁺, a_s⁻, a_s⁺, b_s⁻, b_s⁺.

    Examples
    --------
    >>> from hrg_cli.physics.signals import make_signals
    >>> [round(float(z), 3) + 0.0 for z in make_signals([1.0, 0.0, 0.0, 0.5, 0.1])]
    [0.389, -0.565, -0.921, -0.825, 0.0, 0.0, 0.0, 0.0]
    """
    A, B, theta, phi, psi = np.moveaxis(np.asarray(x, float), -1, 0)
    cos, sin = np.cos(theta), np.sin(theta)
    cos_m, sin_m, cos_p, sin_p = (
        np.cos(phi - psi),
        np.sin(phi - psi),
        np.cos(phi + psi),
        np.sin(phi + psi),
    )
    return np.stack(
        [
            A * cos * sin_m + B * sin * cos_m,
            -A * cos * sin_p - B * sin * cos_p,
            -A * cos * cos_m + B * sin * sin_m,
            -A * cos * cos_p + B * sin * sin_p,
            A * sin * sin_m - B * cos * cos_m,
            -A * sin * sin_p + B * cos * cos_p,
            -A * sin * cos_m - B * cos * sin_m,
            -A * sin * cos_p - B * cos * sin_p,
        ],
        axis=-1,
    )


def find_sidebands(z: Array) -> tuple[Array, Array]:
    """Complex sidebands of eight signals: z⁻ = −b⁻ + j a⁻ = u e^{−jψ}, z⁺ = −b⁺ − j a⁺ = u e^{+jψ}.

    Parameters
    ----------
    z
        The eight signals, (..., 8).

    Returns
    -------
    tuple of ndarray
        z⁻ and z⁺, each (..., 2) for the channels C and S.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.signals import find_sidebands, make_signals
    >>> lower, upper = find_sidebands(make_signals([1.0, 0.0, 0.0, 0.5, 0.1]))
    >>> round(float(np.angle(lower[0])), 3), round(float(np.angle(upper[0])), 3)
    (0.4, 0.6)
    """
    lower = -z[..., 2::4] + 1j * z[..., 0::4]
    upper = -z[..., 3::4] - 1j * z[..., 1::4]
    return lower, upper


def from_sidebands(lower: Array, upper: Array) -> Array:
    """Eight signals of complex sidebands: the inverse of `find_sidebands`.

    Parameters
    ----------
    lower, upper
        z⁻ and z⁺, (..., 2) complex.

    Returns
    -------
    ndarray
        (..., 8).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.signals import from_sidebands, find_sidebands, make_signals
    >>> z = make_signals([1.0, 0.2, 0.3, 0.5, 0.1])
    >>> bool(np.allclose(from_sidebands(*find_sidebands(z)), z))
    True
    """
    z = np.empty((*lower.shape[:-1], 8))
    z[..., 0::4], z[..., 1::4] = lower.imag, -upper.imag
    z[..., 2::4], z[..., 3::4] = -lower.real, -upper.real
    return z


def compute_direct_envelopes(four: Array) -> Array:
    """Envelopes of the direct read-out's signals: C0 = c_cos − j c_sin, S0 likewise.

    Parameters
    ----------
    four
        c_cos, c_sin, s_cos, s_sin, (..., 4).

    Returns
    -------
    ndarray
        u (..., 2), complex.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.signals import compute_direct_envelopes
    >>> compute_direct_envelopes(np.array([1.0, 0.5, 0.0, 0.25])).tolist()
    [(1-0.5j), -0.25j]
    """
    return four[..., 0::2] - 1j * four[..., 1::2]
