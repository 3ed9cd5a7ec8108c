"""The linear coordinates in which the slow generator is fitted, and their way to the resonator's
parameters and back.

L = −p₀ I − p₁ R_c − p₂ R_s + j p₃ R_c + j p₄ R_s + p₅ Ω J, R_c = R(0), R_s = R(π/2): ν, νδμ·(cos,
sin)2mθ_μ, δω·(cos, sin)2mθ_ω, K; p₆ scales the second-order correction of L (1 real resonator, 0
plain averaging).
"""

from __future__ import annotations

import numpy as np

from ...physics.resonator import Mechanics
from .matrices import Matrix, multiply

Array = np.ndarray
COORDINATES = (
    "damping",
    "damping_cos",
    "damping_sin",
    "split_cos",
    "split_sin",
    "scale_factor",
    "second_order",
)
COUNT = len(COORDINATES)
DAMPING, SCALE_FACTOR, SECOND_ORDER = 0, 5, 6
DAMPING_SPLIT, FREQUENCY_SPLIT = slice(1, 3), slice(3, 5)
"""Places of the coordinates in p; of a split its two components."""
SPLIT_COMPONENTS = (
    "damping_split_cos_1_s",
    "damping_split_sin_1_s",
    "frequency_split_cos_rad_s",
    "frequency_split_sin_rad_s",
)
"""Components of the two splits along their electrical axes 0 and 90°."""
SPLITS = (
    ("damping_split_1_s", "damping_axis_rad", SPLIT_COMPONENTS[:2]),
    ("frequency_split_rad_s", "stiffness_axis_rad", SPLIT_COMPONENTS[2:]),
)
"""Size, axis and components of a split."""
SHOWN = 2.3
"""Standard deviations of a component from which a split has an axis; noise alone shows as much with
the chance exp(−SHOWN²/2) = 0.07. With it error/σ of the axis is 0.87 to 1.14 for every true size
from half a standard deviation up; whatever σ(size) is, as long as it does not fall below the
slope's, one end or the other is beyond 0.88 to 1.11."""
R_COS = np.array([[1.0, 0.0], [0.0, -1.0]])
R_SIN = np.array([[0.0, 1.0], [1.0, 0.0]])
BASIS = np.array([-np.eye(2), -R_COS, -R_SIN, 1j * R_COS, 1j * R_SIN])
"""∂L/∂p of the first five coordinates, (5, 2, 2); of the sixth it is ΩJ."""


def build_generator(p: Array, rate_rad_s: Array, omega: Array | float) -> Array:
    """L of coordinates, against the run's own frequency: `compute_entries` side by side.

    Parameters
    ----------
    p
        (7,), in the order of `COORDINATES`.
    rate_rad_s
        Ω, (...).
    omega
        ω [rad/s], (...) or one.

    Returns
    -------
    ndarray
        (..., 2, 2) complex, 1/s.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import from_mechanics, build_generator
    >>> from hrg_cli.physics import resonator
    >>> gyro = resonator.Mechanics(1000.0, 0.2, 0.01, 0.3, 0.05, 0.1)
    >>> L = build_generator(from_mechanics(gyro), np.array(1.0), gyro.omega_rad_s)
    >>> bool(np.allclose(L, resonator.build_generator(gyro, 1.0), atol=1e-9))
    True
    """
    parts = compute_entries(p, np.asarray(rate_rad_s), np.asarray(omega, float))
    out = np.empty((*np.broadcast_shapes(*map(np.shape, parts)), 4), complex)
    for place, part in enumerate(parts):
        out[..., place] = part
    return out.reshape(*out.shape[:-1], 2, 2)


def compute_entries(p: Array, rate_rad_s: Array, omega: Array) -> Matrix:
    """The four entries of L, second order times p₆ (PHYSICS §0 and §5).

    The correction is −(L² + 2ΓL)/2jω three times over, Γ = −Re L₀, from L₀ with the mean of (ω ±
    δω)², ω² + δω² (solvent of resonator.py).

    Parameters
    ----------
    p
        (7,), in the order of `COORDINATES`.
    rate_rad_s, omega
        Ω and the run's own ω [rad/s], (...).

    Returns
    -------
    tuple of ndarray
        L₀₀, L₀₁, L₁₀, L₁₁, each (...) complex, 1/s.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import compute_entries
    >>> p = np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0])
    >>> [float(np.real(part)) for part in compute_entries(p, np.array(1.0), np.array(6283.0))]
    [-0.2, 0.5, -0.5, -0.2]
    """
    # L₁ = [[−ν + along, across + KΩ], [across − KΩ, −ν − along]]
    along, across, turning = -p[1] + 1j * p[3], -p[2] + 1j * p[4], p[5] * rate_rad_s
    first = (along - p[0], across + turning, across - turning, -along - p[0])
    if p[6] == 0:
        return first

    # the stiffness is (ω² + δω²) I + 2ωδω R: its δω² adds jδω²/2ω to both diagonal entries
    factor = p[6] / (2j * omega)
    shift = (p[3] ** 2 + p[4] ** 2) * factor
    first = (first[0] - shift, first[1], first[2], first[3] - shift)

    # L = L₁ − (L + 2Γ)L/2jω, Γ = −Re L₁: each round adds an order in the slow rates over ω
    twice = tuple(-2 * np.real(m) for m in first)
    L = first
    for _ in range(3):
        sum_ = (L[0] + twice[0], L[1] + twice[1], L[2] + twice[2], L[3] + twice[3])
        change = multiply(sum_, L)
        L = (
            first[0] - factor * change[0],
            first[1] - factor * change[1],
            first[2] - factor * change[2],
            first[3] - factor * change[3],
        )
    return L


def to_mechanics(p: Array, frequency_hz: float, mode_number: int) -> Mechanics:
    """The resonator that coordinates describe.

    Parameters
    ----------
    p
        (7,), in the order of `COORDINATES`.
    frequency_hz
        Its frequency, which the coordinates do not hold.
    mode_number
        m.

    Returns
    -------
    Mechanics
        Its axes in [0, π/m).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import to_mechanics
    >>> p = np.array([0.2, 0.0, 0.01, 0.0, 0.0, 0.55, 1.0])
    >>> round(to_mechanics(p, 1000.0, 2).damping_axis_rad * 8 / np.pi, 9)
    1.0
    """
    values, _ = to_parameters(p, mode_number)
    nu, split, damping_axis, detuning, stiffness_axis, factor = (float(v) for v in values)
    return Mechanics(
        frequency_hz, nu, split, damping_axis, detuning, stiffness_axis, factor, mode_number
    )


def from_mechanics(mechanics: Mechanics, second_order: float = 1.0) -> Array:
    """Coordinates of a resonator.

    Parameters
    ----------
    mechanics
        The resonator.
    second_order
        1, as a real resonator has it, or 0 for plain averaging.

    Returns
    -------
    ndarray
        (7,), in the order of `COORDINATES`.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.coordinates import from_mechanics
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from_mechanics(Mechanics(1000.0, 0.2, 0.01, 0.0)).tolist()
    [0.2, 0.01, 0.0, 0.0, 0.0, 0.55, 1.0]
    """
    m = mechanics
    a, b = 2 * m.mode_number * m.damping_axis_rad, 2 * m.mode_number * m.stiffness_axis_rad
    return np.array(
        [
            m.damping_rate_1_s,
            m.damping_split_1_s * np.cos(a),
            m.damping_split_1_s * np.sin(a),
            m.frequency_split_rad_s * np.cos(b),
            m.frequency_split_rad_s * np.sin(b),
            m.scale_factor,
            second_order,
        ]
    )


def to_parameters(p: Array, mode_number: int) -> tuple[Array, Array]:
    """(ν, νδμ, θ_μ, δω, θ_ω, K) of coordinates and their derivatives.

    Parameters
    ----------
    p
        (7,), in the order of `COORDINATES`.
    mode_number
        m.

    Returns
    -------
    tuple of ndarray
        Values (6,), axes in [0, π/m), and slopes (6, 7). A split of 0 has no axis: its slopes are
        those of its size along the first component.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import to_parameters
    >>> values, slopes = to_parameters(np.array([0.2, 0.03, 0.04, 0, 0, 0.55, 1.0]), 2)
    >>> round(float(values[1]), 9), slopes[1, 1:3].round(9).tolist()
    (0.05, [0.6, 0.8])
    """
    values, slopes = np.zeros(6), np.zeros((6, COUNT))
    values[0], slopes[0, 0] = p[0], 1.0
    values[5], slopes[5, 5] = p[5], 1.0
    for row, first in ((1, 1), (3, 3)):
        x, y = p[first], p[first + 1]
        size = float(np.hypot(x, y))
        values[row] = size
        values[row + 1] = wrap_axis(np.arctan2(y, x) / (2 * mode_number), mode_number)
        safe = size if size > 0 else 1.0
        slopes[row, first : first + 2] = (x / safe, y / safe) if size > 0 else (1.0, 0.0)
        slopes[row + 1, first : first + 2] = (
            np.array([-y, x]) / safe / safe / (2 * mode_number) if size > 0 else (0.0, 0.0)
        )
    return values, slopes


def wrap_axis(axis_rad: float, mode_number: int) -> float:
    """A physical axis angle in [0, π/m).

    Parameters
    ----------
    axis_rad
        Any angle.
    mode_number
        m.

    Returns
    -------
    float
        The same axis; 0 within rounding of π/m.

    Examples
    --------
    >>> import math
    >>> from hrg_cli.fitting.envelopes.coordinates import wrap_axis
    >>> round(wrap_axis(-0.1, 2) - math.pi / 2, 9), wrap_axis(math.pi / 2, 2)
    (-0.1, 0.0)
    """
    wrapped = float(np.mod(axis_rad, np.pi / mode_number))
    return 0.0 if np.isclose(wrapped, np.pi / mode_number, rtol=0, atol=1e-15) else wrapped


def is_shown(components: Array, covariance: Array) -> bool:
    """Whether normal components show a split at all: pᵀΣ⁻¹p beyond what noise alone reaches once in
    fourteen times.

    Parameters
    ----------
    components
        (2,), along the electrical axes 0 and 90°.
    covariance
        Theirs, (2, 2).

    Returns
    -------
    bool
        True where the split has an axis.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import is_shown
    >>> is_shown(np.array([2.0, 0.0]), np.eye(2)), is_shown(np.array([3.0, 0.0]), np.eye(2))
    (False, True)
    """
    size, vector = np.linalg.eigh(covariance)
    across = (vector.T @ components) ** 2 / np.maximum(size, 1e-12 * max(size[-1], 1e-300))
    return bool(np.sum(across) >= SHOWN**2)


def compute_axis_spread(components: Array, covariance: Array, mode_number: int) -> float:
    """Standard deviation of the axis of normal components.

    A uniform one's where they show no split (`is_shown`), else that of the components about their
    own, at most the uniform one's. By Gauss–Hermite quadrature: the better known of two components
    may make the tangent look sharp, and then the slope says too little.

    Parameters
    ----------
    components
        x and y, (2,), of an axis arg(x + jy)/2m.
    covariance
        Theirs, (2, 2).
    mode_number
        m.

    Returns
    -------
    float
        rad.

    Examples
    --------
    Far from 0 it is the slope's, σ/2m|p|:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import compute_axis_spread
    >>> round(compute_axis_spread(np.array([100.0, 0.0]), np.eye(2), 2), 6)
    0.0025
    """
    uniform = np.pi / mode_number / np.sqrt(12)
    if not is_shown(components, covariance):
        return float(uniform)
    size, vector = np.linalg.eigh(covariance)
    nodes, weights = np.polynomial.hermite_e.hermegauss(48)
    offset = np.sqrt(np.maximum(size, 0.0))[:, None, None] * np.stack(
        np.meshgrid(nodes, nodes, indexing="ij")
    )
    x, y = components[:, None, None] + np.tensordot(vector, offset, 1)
    # angles from the split's own direction: the cut at ±π is where it points least
    turned = np.angle((x + 1j * y) * complex(components[0], -components[1]))
    weight = np.outer(weights, weights) / np.sum(weights) ** 2
    return float(min(np.sqrt(np.sum(weight * turned**2)) / (2 * mode_number), uniform))
