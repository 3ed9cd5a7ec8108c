"""The standing wave as an ellipse: envelopes (C0, S0) <-> main amplitude, quadrature, wave angle,
phase <-> Stokes vector.

C0 = e^{jφ}(a_A cos mθ + j a_B sin mθ), S0 = e^{jφ}(a_A sin mθ − j a_B cos mθ)
(PHYSICS §0; seed A before (6))
"""

import numpy as np

Array = np.ndarray


def compute_envelopes(
    main_amplitude: Array,
    quadrature_amplitude: Array,
    wave_angle_rad: Array,
    phase_rad: Array,
    mode_number: int = 2,
) -> Array:
    """Complex envelopes of the channels C and S for a wave.

    C0 = e^{jφ}(a_A cos mθ + j a_B sin mθ), S0 = e^{jφ}(a_A sin mθ − j a_B cos mθ) (PHYSICS §0).

    Parameters
    ----------
    main_amplitude, quadrature_amplitude
        a_A and the signed a_B, (...,) in the signals' unit.
    wave_angle_rad, phase_rad
        θ and φ, (...,) rad.
    mode_number
        m.

    Returns
    -------
    ndarray
        (..., 2), complex.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.ellipse import compute_envelopes
    >>> np.round(compute_envelopes(1.0, 0.0, np.pi / 4, 0.0), 6).tolist()
    [0j, (1+0j)]
    """
    cos, sin = (
        np.cos(mode_number * np.asarray(wave_angle_rad)),
        np.sin(mode_number * np.asarray(wave_angle_rad)),
    )
    turn = np.exp(1j * np.asarray(phase_rad))
    c0 = turn * (main_amplitude * cos + 1j * quadrature_amplitude * sin)
    s0 = turn * (main_amplitude * sin - 1j * quadrature_amplitude * cos)
    return np.stack(np.broadcast_arrays(c0, s0), axis=-1)


def compute_stokes(u: Array) -> Array:
    """Stokes vector of envelopes (PHYSICS §0).

    S₀ = |C|² + |S|², then (a_A² − a_B²)·(cos 2mθ, sin 2mθ), then 2·Im(C0 S0*) = 2 a_A a_B:
    quadratic, so without a special place at a circle, where θ and φ alone are undetermined.

    Parameters
    ----------
    u
        Envelopes (..., 2), complex, in the signals' unit.

    Returns
    -------
    ndarray
        (..., 4), in that unit squared.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.ellipse import compute_envelopes, compute_stokes
    >>> np.round(compute_stokes(compute_envelopes(1.0, 0.5, 0.0, 0.3)), 9).tolist()
    [1.25, 0.75, 0.0, 1.0]
    """
    c, s = u[..., 0], u[..., 1]
    c2, s2, cross = np.abs(c) ** 2, np.abs(s) ** 2, c * np.conj(s)
    return np.stack([c2 + s2, c2 - s2, 2 * cross.real, 2 * cross.imag], axis=-1)


def find_wave(u: Array, mode_number: int = 2) -> tuple[Array, Array, Array, Array]:
    """(a_A, a_B, θ, φ) of envelopes: a_A ≥ |a_B|, θ in (−π/2m, π/2m], φ in (−π, π].

    a_A = √((S0+q)/2), a_B = S3/2a_A, θ = arg(S1+jS2)/2m with the Stokes parameters S and
    q = √(S1²+S2²); φ = arg(e_Aᵀu), where e_Aᵀu = a_A e^{jφ}.

    Parameters
    ----------
    u
        Envelopes (..., 2), complex.
    mode_number
        m.

    Returns
    -------
    tuple of ndarray
        a_A and a_B in the signals' unit, θ and φ in rad, each (...,).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.ellipse import compute_envelopes, find_wave
    >>> [round(float(x), 9) for x in find_wave(compute_envelopes(1.0, 0.1, 0.3, 0.5))]
    [1.0, 0.1, 0.3, 0.5]
    """
    s0, s1, s2, s3 = np.moveaxis(compute_stokes(u), -1, 0)
    a_A = np.sqrt((s0 + np.hypot(s1, s2)) / 2)
    # S3 = 2a_A a_B, so a_B keeps its sign and its digits where √((S0 − q)/2) would lose both near a
    # line.
    a_B = np.divide(s3, 2 * a_A, out=np.zeros_like(a_A), where=a_A > 0)
    electrical = np.arctan2(s2, s1) / 2
    phase = np.angle(np.cos(electrical) * u[..., 0] + np.sin(electrical) * u[..., 1])
    return a_A, a_B, electrical / mode_number, phase


def unwrap(wave_angle_rad: Array, phase_rad: Array, mode_number: int = 2) -> tuple[Array, Array]:
    """Continuous (θ, φ) along the first axis: (mθ, φ) and (mθ + π, φ + π) are the same wave.

    Parameters
    ----------
    wave_angle_rad, phase_rad
        θ and φ [rad], (n,); rows that are not finite are stepped over.
    mode_number
        m.

    Returns
    -------
    tuple of ndarray
        θ and φ, each without jumps.

    Examples
    --------
    The wave turns past π/2m, and φ, which the sign of e_A drags along, stays:

    >>> import numpy as np
    >>> from hrg_cli.physics.ellipse import unwrap
    >>> angle, phase = unwrap(np.array([0.78, -0.78]), np.array([0.1, 0.1 - np.pi]))
    >>> np.round(angle, 2).tolist(), np.round(phase, 2).tolist()
    ([0.78, 0.79], [0.1, 0.1])
    """
    angle, phase = np.array(wave_angle_rad, float), np.array(phase_rad, float)
    good = np.isfinite(angle) & np.isfinite(phase)
    # θ first: mθ repeats after π, and each half turn taken there turns φ by π as well.
    electrical = np.unwrap(mode_number * angle[good], period=np.pi)
    turned = np.round((electrical - mode_number * angle[good]) / np.pi)
    angle[good] = electrical / mode_number
    phase[good] = np.unwrap(phase[good] + turned * np.pi)
    return angle, phase
