"""Calibration of any rate gyro from a table of dwells: output against rate and temperature, or
against temperature alone (bias).

output/S₀ = K(T)·Ω − D(T) + Σ_p c_p Ω^p,   p = 2, 3, …;   rate = (output/S₀ + D(T) − Σ c_p Ω^p)/K(T)
S₀ is the nominal scale (output a rad/s) that makes K ≈ 1; the record is a `Calibration` without
wave angle, −output/S₀ in the place of m·dθ/dt.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fourier import coefficients_at, node_weights
from ..records import Calibration

Array = np.ndarray
FOLDS, STRETCHES = 5, 25
"""Every fifth of 25 stretches of the rows is left out together: neighbours stay together, and a
sweep of temperature is not cut short."""
FEWEST_LEFT = 4
"""Rows beyond the coefficients from which the scatter of the rows is told."""
FEWEST_FOR_SPIKES = 8
"""Rows beyond the coefficients from which a spike is told from a bend."""
LARGEST_SHARE = 0.2
"""Share of the rows that may be spikes; if more stand out, it is the curve that is wrong."""
ROWS_A_NODE = 5
"""Rows per coefficient from which the spacing of the nodes alone decides their number."""
LARGEST_CONDITION = 1e6
ON_GRID = 0.02
"""Part of a step by which rounded values may miss its multiples."""
SPIKES_SUSPECT = 0.05
"""Part of the rows that are spikes from which the table is suspect."""
ROUNDING = 1e-12
"""Relative scatter that is rounding, not noise."""


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
        Columns (n,) by name (a DataFrame serves): output in any unit, rate [rad/s], temperature [°C].

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
    >>> tables = rate_table({"out": output, "rate": rate}, output="out", rate="rate", nominal_scale=2.0)
    >>> bool(abs(tables.scale_factor[0, 0] - 1) < 1e-3), bool(abs(tables.drift_rad_s[0, 0] + 0.005) < 1e-3)
    (True, True)
    """
    y, omega, degc = _rows(
        table,
        (output, rate, temperature),
        (temperature_bits, temperature_scale, temperature_offset_degc),
    )
    turning = bool(np.ptp(omega) > 0)
    if rate is not None and not turning:
        raise HrgError(
            f"column {rate}: one rate only, {omega[0]:.6g} rad/s: K and D cannot be told apart; "
            "add dwells at another rate, best of both signs"
        )
    scale = nominal_scale or (float(np.polyfit(omega, y, 1)[0]) if turning else 1.0)
    y = y / scale
    nodes = (
        _nodes(y, omega, degc, node_spacing_degc, interpolation, turning)
        if temperature is not None
        else np.zeros(1)
    )
    step = least_count(y)

    def curve(keep: Array) -> tuple[list[int], dict[str, float], Array, Array]:
        powers, scores = _choose_powers(
            y[keep], omega[keep], degc[keep], nodes, interpolation, turning, largest_power
        )
        X = _design(omega, degc, nodes, interpolation, turning, powers)
        return powers, scores, X, np.linalg.lstsq(X[keep], y[keep], rcond=None)[0]

    keep, too_many = np.ones(len(y), bool), 0
    for _ in range(20):
        powers, scores, X, fits = curve(keep)
        now = ~_spikes(X, y - X @ fits, keep, spike_sigma, step)
        if (now == keep).all():
            break
        if (~now).sum() > LARGEST_SHARE * len(y):
            too_many, keep = int((~now).sum()), np.ones(len(y), bool)
            powers, scores, X, fits = curve(keep)
            break
        keep = now
    covariance = _covariance(X[keep], y[keep] - X[keep] @ fits, step)
    count = len(nodes)
    drift = -fits[:count]
    gain = fits[count : 2 * count] if turning else np.ones(count)
    sizes = covariance[: 2 * count, : 2 * count] if turning else covariance[:count, :count]
    blocks = np.zeros((2 * count, 2 * count))
    order = (
        np.concatenate([2 * np.arange(count), 2 * np.arange(count) + 1])
        if turning
        else 2 * np.arange(count)
    )
    sign = np.concatenate([-np.ones(count), np.ones(count)])[: len(order)]
    blocks[np.ix_(order, order)] = sizes * np.outer(sign, sign)
    std = np.sqrt(np.maximum(np.diag(blocks), 0)).reshape(count, 2)
    details = _details(
        y, omega, degc, keep, nodes, interpolation, turning, powers, fits, scores, scale
    )
    record = Calibration(
        temperature_degc=nodes,
        wave_angle_rad=np.zeros(1),
        drift_rad_s=drift[:, None],
        drift_rad_s_std=std[:, :1],
        scale_factor=gain[:, None],
        scale_factor_std=std[:, 1:],
        drift_harmonics=drift[:, None],
        drift_harmonics_std=std[:, :1],
        scale_factor_harmonics=gain[:, None],
        scale_factor_harmonics_std=std[:, 1:],
        covariance=blocks,
        interpolation=interpolation,
        gyro_id=gyro_id,
        node_min=float(degc.min()) if temperature is not None else -np.inf,
        node_max=float(degc.max()) if temperature is not None else np.inf,
        rate_min_rad_s=float(omega.min()),
        rate_max_rad_s=float(omega.max()),
        correction="rate = (output/nominal_scale + D - sum c_p rate^p) / K",
        details=json.dumps(details),
    )
    doubts = []
    if not np.isfinite(covariance).all():
        doubts.append(
            "the rows lie on the fitted curve to the last digit: what they scatter by cannot be"
            " known, and no standard deviation is stated; give rows with more digits, or repeat the"
            " dwells"
        )
    if too_many:
        doubts.append(
            f"{too_many} of {len(y)} rows lie beyond {spike_sigma:g} robust standard deviations: so"
            " many are no spikes, and none was left out; the table's curve is not the gyro's: give"
            " a smaller node_spacing_degc, or more rows"
        )
    return _remarked(record, keep, spike_sigma, turning).judged(doubts)


def _remarked(record: Calibration, keep: Array, spike_sigma: float, turning: bool) -> Calibration:
    """The record with what was left out and what it lacks; many spikes make it suspect."""
    remarks = []
    if (~keep).any():
        remarks.append(
            f"{int((~keep).sum())} of {len(keep)} rows are spikes (beyond {spike_sigma:g} robust"
            " standard deviations) and were left out"
        )
    if not turning:
        remarks.append(
            "the gyro did not turn: the table holds its bias only, the scale factor is the"
            " nominal one"
        )
    if (~keep).mean() > SPIKES_SUSPECT:
        return record.judged(remarks)
    return record.replace(status_reasons=tuple(remarks))


def rate_of(record: Calibration, output: Array, temperature_degc: Array | float = 0.0) -> Array:
    """Rate [rad/s] of outputs at temperatures with a calibration of `rate_table`; the powers of the
    rate by fixed-point steps."""
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
        coefficients_at(degc.ravel(), record.node, np.asarray(t), record.interpolation)[
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


def summary(record: Calibration) -> dict[str, Any]:
    """Figures of a table's calibration for the JSON: the keys of every calibration and the table's own.

    `scale_factor_rms_ppm`: the residual as a part of the largest rate; nulls where the gyro did not
    turn.
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
    """Whether a calibration was made from a table of dwells."""
    return "nominal_scale" in json.loads(record.details)


def _rows(
    table: Mapping[str, Any],
    names: tuple[str, str | None, str | None],
    word: tuple[int | None, float, float],
) -> tuple[Array, Array, Array]:
    """Output, rate in rad/s and temperature in °C (n,) of the rows in which all are finite.

    names: their columns, None: not there; word: bits of the temperature's two's complement or None,
    its scale and its offset. HrgError: fewer than ten rows.
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
    if good.sum() < 10:
        raise HrgError(
            f"the table has {int(good.sum())} finite rows of {len(y)}, at least ten were expected;"
            " check the columns' names and units"
        )
    return y[good], omega[good], degc[good]


def _column(table: Mapping[str, Any], name: str) -> Array:
    if name not in table:
        raise HrgError(f"the table has no column {name!r}; it has {', '.join(map(str, table))}")
    return np.asarray(table[name], float)


def _nodes(
    y: Array, omega: Array, degc: Array, spacing: float, interpolation: str, turning: bool
) -> Array:
    """Even nodes at most `spacing` apart, as many as the rows can carry: every one seen, and rows
    left over to tell their scatter.

    Where the rows are few for the nodes that the spacing asks for, their number is that which
    predicts rows left out best.
    """
    low, high = float(degc.min()), float(degc.max())
    if high - low < 1e-6:
        return np.array([low])
    count = int(np.clip(np.ceil((high - low) / spacing) + 1, 2, 12))
    a_node = 2 if turning else 1
    room = max(2, (len(y) - max(FEWEST_LEFT, len(y) // 3)) // a_node)
    able = []
    for n in range(2, min(count, room) + 1):
        X = _design(omega, degc, nodes := np.linspace(low, high, n), interpolation, turning, [])
        size = np.linalg.norm(X, axis=0)
        if (size > 0).all() and np.linalg.cond(X / size) < LARGEST_CONDITION:
            able.append((nodes, X))
    if not able:
        return np.array([(low + high) / 2])
    if len(able[-1][0]) == count and len(y) >= ROWS_A_NODE * a_node * count:
        return able[-1][0]
    return min(able, key=lambda pair: held_out_rms(y, pair[1]))[0]


def least_count(y: Array) -> float:
    """The step on whose multiples all values lie: the resolution of what measured them; 0 where
    there is none to be seen."""
    steps = np.diff(np.unique(y))
    if len(steps) < 3:
        return 0.0
    step = float(steps.min())
    multiples = steps / step
    on_grid = (
        float(np.max(np.abs(multiples - np.round(multiples)) / np.maximum(multiples, 1))) < ON_GRID
    )
    # values one step apart all along are a ramp, which looks the same without any grid
    return step if on_grid and multiples.max() > 1.5 else 0.0


def _spikes(X: Array, residual: Array, keep: Array, limit: float, step: float) -> Array:
    """Rows (n,) further from the fit than `limit` robust standard deviations, each held against its
    own error.

    A row that helps to fix the curve is pulled to it: its residual has the variance s²(1 − h). None
    is called a spike where too few rows are left over to tell.
    """
    left = int(keep.sum()) - X.shape[1]
    if left < FEWEST_FOR_SPIKES:
        return np.zeros(len(residual), bool)
    own = residual[keep]
    spread = 1.4826 * float(np.median(np.abs(own - np.median(own)))) * np.sqrt(keep.sum() / left)
    spread = max(spread, step / np.sqrt(12))
    if spread <= ROUNDING * float(np.abs(X).max() + np.abs(residual).max()):
        return np.zeros(len(residual), bool)
    leverage = np.einsum("ij,jk,ik->i", X, np.linalg.pinv(X[keep].T @ X[keep]), X)
    error = np.sqrt(np.where(keep, np.maximum(1 - leverage, 0.1), 1 + leverage))
    return np.asarray(np.abs(residual) > limit * spread * error)


def _design(
    omega: Array, degc: Array, nodes: Array, interpolation: str, turning: bool, powers: list[int]
) -> Array:
    weights = node_weights(degc, nodes, interpolation)
    if not turning:
        return weights
    return np.concatenate(
        [weights, weights * omega[:, None], *((omega**p)[:, None] for p in powers)], axis=1
    )


def _choose_powers(
    y: Array,
    omega: Array,
    degc: Array,
    nodes: Array,
    interpolation: str,
    turning: bool,
    largest: int,
) -> tuple[list[int], dict[str, float]]:
    """Powers 2…P with the smallest held-out residual over folds of stretches of the rows; scores by
    P."""
    if not turning:
        return [], {"1": held_out_rms(y, _design(omega, degc, nodes, interpolation, turning, []))}
    scores = {}
    for highest in range(1, min(largest, len(np.unique(omega)) - 1) + 1):
        X = _design(omega, degc, nodes, interpolation, turning, list(range(2, highest + 1)))
        scores[str(highest)] = held_out_rms(y, X)
    best = int(min(scores, key=lambda key: scores[key]))
    return list(range(2, best + 1)), scores


def held_out_rms(y: Array, X: Array) -> float:
    """Root mean square of the rows predicted without their fold of stretches."""
    fold = np.arange(len(y)) * min(STRETCHES, len(y)) // len(y) % FOLDS
    residual = np.empty(len(y))
    for f in range(FOLDS):
        own = fold == f
        residual[own] = y[own] - X[own] @ np.linalg.lstsq(X[~own], y[~own], rcond=None)[0]
    return float(np.sqrt(np.mean(residual**2)))


def _covariance(X: Array, residual: Array, step: float) -> Array:
    """s²(XᵀX)⁻¹ times the inflation 1 + 2Σ(1 − k/K)ρ_k that neighbouring rows' correlation asks
    for, never less than one.

    s² from the rows left over, at least a least count's step²/12, times n/(n − 2) for how little n
    of them tell it; NaN where the rows lie on the curve to the last digit: what they scatter by is
    then not known.
    """
    left = max(len(X) - X.shape[1], 0)
    power = float(residual @ residual)
    if left < 3 or (
        power / len(X) <= (ROUNDING * float(np.abs(X).max() + np.abs(residual).max())) ** 2
        and step == 0
    ):
        return np.full((X.shape[1], X.shape[1]), np.nan)
    variance = max(power / left, step**2 / 12) * left / (left - 2)
    lags = np.arange(1, max(2, min(len(X) // 10, 200)))
    correlations = (
        np.array([residual[k:] @ residual[:-k] for k in lags]) / power
        if power > 0
        else np.zeros(len(lags))
    )
    # sum up to the first lag without correlation: beyond it there is only noise to add
    stop = (
        int(np.argmax(correlations < 2 / np.sqrt(len(X))))
        if (correlations < 2 / np.sqrt(len(X))).any()
        else len(lags)
    )
    inflation = max(1.0, 1 + 2 * float(((1 - lags[:stop] / len(X)) * correlations[:stop]).sum()))
    return np.asarray(inflation * variance * np.linalg.pinv(X.T @ X))


def _details(
    y: Array, omega: Array, degc: Array, keep: Array, nodes: Array, interpolation: str, turning: bool, powers: list[int], fits: Array,
    scores: dict[str, float], scale: float,
) -> dict[str, Any]:  # fmt: skip
    X = _design(omega, degc, nodes, interpolation, turning, powers)
    residual = (y - X @ fits)[keep]
    plain = (
        np.stack([np.ones(keep.sum()), omega[keep]], axis=1)
        if turning
        else np.ones((int(keep.sum()), 1))
    )
    constant = y[keep] - plain @ np.linalg.lstsq(plain, y[keep], rcond=None)[0]
    out: dict[str, Any] = {
        "nominal_scale": scale,
        "powers": powers,
        "power_coefficients": fits[2 * len(nodes) :].tolist() if turning else [],
        "held_out_by_power": scores,
        "rows": len(y),
        "rejected": int((~keep).sum()),
        "residual_rms_rad_s": {
            "before": float(np.sqrt(np.mean(constant**2))),
            "after": float(np.sqrt(np.mean(residual**2))),
            "held_out": held_out_rms(y[keep], X[keep]),
        },
    }
    if turning:
        gain = fits[len(nodes) : 2 * len(nodes)]
        largest = float(np.abs(omega).max())
        grid = np.linspace(omega.min(), omega.max(), 201)
        bend = sum(
            (c * grid**p for p, c in zip(powers, out["power_coefficients"])), np.zeros(len(grid))
        )
        straight = np.polyfit(grid, bend, 1)
        out["nonlinearity_ppm"] = float(
            np.abs(bend - np.polyval(straight, grid)).max() / largest * 1e6
        )
        even = sum(
            (c * largest**p for p, c in zip(powers, out["power_coefficients"]) if p % 2 == 0), 0.0
        )
        out["asymmetry_ppm"] = float(2 * even / largest * 1e6)
        if len(nodes) > 1:
            out["scale_factor_coefficient_ppm_per_degc"] = float(
                np.polyfit(nodes, gain, 1)[0] / gain.mean() * 1e6
            )
    if len(nodes) > 1:
        out["bias_coefficient_rad_s_per_degc"] = float(np.polyfit(nodes, -fits[: len(nodes)], 1)[0])
    return out
