"""Calibration tables for other programs: CSV, JSON, and a C header in float or fixed point with its
worst errors stated."""

from __future__ import annotations

import csv
import io
import json
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError, UsageError
from ..measured_export import MEASURED_FORMULA, make_csv_measured
from ..records import Calibration
from ..stages.calibration.interpolation import (
    TABLES,
    compute_standard_deviations,
    read_interpolation_std,
)
from ..stages.rate_table import is_rate_table
from .c_header import Exported, make_header

BETWEEN_FORMULA = (
    "between nodes add to the variance (4 u (1 - u) interpolation_std)^2, u: part of the way from"
    " a node to the next; no run has shown how the tables bend there"
)


def export(
    calibration: Calibration,
    suffix: str,
    *,
    fixed_point_bits: Annotated[
        Literal[0, 16, 32],
        Field(description="C header: integers of 16 or 32 bits; 0: floating point"),
    ] = 0,
    precision: Annotated[
        float,
        Field(
            gt=0,
            description=(
                "C header: interpolation error allowed, in standard deviations of the table"
            ),
        ),
    ] = 0.5,
) -> Exported:
    """The tables as text of the form that a suffix names: CSV, JSON or a C header.

    The header's grid is refined until its worst interpolation error is below `precision` of the
    table's own standard deviation (or 1e-7 of its largest value).

    Parameters
    ----------
    calibration
        D [rad/s] and K (nodes, angles).
    suffix
        ".csv", ".json" or ".h".

    Returns
    -------
    Exported
        The text, and of a header its worst errors: D in rad/s, K without unit.

    Raises
    ------
    HrgError
        Another suffix, a refused calibration, other bits.

    Examples
    --------
    >>> from hrg_cli.exporting import export
    >>> from hrg_cli.stages.calibration.drawn_tables import draw_tables
    >>> tables = draw_tables()
    >>> print(export(tables, ".csv").text.splitlines()[1])
    20.0,0.0,1e-05,1e-07,0.55,1e-05
    """
    if calibration.status == "refused":
        raise HrgError(
            f"the calibration is refused ({'; '.join(calibration.status_reasons)}); complete its"
            " programme and calibrate again"
        )
    if suffix == ".csv":
        return Exported(_csv(calibration), {})
    if suffix == ".json":
        return Exported(_json(calibration), {})
    if suffix == ".h" and is_rate_table(calibration):
        raise HrgError(
            "these tables are of a rate gyro's output, which has no wave angle: no C header is made"
            " of them; end the output's name in .json, which holds the powers of the rate too"
        )
    if suffix != ".h":
        raise HrgError(f"cannot export as {suffix!r}; end the output's name in .csv, .json or .h")
    if fixed_point_bits not in (0, 16, 32):
        raise UsageError(
            f"fixed_point_bits is {fixed_point_bits}; 0 (float), 16 or 32 was expected"
        )
    return make_header(calibration, fixed_point_bits, precision)


def _axis(calibration: Calibration) -> str:
    return "temperature_degc" if calibration.axis == "temperature" else "frequency_hz"


def _csv(calibration: Calibration) -> str:
    """One row a node and angle: the tables with standard deviations."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    further, cells = make_csv_measured(calibration)
    midway = _midway(calibration)
    writer.writerow(
        [
            _axis(calibration),
            "wave_angle_rad",
            "drift_rad_s",
            "drift_rad_s_std",
            "scale_factor",
            "scale_factor_std",
            *midway,
            *further,
        ]
    )
    for j, node in enumerate(calibration.node):
        for i, angle in enumerate(calibration.wave_angle_rad):
            row = (
                node, angle, calibration.drift_rad_s[j, i], calibration.drift_rad_s_std[j, i],
                calibration.scale_factor[j, i], calibration.scale_factor_std[j, i],
                *(std[j, i] for std in midway.values()), *cells[j],
            )  # fmt: skip
            writer.writerow([repr(float(v)) for v in row])
    return text.getvalue()


def _midway(calibration: Calibration) -> dict[str, np.ndarray]:
    """Standard deviations (node, angle) of D and K midway to the next node (the last one's: to the
    node before), by column; none where interpolation adds nothing that was estimated."""
    nodes, angles = np.asarray(calibration.node, float), np.asarray(calibration.wave_angle_rad)
    if len(nodes) < 2 or not read_interpolation_std(calibration):
        return {}
    places, theta = np.meshgrid((nodes[1:] + nodes[:-1]) / 2, angles, indexing="ij")
    return {
        f"{name}_std_midway": std.reshape(places.shape)[[*range(len(nodes) - 1), -1]]
        for name, std in zip(
            TABLES, compute_standard_deviations(calibration, places.ravel(), theta.ravel())
        )
    }


def _json(calibration: Calibration) -> str:
    """Everything needed to apply the tables: coefficients, ranges, sign and order."""
    details = json.loads(calibration.details)
    tree: dict[str, Any] = {
        "format": "hrg calibration",
        "gyro_id": calibration.gyro_id,
        "model": calibration.model,
        "mode_number": int(calibration.mode_number),
        "axis": calibration.axis,
        "interpolation": calibration.interpolation,
        "correction": calibration.correction,
        "series": "value = h0 + sum_k h_(2k-1) cos(2 m k angle) + h_2k sin(2 m k angle)",
        "status": calibration.status,
        "status_reasons": list(calibration.status_reasons),
        "node_range": [_finite(calibration.node_min), _finite(calibration.node_max)],
        "rate_range_rad_s": [float(calibration.rate_min_rad_s), float(calibration.rate_max_rad_s)],
        _axis(calibration): np.asarray(calibration.node).tolist(),
        "measured": (
            None
            if not details.get("measured")
            else details["measured"] | {"formula": MEASURED_FORMULA[details["measured"]["kind"]]}
        ),
    }
    doubt = read_interpolation_std(calibration)
    tree["interpolation_std"] = doubt | {"formula": BETWEEN_FORMULA} if doubt else None
    if is_rate_table(calibration):
        tree |= {
            name: details[name]
            for name in ("nominal_scale", "powers", "power_coefficients")
            if name in details
        }
    for name in (
        "drift_harmonics",
        "drift_harmonics_std",
        "scale_factor_harmonics",
        "scale_factor_harmonics_std",
    ):
        tree[name] = [
            [_finite(v) for v in row] for row in np.asarray(getattr(calibration, name), float)
        ]
    return json.dumps(tree, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
