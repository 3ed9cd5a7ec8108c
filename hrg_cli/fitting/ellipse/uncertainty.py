"""Standard deviations of {A, B, θ, φ, ψ} from those of the signals, for any mixture of good and bad signals.

The unweighted least-squares estimate is to first order a sum of projections of the envelope's error δu and (carrier) of half the
difference δd of the demodulated sidebands, with e_A = (cos θ, sin θ), e_B = (−sin θ, cos θ):
    δA = Re e^{−jφ} e_Aᵀδu,   δB = −Im e^{−jφ} e_Bᵀδu,   P = Re e^{−jφ} e_Bᵀδu,   Q = Im e^{−jφ} e_Aᵀδu,
    δθ = (A P − B Q)/(A² − B²),   δφ = (A Q − B P)/(A² − B²),   δψ = Re (j u)†δd / (A² + B²)
Signals of equal σ: direct σ_A = σ_B = σ, σ_θ = σ_φ = σ√(A²+B²)/|A²−B²|; carrier those over √2, and σ_ψ = σ/√(2(A²+B²)).
"""

import numpy as np

Array = np.ndarray
ANGLE_LIMIT, PHASE_LIMIT, CARRIER_LIMIT = np.pi / np.sqrt(12), np.pi / np.sqrt(3), np.pi / np.sqrt(12)
"""Standard deviations of an unknown angle: θ (electrical) and ψ repeat after π, φ after 2π; σ = range/√12."""


def standard_deviations(x: Array, variances: Array, carrier_known: bool) -> Array:
    """σ (n, 5) of A, B, θ (electrical), φ, ψ at x (n, 5) for signals of variances (n, 4) direct or (n, 8) carrier.

    The linear σ of an angle grows without bound towards a circular or a vanishing wave; it is joined there to that of an angle of
    which nothing is known, 1/σ² = 1/σ_linear² + 1/σ_unknown².
    """
    A, B, theta, phi, psi = x.T
    e_A = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    e_B = np.stack([-e_A[:, 1], e_A[:, 0]], axis=-1)
    turn = np.exp(1j * phi)[:, None]
    real, imaginary = _envelope_variances(variances)
    out = np.zeros_like(x)

    def project(direction: Array) -> Array:
        """Variance of Re(direction† δu)."""
        if real.shape[1] == 2:
            return np.sqrt((direction.real**2 * real + direction.imag**2 * imaginary).sum(-1))
        halves = [direction * np.exp(sign * 1j * psi)[:, None] / 2 for sign in (-1, 1)]
        weights = np.concatenate(halves, axis=-1)
        return np.sqrt((weights.real**2 * real + weights.imag**2 * imaginary).sum(-1))

    out[:, 0] = project(turn * e_A)
    out[:, 1] = project(-1j * turn * e_B)
    u = turn * (A[:, None] * e_A - 1j * B[:, None] * e_B)
    determinant, power = np.abs(A**2 - B**2), A**2 + B**2
    out[:, 2] = _limited(project(turn * (A[:, None] * e_B - 1j * B[:, None] * e_A)), determinant, ANGLE_LIMIT)
    out[:, 3] = _limited(project(turn * (1j * A[:, None] * e_A - B[:, None] * e_B)), determinant, PHASE_LIMIT)
    if real.shape[1] == 4 and not carrier_known:
        lower, upper = -1j * u * np.exp(-1j * psi)[:, None] / 2, 1j * u * np.exp(1j * psi)[:, None] / 2
        weights = np.concatenate([lower, upper], axis=-1)
        spread = np.sqrt((weights.real**2 * real + weights.imag**2 * imaginary).sum(-1))
        out[:, 4] = _limited(spread, power, CARRIER_LIMIT)
    return out


def _envelope_variances(variances: Array) -> tuple[Array, Array]:
    """Variances of real and imaginary parts: of u_C, u_S (direct), or of z⁻_C, z⁻_S, z⁺_C, z⁺_S (carrier)."""
    if variances.shape[1] == 4:
        return variances[:, 0::2], variances[:, 1::2]
    a, b = variances[:, [0, 4, 1, 5]], variances[:, [2, 6, 3, 7]]
    return b, a


def _limited(spread: Array, size: Array, unknown: float) -> Array:
    """σ = spread/size joined to that of an unknown angle; size 0 counts as unknown, NaN stays NaN."""
    ratio = np.where(size == 0, np.inf, spread / np.where(size == 0, 1.0, size)) / unknown
    return unknown * np.sin(np.arctan(ratio))
