"""A table of dwells as rows, the curve through them without spikes, and the figures of that curve.

output/S₀ = K(T)·Ω − D(T) + Σ_p c_p Ω^p, as `rate_table` has it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import HrgError, name_some
from ...fitting.least_squares import fit_columns
from ...fitting.tables.dwells import (
    build_dwell_design,
    choose_powers,
    compute_held_out_rms,
    find_least_count,
    find_spikes,
)

Array = np.ndarray
LARGEST_SHARE = 0.2
"""Share of the rows that may be spikes; if more stand out, it is the curve that is wrong."""
MOST_ROUNDS = 20
"""Rounds of leaving out spikes and fitting anew."""
LEAST_ROWS = 10


@dataclass(frozen=True)
class Dwells:
    """Rows (n,): output over the nominal scale, rate in rad/s, temperature; nodes (j,), what lies
    between them, and whether the gyro turned."""

    output: Array
    rate_rad_s: Array
    temperature_degc: Array
    nodes: Array
    interpolation: str
    turning: bool


@dataclass(frozen=True)
class Curve:
    """The curve through the rows that are no spikes."""

    powers: list[int]
    scores: dict[str, float]
    """Error of rows left out by highest power."""
    X: Array
    """(n, k) columns of all rows: −D of every node, K of every node, the powers."""
    coefficients: Array
    """(k,)"""
    residual: Array
    """(n,)"""
    keep: Array
    """(n,) rows that are no spikes."""
    too_many: int
    """Rows that stood out, where they were too many to be spikes and all were kept."""


def read_dwell_rows(
    table: Mapping[str, Any],
    names: tuple[str, str | None, str | None],
    word: tuple[int | None, float, float],
) -> tuple[Array, Array, Array]:
    """The rows of a table of dwells in which everything is finite.

    Parameters
    ----------
    table
        Column name -> values (n,).
    names
        Columns of output, rate [rad/s] and temperature; None: there is none.
    word
        Bits of the temperature's two's complement or None, and its scale and offset to °C.

    Returns
    -------
    tuple of ndarray
        Output, rate [rad/s] and temperature [°C]; zeros where there is no column.

    Raises
    ------
    HrgError
        No such column, or fewer than ten rows.

    Examples
    --------
    A thermometer's word of 16 bits, a count of which is 1/256 °C; 65280 is −256 counts:

    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.dwell_curve import read_dwell_rows
    >>> table = {"out": np.ones(10), "word": np.full(10, 65280)}
    >>> output, rate, degc = read_dwell_rows(table, ("out", None, "word"), (16, 1 / 256, 0.0))
    >>> float(rate[0]), float(degc[0])
    (0.0, -1.0)
    """
    output, rate, temperature = names
    y = _column(table, output)
    omega = np.zeros(len(y)) if rate is None else _column(table, rate)
    degc = np.zeros(len(y))
    if temperature is not None:
        bits, scale, offset = word
        read = _column(table, temperature)
        if bits is not None:
            read = np.where(read >= 2.0 ** (bits - 1), read - 2.0**bits, read)
        degc = read * scale + offset
    good = np.isfinite(y) & np.isfinite(omega) & np.isfinite(degc)
    if good.sum() < LEAST_ROWS:
        raise HrgError(
            f"the table has {int(good.sum())} finite rows of {len(y)}, at least ten were expected;"
            " check the columns' names and units"
        )
    return y[good], omega[good], degc[good]


def _column(table: Mapping[str, Any], name: str) -> Array:
    if name not in table:
        raise HrgError(f"the table has no column {name!r}; it has {name_some(table)}")
    return np.asarray(table[name], float)


def fit_without_spikes(dwells: Dwells, largest_power: int, spike_sigma: float) -> Curve:
    """The curve of a table of dwells, spikes left out until their choice repeats.

    Parameters
    ----------
    dwells
        The rows.
    largest_power
        Highest power of the rate that may be chosen, on rows left out.
    spike_sigma
        Standard deviations from which a row is a spike.

    Returns
    -------
    Curve
        All rows are kept where more than a fifth stand out: then the curve is wrong, not the rows.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.dwell_curve import Dwells, fit_without_spikes
    >>> rate = np.tile(np.linspace(-1.0, 1.0, 12), 10)
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal(120)
    >>> noise[7] = 0.1
    >>> dwells = Dwells(rate + noise, rate, 0 * rate, np.zeros(1), "linear", True)
    >>> np.flatnonzero(~fit_without_spikes(dwells, 1, 6.0).keep).tolist()
    [7]
    """
    keep, step = np.ones(len(dwells.output), bool), find_least_count(dwells.output)
    for _ in range(MOST_ROUNDS):
        curve = _fit(dwells, keep, largest_power)
        spikes = find_spikes(curve.X, curve.residual, keep, spike_sigma, step)
        if (~spikes == keep).all():
            return curve
        if spikes.sum() > LARGEST_SHARE * len(keep):
            return _fit(dwells, np.ones(len(keep), bool), largest_power, int(spikes.sum()))
        keep = ~spikes
    return replace(curve, keep=keep)


def _fit(dwells: Dwells, keep: Array, largest_power: int, too_many: int = 0) -> Curve:
    d = dwells
    y, omega, degc = d.output, d.rate_rad_s, d.temperature_degc
    powers, scores = choose_powers(
        y[keep], omega[keep], degc[keep], d.nodes, d.interpolation, d.turning, largest_power
    )
    X = build_dwell_design(omega, degc, d.nodes, d.interpolation, d.turning, powers)
    coefficients = fit_columns(X[keep], y[keep])
    return Curve(powers, scores, X, coefficients, y - X @ coefficients, keep, too_many)


def list_curve_figures(dwells: Dwells, curve: Curve, scale: float) -> dict[str, Any]:
    """The figures of a data sheet of the curve through a table of dwells.

    Parameters
    ----------
    dwells
        The rows.
    curve
        Through those that are no spikes.
    scale
        Nominal output per rad/s.

    Returns
    -------
    dict
        Coefficients of the powers, residuals before, after and of rows left out [rad/s],
        nonlinearity and asymmetry [ppm of the largest rate], and how bias and scale factor follow
        the temperature.

    Examples
    --------
    A gain that differs by 1 % between left and right bends by ⅔ of half of that about its best
    line:

    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.dwell_curve import (
    ...     Dwells,
    ...     fit_without_spikes,
    ...     list_curve_figures,
    ... )
    >>> rate = np.tile(np.linspace(-1.0, 1.0, 11), 20)
    >>> noise = 1e-6 * np.random.default_rng(0).standard_normal(220)
    >>> dwells = Dwells(rate + 0.005 * rate**2 + noise, rate, 0 * rate, np.zeros(1), "linear", True)
    >>> figures = list_curve_figures(dwells, fit_without_spikes(dwells, 3, 6.0), 1.0)
    >>> round(figures["asymmetry_ppm"], -2), round(figures["nonlinearity_ppm"], -2)
    (10000.0, 3300.0)
    """
    y, omega, keep, count = dwells.output, dwells.rate_rad_s, curve.keep, len(dwells.nodes)
    out: dict[str, Any] = {
        "nominal_scale": scale,
        "powers": curve.powers,
        "power_coefficients": curve.coefficients[2 * count :].tolist() if dwells.turning else [],
        "held_out_by_power": curve.scores,
        "rows": len(y),
        "rejected": int((~keep).sum()),
        "residual_rms_rad_s": {
            "before": _rms(_fit_line(y[keep], omega[keep], dwells.turning)),
            "after": _rms(curve.residual[keep]),
            "held_out": compute_held_out_rms(y[keep], curve.X[keep]),
        },
    }
    if dwells.turning:
        gain = curve.coefficients[count : 2 * count]
        out |= _bends(omega, curve.powers, out["power_coefficients"])
        if count > 1:
            out["scale_factor_coefficient_ppm_per_degc"] = float(
                np.polyfit(dwells.nodes, gain, 1)[0] / gain.mean() * 1e6
            )
    if count > 1:
        out["bias_coefficient_rad_s_per_degc"] = float(
            np.polyfit(dwells.nodes, -curve.coefficients[:count], 1)[0]
        )
    return out


def _fit_line(y: Array, omega: Array, turning: bool) -> Array:
    """What one scale factor and one bias leave of the rows; a bias alone where nothing turned."""
    ones = np.ones(len(y))
    plain = np.stack([ones, omega], axis=1) if turning else ones[:, None]
    return np.asarray(y - plain @ fit_columns(plain, y))


def _bends(omega: Array, powers: list[int], coefficients: list[float]) -> dict[str, float]:
    """Nonlinearity (largest departure from the best line) and asymmetry between both signs, as
    parts of the largest rate."""
    largest = float(np.abs(omega).max())
    grid = np.linspace(omega.min(), omega.max(), 201)
    bend = sum((c * grid**p for p, c in zip(powers, coefficients)), np.zeros(len(grid)))
    straight = np.polyval(np.polyfit(grid, bend, 1), grid)
    even = sum((c * largest**p for p, c in zip(powers, coefficients) if p % 2 == 0), 0.0)
    return {
        "nonlinearity_ppm": float(np.abs(bend - straight).max() / largest * 1e6),
        "asymmetry_ppm": float(2 * even / largest * 1e6),
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
