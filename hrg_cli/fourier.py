"""Tables over wave angle and temperature: a Fourier series in 2mθ with coefficients that are
interpolated between nodes.

value(x, θ) = Σ_j ψ_j(x) [h_j0 + Σ_k h_j,2k−1 cos 2mkθ + h_j,2k sin 2mkθ],   ψ_j(x_i) = δ_ij
x is temperature (or frequency); 2mθ because a linear defect repeats with the period π/m of the wave
angle (PHYSICS §0, harmonic theorem).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Array = np.ndarray


def build_harmonic_basis(
    wave_angle_rad: Array,
    harmonics: int,
    mode_number: int,
    travel_rad: Array | float = 0.0,
    block_travel_rad: Array | float = 0.0,
) -> Array:
    """Columns 1, cos 2mθ, sin 2mθ, …, sin 2mKθ, averaged along what the wave travels.

    A harmonic nθ averaged along a stretch Δθ that is crossed evenly loses the factor
    sin(nΔθ/2)/(nΔθ/2). Between two averages over blocks of windows it loses a second one, of the
    travel within a block: the weight is the convolution of both boxes.

    Parameters
    ----------
    wave_angle_rad
        θ [rad], (n,).
    harmonics
        K.
    mode_number
        m.
    travel_rad
        Δθ about each θ [rad], (n,) or one number.
    block_travel_rad
        Δθ within a block [rad], (n,) or one number.

    Returns
    -------
    ndarray
        (n, 1 + 2K).

    Examples
    --------
    A quarter of the period π/2 of m = 2, and the same averaged over half of it:

    >>> import numpy as np
    >>> from hrg_cli.fourier import build_harmonic_basis
    >>> build_harmonic_basis(np.array([np.pi / 8]), 1, 2).round(6).tolist()
    [[1.0, 0.0, 1.0]]
    >>> build_harmonic_basis(np.array([np.pi / 8]), 1, 2, travel_rad=np.pi / 4).round(6).tolist()
    [[1.0, 0.0, 0.63662]]
    """
    angle = np.asarray(wave_angle_rad, float)
    columns = np.empty((angle.size, 1 + 2 * harmonics))
    columns[:, 0] = 1.0
    n = 2 * mode_number * np.arange(1, harmonics + 1)
    loss = np.sinc(np.asarray(travel_rad)[..., None] * n / (2 * np.pi)) * np.sinc(
        np.asarray(block_travel_rad)[..., None] * n / (2 * np.pi)
    )
    columns[:, 1::2] = np.cos(angle[:, None] * n) * loss
    columns[:, 2::2] = np.sin(angle[:, None] * n) * loss
    return columns


def compute_node_weights(x: Array, nodes: Array, interpolation: str = "linear") -> Array:
    """Weights ψ_j(x) of the node values: linear between neighbours, or the cardinal cubic splines
    (not-a-knot).

    Beyond the outer nodes the outer straight line (or the spline's outer slope) is continued;
    whether that is allowed is the table's range, not this function's business.

    Parameters
    ----------
    x
        Temperature or frequency, (n,).
    nodes
        Of the table, rising, (J,).
    interpolation
        "linear", or else cubic.

    Returns
    -------
    ndarray
        (n, J); every row sums to 1.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fourier import compute_node_weights
    >>> compute_node_weights(np.array([5.0, 25.0]), np.array([0.0, 10.0, 20.0])).tolist()
    [[0.5, 0.5, 0.0], [0.0, -0.5, 1.5]]
    """
    x, nodes = np.asarray(x, float), np.asarray(nodes, float)
    if len(nodes) == 1:
        return np.ones((x.size, 1))
    if interpolation == "linear" or len(nodes) == 2:
        left = np.clip(np.searchsorted(nodes, x) - 1, 0, len(nodes) - 2)
        part = (x - nodes[left]) / (nodes[left + 1] - nodes[left])
        weights = np.zeros((x.size, len(nodes)))
        rows = np.arange(x.size)
        weights[rows, left] = 1 - part
        weights[rows, left + 1] = part
        return weights
    from scipy.interpolate import CubicSpline

    return _continue_straight(CubicSpline(nodes, np.eye(len(nodes))), x, nodes)


def _continue_straight(curve: Callable[..., Array], x: Array, nodes: Array) -> Array:
    """A curve's values at x (n,), beyond the outer nodes along its slopes there."""
    inside = np.clip(x, nodes[0], nodes[-1])
    return np.asarray(curve(inside) + curve(inside, 1) * (x - inside)[:, None])


def compute_monotone_weights(x: Array, nodes: Array, values: Array) -> Array:
    """Weights with Σ_j weight_j·value_j = the monotone (PCHIP) interpolant of the values at x.

    The interpolant is homogeneous of degree one in the node values, so by Euler's theorem its
    derivatives with respect to them are such weights; a fit repeats with them until they settle.

    Parameters
    ----------
    x
        Temperature or frequency, (n,).
    nodes
        Of the table, rising, (J,).
    values
        At the nodes, (J,).

    Returns
    -------
    ndarray
        (n, J).

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.interpolate import PchipInterpolator
    >>> from hrg_cli.fourier import compute_monotone_weights
    >>> x, nodes, values = np.array([3.0]), np.array([0.0, 10.0, 20.0]), np.array([1.0, 2.0, 8.0])
    >>> curve = PchipInterpolator(nodes, values)
    >>> bool(np.allclose(compute_monotone_weights(x, nodes, values) @ values, curve(x)))
    True
    """
    from scipy.interpolate import PchipInterpolator

    nodes, values = np.asarray(nodes, float), np.asarray(values, float)
    if len(nodes) < 3:
        return compute_node_weights(x, nodes)
    # where all values are one, any step gives the same weights
    step = 1e-6 * (float(np.ptp(values)) or max(1.0, float(np.abs(values).max())))
    moved = (
        values[:, None] + np.concatenate([np.eye(len(nodes)), -np.eye(len(nodes))], axis=1) * step
    )
    both = _continue_straight(PchipInterpolator(nodes, moved, axis=0), np.asarray(x, float), nodes)
    return np.asarray((both[:, : len(nodes)] - both[:, len(nodes) :]) / (2 * step))


def interpolate_coefficients(
    x: Array, nodes: Array, coefficients: Array, interpolation: str = "linear"
) -> Array:
    """Fourier coefficients at x from those of the nodes.

    Parameters
    ----------
    x
        Temperature or frequency, (n,).
    nodes
        Of the table, rising, (J,).
    coefficients
        h_j, (J, H), in the unit of the table.
    interpolation
        "linear", "cubic" or "monotone".

    Returns
    -------
    ndarray
        (n, H), in the same unit.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fourier import interpolate_coefficients
    >>> nodes, at_nodes = np.array([0.0, 20.0]), np.array([[1.0, 0.0], [3.0, 4.0]])
    >>> interpolate_coefficients(np.array([5.0]), nodes, at_nodes).tolist()
    [[1.5, 1.0]]
    """
    return make_interpolant(nodes, coefficients, interpolation)(x)


def make_interpolant(
    nodes: Array, coefficients: Array, interpolation: str = "linear"
) -> Callable[[Array], Array]:
    """`interpolate_coefficients` of one table, for many calls.

    Parameters
    ----------
    nodes
        Of the table, rising, (J,).
    coefficients
        h_j, (J, H), in the unit of the table.
    interpolation
        "linear", "cubic" or "monotone".

    Returns
    -------
    callable
        x (n,) -> coefficients (n, H).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fourier import make_interpolant
    >>> at = make_interpolant(np.array([0.0, 20.0]), np.array([[1.0, 0.0], [3.0, 4.0]]))
    >>> at(np.array([5.0])).tolist()
    [[1.5, 1.0]]
    """
    nodes, coefficients = np.asarray(nodes, float), np.asarray(coefficients, float)
    if len(nodes) < 3 or interpolation == "linear":
        return lambda x: compute_node_weights(x, nodes) @ coefficients
    from scipy.interpolate import CubicSpline, PchipInterpolator

    curve = (PchipInterpolator if interpolation == "monotone" else CubicSpline)(
        nodes, coefficients, axis=0
    )
    return lambda x: _continue_straight(curve, np.asarray(x, float), nodes)


def evaluate(
    x: Array,
    wave_angle_rad: Array,
    nodes: Array,
    coefficients: Array,
    mode_number: int,
    interpolation: str = "linear",
    travel_rad: Array | float = 0.0,
) -> Array:
    """The table's value Σ_j ψ_j(x) [h_j0 + Σ_k h_j,2k−1 cos 2mkθ + h_j,2k sin 2mkθ].

    Parameters
    ----------
    x
        Temperature or frequency, (n,).
    wave_angle_rad
        θ [rad], (n,).
    nodes
        Of the table, rising, (J,).
    coefficients
        h_j, (J, 1 + 2K), in the unit of the table.
    mode_number
        m.
    interpolation
        "linear", "cubic" or "monotone".
    travel_rad
        Of wave angle, along which the value is averaged [rad], (n,) or one number.

    Returns
    -------
    ndarray
        (n,), in the unit of the table.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fourier import evaluate
    >>> coefficients = np.array([[1.0, 0.5, 0.0]])
    >>> evaluate(np.zeros(2), np.array([0.0, np.pi / 4]), np.zeros(1), coefficients, 2).tolist()
    [1.5, 0.5]
    """
    harmonics = (np.shape(coefficients)[1] - 1) // 2
    basis = build_harmonic_basis(wave_angle_rad, harmonics, mode_number, travel_rad)
    return np.asarray(
        (basis * interpolate_coefficients(x, nodes, coefficients, interpolation)).sum(axis=1)
    )
