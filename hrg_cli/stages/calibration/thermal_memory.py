"""Thermal lag of the thermometer against hysteresis, from the sweeps of a calibration.

Both are first-order shifts of the temperature; one ramp speed cannot tell them apart (PHYSICS §2
iv): then it is said so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import name_some
from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted, fit
from ...fitting.tables.normal_pieces import solve
from ...fitting.tables.table_layout import Model, TableLayout
from ...fourier import interpolate_coefficients
from ...units import DEGREE_PER_HOUR
from .column_spaces import solve_columns
from .repeatability import LEAST_SWEEP_DEGC_S, compute_sweep

Array = np.ndarray
UNITS = {"lag": "s", "hysteresis": "degC"}
INSEPARABLE = 0.98
"""Correlation of two thermal factors above which this programme does not separate them."""
LEAST_INDEPENDENT = 0.02
"""Part of a factor's columns that the tables must leave for it to be told at all."""
LEAST_KNOWN = 1e-3
"""Part of a factor's columns left by the tables below which its size is rounding: of runs that
follow one course of temperature free tables take all."""
SHOWN = 6.0
"""Standard deviations from which a lag or a hysteresis is told: the tables hold neither."""
STEP = 0.05
"""Step of the tables' derivative, as a part of the nodes' range."""


def compare_thermal_memory(
    fitted: Fitted, model: Model, coefficients: Array
) -> dict[str, Any] | None:
    """Lag of the thermometer τ (D and K at T + τ·dT/dt) against hysteresis w (at T + w·sign dT/dt).

    Parameters
    ----------
    fitted
        The runs.
    model
        What of the coefficients is free.
    coefficients
        Of the tables (size,), about which both are looked for.

    Returns
    -------
    dict or None
        Value and standard deviation of both [s, °C], whether the programme separates them, and what
        to do where it does not; None where no run sweeps.

    Examples
    --------
    Runs that dwell show neither:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.thermal_memory import compare_thermal_memory
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> everything = Model("everything", np.eye(layout.size))
    >>> compare_thermal_memory(fitted, everything, fitted.solution.coefficients) is None
    True
    """
    layout = fitted.layout
    speeds = np.concatenate([compute_sweep(p) for p in fitted.paths])
    # lag and hysteresis act on dT/dt: dwells alone show neither
    still = np.abs(speeds).max(initial=0.0) < LEAST_SWEEP_DEGC_S
    if len(layout.nodes) < 2 or layout.axis != "temperature" or still:
        return None

    wide = _with_memory(layout, coefficients)
    grown = np.concatenate([model.matrix, np.zeros((2, model.matrix.shape[1]))])
    both = Model("both", np.concatenate([grown, wide.build_factor_map(*UNITS)], axis=1))
    # what memory the tables leave must not count as noise
    refitted = fit(fitted.paths, wide, replace(both, name="memory"), fitted)
    left, correlation = _independence(refitted, grown, wide.build_factor_map(*UNITS))
    out: dict[str, Any] = {
        "independence": dict(zip(UNITS, map(float, left))),
        "correlation": correlation,
    }
    for name, unit in UNITS.items():
        alone = Model(name, np.concatenate([grown, wide.build_factor_map(name)], axis=1))
        out[name] = _size(refitted, alone, name) | {"units": unit, "assuming": "the other is zero"}
    for name, part in zip(UNITS, left, strict=True):
        if not part > LEAST_KNOWN:
            out[name] |= {"value": None, "std": None}
    if abs(correlation) > INSEPARABLE or left.min() < LEAST_INDEPENDENT:
        out["separable"] = False
        out["sentence"] = (
            "thermal lag and hysteresis cannot be told apart by this programme; "
            "add a sweep at another speed (a half or a third), or steps with soaks"
        )
        return out
    for name in UNITS:
        out[name] |= _size(refitted, both, name) | {"assuming": "nothing of the other"}
    out["separable"] = True
    return out


def find_shown_memory(memory: Mapping[str, Any] | None) -> list[str]:
    """What of lag and hysteresis stands out of its error.

    Such runs follow the resonator's temperature before or behind the thermometer's, and so do
    tables made of them: at rest they are of another temperature than they say.

    Parameters
    ----------
    memory
        Of `compare_thermal_memory`.

    Returns
    -------
    list of str
        A sentence each; where the two are not told apart, of the one that stands out more.

    Examples
    --------
    >>> from hrg_cli.stages.calibration.thermal_memory import find_shown_memory
    >>> memory = dict(
    ...     lag=dict(value=12.0, std=0.5), hysteresis=dict(value=0.1, std=0.1), separable=True
    ... )
    >>> find_shown_memory(memory)
    ['the thermometer lags by 12 ± 0.5 s, which the tables do not hold: ...']
    """
    if memory is None:
        return []
    clear = {
        name: abs(memory[name]["value"]) / memory[name]["std"]
        for name in UNITS
        if memory[name]["std"]
    }
    shown = sorted((name for name in clear if clear[name] > SHOWN), key=lambda name: -clear[name])
    words = {"lag": "lags by {} s", "hysteresis": "has a hysteresis of {} °C"}
    told = [
        words[name].format(f"{memory[name]['value']:.3g} ± {memory[name]['std']:.1g}")
        for name in (shown if memory["separable"] else shown[:1])
    ]
    rest = "" if memory["separable"] else " (lag or hysteresis is not told)"
    return [
        (
            f"the thermometer {one}{rest}, which the tables do not hold: sweep slower both ways, or"
            " dwell"
        )
        for one in told
    ]


def tell_one_way(fitted: Fitted, coefficients: Array) -> list[str]:
    """What is taken for granted where all runs only warm, or only cool: that the thermometer has no
    lag.

    Parameters
    ----------
    fitted
        The runs.
    coefficients
        Of the tables (size,).

    Returns
    -------
    list of str
        What a second of a lag would do to the drift; empty where runs go both ways, or dwell.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.thermal_memory import tell_one_way
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> tell_one_way(fitted, fitted.solution.coefficients)
    []
    """
    layout = fitted.layout
    if len(layout.nodes) < 2 or layout.axis != "temperature":
        return []
    sweeps = [compute_sweep(path) for path in fitted.paths]
    speeds = np.concatenate(sweeps)
    moving = speeds[np.abs(speeds) > LEAST_SWEEP_DEGC_S]
    if not len(moving) or (moving > 0).any() == (moving < 0).any():
        return []
    slope = _slope_over_temperature(layout, coefficients)
    turn = max(
        float(np.abs(slope(path) * sweep).max())
        for path, sweep in zip(fitted.paths, sweeps, strict=True)
    )
    rate = turn / max(abs(layout.compute_mean_scale_factor(coefficients)), 1e-300)
    return [
        f"{_name_moving(fitted, sweeps)} {'warm' if moving.mean() > 0 else 'cool'}, where no lag of"
        " the thermometer shows: each second of it makes the drift wrong by up to"
        f" {rate / DEGREE_PER_HOUR:.2g} °/h; sweep both ways"
    ]


def _name_moving(fitted: Fitted, sweeps: Sequence[Array]) -> str:
    """Those of the runs whose temperature moves."""
    names = [
        path.run_id or f"number {k}"
        for k, (path, sweep) in enumerate(zip(fitted.paths, sweeps, strict=True), 1)
        if (np.abs(sweep) > LEAST_SWEEP_DEGC_S).any()
    ]
    if len(names) == len(sweeps):
        return "all runs"
    return f"all runs that do not dwell ({name_some(names)})"


def _with_memory(layout: TableLayout, coefficients: Array) -> TableLayout:
    """The layout with a column each for lag and hysteresis about these tables."""
    slope = _slope_over_temperature(layout, coefficients)

    def lag(path: AnglePath) -> Array:
        return (slope(path) * compute_sweep(path))[:, None]

    def hysteresis(path: AnglePath) -> Array:
        # sign dT/dt without a jump: a soak has no branch of its own.
        return (slope(path) * np.tanh(compute_sweep(path) / LEAST_SWEEP_DEGC_S))[:, None]

    return replace(
        layout,
        factors={**layout.factors, "lag": lag, "hysteresis": hysteresis},
        factor_columns={**layout.factor_columns, "lag": 1, "hysteresis": 1},
    )


def _slope_over_temperature(
    layout: TableLayout, coefficients: Array
) -> Callable[[AnglePath], Array]:
    """d(D − KΩ)/dT along a path, by central differences of the tables."""
    drift, scale = layout.split_tables(coefficients)
    harmonics = max(layout.drift_harmonics, layout.scale_harmonics)
    step = STEP * float(np.ptp(layout.nodes))
    kind = "linear" if layout.interpolation in ("linear", "monotone") else "cubic"

    def slope(path: AnglePath) -> Array:
        at, basis = layout.find_abscissa(path), path.build_angle_basis(harmonics)

        def derivative(table: Array) -> Array:
            up = interpolate_coefficients(at + step, layout.nodes, table, kind)
            down = interpolate_coefficients(at - step, layout.nodes, table, kind)
            return np.asarray(((up - down) / (2 * step) * basis[:, : table.shape[1]]).sum(axis=1))

        return derivative(drift) - path.rate_rad_s * derivative(scale)

    return slope


def _independence(fitted: Fitted, grown: Array, extra: Array) -> tuple[Array, float]:
    """What the tables leave of both factors' columns (2,), as parts of their length, and the
    correlation of what is left."""
    A = fitted.pieces.sum()[0]
    whole = extra.T @ A @ extra
    own = np.diag(whole)
    rest = whole - extra.T @ A @ solve_columns(A, grown, A @ extra)
    left = np.sqrt(np.maximum(np.diag(rest), 0) / np.where(own > 0, own, 1))
    if not (np.diag(rest) > 0).all():
        return left, 1.0
    return left, float(rest[0, 1] / np.sqrt(rest[0, 0] * rest[1, 1]))


def _size(fitted: Fitted, model: Model, name: str) -> dict[str, Any]:
    """A factor's size with its σ at the noise found."""
    A, b, _ = fitted.pieces.sum()
    solution = solve(A, b, model)
    place = fitted.layout.factor(name).start
    std = float(np.sqrt(solution.covariance[place, place] * fitted.chi2_per_dof))
    return {"value": float(solution.coefficients[place]), "std": std}
