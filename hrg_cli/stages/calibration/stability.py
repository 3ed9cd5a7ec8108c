"""Structural stability: which harmonics of the tables repeat between programmes, and thermal lag
against hysteresis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...fitting.checks import CHANCE
from ...fitting.tables.increments import Path
from ...fitting.tables.joint import PIECES, Fitted, Model, TableLayout, fit, piece_of, solve
from ...fourier import coefficients_at
from .column_spaces import solve_columns

Array = np.ndarray
NOT_REPEATED = 0.01
"""Probability, over all harmonics together, below which a harmonic is said not to repeat."""
LEAST_SWEEP_DEGC_S = 1e-4
INSEPARABLE = 0.98
"""Correlation of two thermal factors above which this programme does not separate them."""


def labels(paths: Sequence[Path], programmes: Mapping[str, str] | None) -> tuple[Array, str]:
    """Programme (R, S) of each piece, and what told it: names given, else the day of start_time,
    else warming against cooling."""
    if programmes:
        own = [programmes.get(p.run_id, "") for p in paths]
        return np.repeat(np.array(own, object)[:, None], PIECES, axis=1), "programmes"
    days = [p.start_time[:10] for p in paths]
    if len(set(days)) > 1 and all(days):
        return np.repeat(np.array(days, object)[:, None], PIECES, axis=1), "day"
    out = np.full((len(paths), PIECES), "", object)
    for r, path in enumerate(paths):
        rate, piece = sweep(path), piece_of(len(path))
        for s in range(PIECES):
            mean = float(np.mean(rate[piece == s])) if (piece == s).any() else 0.0
            out[r, s] = (
                "warming"
                if mean > LEAST_SWEEP_DEGC_S
                else "cooling"
                if mean < -LEAST_SWEEP_DEGC_S
                else ""
            )
    return out, "warming and cooling"


def sweep(path: Path) -> Array:
    """dT/dt of the increments, °C/s, smoothed over a twentieth of the run; zeros without a
    temperature."""
    if len(path) < 3 or not np.isfinite(path.temperature_degc).all():
        return np.zeros(len(path))
    width = max(1, len(path) // 40)
    padded = np.pad(path.temperature_degc, width, mode="edge")
    time = np.pad(path.time_s, width, mode="edge")
    slope = (padded[2 * width :] - padded[: -2 * width]) / np.maximum(
        time[2 * width :] - time[: -2 * width], 1e-12
    )
    return path.middle(slope)


def repeat_of_harmonics(
    fitted: Fitted,
    coefficients: Array,
    drift_limit: int,
    scale_limit: int,
    programmes: Mapping[str, str] | None,
) -> dict[str, Any] | None:
    """How each harmonic differs between programmes; None where there is one programme only.

    Each programme's own offset from the joint tables (the same at all nodes) is fitted; per
    harmonic Q = Σ(δ_g − δ̄)ᵀS_g⁻¹(δ_g − δ̄) is χ² with (G − 1) degrees a coefficient if the
    harmonic repeats; the scatter between programmes follows from its excess.
    """
    label, told_by = labels(fitted.paths, programmes)
    layout = fitted.layout
    drift_limit, scale_limit = (
        min(drift_limit, layout.drift_harmonics),
        min(scale_limit, layout.scale_harmonics),
    )
    matrix = np.concatenate(
        [
            layout.part("drift", drift_limit, one_node=True),
            layout.part("scale", scale_limit, one_node=True),
        ],
        axis=1,
    )
    offsets, covariances, names, skipped = [], [], [], []
    for name in sorted({str(v) for v in label.ravel()} - {""}):
        A, b, _, rows = fitted.pieces.sum(label == name)
        if rows == 0:
            continue
        G = matrix.T @ A @ matrix
        scale = np.sqrt(np.maximum(np.diag(G), 1e-300))
        values, vectors = np.linalg.eigh(G / np.outer(scale, scale))
        if values.min() < 1e-7:
            skipped.append(name)
            continue
        inverse = (vectors / values) @ vectors.T / np.outer(scale, scale)
        offsets.append(inverse @ (matrix.T @ (b - A @ coefficients)))
        covariances.append(inverse * fitted.chi2_per_dof)
        names.append(name)
    if len(names) < 2:
        return None
    table: list[dict[str, Any]] = []
    groups = [("drift", k) for k in range(drift_limit + 1)] + [
        ("scale", k) for k in range(scale_limit + 1)
    ]
    place = 0
    for kind, k in groups:
        own = slice(place, place + (2 if k else 1))
        place = own.stop
        table.append(
            {
                "kind": kind,
                "harmonic": k,
                **_scatter(np.array([o[own] for o in offsets]), [c[own, own] for c in covariances]),
            }
        )
        table[-1]["amplitude"] = _amplitude(layout, coefficients, kind, k)
    for row in table:
        row["name"] = harmonic_name(layout, row["kind"], row["harmonic"])
        row["repeats"] = bool(row["p_value"] * len(table) > NOT_REPEATED)
        # an offset that scatters more than the harmonic itself makes predictions worse, not better
        row["stable"] = bool(
            row["repeats"] or row["scatter"] ** 2 * (1 + 1 / len(names)) < row["amplitude"] ** 2
        )
    return {
        "told_by": told_by,
        "programmes": names,
        "not_enough_alone": skipped,
        "harmonics": table,
    }


def say_unstable(found: dict[str, Any] | None, dropped: Sequence[str]) -> list[str]:
    """One sentence a harmonic that does not repeat between programmes, beyond chance, and was not
    dropped."""
    if found is None:
        return []
    out = []
    for row in found["harmonics"]:
        if row["p_value"] * len(found["harmonics"]) >= CHANCE or row["name"] in dropped:
            continue
        unit = " rad/s" if row["kind"] == "drift" else ""
        out.append(
            f"the {row['name']} does not repeat between programmes (told by {found['told_by']}, p ="
            f" {row['p_value']:.2g}): it scatters by {row['scatter']:.2g}{unit} beside its own"
            f" {row['amplitude']:.2g}{unit}, which the tables' errors do not hold; look for what"
            " differs, or use --stable-only"
        )
    return out


def _amplitude(layout: TableLayout, coefficients: Array, kind: str, k: int) -> float:
    table = layout.tables(coefficients)[0 if kind == "drift" else 1]
    return float(
        np.sqrt(
            np.mean(
                (table[:, [0]] if k == 0 else table[:, 2 * k - 1 : 2 * k + 1]) ** 2, axis=0
            ).sum()
        )
    )


def _scatter(offsets: Array, covariances: Sequence[Array]) -> dict[str, float]:
    """Weighted mean removed: p-value of "the same", and the scatter between programmes by moments
    (DerSimonian–Laird)."""
    from scipy.stats import chi2

    weights = [np.linalg.inv(c) for c in covariances]
    total = np.sum(weights, axis=0)
    mean = np.linalg.solve(total, np.sum([w @ o for w, o in zip(weights, offsets)], axis=0))
    Q = float(sum((o - mean) @ w @ (o - mean) for w, o in zip(weights, offsets)))
    size = offsets.shape[1]
    freedom = size * (len(offsets) - 1)
    spread = float(
        np.trace(total) - np.trace(np.linalg.solve(total, np.sum([w @ w for w in weights], axis=0)))
    )
    variance = max(Q - freedom, 0.0) / max(spread, 1e-300)
    return {"p_value": float(chi2.sf(Q, freedom)), "scatter": float(np.sqrt(size * variance))}


def harmonic_name(layout: TableLayout, kind: str, k: int) -> str:
    """Name of a harmonic: "drift 8θ", "scale factor constant"."""
    return (
        f"{'drift' if kind == 'drift' else 'scale factor'}"
        f" {f'{2 * layout.mode_number * k}θ' if k else 'constant'}"
    )


def drop_unstable(
    layout: TableLayout, drift_limit: int, scale_limit: int, found: dict[str, Any]
) -> tuple[Array, list[str]]:
    """(model matrix without the harmonics that do not repeat, their names); the constant of K
    always stays."""
    parts, dropped = [], []
    for row in found["harmonics"]:
        kind, k = row["kind"], row["harmonic"]
        if k > (drift_limit if kind == "drift" else scale_limit):
            continue
        if row["stable"] or (kind == "scale" and k == 0):
            parts.append(layout.part(kind, k, lowest=k))
        else:
            dropped.append(row["name"])
    return np.concatenate(parts, axis=1), dropped


def thermal_memory(fitted: Fitted, model: Model, coefficients: Array) -> dict[str, Any] | None:
    """Lag of the thermometer τ (D and K at T + τ·dT/dt) against hysteresis w (at T + w·sign dT/dt);
    None without sweeps.

    Both are first-order shifts of the temperature; one ramp speed cannot tell them apart (PHYSICS
    §2 iv): then said so.
    """
    layout = fitted.layout
    speeds = np.concatenate([sweep(p) for p in fitted.paths])
    if (
        len(layout.nodes) < 2
        or layout.axis != "temperature"
        or np.abs(speeds).max(initial=0.0) < LEAST_SWEEP_DEGC_S
    ):
        return None
    drift, scale = layout.tables(coefficients)
    step = 0.05 * float(np.ptp(layout.nodes))

    def slope(path: Path) -> Array:
        x, basis = (
            layout.abscissa(path),
            path.angle_basis(max(layout.drift_harmonics, layout.scale_harmonics)),
        )

        def derivative(table: Array) -> Array:
            up, down = (
                coefficients_at(x + sign * step, layout.nodes, table, _kind(layout))
                for sign in (1, -1)
            )
            return np.asarray(((up - down) / (2 * step) * basis[:, : table.shape[1]]).sum(axis=1))

        return derivative(drift) - path.rate_rad_s * derivative(scale)

    def lag(path: Path) -> Array:
        return (slope(path) * sweep(path))[:, None]

    def hysteresis(path: Path) -> Array:
        speed = sweep(path)
        return (slope(path) * np.tanh(speed / LEAST_SWEEP_DEGC_S))[:, None]

    wide = replace(
        layout,
        factors={**layout.factors, "lag": lag, "hysteresis": hysteresis},
        factor_columns={**layout.factor_columns, "lag": 1, "hysteresis": 1},
    )
    grown = np.concatenate([model.matrix, np.zeros((2, model.matrix.shape[1]))])
    extra = wide.of_factors("lag", "hysteresis")
    # what memory the tables leave must not count as noise
    refitted = fit(
        fitted.paths, wide, Model("memory", np.concatenate([grown, extra], axis=1)), fitted
    )
    A, b, _, _ = refitted.pieces.sum()
    own = np.diag(extra.T @ A @ extra)
    rest = extra.T @ A @ extra - extra.T @ A @ solve_columns(A, grown, A @ extra)
    left = np.sqrt(np.maximum(np.diag(rest), 0) / np.where(own > 0, own, 1))
    correlation = (
        float(rest[0, 1] / np.sqrt(rest[0, 0] * rest[1, 1])) if (np.diag(rest) > 0).all() else 1.0
    )
    out: dict[str, Any] = {
        "independence": {"lag": float(left[0]), "hysteresis": float(left[1])},
        "correlation": correlation,
    }
    for name, unit in (("lag", "s"), ("hysteresis", "degC")):
        alone = Model(name, np.concatenate([grown, wide.of_factors(name)], axis=1))
        solution = solve(A, b, alone)
        place = wide.factor(name).start
        std = float(np.sqrt(solution.covariance[place, place] * refitted.chi2_per_dof))
        out[name] = {
            "value": float(solution.coefficients[place]),
            "std": std,
            "units": unit,
            "assuming": "the other is zero",
        }
    if abs(correlation) > INSEPARABLE or left.min() < 0.02:
        out["separable"] = False
        out["sentence"] = (
            "thermal lag and hysteresis cannot be told apart by this programme; "
            "add a sweep at another speed (a half or a third), or steps with soaks"
        )
        return out
    both = solve(A, b, Model("both", np.concatenate([grown, extra], axis=1)))
    for name in ("lag", "hysteresis"):
        place = wide.factor(name).start
        std = float(np.sqrt(both.covariance[place, place] * refitted.chi2_per_dof))
        out[name] |= {
            "value": float(both.coefficients[place]),
            "std": std,
            "assuming": "nothing of the other",
        }
    out["separable"] = True
    return out


def _kind(layout: TableLayout) -> str:
    return "linear" if layout.interpolation in ("linear", "monotone") else "cubic"
