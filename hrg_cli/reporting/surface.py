"""The surface D(T, θ) that is turned by hand on the page: its data, computed beforehand and drawn
by the page's script."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..records import Array, Calibration
from ..units import DEGREE, DEGREE_PER_HOUR
from .quantities import round_with_std
from .text import clean_text

ANGLES, NODES = 49, 25
"""Most angles and nodes that are drawn."""


def gather_surface_data(record: Calibration) -> dict[str, Any] | None:
    """Drift and scale factor over the nodes and wave angles of tables, for a surface on the page.

    Parameters
    ----------
    record
        The tables.

    Returns
    -------
    dict or None
        Drift [°/h] and scale factor [ppm of its mean]; None where there is one node or one angle.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.reporting.surface import gather_surface_data
    >>> gather_surface_data(Told(node=[20.0], wave_angle_rad=[0.0, 0.1])) is None
    True
    """
    node, angle = np.asarray(record.node, float), np.asarray(record.wave_angle_rad, float) / DEGREE
    if len(node) < 2 or len(angle) < 2:
        return None
    rows, columns = np.argsort(node)[_thinned(len(node), NODES)], _thinned(len(angle), ANGLES)
    mean = float(np.nanmean(record.scale_factor_harmonics[:, 0])) or 1.0
    warm = record.axis == "temperature"

    def quantity(name: str, label: str, unit: str, values: Array, std: Array) -> dict[str, Any]:
        return {
            "name": name,
            "label": label,
            "unit": unit,
            "values": [_numbers(row) for row in np.asarray(values)[np.ix_(rows, columns)]],
            "std": float(f"{np.nanmedian(np.asarray(std)):.3g}"),
        }

    return {
        "axis": clean_text(record.axis),
        "unit": "T, °C" if warm else "f, Hz",
        "angle": _numbers(angle[columns]),
        "node": _numbers(node[rows]),
        "quantities": [
            quantity(
                "drift D",
                "D, °/h",
                "°/h",
                record.drift_rad_s / DEGREE_PER_HOUR,
                record.drift_rad_s_std / DEGREE_PER_HOUR,
            ),
            quantity(
                "scale factor K",
                f"K/{round_with_std(mean, abs(mean) * 1e-6).partition('(')[0]} − 1, ppm",
                "ppm",
                (record.scale_factor / mean - 1) * 1e6,
                record.scale_factor_std / abs(mean) * 1e6,
            ),
        ],
    }


def _thinned(count: int, most: int) -> Array:
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def _numbers(values: Array) -> list[float | None]:
    return [float(f"{v:.6g}") if np.isfinite(v) else None for v in values]
