"""The design of D(T, θ), K(T, θ) and further factors: what each coefficient makes of a run's
increments m·Δθ."""

from __future__ import annotations

import numpy as np

from ...fourier import compute_monotone_weights, compute_node_weights
from .increments import AnglePath
from .table_layout import TableLayout

Array = np.ndarray
ROWS_AT_ONCE = 1 << 12
"""Increments of a run whose design is held at once."""


def build_design(run: AnglePath, layout: TableLayout, previous: Array | None, rows: slice) -> Array:
    """What each coefficient makes of a run's increments m·Δθ.

    m·Δθ = ∫(D − KΩ) dt, each harmonic averaged over the angle that the wave passes meanwhile.

    Parameters
    ----------
    run
        The whole run: a factor may look at neighbours in time.
    layout
        Nodes, harmonics and factors.
    previous
        Coefficients (size,) whose slopes give a monotone interpolation its weights; None: linear
        ones.
    rows
        The increments wanted.

    Returns
    -------
    ndarray
        (n, size): s for drift coefficients in rad/s, rad for scale factors, which have no unit.

    Examples
    --------
    At 0.1 rad/s a second's increment holds 1 s of the drift and −0.1 rad of the scale factor:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.table_design import build_design
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> path = draw_path(0.1, blocks=5, width_s=0.0)
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 0, 0)
    >>> build_design(path, layout, None, slice(0, 1)).round(9).tolist()
    [[1.0, -0.1]]
    """
    path = run.select_rows(rows)
    x = layout.find_abscissa(path)
    basis = path.build_angle_basis(max(layout.drift_harmonics, layout.scale_harmonics))
    columns = np.empty((len(path), layout.size))
    weights = compute_node_weights(
        x, layout.nodes, "linear" if layout.interpolation in ("linear", "monotone") else "cubic"
    )
    table = columns[:, : layout.table_size].reshape(len(path), len(layout.nodes), layout.node_size)
    tables = (
        layout.split_tables(previous)
        if previous is not None and layout.interpolation == "monotone"
        else None
    )
    # m·Δθ = ∫(D − KΩ)dt: drift columns by the time, scale-factor columns by −∫Ω dt.
    time = (path.interval_s, -path.rotation)
    for kind, (start, width) in enumerate(
        ((0, layout.drift_size), (layout.drift_size, layout.node_size - layout.drift_size))
    ):
        for h in range(width):
            psi = (
                weights
                if tables is None
                else compute_monotone_weights(x, layout.nodes, tables[kind][:, h])
            )
            table[:, :, start + h] = psi * (time[kind] * basis[:, h])[:, None]
    for name, factor in layout.factors.items():
        # of the whole run: a factor may look at its neighbours in time
        columns[:, layout.factor(name)] = factor(run)[rows] * path.interval_s[:, None]
    return columns


def split_stretches(length: int) -> list[slice]:
    """Increments a run is worked through at once, so that memory holds one stretch of the design.

    Parameters
    ----------
    length
        Increments of the run.

    Returns
    -------
    list of slice
        In order, without gaps.

    Examples
    --------
    >>> from hrg_cli.fitting.tables.table_design import split_stretches
    >>> split_stretches(5000)
    [slice(0, 4096, None), slice(4096, 5000, None)]
    """
    return [
        slice(first, min(first + ROWS_AT_ONCE, length)) for first in range(0, length, ROWS_AT_ONCE)
    ]


def predict_turn(
    path: AnglePath, layout: TableLayout, coefficients: Array, previous: Array | None = None
) -> Array:
    """The increments m·Δθ that given coefficients make.

    Parameters
    ----------
    path
        The run.
    layout
        Order of the coefficients.
    coefficients
        (size, …): drift in rad/s, scale factor without unit.
    previous
        Coefficients (size,) whose slopes give a monotone interpolation its weights; None: linear
        ones.

    Returns
    -------
    ndarray
        (n, …) [rad].

    Examples
    --------
    D − KΩ with a drift of 0.01 rad/s, K = 0.3 and a rate of 0.1 rad/s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.table_design import predict_turn
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> path = draw_path(0.1, blocks=5, width_s=0.0)
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 0, 0)
    >>> predict_turn(path, layout, np.array([0.01, 0.3])).round(9).tolist()
    [-0.02, -0.02, -0.02, -0.02]
    """
    return np.concatenate(
        [
            build_design(path, layout, previous, rows) @ coefficients
            for rows in split_stretches(len(path))
        ]
    )
