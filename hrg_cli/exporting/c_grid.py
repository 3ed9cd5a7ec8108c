"""The grid of a C header: as fine as the tables' own errors ask for, its interpolation, its
integers."""

from __future__ import annotations

import numpy as np

from ..records import Calibration

Array = np.ndarray
LARGEST_ANGLES, LARGEST_NODES = 192, 33
PLACES = 32768
"""Steps of a cell in which the fixed-point header counts places: 15 bits."""


def refine_grid(calibration: Calibration, precision: float) -> tuple[Array, int]:
    """Even nodes and angles of a C header, as fine as the tables' own errors ask for.

    Parameters
    ----------
    calibration
        The tables.
    precision
        Interpolation error that is allowed, in standard deviations of the tables.

    Returns
    -------
    tuple
        Nodes (J,), and the number of angles; no more than a header shall hold.

    Examples
    --------
    A table of one node and one harmonic needs few angles where its σ is large:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.exporting.c_grid import refine_grid
    >>> angle = np.arange(24) * np.pi / 2 / 24
    >>> wavy, flat = 1e-6 * np.cos(4 * angle)[None], np.full((1, 24), 0.55)
    >>> def count(std):
    ...     tables = Told(
    ...         node=np.array([20.0]), node_min=20.0, node_max=20.0, mode_number=2,
    ...         drift_harmonics=np.zeros((1, 3)), drift_rad_s=wavy, drift_rad_s_std=std + 0 * wavy,
    ...         scale_factor=flat, scale_factor_std=1e-6 + 0 * flat,
    ...         values_at=lambda x, theta: (1e-6 * np.cos(4 * theta), 0.55 + 0 * theta),
    ...     )
    ...     return refine_grid(tables, 0.1)[1]
    >>> count(1e-6), count(1e-8)
    (24, 96)
    """
    low = calibration.node_min if np.isfinite(calibration.node_min) else float(calibration.node[0])
    high = calibration.node_max if np.isfinite(calibration.node_max) else float(calibration.node[0])
    count = 2 if len(calibration.node) > 1 else 1
    angles = 24 * max(1, (calibration.drift_harmonics.shape[1] - 1) // 2)
    period = np.pi / calibration.mode_number
    limits = [
        max(precision * float(np.median(std)), 1e-7 * float(np.abs(table).max()))
        for table, std in (
            (calibration.drift_rad_s, calibration.drift_rad_s_std),
            (calibration.scale_factor, calibration.scale_factor_std),
        )
    ]

    def error(count: int, angles: int) -> float:
        """The worst interpolation error, in the limits."""
        nodes = _even_nodes(low, high, count)
        px, pt = place_probes(nodes, angles, period)
        tables, truth = evaluate_on_grid(calibration, nodes, angles), calibration.values_at(px, pt)
        return max(
            float(np.abs(interpolate_bilinear(table, nodes, px, pt, period) - true).max()) / limit
            for table, true, limit in zip(tables, truth, limits)
        )

    while error(count, angles) > 1:
        finer_nodes, finer_angles = 2 * count - 1, 2 * angles
        can_nodes = count > 1 and finer_nodes <= LARGEST_NODES
        can_angles = finer_angles <= LARGEST_ANGLES
        if not can_nodes and not can_angles:
            break
        by_nodes = error(finer_nodes, angles) if can_nodes else np.inf
        by_angles = error(count, finer_angles) if can_angles else np.inf
        if by_nodes < by_angles:
            count = finer_nodes
        else:
            angles = finer_angles
    return _even_nodes(low, high, count), angles


def _even_nodes(low: float, high: float, count: int) -> Array:
    """Nodes (count,) from low to high; the middle where there is one."""
    return np.linspace(low, high, count) if count > 1 else np.array([(low + high) / 2])


def evaluate_on_grid(calibration: Calibration, nodes: Array, angles: int) -> list[Array]:
    """Drift and scale factor of tables on a grid of one period of the wave angle.

    Parameters
    ----------
    calibration
        The tables.
    nodes
        (J,) [°C or Hz].
    angles
        How many, from 0 on.

    Returns
    -------
    list of ndarray
        D [rad/s] and K, (J, angles) each.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.exporting.c_grid import evaluate_on_grid
    >>> tables = Told(mode_number=2, values_at=lambda x, theta: (np.cos(4 * theta), 0 * x))
    >>> evaluate_on_grid(tables, np.array([20.0]), 4)[0].round(9).tolist()
    [[1.0, 0.0, -1.0, -0.0]]
    """
    period = np.pi / calibration.mode_number
    x, theta = np.meshgrid(nodes, np.arange(angles) * period / angles, indexing="ij")
    return [v.reshape(x.shape) for v in calibration.values_at(x.ravel(), theta.ravel())]


def place_probes(nodes: Array, angles: int, period: float) -> tuple[Array, Array]:
    """Points between those of a grid, at which its interpolation is judged.

    Parameters
    ----------
    nodes
        (J,).
    angles
        How many in a period.
    period
        Of the wave angle [rad].

    Returns
    -------
    tuple of ndarray
        Places and angles, four a cell in each direction.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.exporting.c_grid import place_probes
    >>> x, theta = place_probes(np.array([20.0]), 2, np.pi / 2)
    >>> (8 * theta / np.pi).round(9).tolist()
    [0.25, 0.75, 1.25, 1.75, 2.25, 2.75, 3.25, 3.75]
    """
    x = (
        np.linspace(nodes[0], nodes[-1], max(1, 4 * (len(nodes) - 1)) + 1)
        if len(nodes) > 1
        else nodes
    )
    theta = (np.arange(4 * angles) + 0.5) * period / (4 * angles)
    grid = np.meshgrid(x, theta, indexing="ij")
    return grid[0].ravel(), grid[1].ravel()


def _places(
    nodes: Array, angles: int, x: Array, theta: Array, period: float
) -> tuple[Array, Array, Array, Array]:
    u = (
        np.clip((x - nodes[0]) / (nodes[1] - nodes[0]), 0, len(nodes) - 1)
        if len(nodes) > 1
        else np.zeros(np.shape(x))
    )
    i = np.minimum(u.astype(int), max(len(nodes) - 2, 0))
    v = np.mod(theta / period, 1.0) * angles
    k = np.minimum(v.astype(int), angles - 1)
    return i, u - i, k, v - k


def interpolate_bilinear(
    table: Array, nodes: Array, x: Array, theta: Array, period: float
) -> Array:
    """Bilinear interpolation of a table, as the header does it.

    Parameters
    ----------
    table
        (J, A).
    nodes
        (J,), even.
    x, theta
        Places and wave angles [rad] (n,).
    period
        Of the wave angle [rad].

    Returns
    -------
    ndarray
        (n,); periodic in the angle, clamped at the outer nodes.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.exporting.c_grid import interpolate_bilinear
    >>> table, nodes = np.array([[0.0, 1.0], [10.0, 11.0]]), np.array([20.0, 30.0])
    >>> x, theta = np.array([25.0, 99.0, 20.0]), np.array([0.0, 0.0, 0.75])
    >>> interpolate_bilinear(table, nodes, x, theta, 1.0).tolist()
    [5.0, 10.0, 0.5]
    """
    angles = table.shape[1]
    i, u, k, v = _places(nodes, angles, x, theta, period)
    up, right = np.minimum(i + 1, len(nodes) - 1), (k + 1) % angles
    low = table[i, k] + (table[i, right] - table[i, k]) * v
    high = table[up, k] + (table[up, right] - table[up, k]) * v
    return np.asarray(low + (high - low) * u)


def quantise(table: Array, bits: int) -> tuple[Array, float, float]:
    """A table as integers: value = offset + step × integer.

    Parameters
    ----------
    table
        (J, A).
    bits
        Of a signed integer, whose whole range is used.

    Returns
    -------
    tuple
        Integers (J, A), offset and step.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.exporting.c_grid import quantise
    >>> integers, offset, step = quantise(np.array([[1.0, 2.0, 3.0]]), 16)
    >>> integers.tolist(), offset, round(step * 32767, 9)
    ([[-32767, 0, 32767]], 2.0, 1.0)
    """
    top = 2 ** (bits - 1) - 1
    offset = float((table.max() + table.min()) / 2)
    step = float(max((table.max() - table.min()) / 2, abs(offset) * 1e-12, 1e-300) / top)
    return np.clip(np.round((table - offset) / step), -top, top).astype(np.int64), offset, step


def compute_fixed_rounding(table: Array, step: float) -> float:
    """The most by which interpolation in integers misses the plain one.

    Half a step each of the stored integers and of two products, and the part of a place that is cut
    off in each direction.

    Parameters
    ----------
    table
        (J, A).
    step
        Of the integers.

    Returns
    -------
    float
        In the unit of the table.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.exporting.c_grid import compute_fixed_rounding
    >>> compute_fixed_rounding(np.zeros((2, 4)), 2.0)
    3.0
    """
    over_nodes = np.abs(np.diff(table, axis=0)).max(initial=0.0)
    over_angles = np.abs(np.roll(table, -1, axis=1) - table).max()
    return 1.5 * step + float(over_nodes + over_angles) / PLACES
