"""C functions of the standard deviations of D and K over temperature or frequency: what the runs'
noise left, and what interpolation between the calibrated nodes does not know."""

from __future__ import annotations

import numpy as np

from ..records import Calibration
from ..stages.calibration.interpolation import compute_standard_deviations

Array = np.ndarray
PIECES = 16
"""Even steps between two nodes: a parabola between them is met to 1/16² of its height."""
ANGLES = 24
"""Wave angles of which the largest standard deviation is taken."""


def make_c_deviations(calibration: Calibration) -> str:
    """The C functions of the standard deviations of D and K over temperature or frequency.

    Parameters
    ----------
    calibration
        The tables.

    Returns
    -------
    str
        `hrg_drift_std_rad_s(x)` and `hrg_scale_factor_std(x)`, the largest over the wave angle.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.exporting.c_deviations import make_c_deviations
    >>> one = np.ones((2, 1))
    >>> tables = Told(
    ...     node=np.array([0.0, 40.0]), drift_harmonics=0 * one, scale_factor_harmonics=one,
    ...     covariance=1e-12 * np.eye(4), interpolation="linear", mode_number=2, details="{}",
    ... )
    >>> [line for line in make_c_deviations(tables).splitlines() if line.startswith("    {")][0]
    '    {0, 1e-06, 1e-06},'
    """
    places = _places(np.asarray(calibration.node, float))
    angles = np.arange(ANGLES) * np.pi / calibration.mode_number / ANGLES
    stds = compute_standard_deviations(
        calibration, np.repeat(places, ANGLES), np.tile(angles, len(places))
    )
    largest = [std.reshape(len(places), ANGLES).max(axis=1) for std in stds]
    rows = ",\n".join(
        "    {" + ", ".join(_literal(v) for v in row) + "}" for row in zip(places, *largest)
    )
    return _C.replace("COUNT", str(len(places))).replace("ROWS", rows)


def _places(nodes: Array) -> Array:
    """The nodes, and between neighbours further places at even steps."""
    part = np.arange(PIECES) / PIECES
    between = nodes[:-1, None] + np.diff(nodes)[:, None] * part
    return np.append(between.ravel(), nodes[-1])


def _literal(value: float) -> str:
    return f"{value:.9g}" if np.isfinite(value) else "NAN"


_C = """
/* Standard deviations over x: {x, of the drift, of the scale factor}, each the largest over theta; linear between.
   They hold the noise of the calibration's runs, and midway between its nodes what no run has shown. */
#define HRG_STD_PLACES COUNT
static const double hrg_std_table[HRG_STD_PLACES][3] = {
ROWS
};

static inline double hrg_std_at(double x, int column) {
    int i = 0;
    if (!(x > hrg_std_table[0][0])) return hrg_std_table[0][column];
    if (x >= hrg_std_table[HRG_STD_PLACES - 1][0]) return hrg_std_table[HRG_STD_PLACES - 1][column];
    while (i + 2 < HRG_STD_PLACES && x > hrg_std_table[i + 1][0]) i++;
    int up = i + 1 < HRG_STD_PLACES ? i + 1 : i;
    double step = hrg_std_table[up][0] - hrg_std_table[i][0];
    double part = step > 0.0 ? (x - hrg_std_table[i][0]) / step : 0.0;
    return hrg_std_table[i][column] + (hrg_std_table[up][column] - hrg_std_table[i][column]) * part;
}

static inline double hrg_drift_std_rad_s(double x) { return hrg_std_at(x, 1); }
static inline double hrg_scale_factor_std(double x) { return hrg_std_at(x, 2); }
"""
