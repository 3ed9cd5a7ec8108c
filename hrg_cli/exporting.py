"""Calibration tables for other programs: CSV, JSON, and a C header in float or fixed point with its
worst errors stated."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from .errors import HrgError
from .measured_export import MEASURED_FORMULA, c_measured, csv_measured
from .records import Calibration
from .reporting.text import c_comment
from .stages.rate_table import is_rate_table

Array = np.ndarray
LARGEST_ANGLES, LARGEST_NODES = 192, 33
LARGEST_FLOAT = 1e38
"""Of single precision, with a margin for differences of two."""
PLACES = 32768
"""Steps of a cell in which the fixed-point header counts places: 15 bits."""


@dataclass(frozen=True)
class Exported:
    """The text of the export, and its worst errors against the series (drift in rad/s, scale factor
    dimensionless)."""

    text: str
    errors: dict[str, float]


def export(
    calibration: Calibration,
    suffix: str,
    *,
    fixed_point_bits: Annotated[
        int, Field(description="C header: integers of 16 or 32 bits; 0: floating point")
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
    """The tables as `suffix` ".csv", ".json" or ".h".

    fixed_point_bits: 0 for float tables in the header, 16 or 32 for integers. precision: the
    header's grid is refined until its worst interpolation error is below this part of the table's
    own standard deviation (or 1e-7 of its largest value). HrgError: another suffix, a refused
    calibration, other bits.
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
        raise HrgError(f"fixed_point_bits is {fixed_point_bits}; 0 (float), 16 or 32 was expected")
    return _header(calibration, fixed_point_bits, precision)


def _axis(calibration: Calibration) -> str:
    return "temperature_degc" if calibration.axis == "temperature" else "frequency_hz"


def _csv(calibration: Calibration) -> str:
    """One row a node and angle: the tables with standard deviations."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    further, cells = csv_measured(calibration)
    writer.writerow(
        [
            _axis(calibration),
            "wave_angle_rad",
            "drift_rad_s",
            "drift_rad_s_std",
            "scale_factor",
            "scale_factor_std",
            *further,
        ]
    )
    for j, node in enumerate(calibration.node):
        for i, angle in enumerate(calibration.wave_angle_rad):
            row = (
                node, angle, calibration.drift_rad_s[j, i], calibration.drift_rad_s_std[j, i],
                calibration.scale_factor[j, i], calibration.scale_factor_std[j, i], *cells[j],
            )  # fmt: skip
            writer.writerow([repr(float(v)) for v in row])
    return text.getvalue()


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


def _header(calibration: Calibration, bits: int, precision: float) -> Exported:
    nodes, angles = _grid(calibration, precision)
    period = np.pi / calibration.mode_number
    x, theta = np.meshgrid(nodes, np.arange(angles) * period / angles, indexing="ij")
    exact = [v.reshape(x.shape) for v in calibration.values_at(x.ravel(), theta.ravel())]
    probe_x, probe_theta = _probe(nodes, angles, period)
    truth = calibration.values_at(probe_x, probe_theta)
    _need_floats([*exact, *truth])
    errors: dict[str, float] = {}
    parts = []
    for name, table, true in zip(("drift_rad_s", "scale_factor"), exact, truth):
        plain = bilinear(table, nodes, probe_x, probe_theta, period)
        errors[f"{name}_interpolation"] = float(np.abs(plain - true).max())
        if bits:
            raw, offset, step = quantise(table, bits)
            parts.append((name, raw, offset, step))
            errors[f"{name}_rounding"] = fixed_rounding(table, step)
        else:
            stored = bilinear(
                table.astype(np.float32).astype(float), nodes, probe_x, probe_theta, period
            )
            parts.append((name, table, 0.0, 1.0))
            errors[f"{name}_rounding"] = float(np.abs(stored - plain).max())
    return Exported(_c_text(calibration, nodes, angles, bits, parts, errors), errors)


def _need_floats(tables: list[Array]) -> None:
    """Refuse values that the header's `float` cannot hold. HrgError: the largest of them."""
    largest = max(float(np.abs(table).max()) for table in tables)
    if not largest <= LARGEST_FLOAT:
        raise HrgError(
            f"the tables reach {largest:.3g}, beyond what a float of the header holds"
            f" ({LARGEST_FLOAT:.3g}); the calibration is damaged: make it again from its runs"
        )


def _grid(calibration: Calibration, precision: float) -> tuple[Array, int]:
    """Even nodes (J,) and the number of angles, refined until the interpolation error is small
    against the table's own σ."""
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
        nodes = np.linspace(low, high, count) if count > 1 else np.array([(low + high) / 2])
        x, theta = np.meshgrid(nodes, np.arange(angles) * period / angles, indexing="ij")
        px, pt = _probe(nodes, angles, period)
        worst = 0.0
        for table, true, limit in zip(
            calibration.values_at(x.ravel(), theta.ravel()), calibration.values_at(px, pt), limits
        ):
            worst = max(
                worst,
                float(np.abs(bilinear(table.reshape(x.shape), nodes, px, pt, period) - true).max())
                / limit,
            )
        return worst

    while error(count, angles) > 1:
        finer_nodes, finer_angles = 2 * count - 1 if count > 1 else 1, 2 * angles
        can_nodes, can_angles = (
            count > 1 and finer_nodes <= LARGEST_NODES,
            finer_angles <= LARGEST_ANGLES,
        )
        if not can_nodes and not can_angles:
            break
        by_nodes = error(finer_nodes, angles) if can_nodes else np.inf
        by_angles = error(count, finer_angles) if can_angles else np.inf
        if by_nodes < by_angles:
            count = finer_nodes
        else:
            angles = finer_angles
    return (np.linspace(low, high, count) if count > 1 else np.array([(low + high) / 2])), angles


def _probe(nodes: Array, angles: int, period: float) -> tuple[Array, Array]:
    """Points between the grid's, four a cell in each direction."""
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


def bilinear(table: Array, nodes: Array, x: Array, theta: Array, period: float) -> Array:
    """Bilinear interpolation of table (J, A), periodic in the angle, clamped at the outer nodes:
    what the header does."""
    angles = table.shape[1]
    i, u, k, v = _places(nodes, angles, x, theta, period)
    up, right = np.minimum(i + 1, len(nodes) - 1), (k + 1) % angles
    low = table[i, k] + (table[i, right] - table[i, k]) * v
    high = table[up, k] + (table[up, right] - table[up, k]) * v
    return np.asarray(low + (high - low) * u)


def quantise(table: Array, bits: int) -> tuple[Array, float, float]:
    """(integers, offset, step): value = offset + step × integer, the whole range of signed `bits`
    used."""
    top = 2 ** (bits - 1) - 1
    offset = float((table.max() + table.min()) / 2)
    step = float(max((table.max() - table.min()) / 2, abs(offset) * 1e-12, 1e-300) / top)
    return np.clip(np.round((table - offset) / step), -top, top).astype(np.int64), offset, step


def fixed_rounding(table: Array, step: float) -> float:
    """The most by which the integer interpolation misses the plain one: half a step each of the
    stored integers and of two products, and the part of a place that is cut off in each
    direction."""
    over_nodes = np.abs(np.diff(table, axis=0)).max(initial=0.0)
    over_angles = np.abs(np.roll(table, -1, axis=1) - table).max()
    return 1.5 * step + float(over_nodes + over_angles) / PLACES


_C = """\
/* Calibration tables of gyro "{gyro}", written by hrg. Model {model}, {status}.
 *
 * Output equation: m*dtheta/dt = -K*Omega + D(x, theta), m = {mode}; {correction}.
 * x: {axis_words}, used from {low:.9g} to {high:.9g} only (hrg_in_range); outside, the outer node is returned.
 * theta: wave angle in rad, any turn; the tables repeat after pi/m.
 * Rates calibrated: {rate_low:.6g} to {rate_high:.6g} rad/s.
 *
 * Worst errors against the series the tables were made from:
 *   drift         interpolation {e[drift_rad_s_interpolation]:.3e}, rounding {e[drift_rad_s_rounding]:.3e} rad/s
 *   scale factor  interpolation {e[scale_factor_interpolation]:.3e}, rounding {e[scale_factor_rounding]:.3e}
 */
#ifndef HRG_CALIBRATION_H
#define HRG_CALIBRATION_H

#include <math.h>
#include <stdint.h>

#define HRG_MODE_NUMBER {mode}
#define HRG_NODES {nodes}
#define HRG_ANGLES {angles}
#define HRG_NODE_FIRST {first:.17g}
#define HRG_NODE_STEP {step:.17g}
#define HRG_NODE_LOW {low:.17g}
#define HRG_NODE_HIGH {high:.17g}
#define HRG_ANGLE_PERIOD {period:.17g}
#define HRG_DRIFT_WORST_ERROR {drift_worst:.6e}
#define HRG_SCALE_FACTOR_WORST_ERROR {scale_worst:.6e}

{tables}
static inline int hrg_in_range(double x) {{ return x >= HRG_NODE_LOW && x <= HRG_NODE_HIGH; }}

static inline void hrg_place(double x, double theta, int *i, double *u, int *k, double *v) {{
    double a = (x - HRG_NODE_FIRST) / HRG_NODE_STEP, b = theta / HRG_ANGLE_PERIOD;
    if (!(a > 0.0)) a = 0.0;
    if (a > HRG_NODES - 1) a = HRG_NODES - 1;
    *i = (int)a;
    if (*i > HRG_NODES - 2) *i = HRG_NODES > 1 ? HRG_NODES - 2 : 0;
    *u = a - *i;
    b = (b - floor(b)) * HRG_ANGLES;
    *k = (int)b;
    if (*k > HRG_ANGLES - 1) *k = HRG_ANGLES - 1;
    *v = b - *k;
}}

{lookup}
static inline double hrg_drift_rad_s(double x, double theta) {{ return {drift_call}; }}
static inline double hrg_scale_factor(double x, double theta) {{ return {scale_call}; }}

/* Rate from the measured speed of the wave; `measured_drift` is what hrg_measured_drift_rad_s below computes (0 for a model without). */
static inline double hrg_rate_rad_s(double x, double theta, double dtheta_dt, double measured_drift) {{
    return (hrg_drift_rad_s(x, theta) + measured_drift - HRG_MODE_NUMBER * dtheta_dt) / hrg_scale_factor(x, theta);
}}
{measured}
#endif
"""

_LOOKUP_FLOAT = """\
static inline double hrg_lookup(const float table[HRG_NODES][HRG_ANGLES], double x, double theta) {
    int i, k; double u, v;
    hrg_place(x, theta, &i, &u, &k, &v);
    int up = i + 1 < HRG_NODES ? i + 1 : i, right = k + 1 < HRG_ANGLES ? k + 1 : 0;
    double low = table[i][k] + ((double)table[i][right] - table[i][k]) * v;
    double high = table[up][k] + ((double)table[up][right] - table[up][k]) * v;
    return low + (high - low) * u;
}
"""

_LOOKUP_FIXED = """\
static inline int64_t hrg_mix(int64_t a, int64_t b, int64_t part) { return a + (((b - a) * part + 16384) >> 15); }

/* Whole steps; u15 and v15 are the fractions along nodes and angle with 15 bits. */
static inline int64_t hrg_lookup_fixed(const {type} table[HRG_NODES][HRG_ANGLES], int i, int64_t u15, int k, int64_t v15) {
    int up = i + 1 < HRG_NODES ? i + 1 : i, right = k + 1 < HRG_ANGLES ? k + 1 : 0;
    return hrg_mix(hrg_mix(table[i][k], table[i][right], v15), hrg_mix(table[up][k], table[up][right], v15), u15);
}

static inline int64_t hrg_lookup(const {type} table[HRG_NODES][HRG_ANGLES], double x, double theta) {
    int i, k; double u, v;
    hrg_place(x, theta, &i, &u, &k, &v);
    return hrg_lookup_fixed(table, i, (int64_t)(u * 32768.0), k, (int64_t)(v * 32768.0));
}
"""


def _c_text(
    calibration: Calibration,
    nodes: Array,
    angles: int,
    bits: int,
    parts: list[tuple[str, Array, float, float]],
    errors: dict[str, float],
) -> str:
    short = {"drift_rad_s": "drift", "scale_factor": "scale"}
    kind = f"int{bits}_t" if bits else "float"
    tables, calls = [], {}
    for name, table, offset, step in parts:
        rows = []
        for row in table:
            cells = [str(int(v)) for v in row] if bits else [_float_literal(v) for v in row]
            lines = [", ".join(cells[n : n + 12]) for n in range(0, len(cells), 12)]
            rows.append("    {" + ",\n     ".join(lines) + "}")
        if bits:
            tables.append(
                f"/* {name} = offset + step * integer */\n#define HRG_{short[name].upper()}_OFFSET"
                f" {offset:.17g}\n"
            )
            tables.append(f"#define HRG_{short[name].upper()}_STEP {step:.17g}\n")
        tables.append(
            f"static const {kind} hrg_{short[name]}_table[HRG_NODES][HRG_ANGLES] = {{\n"
            + ",\n".join(rows)
            + "\n};\n"
        )
        look = f"hrg_lookup(hrg_{short[name]}_table, x, theta)"
        calls[name] = (
            f"HRG_{short[name].upper()}_OFFSET + HRG_{short[name].upper()}_STEP * (double){look}"
            if bits
            else look
        )
    low, high = (
        v if np.isfinite(v) else n
        for v, n in ((calibration.node_min, -1e308), (calibration.node_max, 1e308))
    )
    return _C.format(
        gyro=c_comment(calibration.gyro_id), model=c_comment(calibration.model), status=calibration.status,
        mode=int(calibration.mode_number), correction=c_comment(calibration.correction),
        axis_words="temperature, degC" if calibration.axis == "temperature" else "frequency, Hz",
        low=low, high=high, rate_low=calibration.rate_min_rad_s, rate_high=calibration.rate_max_rad_s, e=errors,
        nodes=len(nodes), angles=angles,
        first=float(nodes[0]), step=float(nodes[1] - nodes[0]) if len(nodes) > 1 else 1.0, period=np.pi / calibration.mode_number,
        drift_worst=errors["drift_rad_s_interpolation"] + errors["drift_rad_s_rounding"],
        scale_worst=errors["scale_factor_interpolation"] + errors["scale_factor_rounding"],
        tables="".join(tables), lookup=_LOOKUP_FIXED.replace("{type}", kind) if bits else _LOOKUP_FLOAT,
        drift_call=calls["drift_rad_s"], scale_call=calls["scale_factor"], measured=c_measured(calibration, nodes),
    )  # fmt: skip


def _float_literal(value: float) -> str:
    text = f"{np.float32(value):.9g}"
    return (text if any(c in text for c in ".en") else text + ".0") + "f"
