"""The design of D(T, θ), K(T, θ) and further factors: what each coefficient makes of a run's
increments m·Δθ."""

from __future__ import annotations

import numpy as np

from ...fourier import monotone_weights, node_weights
from .increments import AnglePath
from .table_layout import TableLayout

Array = np.ndarray
ROWS_AT_ONCE = 1 << 12
"""Increments of a run whose design is held at once."""


def build_design(run: AnglePath, layout: TableLayout, previous: Array | None, rows: slice) -> Array:
    """Columns (n, size) of m·Δθ for the increments `rows` of a run. `previous` coefficients
    linearise the monotone interpolation."""
    path = run.part(rows)
    x = layout.abscissa(path)
    basis = path.angle_basis(max(layout.drift_harmonics, layout.scale_harmonics))
    columns = np.empty((len(path), layout.size))
    weights = node_weights(
        x, layout.nodes, "linear" if layout.interpolation in ("linear", "monotone") else "cubic"
    )
    table = columns[:, : layout.table_size].reshape(len(path), len(layout.nodes), layout.node_size)
    tables = (
        layout.tables(previous)
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
                weights if tables is None else monotone_weights(x, layout.nodes, tables[kind][:, h])
            )
            table[:, :, start + h] = psi * (time[kind] * basis[:, h])[:, None]
    for name, factor in layout.factors.items():
        # of the whole run: a factor may look at its neighbours in time
        columns[:, layout.factor(name)] = factor(run)[rows] * path.interval_s[:, None]
    return columns


def split_stretches(length: int) -> list[slice]:
    """Increments a run is worked through at once, so that memory holds one stretch of the
    design."""
    return [
        slice(first, min(first + ROWS_AT_ONCE, length)) for first in range(0, length, ROWS_AT_ONCE)
    ]


def predict_turn(
    path: AnglePath, layout: TableLayout, coefficients: Array, previous: Array | None = None
) -> Array:
    """m·Δθ (n, …) of given coefficients (size, …), a stretch at a time."""
    return np.concatenate(
        [
            build_design(path, layout, previous, rows) @ coefficients
            for rows in split_stretches(len(path))
        ]
    )
