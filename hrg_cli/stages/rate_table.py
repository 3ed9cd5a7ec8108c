"""Calibration of any rate gyro from a table of dwells: output against rate and temperature, or
against temperature alone (bias).

output/S₀ = K(T)·Ω − D(T) + Σ_p c_p Ω^p,   p = 2, 3, …;   rate = (output/S₀ + D(T) − Σ c_p Ω^p)/K(T)
S₀ is the nominal scale (output a rad/s) that makes K ≈ 1; the record is a `Calibration` without
wave angle, −output/S₀ in the place of m·dθ/dt.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError, name_some
from ..fitting.tables.dwells import compute_covariance, find_least_count
from ..fourier import interpolate_coefficients
from ..records import Calibration
from .calibration.dwell_curve import (
    Dwells,
    find_supported_curve,
    list_curve_figures,
    read_dwell_rows,
)

Array = np.ndarray
SPIKES_SUSPECT = 0.05
"""Part of the rows that are spikes from which the table is suspect."""


def rate_table(
    table: Mapping[str, Any],
    *,
    output: Annotated[str, Field(description="column of the gyro's output")],
    rate: Annotated[
        str | None, Field(description="column of the rate in rad/s; none: at rest, the bias alone")
    ] = None,
    temperature: Annotated[str | None, Field(description="column of the temperature")] = None,
    temperature_bits: Annotated[
        int | None,
        Field(
            ge=8,
            le=32,
            description=(
                "the temperature column is a two's complement word of so many bits read as unsigned"
            ),
        ),
    ] = None,
    temperature_scale: Annotated[
        float, Field(description="°C a unit of the temperature column")
    ] = 1.0,
    temperature_offset_degc: Annotated[
        float, Field(description="°C at 0 of the temperature column")
    ] = 0.0,
    nominal_scale: Annotated[
        float | None, Field(description="output a rad/s; none: fitted, or 1 at rest")
    ] = None,
    node_spacing_degc: Annotated[
        float, Field(gt=0, description="distance of the temperature nodes at most")
    ] = 5.0,
    interpolation: Annotated[
        Literal["linear", "cubic"], Field(description="between nodes")
    ] = "cubic",
    largest_power: Annotated[
        int, Field(ge=1, le=9, description="highest power of the rate that cross-validation tries")
    ] = 7,
    spike_sigma: Annotated[
        float,
        Field(
            gt=0,
            description=(
                "rows further than this from the fit, in robust standard deviations, are spikes"
            ),
        ),
    ] = 6.0,
    gyro_id: Annotated[str, Field(description="the gyro")] = "",
) -> Calibration:
    """K(T) and D(T) of any rate gyro from a table of dwells.

    output/nominal = K(T)Ω − D(T) + Σ c_p Ω^p at nodes of temperature, the powers chosen on data not
    used (every fifth of 25 stretches of rows), spikes rejected and counted. Standard deviations are
    inflated by the correlation of neighbouring rows.

    Parameters
    ----------
    table
        Columns (n,) by name (a DataFrame serves): output in any unit, rate [rad/s], temperature
        [°C].

    Returns
    -------
    Calibration
        D [rad/s] and K (nodes, 1).

    Raises
    ------
    HrgError
        A missing column, too few finite rows, one rate only.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.rate_table import rate_table
    >>> rate = np.tile([-1.0, 0.0, 1.0], 40)
    >>> output = 2.0 * rate + 0.01 + 1e-4 * np.random.default_rng(0).standard_normal(120)
    >>> tables = rate_table(
    ...     {"out": output, "rate": rate}, output="out", rate="rate", nominal_scale=2.0
    ... )
    >>> (
    ...     bool(abs(tables.scale_factor[0, 0] - 1) < 1e-3),
    ...     bool(abs(tables.drift_rad_s[0, 0] + 0.005) < 1e-3),
    ... )
    (True, True)
    """
    y, omega, degc, number = read_dwell_rows(
        table,
        (output, rate, temperature),
        (temperature_bits, temperature_scale, temperature_offset_degc),
    )
    turning = _is_turning(omega, rate)
    scale = nominal_scale or (float(np.polyfit(omega, y, 1)[0]) if turning else 1.0)
    y = y / scale
    dwells = Dwells(y, omega, degc, np.zeros(0), interpolation, turning)
    dwells, curve, reached = find_supported_curve(
        dwells, node_spacing_degc, largest_power, spike_sigma
    )
    y, omega, degc, nodes = dwells.output, dwells.rate_rad_s, dwells.temperature_degc, dwells.nodes
    X = curve.X[curve.keep]
    covariance = compute_covariance(X, y[curve.keep] - X @ curve.coefficients, find_least_count(y))
    left_out = _LeftOut(number[reached][~curve.keep], number[~reached], spike_sigma)

    record = Calibration(
        **_tables(curve.coefficients, covariance, nodes, turning),
        interpolation=interpolation,
        gyro_id=gyro_id,
        node_min=float(degc.min()) if temperature is not None else -np.inf,
        node_max=float(degc.max()) if temperature is not None else np.inf,
        rate_min_rad_s=float(omega.min()),
        rate_max_rad_s=float(omega.max()),
        correction="rate = (output/nominal_scale + D - sum c_p rate^p) / K",
        details=json.dumps(
            list_curve_figures(dwells, curve, scale) | left_out.list_figures(len(number))
        ),
    )
    known = bool(np.isfinite(covariance).all())
    return _remarked(record, left_out.say_spikes(len(number)), turning).judged(
        _doubts(known, curve.too_many, len(y), spike_sigma) + left_out.say_ends()
    )


@dataclass(frozen=True)
class _LeftOut:
    """Numbers from 1 of the rows that the curve was not fitted to: spikes, and rows beyond all
    others that they do not confirm."""

    spikes: Array
    ends: Array
    spike_sigma: float

    def list_figures(self, rows: int) -> dict[str, Any]:
        """For the record's details."""
        numbers = sorted(int(n) for n in (*self.spikes, *self.ends))
        return {"rows": rows, "rejected": len(numbers), "rejected_rows": numbers}

    def say_spikes(self, rows: int) -> tuple[list[str], bool]:
        """What was left out, and whether it is more than spikes are."""
        if not len(self.spikes):
            return [], False
        return [
            f"{len(self.spikes)} of {rows} rows are spikes (beyond {self.spike_sigma:g} robust"
            f" standard deviations) and were left out: {_name_rows(self.spikes)}"
        ], len(self.spikes) / rows > SPIKES_SUSPECT

    def say_ends(self) -> list[str]:
        """Rows at the end that may be spikes or the curve."""
        if not len(self.ends):
            return []
        return [
            f"{_name_rows(self.ends)}, beyond all others in temperature or rate, lies off the curve"
            " of the others: whether it is a spike or the curve bends there cannot be known, and"
            " the tables end before it; repeat the dwell"
        ]


def _name_rows(numbers: Array) -> str:
    rows = f"row{'s' if len(numbers) > 1 else ''} {name_some(numbers.tolist())}"
    return f"{rows} (counted below the columns' names)"


def _covariance_of_tables(covariance: Array, count: int, turning: bool) -> Array:
    """Covariance (2j, 2j) of D and K node by node, from that of the fit's −D of all nodes and K of
    all nodes; K that was not fitted has none."""
    out = np.zeros((2 * count, 2 * count))
    of_drift = 2 * np.arange(count)
    places = np.concatenate([of_drift, of_drift + 1]) if turning else of_drift
    sign = np.concatenate([-np.ones(count), np.ones(count)])[: len(places)]
    out[np.ix_(places, places)] = covariance[: len(places), : len(places)] * np.outer(sign, sign)
    return out


def _doubts(known: bool, too_many: int, rows: int, spike_sigma: float) -> list[str]:
    """What makes the table suspect: a scatter that cannot be known, more spikes than spikes are."""
    doubts = []
    if not known:
        doubts.append(
            "the rows lie on the fitted curve to the last digit: what they scatter by cannot be"
            " known, and no standard deviation is stated; give rows with more digits, or repeat the"
            " dwells"
        )
    if too_many:
        doubts.append(
            f"{too_many} of {rows} rows lie beyond {spike_sigma:g} robust standard deviations, too"
            " many to be spikes: the curve does not fit, and none was left out; give a smaller"
            " node_spacing_degc, or more rows"
        )
    return doubts


def _remarked(record: Calibration, spikes: tuple[list[str], bool], turning: bool) -> Calibration:
    """The record with what was left out and what it lacks; many spikes make it suspect."""
    remarks, many = list(spikes[0]), spikes[1]
    if not turning:
        remarks.append(
            "the gyro did not turn: the table holds its bias only, the scale factor is the"
            " nominal one"
        )
    if many:
        return record.judged(remarks)
    return record.replace(status_reasons=tuple(remarks))


def find_rate(record: Calibration, output: Array, temperature_degc: Array | float = 0.0) -> Array:
    """Rate of outputs at temperatures, by a calibration that was made of a table of dwells.

    The powers of the rate are solved by fixed-point steps.

    Parameters
    ----------
    record
        Made by `rate_table`.
    output
        In the unit of the table (n,).
    temperature_degc
        (n,), or one for all.

    Returns
    -------
    ndarray
        (n,) [rad/s].

    Raises
    ------
    HrgError
        A temperature outside the tables.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.rate_table import find_rate, rate_table
    >>> rate = np.tile(np.linspace(-1.0, 1.0, 11), 20)
    >>> output = 2.0 * rate + 0.01 + 1e-6 * np.random.default_rng(0).standard_normal(220)
    >>> tables = rate_table(
    ...     {"out": output, "rate": rate}, output="out", rate="rate", nominal_scale=2.0
    ... )
    >>> find_rate(tables, np.array([-0.99, 2.01])).round(4).tolist()
    [-0.5, 1.0]
    """
    details = json.loads(record.details)
    degc = np.broadcast_to(np.asarray(temperature_degc, float), np.shape(output))
    slack = 0.02 * (record.node_max - record.node_min)
    if (
        np.isfinite(record.node_min)
        and ((degc < record.node_min - slack) | (degc > record.node_max + slack)).any()
    ):
        raise HrgError(
            f"temperatures from {degc.min():.6g} to {degc.max():.6g} °C leave the table's"
            f" {record.node_min:.6g} to {record.node_max:.6g} °C; calibrate over the wider range"
        )
    at = [
        interpolate_coefficients(degc.ravel(), record.node, np.asarray(t), record.interpolation)[
            :, 0
        ].reshape(degc.shape)
        for t in (record.drift_rad_s, record.scale_factor)
    ]
    linear = np.asarray(output, float) / details["nominal_scale"] + at[0]
    rate = linear / at[1]
    for _ in range(20):
        rate = (
            linear
            - sum(c * rate**p for p, c in zip(details["powers"], details["power_coefficients"]))
        ) / at[1]
    return np.asarray(rate)


def summarise(record: Calibration) -> dict[str, Any]:
    """Figures of a table's calibration for the JSON: the keys of every calibration and the table's
    own.

    Parameters
    ----------
    record
        Made by `rate_table`.

    Returns
    -------
    dict
        `scale_factor_rms_ppm` is the residual as a part of the largest rate; None where the gyro
        did not turn.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.rate_table import rate_table, summarise
    >>> rate = np.tile([-1.0, 0.0, 1.0], 40)
    >>> output = 2.0 * rate + 1e-4 * np.random.default_rng(0).standard_normal(120)
    >>> tables = rate_table(
    ...     {"out": output, "rate": rate}, output="out", rate="rate", nominal_scale=2.0
    ... )
    >>> ppm = summarise(tables)["scale_factor_rms_ppm"]["after"]
    >>> bool(np.isclose(ppm, 1e6 * summarise(tables)["drift_rms_rad_s"]["after"]))
    True
    """
    details = json.loads(record.details)
    residual = details["residual_rms_rad_s"]
    largest = max(abs(record.rate_min_rad_s), abs(record.rate_max_rad_s))
    return {
        "drift_rms_rad_s": residual,
        "scale_factor_rms_ppm": {
            key: value / largest * 1e6 if largest > 0 else None for key, value in residual.items()
        },
        "harmonics": 0,
        "ladder": [],
        "nodes": [float(n) for n in record.node],
        "trade": {
            key: details[key] for key in ("nonlinearity_ppm", "asymmetry_ppm") if key in details
        },
        **details,
    }


def is_rate_table(record: Calibration) -> bool:
    """Whether a calibration was made of a table of dwells, and not of runs.

    Parameters
    ----------
    record
        A calibration.

    Returns
    -------
    bool
        As it was written by `rate_table`.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.rate_table import is_rate_table
    >>> is_rate_table(SimpleNamespace(model="table", details="{}"))
    False
    """
    return "nominal_scale" in json.loads(record.details)


def _is_turning(omega: Array, rate: str | None) -> bool:
    """Whether the dwells hold several rates. HrgError: a column of one rate only."""
    turning = bool(np.ptp(omega) > 0)
    if rate is not None and not turning:
        raise HrgError(
            f"column {rate}: one rate only, {omega[0]:.6g} rad/s: K and D cannot be told apart; "
            "add dwells at another rate, best of both signs"
        )
    return turning


def _tables(coefficients: Array, covariance: Array, nodes: Array, turning: bool) -> dict[str, Any]:
    """The columns of a table without a wave angle: D and K at the nodes, each its own constant
    term.

    The fit's output/nominal = KΩ − D has D with the sign of the calibration's m·dθ/dt = −KΩ + D.
    """
    count = len(nodes)
    drift = -coefficients[:count]
    gain = coefficients[count : 2 * count] if turning else np.ones(count)
    of_tables = _covariance_of_tables(covariance, count, turning)
    std = np.sqrt(np.maximum(np.diag(of_tables), 0)).reshape(count, 2)
    columns: dict[str, Any] = {
        "temperature_degc": nodes,
        "wave_angle_rad": np.zeros(1),
        "covariance": of_tables,
    }
    for name, values, errors in (
        ("drift_rad_s", drift, std[:, :1]),
        ("scale_factor", gain, std[:, 1:]),
        ("drift_harmonics", drift, std[:, :1]),
        ("scale_factor_harmonics", gain, std[:, 1:]),
    ):
        columns |= {name: values[:, None], f"{name}_std": errors}
    return columns
