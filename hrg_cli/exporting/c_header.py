"""A C header of calibration tables in float or fixed point, with its worst errors stated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import HrgError
from ..measured_export import make_c_measured
from ..records import Calibration
from ..reporting.text import escape_c_comment
from .c_deviations import make_c_deviations
from .c_grid import (
    compute_fixed_rounding,
    evaluate_on_grid,
    interpolate_bilinear,
    place_probes,
    quantise,
    refine_grid,
)

Array = np.ndarray
LARGEST_FLOAT = 1e38
"""Of single precision, with a margin for differences of two."""


@dataclass(frozen=True)
class Exported:
    """The text of the export, and its worst errors against the series (drift in rad/s, scale factor
    dimensionless)."""

    text: str
    errors: dict[str, float]


def make_header(calibration: Calibration, bits: int, precision: float) -> Exported:
    """The C header of tables, on a grid that is fine enough.

    Parameters
    ----------
    calibration
        The tables.
    bits
        Of integers; 0: floating point.
    precision
        Interpolation error that is allowed, in standard deviations of the tables.

    Returns
    -------
    Exported
        The header, and its worst errors.

    Raises
    ------
    HrgError
        Values that a float does not hold.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.exporting.c_header import make_header
    >>> from hrg_cli.stages.rate_table import rate_table
    >>> rate = np.tile(np.linspace(-1.0, 1.0, 11), 20)
    >>> output = 2.0 * rate + 1e-4 * np.random.default_rng(0).standard_normal(220)
    >>> tables = rate_table(
    ...     {"out": output, "rate": rate}, output="out", rate="rate", nominal_scale=2.0
    ... )
    >>> made = make_header(tables, 0, 0.1)
    >>> "hrg_rate_rad_s" in made.text
    True
    """
    nodes, angles = refine_grid(calibration, precision)
    period = np.pi / calibration.mode_number
    exact = evaluate_on_grid(calibration, nodes, angles)
    probe_x, probe_theta = place_probes(nodes, angles, period)
    truth = calibration.values_at(probe_x, probe_theta)
    _need_floats([*exact, *truth])
    errors: dict[str, float] = {}
    parts = []
    for name, table, true in zip(("drift_rad_s", "scale_factor"), exact, truth):
        plain = interpolate_bilinear(table, nodes, probe_x, probe_theta, period)
        errors[f"{name}_interpolation"] = float(np.abs(plain - true).max())
        if bits:
            raw, offset, step = quantise(table, bits)
            parts.append((name, raw, offset, step))
            errors[f"{name}_rounding"] = compute_fixed_rounding(table, step)
        else:
            stored = interpolate_bilinear(
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
{deviations}{measured}
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


SHORT = {"drift_rad_s": "drift", "scale_factor": "scale"}
CELLS_A_LINE = 12


def _c_text(
    calibration: Calibration,
    nodes: Array,
    angles: int,
    bits: int,
    parts: list[tuple[str, Array, float, float]],
    errors: dict[str, float],
) -> str:
    kind = f"int{bits}_t" if bits else "float"
    calls = {name: _call(name, bits) for name, *_ in parts}
    low, high = (
        v if np.isfinite(v) else n
        for v, n in ((calibration.node_min, -1e308), (calibration.node_max, 1e308))
    )
    return _C.format(
        gyro=escape_c_comment(calibration.gyro_id), model=escape_c_comment(calibration.model),
        status=calibration.status,
        mode=int(calibration.mode_number), correction=escape_c_comment(calibration.correction),
        axis_words="temperature, degC" if calibration.axis == "temperature" else "frequency, Hz",
        low=low, high=high, rate_low=calibration.rate_min_rad_s,
        rate_high=calibration.rate_max_rad_s, e=errors, nodes=len(nodes), angles=angles,
        first=float(nodes[0]), step=float(nodes[1] - nodes[0]) if len(nodes) > 1 else 1.0,
        period=np.pi / calibration.mode_number,
        drift_worst=errors["drift_rad_s_interpolation"] + errors["drift_rad_s_rounding"],
        scale_worst=errors["scale_factor_interpolation"] + errors["scale_factor_rounding"],
        tables="".join(_declare(*part, kind, bits) for part in parts),
        lookup=_LOOKUP_FIXED.replace("{type}", kind) if bits else _LOOKUP_FLOAT,
        drift_call=calls["drift_rad_s"], scale_call=calls["scale_factor"],
        measured=make_c_measured(calibration, nodes), deviations=make_c_deviations(calibration),
    )  # fmt: skip


def _declare(name: str, table: Array, offset: float, step: float, kind: str, bits: int) -> str:
    """The declaration of one table (nodes, angles), with what makes values of its integers."""
    rows = []
    for row in table:
        cells = [str(int(v)) for v in row] if bits else [_float_literal(v) for v in row]
        lines = [", ".join(cells[n : n + CELLS_A_LINE]) for n in range(0, len(cells), CELLS_A_LINE)]
        rows.append("    {" + ",\n     ".join(lines) + "}")
    array = (
        f"static const {kind} hrg_{SHORT[name]}_table[HRG_NODES][HRG_ANGLES] = {{\n"
        + ",\n".join(rows)
        + "\n};\n"
    )
    if not bits:
        return array
    prefix = f"#define HRG_{SHORT[name].upper()}"
    return (
        f"/* {name} = offset + step * integer */\n"
        f"{prefix}_OFFSET {offset:.17g}\n{prefix}_STEP {step:.17g}\n{array}"
    )


def _call(name: str, bits: int) -> str:
    """The C expression of a table's value at x and theta."""
    look = f"hrg_lookup(hrg_{SHORT[name]}_table, x, theta)"
    if not bits:
        return look
    prefix = f"HRG_{SHORT[name].upper()}"
    return f"{prefix}_OFFSET + {prefix}_STEP * (double){look}"


def _float_literal(value: float) -> str:
    text = f"{np.float32(value):.9g}"
    return (text if any(c in text for c in ".en") else text + ".0") + "f"
