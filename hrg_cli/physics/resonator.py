"""The linear resonator: second-order equations of motion, their slow generator exact to second
order, and its propagator.

Fast, in the instrument axes z = (C, S)
(seed A (3) at θ_x = 0, with the Euler term of PHYSICS M14):
    z'' + 2(N − KΩ J) z' + (W − KΩ' J) z = force,
    N = ν I + ν δμ R(2mθ_μ),   W = (ω² + δω²) I + 2 ω δω R(2mθ_ω)
Slow, z = Re[u e^{jω_r t}]: u' = L u, L the solvent of the quadratic eigenproblem near
    L₀ = −N + j δω R(2mθ_ω) + j(ω − ω_r) + KΩ J   (PHYSICS §0)
R(α) = [[cos α, sin α], [sin α, −cos α]], J = [[0, 1], [−1, 0]].
"""

from dataclasses import dataclass

import numpy as np

Array = np.ndarray
IDENTITY = np.eye(2)
J = np.array([[0.0, 1.0], [-1.0, 0.0]])

PARAMETERS = (
    ("frequency_hz", "Hz"),
    ("damping_rate_1_s", "s-1"),
    ("damping_split_1_s", "s-1"),
    ("damping_axis_rad", "rad"),
    ("frequency_split_rad_s", "rad s-1"),
    ("stiffness_axis_rad", "rad"),
    ("scale_factor", "1"),
)
"""Resonator parameters with their units, in file order (docs/reference/files.md)."""
OF_GENERATOR = tuple(name for name, _ in PARAMETERS if name != "frequency_hz")
"""Those that the slow generator holds: all but the frequency, which every run has of its own."""


@dataclass(frozen=True)
class Mechanics:
    """The linear resonator's parameters: f, ν = 1/τ, νδμ, θ_μ, δω = (ω_p − ω_q)/2, θ_ω, K, and the
    mode number m."""

    frequency_hz: float
    damping_rate_1_s: float
    damping_split_1_s: float = 0.0
    damping_axis_rad: float = 0.0
    frequency_split_rad_s: float = 0.0
    stiffness_axis_rad: float = 0.0
    scale_factor: float = 0.55
    mode_number: int = 2

    @property
    def omega_rad_s(self) -> float:
        """Mean angular frequency ω = (ω_p + ω_q)/2."""
        return 2 * np.pi * self.frequency_hz

    def build_damping_matrix(self) -> Array:
        """N, 1/s."""
        return self.damping_rate_1_s * IDENTITY + self.damping_split_1_s * make_reflection(
            2 * self.mode_number * self.damping_axis_rad
        )

    def build_stiffness_matrix(self) -> Array:
        """W, rad²/s²: eigenvalues (ω ± δω)²."""
        omega, split = self.omega_rad_s, self.frequency_split_rad_s
        return (omega**2 + split**2) * IDENTITY + 2 * omega * split * make_reflection(
            2 * self.mode_number * self.stiffness_axis_rad
        )


def make_reflection(alpha: float | Array) -> Array:
    """R(α) = [[cos α, sin α], [sin α, −cos α]], (..., 2, 2).

    Parameters
    ----------
    alpha
        α [rad], an electrical angle (2m times a physical axis), (...).

    Returns
    -------
    ndarray
        (..., 2, 2), symmetric, with the eigenvalues ±1.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.resonator import make_reflection
    >>> np.round(make_reflection(np.pi / 2), 9).tolist()
    [[0.0, 1.0], [1.0, -0.0]]
    """
    cos, sin = np.cos(alpha), np.sin(alpha)
    return np.stack([np.stack([cos, sin], -1), np.stack([sin, -cos], -1)], -2)


def split_matrix(cos: float, sin: float) -> Array:
    """c R(0) + s R(π/2) = [[c, s], [s, −c]] (2, 2): a split of components c and s along the
    electrical axes 0 and π/2.

    Parameters
    ----------
    cos, sin
        Components c and s of the split, in its own unit.

    Returns
    -------
    ndarray
        (2, 2), in that unit.

    Examples
    --------
    >>> from hrg_cli.physics.resonator import split_matrix
    >>> split_matrix(0.02, 0.01).tolist()
    [[0.02, 0.01], [0.01, -0.02]]
    """
    return np.array([[cos, sin], [sin, -cos]])


def build_generator(
    mechanics: Mechanics,
    rate_rad_s: float | Array = 0.0,
    reference_frequency_hz: float | None = None,
    second_order: float = 1.0,
) -> Array:
    """Slow generator L of u' = L u for a constant rate.

    L₀ = −N + jδω R(2mθ_ω) + j(ω − ω_r) + KΩ J averages over a period (PHYSICS §0; Lynch 1995); the
    solvent adds what is of second order in the slow rates over ω (PHYSICS §5).

    Parameters
    ----------
    mechanics
        The resonator.
    rate_rad_s
        Ω [rad/s], (...).
    reference_frequency_hz
        ω_r/2π, against which the envelopes are taken; by default the resonator's own frequency.
    second_order
        1 for the solvent, exact to O(L³/ω²); 0 for plain averaging; between them a part of it.

    Returns
    -------
    ndarray
        (..., 2, 2) complex, 1/s.

    Examples
    --------
    A rate turns the wave by −KΩ, here 0.5 rad/s:

    >>> import numpy as np
    >>> from hrg_cli.physics.resonator import Mechanics, build_generator
    >>> gyro = Mechanics(1000.0, 0.1, scale_factor=0.5)
    >>> np.round(build_generator(gyro, 1.0, second_order=0).real, 9).tolist()
    [[-0.1, 0.5], [-0.5, -0.1]]
    """
    omega_r = (
        2
        * np.pi
        * (mechanics.frequency_hz if reference_frequency_hz is None else reference_frequency_hz)
    )
    turning = mechanics.scale_factor * np.asarray(rate_rad_s, float)[..., None, None] * J
    damping = mechanics.build_damping_matrix() - turning
    if second_order == 0:
        return average_generator(damping, mechanics.build_stiffness_matrix(), omega_r)
    return find_solvent(damping, mechanics.build_stiffness_matrix(), omega_r, second_order)


def average_generator(damping: Array, stiffness: Array, omega_r: float) -> Array:
    """L₀ = −Γ + j(√W − ω_r), the motion averaged over a period (PHYSICS §0; Lynch 1995).

    √W = (W + √det W)/√(tr W + 2√det W), exact for two by two: its eigenvalues are ω ± δω.

    Parameters
    ----------
    damping
        Γ = N − KΩJ, (..., 2, 2), 1/s.
    stiffness
        W, (..., 2, 2), rad²/s².
    omega_r
        ω_r [rad/s] of the envelopes.

    Returns
    -------
    ndarray
        L₀ (..., 2, 2) complex, 1/s.

    Examples
    --------
    Damping does not change the frequency of the average:

    >>> import numpy as np
    >>> from hrg_cli.physics.resonator import average_generator
    >>> average_generator(0.2 * np.eye(2), 100.0**2 * np.eye(2), 100.0)[0, 0].round(9).tolist()
    (-0.2+0j)
    """
    W = np.asarray(stiffness, float)
    product = np.sqrt(W[..., 0, 0] * W[..., 1, 1] - W[..., 0, 1] * W[..., 1, 0])
    sum_ = np.sqrt(W[..., 0, 0] + W[..., 1, 1] + 2 * product)
    root = (W + product[..., None, None] * IDENTITY) / sum_[..., None, None]
    return np.asarray(-damping + 1j * (root - omega_r * IDENTITY))


def find_solvent(
    damping: Array, stiffness: Array, omega_r: float, second_order: float = 1.0
) -> Array:
    """L with (jω_r + L)² + 2Γ(jω_r + L) + W = 0 near −Γ + j(W − ω_r²)/2ω_r (PHYSICS §5).

    Three steps of L ← L₀ − (L² + 2ΓL)/2jω_r: each is wrong by a further factor of the slow rates
    over ω, and the third is below rounding for any resonator with Q above some hundred.

    Parameters
    ----------
    damping
        Γ = N − KΩJ, (..., 2, 2), 1/s.
    stiffness
        W, (..., 2, 2), rad²/s².
    omega_r
        ω_r [rad/s] of the envelopes.
    second_order
        Part of the second order that is taken, 0 to 1.

    Returns
    -------
    ndarray
        L (..., 2, 2) complex, 1/s.

    Examples
    --------
    A damped oscillation is slower by ν²/2ω:

    >>> import numpy as np
    >>> from hrg_cli.physics.resonator import find_solvent
    >>> L = find_solvent(0.2 * np.eye(2), 100.0**2 * np.eye(2), 100.0)
    >>> bool(np.isclose(L[0, 0], -0.2 - 0.2**2 / 200 * 1j, atol=1e-8))
    True
    """
    first = -damping + 1j * (stiffness - omega_r**2 * IDENTITY) / (2 * omega_r)
    L = first
    for _ in range(3):
        L = first - second_order * (L @ L + 2 * damping @ L) / (2j * omega_r)
    return L


def exponentiate(L: Array, time_s: float | Array) -> Array:
    """exp(L t) of 2 × 2 matrices in closed form, through equal eigenvalues too.

    exp(Lt) = e^{ht}[cosh(dt) I + t·sinhc(dt)(L − hI)], h = tr L/2, d² = h² − det L.

    Parameters
    ----------
    L
        (..., 2, 2), 1/s.
    time_s
        t [s], broadcast against L's leading axes.

    Returns
    -------
    ndarray
        (..., 2, 2) complex: u(t) = exp(L t) u(0).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.resonator import J, exponentiate
    >>> np.round(exponentiate(J, np.pi / 2).real, 9).tolist()
    [[0.0, 1.0], [-1.0, 0.0]]
    """
    t = np.asarray(time_s)[..., None, None]
    half = (L[..., 0, 0] + L[..., 1, 1])[..., None, None] / 2
    rest = L - half * IDENTITY
    d = np.sqrt((rest[..., 0, 0] ** 2 + rest[..., 0, 1] * rest[..., 1, 0]).astype(complex))[
        ..., None, None
    ]
    x = d * t
    # sinh x/x cancels at 0; its series up to x²/6 leaves x⁴/120 = 1e-18 there.
    small = np.abs(x) < 1e-4
    safe = np.where(small, 1.0, x)
    sinhc = np.where(small, 1 + x**2 / 6, np.sinh(safe) / safe)
    return np.exp(half * t) * (np.cosh(x) * IDENTITY + t * sinhc * rest)
