"""Standard deviations of {A, B, θ, φ, ψ} from those of the signals, for any mixture of good and bad
signals.

The unweighted least-squares estimate is to first order a sum of projections of the envelope's error
δu and (carrier) of half the difference δd of the demodulated sidebands, with e_A = (cos θ, sin θ),
e_B = (−sin θ, cos θ):
    δA = Re e^{−jφ} e_Aᵀδu,   δB = −Im e^{−jφ} e_Bᵀδu,
    P = Re e^{−jφ} e_Bᵀδu,   Q = Im e^{−jφ} e_Aᵀδu,
    δθ = (A P − B Q)/(A² − B²),   δφ = (A Q − B P)/(A² − B²),   δψ = Re (j u)†δd / (A² + B²)
Signals of equal σ: direct σ_A = σ_B = σ, σ_θ = σ_φ = σ√(A²+B²)/|A²−B²|; carrier those over √2, and
σ_ψ = σ/√(2(A²+B²)).
"""

import numpy as np

Array = np.ndarray
CHUNK_ROWS = 8192
"""Rows worked on together, so that the intermediate arrays stay in the processor's cache."""
ANGLE_LIMIT, PHASE_LIMIT, CARRIER_LIMIT = (
    np.pi / np.sqrt(12),
    np.pi / np.sqrt(3),
    np.pi / np.sqrt(12),
)
"""Standard deviations of an unknown angle: θ (electrical) and ψ repeat after π, φ after 2π; σ =
range/√12."""


def compute_standard_deviations(
    x: Array, variances: Array, carrier_known: bool, correlation: float = 0.0
) -> Array:
    """Standard deviations of A, B, θ (electrical), φ, ψ from the variances of the signals.

    A projection Re d†δu has the variance Σ |d|²M + Re(d²N) over both channels, M half the sum and N
    half the difference of the variances of Re u and Im u; with a carrier each is the sum over both
    side bands, N turned by their phases ∓2ψ, over 4. With d from the module's page and T = e^{2jφ}N
    all is real in P = Re T, Q = Im T, e_A², e_B² and e_A e_B. What both channels' noise has in
    common adds 2 e_C e_S ρ√(M_C M_S) to a projection along e: ± sin 2θ times that.

    The linear σ of an angle grows without bound towards a circular or a vanishing wave; it is
    joined there to that of an angle of which nothing is known, 1/σ² = 1/σ_linear² + 1/σ_unknown².

    Parameters
    ----------
    x
        A, B, θ (electrical), φ, ψ (n, 5).
    variances
        Of the signals, direct (n, 4) or with a carrier (n, 8).
    carrier_known
        Whether ψ is known; its σ is then 0, as without a carrier.
    correlation
        ρ of the channels' noise.

    Returns
    -------
    ndarray
        (n, 5), amplitudes in the signals' unit, angles in rad.

    Examples
    --------
    Signals of σ = 1e-3: σ_A = σ_B = σ, σ_θ = σ_φ = σ√(A² + B²)/|A² − B²|; at a circle θ is not
    known.

    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.uncertainty import compute_standard_deviations
    >>> x = np.array([[1.0, 0.5, 0.3, 0.2, 0.0], [1.0, 1.0, 0.3, 0.2, 0.0]])
    >>> compute_standard_deviations(x, np.full((2, 4), 1e-6), True).round(6).tolist()
    [[0.001, 0.001, 0.001491, 0.001491, 0.0], [0.001, 0.001, 0.9069, 1.813799, 0.0]]
    """
    out = np.zeros_like(x)
    for start in range(0, len(x), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        with_carrier = variances.shape[1] == 8 and not carrier_known
        _fill(out[rows], x[rows], variances[rows], with_carrier, correlation)
    return out


def _fill(out: Array, x: Array, variances: Array, with_carrier: bool, correlation: float) -> None:
    """Write the standard deviations of some rows, by the variances of the projections."""
    A, B, theta, phi, psi = np.ascontiguousarray(x.T)
    cosine, sine = _double_angle(theta)
    cos2 = (1 + cosine) / 2
    sin2, A2, B2 = 1 - cos2, A * A, B * B
    cos_turn, sin_turn = _double_angle(phi)
    more, less, imaginary = [], [], []
    halves = _halves(variances, psi)
    for M, real, other in halves:
        P = cos_turn * real - sin_turn * other
        more.append(M + P)
        less.append(M - P)
        imaginary.append(cos_turn * other + sin_turn * real)
    common = correlation * sine * np.sqrt(halves[0][0] * halves[1][0]) if correlation else 0.0
    turning = sin2 * more[0] + cos2 * more[1] - common  # of e_B in phase, of e_A beside it
    beating = cos2 * less[0] + sin2 * less[1] + common
    mixed = A * B * sine * (imaginary[1] - imaginary[0])
    both = A2 * beating + B2 * turning
    # |A² − B²| is the Jacobian's: at a circle θ and φ exchange without a change of the signals.
    determinant = np.abs(A2 - B2)
    out[:, 0] = _root(cos2 * more[0] + sin2 * more[1] + common)
    out[:, 1] = _root(sin2 * less[0] + cos2 * less[1] - common)
    out[:, 2] = _limited(A2 * turning + B2 * beating + mixed, determinant, ANGLE_LIMIT)
    out[:, 3] = _limited(both + mixed, determinant, PHASE_LIMIT)
    if with_carrier:
        out[:, 4] = _limited(both - mixed, A2 + B2, CARRIER_LIMIT)


def _double_angle(angle: Array) -> tuple[Array, Array]:
    """cos and sin of twice an angle, both by its tangent, which costs less than either."""
    tangent = np.tan(angle)
    square = tangent * tangent
    return (1 - square) / (1 + square), 2 * tangent / (1 + square)


def _root(variance: Array) -> Array:
    """Square root; rounding may leave a variance below zero."""
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _halves(variances: Array, psi: Array) -> tuple[tuple[Array, Array | float, Array | float], ...]:
    """M, Re N and Im N (n) of channels C and S, see `compute_standard_deviations`."""
    if variances.shape[1] == 4:
        c_re, c_im, s_re, s_im = np.ascontiguousarray(variances.T) / 2
        return (c_re + c_im, c_re - c_im, 0.0), (s_re + s_im, s_re - s_im, 0.0)
    a_c_low, a_c_up, b_c_low, b_c_up, a_s_low, a_s_up, b_s_low, b_s_up = (
        np.ascontiguousarray(variances.T) / 8
    )
    cos, sin = _double_angle(psi)
    halves = []
    for a_low, a_up, b_low, b_up in (
        (a_c_low, a_c_up, b_c_low, b_c_up),
        (a_s_low, a_s_up, b_s_low, b_s_up),
    ):
        low, up = b_low - a_low, b_up - a_up
        halves.append((a_low + a_up + b_low + b_up, (up + low) * cos, (up - low) * sin))
    return tuple(halves)


def _limited(variance: Array, size: Array, unknown: float) -> Array:
    """σ = √variance/size joined to that of an unknown angle; size 0 counts as unknown, NaN stays
    NaN."""
    above = np.maximum(variance, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        joined = np.asarray(np.sqrt(above / (size * size + above / unknown**2)))
    if not size.all():
        joined[size == 0] = unknown
    return joined
