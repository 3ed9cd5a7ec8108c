"""Standard deviations of {A, B, θ, φ, ψ} from those of the signals, for any mixture of good and bad
signals.

The unweighted least-squares estimate is to first order a sum of projections of the envelope's error
δu and (carrier) of half the difference δd of the demodulated sidebands, with e_A = (cos θ, sin θ),
e_B = (−sin θ, cos θ):
    δA = Re e^{−jφ} e_Aᵀδu,   δB = −Im e^{−jφ} e_Bᵀδu,   P = Re e^{−jφ} e_Bᵀδu,   Q = Im e^{−jφ} e_Aᵀδu,
    δθ = (A P − B Q)/(A² − B²),   δφ = (A Q − B P)/(A² − B²),   δψ = Re (j u)†δd / (A² + B²)
Signals of equal σ: direct σ_A = σ_B = σ, σ_θ = σ_φ = σ√(A²+B²)/|A²−B²|; carrier those over √2, and
σ_ψ = σ/√(2(A²+B²)).
"""

import numpy as np

Array = np.ndarray
CHUNK_ROWS = 4096
"""Rows worked on together, so that the intermediate arrays stay in the processor's cache."""
ANGLE_LIMIT, PHASE_LIMIT, CARRIER_LIMIT = (
    np.pi / np.sqrt(12),
    np.pi / np.sqrt(3),
    np.pi / np.sqrt(12),
)
"""Standard deviations of an unknown angle: θ (electrical) and ψ repeat after π, φ after 2π; σ =
range/√12."""


def standard_deviations(x: Array, variances: Array, carrier_known: bool) -> Array:
    """σ (n, 5) of A, B, θ (electrical), φ, ψ at x (n, 5) for signals of variances (n, 4) direct or
    (n, 8) carrier.

    A projection Re d†δu has the variance Σ |d|²M + Re(d²N) over both channels, M half the sum and N
    half the difference of the variances of Re u and Im u; with a carrier each is the sum over both
    side bands, N turned by their phases ∓2ψ, over 4. With d from the module's page and T = e^{2jφ}N
    all is real in P = Re T, Q = Im T, e_A², e_B² and e_A e_B.

    The linear σ of an angle grows without bound towards a circular or a vanishing wave; it is
    joined there to that of an angle of which nothing is known, 1/σ² = 1/σ_linear² + 1/σ_unknown².
    """
    out = np.zeros_like(x)
    for start in range(0, len(x), CHUNK_ROWS):
        rows = slice(start, start + CHUNK_ROWS)
        _fill(out[rows], x[rows], variances[rows], variances.shape[1] == 8 and not carrier_known)
    return out


def _fill(out: Array, x: Array, variances: Array, with_carrier: bool) -> None:
    A, B, theta, phi, psi = np.ascontiguousarray(x.T)
    cos, sin = np.cos(theta), np.sin(theta)
    cos_turn, sin_turn = np.cos(2 * phi), np.sin(2 * phi)
    cos2, sin2, A2, B2, cross = cos * cos, sin * sin, A * A, B * B, 2 * A * B * cos * sin
    sums = np.zeros((5, len(A)))
    for (M, real, imaginary), along2, across2, product in zip(
        _halves(variances, psi), (cos2, sin2), (sin2, cos2), (-cross, cross), strict=True
    ):
        P = cos_turn * real - sin_turn * imaginary
        Q = (cos_turn * imaginary + sin_turn * real) * product
        more, less = M + P, M - P
        sums[0] += along2 * more
        sums[1] += across2 * less
        sums[2] += A2 * across2 * more + B2 * along2 * less + Q
        both = A2 * along2 * less + B2 * across2 * more
        sums[3] += both + Q
        sums[4] += both - Q
    spread = np.sqrt(np.maximum(sums, 0.0))
    determinant = np.abs(A2 - B2)
    out[:, 0], out[:, 1] = spread[0], spread[1]
    out[:, 2] = _limited(spread[2], determinant, ANGLE_LIMIT)
    out[:, 3] = _limited(spread[3], determinant, PHASE_LIMIT)
    if with_carrier:
        out[:, 4] = _limited(spread[4], A2 + B2, CARRIER_LIMIT)


def _halves(variances: Array, psi: Array) -> tuple[tuple[Array, Array | float, Array | float], ...]:
    """M, Re N and Im N (n) of channels C and S, see `standard_deviations`."""
    if variances.shape[1] == 4:
        c_re, c_im, s_re, s_im = np.ascontiguousarray(variances.T) / 2
        return (c_re + c_im, c_re - c_im, 0.0), (s_re + s_im, s_re - s_im, 0.0)
    a_c_low, a_c_up, b_c_low, b_c_up, a_s_low, a_s_up, b_s_low, b_s_up = (
        np.ascontiguousarray(variances.T) / 8
    )
    cos, sin = np.cos(2 * psi), np.sin(2 * psi)
    halves = []
    for a_low, a_up, b_low, b_up in (
        (a_c_low, a_c_up, b_c_low, b_c_up),
        (a_s_low, a_s_up, b_s_low, b_s_up),
    ):
        low, up = b_low - a_low, b_up - a_up
        halves.append((a_low + a_up + b_low + b_up, (up + low) * cos, (up - low) * sin))
    return tuple(halves)


def _limited(spread: Array, size: Array, unknown: float) -> Array:
    """σ = spread/size joined to that of an unknown angle; size 0 counts as unknown, NaN stays
    NaN."""
    with np.errstate(divide="ignore", invalid="ignore"):
        joined = spread / np.sqrt(size * size + (spread / unknown) ** 2)
    return np.where(size == 0, unknown, joined)
