"""The drift models of seed A as linear models inside one layout: table, parametric (10), quadrature
(11), phase (12), combined, physical.

(11), exact in r: D = νδμ sin χ (1 + r²)/(1 − r²) − 2rδω cos ζ/(1 − r²)   (PHYSICS §4, (8))
(12), exact in r: D = νδμ sin χ (1 − r²)/(1 + r²) − 2r/(1 + r²)·(dφ/dt − 2πf(T))
(the same with dφ/dt for δω cos ζ)
What r does to the damping is not free: its columns are tied to the first harmonic of the table.
`combined` is the table over temperature and angle with the measured part of (11) beside it: seed
A's fourth stage.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...fitting.tables.increments import AnglePath
from ...fitting.tables.table_layout import Model, TableLayout
from .factors import choose_reference_hz
from .late_log import LATE
from .resonators import ResonatorCoefficients

Array = np.ndarray
VARIANTS = ("table", "parametric", "quadrature", "phase", "combined", "physical")
FACTORS = (
    "quadrature_course",
    "ellipticity_course",
    "phase",
    "mean_frequency",
    "flattening_course",
    "rate",
    "quadrature_drive",
    LATE,
)
"""What the common layout holds beside the tables: the variants' measured parts, and causes that no
variant holds."""
NEEDS = {"quadrature": "quadrature_course", "combined": "quadrature_course", "phase": "phase"}
"""Factor without which a variant cannot be tried."""
WHOLE_DRIFT = ("table", "combined")
"""Variants whose drift is a table of all harmonics; the others hold the first alone."""


def explain_missing(
    name: str, layout: TableLayout, coefficients: ResonatorCoefficients | None
) -> str | None:
    """Why a variant cannot be tried on runs.

    Parameters
    ----------
    name
        Of the variant.
    layout
        Of the tables, with the factors that the runs carry.
    coefficients
        Of the resonators; None: none were given.

    Returns
    -------
    str or None
        For a person; None where it can be tried.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.drift_models import explain_missing
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 1, 0)
    >>> explain_missing("quadrature", layout, None), explain_missing("table", layout, None)
    ('the runs hold no quadrature (a_B is 0 everywhere)', None)
    """
    if name == "physical" and coefficients is None:
        return "no resonator file was given (--resonator)"
    needed = NEEDS.get(name)
    if needed is None or needed in layout.factors:
        return None
    if "quadrature_course" in layout.factors:
        return "frequency_hz is missing or not finite in a run; estimate the runs again"
    return "the runs hold no quadrature (a_B is 0 everywhere)"


def build_variant(
    name: str,
    layout: TableLayout,
    drift_limit: int,
    scale_limit: int,
    coefficients: ResonatorCoefficients | None = None,
) -> Model:
    """A variant of the drift as a linear model inside the common layout.

    Parameters
    ----------
    name
        Of the variant.
    layout
        Of the tables and factors.
    drift_limit
        Harmonics of 2mθ in the drift, of a table; the other variants hold the first alone.
    scale_limit
        Harmonics of 2mθ in the scale factor.
    coefficients
        Of the resonators, for "physical".

    Returns
    -------
    Model
        What of the coefficients is free.

    Examples
    --------
    Seed A (10) has no constant drift, a table has:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.drift_models import build_variant
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 2, 0)
    >>> [build_variant(name, layout, 2, 0).free for name in ("table", "parametric")]
    [6, 3]
    """
    scale = layout.build_part_map("scale", scale_limit)
    if name == "physical":
        assert coefficients is not None
        return Model(
            name,
            np.zeros((layout.size, 0)),
            coefficients.build_node_map(layout) @ coefficients.interpolate_at_nodes(layout)[0],
        )
    lowest, highest = (0, drift_limit) if name in WHOLE_DRIFT else (1, 1)
    drift = layout.build_part_map("drift", highest, lowest=lowest)
    if name in ("quadrature", "combined"):
        drift = tie_course(layout, "ellipticity_course") @ drift
        return Model(
            name,
            np.concatenate([drift, scale, layout.build_factor_map("quadrature_course")], axis=1),
        )
    if name == "phase":
        start = np.zeros(layout.size)
        start[layout.factor("phase")] = 1.0
        drift = tie_course(layout, "flattening_course") @ drift
        return Model(
            name,
            np.concatenate([drift, scale, layout.build_factor_map("mean_frequency")], axis=1),
            start,
        )
    return Model(name, np.concatenate([drift, scale], axis=1))


def tie_course(layout: TableLayout, course: str) -> Array:
    """A map that gives the columns of a course the coefficients of the drift's first harmonic.

    What r does to the damping's drift is not free: it comes with the table's own coefficients.

    Parameters
    ----------
    layout
        Of the tables and factors.
    course
        Name of the factor, two columns a node.

    Returns
    -------
    ndarray
        (size, size), at each node its own.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.drift_models import tie_course
    >>> names = dict(factors={"ellipticity_course": None}, factor_columns={"ellipticity_course": 2})
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 1, 0, **names)
    >>> (tie_course(layout, "ellipticity_course") @ [9.0, 1.0, 2.0, 0.55, 0.0, 0.0]).tolist()
    [9.0, 1.0, 2.0, 0.55, 1.0, 2.0]
    """
    out = np.eye(layout.size)
    first = layout.factor(course).start
    for j in range(len(layout.nodes)):
        for h in (0, 1):
            out[first + 2 * j + h, layout.drift(j).start + 1 + h] = 1.0
    return out


def list_measured_details(
    name: str, layout: TableLayout, coefficients: Array, covariance: Array, paths: list[AnglePath]
) -> dict[str, Any] | None:
    """What is needed to compute the measured part of the drift in operation.

    Parameters
    ----------
    name
        Of the variant.
    layout
        Of the tables and factors.
    coefficients
        (size,).
    covariance
        (size, size).
    paths
        The runs, against whose frequency (12) is fitted.

    Returns
    -------
    dict or None
        Coefficients [rad/s] or mean frequencies [Hz] with standard deviations, a row a node; None
        for a variant without such a part.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.drift_models import list_measured_details
    >>> names = dict(factors={"mean_frequency": None}, factor_columns={"mean_frequency": 1})
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 0, 0, **names)
    >>> paths, value = [Told(frequency_hz=[5000.0])], np.array([0.0, 0.55, 0.25])
    >>> found = list_measured_details("phase", layout, value, 1e-4 * np.eye(3), paths)
    >>> found["mean_frequency_hz"], found["mean_frequency_hz_std"]
    ([5000.25], [0.01])
    """
    count = len(layout.nodes)
    if name in ("quadrature", "combined", "physical") and "quadrature_course" in layout.factors:
        place = layout.factor("quadrature_course")
        return {
            "kind": "quadrature",
            "exact": True,
            "coefficients": coefficients[place].reshape(count, 2).tolist(),
            "std": _std(covariance, place).reshape(count, 2).tolist(),
        }
    if name == "phase":
        place = layout.factor("mean_frequency")
        return {
            "kind": "phase",
            "exact": True,
            "mean_frequency_hz": (choose_reference_hz(paths) + coefficients[place]).tolist(),
            "mean_frequency_hz_std": _std(covariance, place).tolist(),
        }
    return None


def _std(covariance: Array, place: slice) -> Array:
    return np.sqrt(np.maximum(np.diag(covariance)[place], 0))
