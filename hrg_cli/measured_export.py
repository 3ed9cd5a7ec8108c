"""The measured part of a drift model, seed A (11) or (12), for the exports: columns of the CSV,
formula of the JSON, a C function.

The formulas are those of `stages.calibration.interpolation.compute_measured_drift`, with the 1/(1 −
r²) they were fitted with.
"""

from __future__ import annotations

import numpy as np

from .records import Calibration
from .stages.calibration.factors import LEAST_FLATNESS
from .stages.calibration.interpolation import MeasuredDrift, interpolate_measured

Array = np.ndarray
FINE_NODES = 129
"""Even nodes on which the C function keeps its coefficients: between them it is linear."""
MEASURED_FORMULA = {
    "quadrature": (
        "add to the drift, r = a_B/a_A: r/(1 - r^2) (q_cos cos 2mA + q_sin sin 2mA) + 2r^2/(1 -"
        " r^2) (d_cos cos 2mA + d_sin sin 2mA); q: coefficients, one pair a node; d: the drift's"
        " first harmonic"
    ),
    "phase": (
        "add to the drift, r = a_B/a_A, f the oscillation frequency in Hz: -4 pi r/(1 + r^2) (f -"
        " mean_frequency_hz) - 2r^2/(1 + r^2) (d_cos cos 2mA + d_sin sin 2mA); d: the drift's first"
        " harmonic"
    ),
}


def make_csv_measured(calibration: Calibration) -> tuple[list[str], list[list[float]]]:
    """The measured part of a drift model as columns of a CSV file.

    Parameters
    ----------
    calibration
        Its tables.

    Returns
    -------
    tuple
        Names of further columns, and their values, a list for each node; none for a model without a
        measured part.

    Examples
    --------
    >>> from hrg_cli.measured_export import make_csv_measured
    >>> from hrg_cli.stages.calibration.drawn_tables import draw_tables
    >>> make_csv_measured(draw_tables())
    ([], [[]])
    """
    part = interpolate_measured(calibration, np.asarray(calibration.node, float))
    if part is None:
        return [], [[] for _ in calibration.node]
    names, values = _columns(part)
    return names, values.tolist()


def _columns(part: MeasuredDrift) -> tuple[list[str], Array]:
    if part.kind == "phase":
        assert part.mean_frequency_hz is not None
        names, first = ["mean_frequency_hz"], part.mean_frequency_hz[:, None]
    else:
        assert part.quadrature is not None
        names, first = ["quadrature_cos_rad_s", "quadrature_sin_rad_s"], part.quadrature
    return [*names, "damping_cos_rad_s", "damping_sin_rad_s"], np.concatenate(
        [first, part.damping if part.exact else 0 * part.damping], axis=1
    )


def make_c_measured(calibration: Calibration, nodes: Array) -> str:
    """The C function `hrg_measured_drift_rad_s(x, theta, ratio, frequency_hz)` of a drift model.

    Parameters
    ----------
    calibration
        Its tables.
    nodes
        Of the header, rising, (J,): temperatures or frequencies.

    Returns
    -------
    str
        C; the function is there whatever the model, and gives 0 for one without a measured part.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.measured_export import make_c_measured
    >>> from hrg_cli.stages.calibration.drawn_tables import draw_tables
    >>> "double hrg_measured_drift_rad_s(" in make_c_measured(draw_tables(), np.array([20.0]))
    True
    """
    fine = np.linspace(nodes[0], nodes[-1], FINE_NODES) if len(nodes) > 1 else nodes
    part = interpolate_measured(calibration, fine)
    if part is None:
        return _NONE
    _, values = _columns(part)
    between = (fine[1:] + fine[:-1]) / 2
    worst = np.zeros(values.shape[1])
    if len(between):
        truth = interpolate_measured(calibration, between)
        assert truth is not None
        worst = np.abs((values[1:] + values[:-1]) / 2 - _columns(truth)[1]).max(axis=0)
    rows = ",\n".join("    {" + ", ".join(f"{v:.17g}" for v in row) + "}" for row in values)
    text = _C_QUADRATURE if part.kind == "quadrature" else _C_PHASE
    step = (fine[1] - fine[0]) if len(fine) > 1 else 1.0
    head = _HEAD.format(
        count=len(fine),
        width=values.shape[1],
        rows=rows,
        first=float(fine[0]),
        step=float(step),
        worst=", ".join(f"{w:.2g}" for w in worst),
    )
    return head + text.replace("FLATTEST", repr(LEAST_FLATNESS))


_NONE = """
/* Model without a measured part: nothing to add in operation. */
static inline double hrg_measured_drift_rad_s(double x, double theta, double ratio, double frequency_hz) {
    (void)x; (void)theta; (void)ratio; (void)frequency_hz;
    return 0.0;
}
"""

_HEAD = """
/* Coefficients of the measured part over x, linear between; worst errors of that: {worst}. */
#define HRG_MEASURED_NODES {count}
static const double hrg_measured_table[HRG_MEASURED_NODES][{width}] = {{
{rows}
}};

static inline double hrg_measured_coefficient(double x, int column) {{
    double a = (x - {first:.17g}) / {step:.17g};
    if (!(a > 0.0)) a = 0.0;
    if (a > HRG_MEASURED_NODES - 1) a = HRG_MEASURED_NODES - 1;
    int i = (int)a, up = i + 1 < HRG_MEASURED_NODES ? i + 1 : i;
    return hrg_measured_table[i][column] + (hrg_measured_table[up][column] - hrg_measured_table[i][column]) * (a - i);
}}
"""

_C_QUADRATURE = """
/* Seed A (11), exact in ratio = a_B/a_A: what the frequency split adds, and what the ellipse does to the damping. */
static inline double hrg_measured_drift_rad_s(double x, double theta, double ratio, double frequency_hz) {
    double c = cos(2.0 * HRG_MODE_NUMBER * theta), s = sin(2.0 * HRG_MODE_NUMBER * theta), flat = 1.0 - ratio * ratio;
    (void)frequency_hz;
    if (flat < FLATTEST) flat = FLATTEST;
    return ratio / flat * (hrg_measured_coefficient(x, 0) * c + hrg_measured_coefficient(x, 1) * s)
         + 2.0 * ratio * ratio / flat * (hrg_measured_coefficient(x, 2) * c + hrg_measured_coefficient(x, 3) * s);
}
"""

_C_PHASE = """
/* Seed A (12), exact in ratio = a_B/a_A: frequency_hz is the oscillation's; the mean frequency f(x) is the table's first column. */
static inline double hrg_measured_drift_rad_s(double x, double theta, double ratio, double frequency_hz) {
    double c = cos(2.0 * HRG_MODE_NUMBER * theta), s = sin(2.0 * HRG_MODE_NUMBER * theta), whole = 1.0 + ratio * ratio;
    return -4.0 * 3.14159265358979323846 * ratio / whole * (frequency_hz - hrg_measured_coefficient(x, 0))
         - 2.0 * ratio * ratio / whole * (hrg_measured_coefficient(x, 1) * c + hrg_measured_coefficient(x, 2) * s);
}
"""
