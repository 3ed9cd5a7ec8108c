"""The calibration record from the joint fit: coefficients cut to the band limits, tables, standard
deviations, ranges."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import TableSolution
from ...fitting.tables.table_layout import TableLayout
from ...fourier import build_harmonic_basis
from ...records import Calibration, Wave

Array = np.ndarray
TABLE_ANGLES = 72


def make_calibration_record(
    waves: Sequence[Wave],
    fitted: Fitted,
    solution: TableSolution,
    chi2: float,
    limits: tuple[int, int],
    valid: tuple[float, float],
    model: str,
    details: dict[str, Any],
) -> Calibration:
    """The calibration record of a solution: harmonics up to the band limits, tables, errors,
    ranges.

    Parameters
    ----------
    waves
        The runs, for their names.
    fitted
        As they were fitted.
    solution
        Coefficients with their covariance.
    chi2
        Per degree of freedom, by which the covariance is scaled.
    limits
        Harmonics of 2mθ in drift and scale factor.
    valid
        Lowest and highest temperature [°C] or frequency [Hz] the tables may be used at.
    model
        Name of the variant.
    details
        What else is kept.

    Returns
    -------
    Calibration
        Tables over 72 wave angles of a period.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.record import make_calibration_record
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> solution = fitted.solution
    >>> record = make_calibration_record(
    ...     [], fitted, solution, 1.0, (1, 0), (17.0, 23.0), "table", {}
    ... )
    >>> record.drift_rad_s.shape, round(float(record.scale_factor[0, 0]), 6), record.node_max
    ((1, 72), 0.55, 23.0)
    """
    layout = fitted.layout
    sizes = [1 + 2 * k for k in limits]
    covariance = _covariance_of_stored(layout, solution, sizes) * chi2
    drift, scale = (
        table[:, :size] for table, size in zip(layout.split_tables(solution.coefficients), sizes)
    )
    angles = np.arange(TABLE_ANGLES) * np.pi / layout.mode_number / TABLE_ANGLES
    of_drift, of_scale = (build_harmonic_basis(angles, k, layout.mode_number) for k in limits)
    count = len(layout.nodes)
    std = np.sqrt(np.maximum(np.diag(covariance), 0)).reshape(count, sum(sizes))
    rates = [float(extreme(p.rate_rad_s)) for p in fitted.paths for extreme in (np.min, np.max)]
    temperature = layout.axis == "temperature"
    return Calibration(
        temperature_degc=layout.nodes if temperature else None,
        frequency_hz=None if temperature else layout.nodes,
        wave_angle_rad=angles,
        drift_rad_s=drift @ of_drift.T,
        drift_rad_s_std=compute_table_std(of_drift, covariance, count, 0),
        scale_factor=scale @ of_scale.T,
        scale_factor_std=compute_table_std(of_scale, covariance, count, sizes[0]),
        drift_harmonics=drift,
        drift_harmonics_std=std[:, : sizes[0]],
        scale_factor_harmonics=scale,
        scale_factor_harmonics_std=std[:, sizes[0] :],
        covariance=covariance,
        axis=layout.axis,
        model=model,
        # smoothing chose the nodes' values; between them the tables are cubic
        interpolation="cubic" if layout.interpolation == "smooth" else layout.interpolation,
        mode_number=layout.mode_number,
        gyro_id=next((w.gyro_id for w in waves if w.gyro_id), ""),
        lot_id=next((w.lot_id for w in waves if w.lot_id), ""),
        node_min=valid[0],
        node_max=valid[1],
        rate_min_rad_s=min(rates),
        rate_max_rad_s=max(rates),
        details=json.dumps(details),
    )


def _covariance_of_stored(layout: TableLayout, solution: TableSolution, sizes: list[int]) -> Array:
    """Covariance of the first harmonics of drift and scale factor, node by node."""
    everything = np.arange(layout.size)
    keep = [
        everything[part(j)][:size]
        for j in range(len(layout.nodes))
        for part, size in zip((layout.drift, layout.scale), sizes)
    ]
    places = np.concatenate(keep)
    return np.asarray(solution.covariance[np.ix_(places, places)])


def compute_table_std(basis: Array, covariance: Array, nodes: int, first: int) -> Array:
    """Standard deviations of a table over the wave angle at each node.

    √(bᵀCb) of the basis b(θ) and the covariance C of the node's coefficients.

    Parameters
    ----------
    basis
        (angles, h).
    covariance
        Of all coefficients, node by node.
    nodes
        How many.
    first
        Where the table's coefficients stand among those of a node.

    Returns
    -------
    ndarray
        (nodes, angles).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.record import compute_table_std
    >>> compute_table_std(np.array([[1.0], [2.0]]), np.diag([9.0, 4.0]), 1, 1).tolist()
    [[2.0, 4.0]]
    """
    width = len(covariance) // nodes
    out = []
    for node in range(nodes):
        own = slice(node * width + first, node * width + first + basis.shape[1])
        variance = np.einsum("ai,ij,aj->a", basis, covariance[own, own], basis)
        out.append(np.sqrt(np.maximum(variance, 0)))
    return np.stack(out)
