"""`hrg calibrate`: drift D(T, θ) and scale factor K(T, θ) of m·dθ/dt = −K·Ω + D from forced runs over temperature and rate, jointly."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting.fourier import harmonic_basis
from ..fitting.increments import path_of
from ..fitting.joint import PIECES, Fitted, Layout, Solution, chi_square, fit, roughness, solve
from ..records import Calibration, Resonator, Wave
from .calibration_figures import Cells, cells, figure, predictions
from .calibration_programme import choose_nodes, examine

Array = np.ndarray
TABLE_ANGLES = 72
LARGEST_LIMIT = 4
"""Highest harmonic of 2mθ that cross-validation tries."""
SMOOTHNESS = (1e-6, 1e-4, 1e-2, 1.0, 100.0)


def calibrate(
    waves: Sequence[Wave],
    resonator: Resonator | None = None,
    *,
    model: Annotated[
        Literal["table", "parametric", "quadrature", "phase", "physical"],
        Field(
            description="variant of seed A: table D(T, θ); parametric (10); quadrature (11); phase (12); physical (coefficients of a resonator file)"
        ),
    ] = "table",
    axis: Annotated[Literal["temperature", "frequency"], Field(description="what the nodes are of")] = "temperature",
    harmonics: Annotated[
        int | None, Field(ge=0, le=12, description="band limit of the drift in harmonics of 2mθ; none: by cross-validation")
    ] = None,
    scale_factor_harmonics: Annotated[
        int | None, Field(ge=0, le=12, description="band limit of the scale factor; none: by cross-validation")
    ] = None,
    nodes: Annotated[
        list[float] | None, Field(description="nodes of temperature [°C] or frequency [Hz]; none: the dwells, or evenly over a sweep")
    ] = None,
    interpolation: Annotated[
        Literal["linear", "cubic", "monotone", "smooth"],
        Field(description="between nodes; smooth: cubic splines with a penalty chosen by cross-validation"),
    ] = "cubic",
    ladder: Annotated[bool, Field(description="all seven stages of accuracy instead of the first three")] = False,
    compare: Annotated[bool, Field(description="compare the variants of the drift model in one table")] = False,
    stable_only: Annotated[bool, Field(description="drop harmonics that do not repeat between programmes")] = False,
    rate_rad_s: Annotated[float | None, Field(description="constant rate of runs without a rate log")] = None,
    rates_rad_s: Annotated[dict[str, float] | None, Field(description="constant rate by run_id")] = None,
    earth_rate_rad_s: Annotated[
        float, Field(description="component of the Earth's rate about the sensitive axis, added to the logged rate")
    ] = 0.0,
    programmes: Annotated[
        dict[str, str] | None,
        Field(description="programme (day, switch-on, branch) by run_id; none: by start_time's day, else by the sign of dT/dt"),
    ] = None,
    bootstrap: Annotated[int, Field(ge=0, le=100_000, description="draws for the intervals of the figures")] = 400,
    seed: Annotated[int, Field(ge=0, description="seed of the draws")] = 0,
) -> Calibration:
    """Drift and scale-factor tables from forced whole-angle runs, by generalised least squares on increments of the wave angle.

    m(θ̄_{i+1} − θ̄_i) = ∫w[−K(T,θ)Ω + D(T,θ)]dt (seed A after (7), PHYSICS §0), D and K Fourier series in 2mθ with coefficients at
    nodes. All runs are fitted jointly; each run's white angle noise and angle random walk are estimated from its own residuals.
    A programme that cannot give the tables yields a record of status "refused" whose reasons name the missing run.

    HrgError: no runs, different gyros or mode numbers, no rate, times that go back.
    """
    waves = list(waves)
    _same_gyro(waves, resonator)
    limit = max(
        harmonics if harmonics is not None else LARGEST_LIMIT,
        scale_factor_harmonics if scale_factor_harmonics is not None else LARGEST_LIMIT,
    )
    rates = rates_rad_s or {}
    paths = [path_of(w, harmonics=limit, rate_rad_s=rates.get(w.run_id, rate_rad_s), earth_rate_rad_s=earth_rate_rad_s) for w in waves]
    forced = [p for p in paths if p.forced]
    remarks = []
    if not forced:
        forced = paths
        remarks.append("no run is forced: the tables are those of free runs, which the drive's own errors do not touch")
    table_nodes, low, high, words = choose_nodes(forced, axis, nodes)
    remarks += words
    needed = harmonics if harmonics is not None else 1
    findings = examine(forced, table_nodes, axis, needed)
    refusals = [f.sentence for f in findings if f.refuses]
    remarks += [f.sentence for f in findings if not f.refuses]

    layout = Layout(
        nodes=table_nodes, axis=axis, mode_number=waves[0].mode_number, drift_harmonics=harmonics if harmonics is not None else LARGEST_LIMIT,
        scale_harmonics=scale_factor_harmonics if scale_factor_harmonics is not None else LARGEST_LIMIT, interpolation=interpolation,
    )  # fmt: skip
    fitted = fit(forced, layout)
    folds, held_out = choose_folds(fitted, needed)
    drift_limit, scale_limit, scores = choose_limits(fitted, time_folds(fitted), harmonics, scale_factor_harmonics)
    chosen = layout.select(drift_limit, scale_limit)
    penalty, smoothness = choose_smoothness(fitted, time_folds(fitted), chosen) if interpolation == "smooth" else (None, None)
    A, b, square, rows = fitted.pieces.sum()
    solution = solve(A, b, chosen, penalty)
    chi2 = chi_square(A, b, square, solution.coefficients) / max(rows - solution.degrees, 1.0)

    stages = {
        "1 constant scale factor": layout.select(-1, 0, one_scale=True),
        "2 drift and scale factor over angle": layout.select(drift_limit, scale_limit, one_drift=True, one_scale=True),
        "3 drift and scale factor over temperature and angle": chosen,
    }
    whole, held = predictions(fitted, list(stages.values()), folds, penalty)
    used, unseen = cells(fitted, whole, held, folds)
    scale_factor = float(np.mean(layout.tables(solution.coefficients)[1][:, 0]))
    steps = ladder_rows(list(stages), used, unseen, scale_factor, bootstrap, seed)
    details: dict[str, Any] = {
        "scale_factor": scale_factor,
        "figures": {
            kind: {"before": steps[0][kind], "after": steps[-1][kind + "_used"], "held_out": steps[-1][kind]} for kind in ("drift", "scale")
        },
        "held_out_by": held_out,
        "ladder": steps,
        "band_limit_scores": scores,
        "smoothness": smoothness,
        "chi2_per_dof": chi2,
        "jumps_of_half_a_turn": fitted.jumps,
        "runs": [
            {"run_id": p.run_id, "rows": p.rows, "blocks": len(p) + 1, "white_rad": float(np.sqrt(n.white)), "walk_rad2_s": n.walk}
            for p, n in zip(fitted.paths, fitted.noises)
        ],
    }
    record = _record(waves, fitted, solution, chi2, drift_limit, scale_limit, (low, high), model, details)
    return record.judged(refusals, "refused").judged(remarks, "suspect")


def summary(record: Calibration) -> dict[str, Any]:
    """The JSON of CONTRACT.md for a calibration."""
    details = json.loads(record.details)
    figures = details["figures"]
    return {
        "drift_rms_rad_s": {key: figures["drift"][key]["value"] for key in ("before", "after", "held_out")},
        "scale_factor_rms_ppm": {key: figures["scale"][key]["value"] for key in ("before", "after", "held_out")},
        "harmonics": (record.drift_harmonics.shape[1] - 1) // 2,
        "scale_factor_harmonics": (record.scale_factor_harmonics.shape[1] - 1) // 2,
        "scale_factor": details["scale_factor"],
        "nodes": [float(n) for n in record.node],
        "held_out_by": details["held_out_by"],
        "ladder": [
            {"stage": s["stage"], "drift_rms_rad_s": s["drift"]["value"], "scale_factor_rms_ppm": s["scale"]["value"]}
            for s in details["ladder"]
        ],
    }


def _same_gyro(waves: Sequence[Wave], resonator: Resonator | None) -> None:
    if not waves:
        raise HrgError("calibrate needs at least one wave file of a forced run; none was given")
    gyros = sorted(
        {w.gyro_id for w in waves if w.gyro_id} | ({resonator.gyro_id} if resonator is not None and resonator.gyro_id else set())
    )
    if len(gyros) > 1:
        raise HrgError(f"runs of {len(gyros)} gyros ({', '.join(gyros)}) were given, a table belongs to one; calibrate each gyro by itself")
    modes = sorted({w.mode_number for w in waves})
    if len(modes) > 1:
        raise HrgError(f"runs of mode numbers {modes} were given, one was expected; correct mode_number of the recordings")


def time_folds(fitted: Fitted) -> Array:
    """Fold (R, S) of each piece: contiguous stretches of time, the same of every run."""
    return np.tile(np.arange(PIECES), (len(fitted.paths), 1))


def choose_folds(fitted: Fitted, harmonics: int) -> tuple[Array, str]:
    """Fold (R, S) of each piece: whole runs where repeated programmes allow it, otherwise contiguous stretches of time of each run.

    Whole runs are left out only if the others still give every table and reach the rates left out: no figure is an extrapolation.
    """
    nodes, axis = fitted.layout.nodes, fitted.layout.axis
    nearest = [int(np.argmin(np.abs(nodes - np.mean(fitted.layout.abscissa(p))))) for p in fitted.paths]
    fold = np.array([nearest[:r].count(n) for r, n in enumerate(nearest)])
    mean = np.array([float(np.mean(p.rate_rad_s)) for p in fitted.paths])
    slack = 0.1 * float(np.abs(mean).max(initial=0.0))

    def serves(left: int) -> bool:
        for n in set(nearest):
            own = np.array(nearest) == n
            kept, gone = mean[own & (fold != left)], mean[own & (fold == left)]
            if len(gone) and (len(kept) == 0 or (gone < kept.min() - slack).any() or (gone > kept.max() + slack).any()):
                return False
        rest = [p for p, f in zip(fitted.paths, fold) if f != left]
        return not any(f.refuses for f in examine(rest, nodes, axis, harmonics))

    count = int(fold.max()) + 1
    if count >= 3 and all(serves(left) for left in range(count)):
        return np.repeat(fold[:, None], PIECES, axis=1), "runs"
    return time_folds(fitted), "time"


def held_out_chi_square(fitted: Fitted, folds: Array, model: Array, penalty: Array | None = None) -> float:
    """Σ over folds of the whitened residuals squared, the fold predicted from the others."""
    A, b, _, _ = fitted.pieces.sum()
    total = 0.0
    for f in range(int(folds.max()) + 1):
        A_f, b_f, square, _ = fitted.pieces.sum(folds == f)
        total += chi_square(A_f, b_f, square, solve(A - A_f, b - b_f, model, penalty).coefficients)
    return total


def choose_limits(fitted: Fitted, folds: Array, drift: int | None, scale: int | None) -> tuple[int, int, dict[str, list[float]]]:
    """Band limits of drift and scale factor with the smallest held-out χ², drift first; the scores are kept."""
    layout, scores = fitted.layout, {"drift": [0.0], "scale_factor": [0.0]}
    if drift is None:
        scores["drift"] = [held_out_chi_square(fitted, folds, layout.select(k, None)) for k in range(layout.drift_harmonics + 1)]
    drift = int(np.argmin(scores["drift"])) if drift is None else drift
    if scale is None:
        scores["scale_factor"] = [held_out_chi_square(fitted, folds, layout.select(drift, k)) for k in range(layout.scale_harmonics + 1)]
    scale = int(np.argmin(scores["scale_factor"])) if scale is None else scale
    return drift, scale, {key: [s - min(row) for s in row] for key, row in scores.items()}


def choose_smoothness(fitted: Fitted, folds: Array, model: Array) -> tuple[Array, float]:
    """Penalty on curvature along the nodes with the smallest held-out χ², relative to the information about each kind of coefficient."""
    layout = fitted.layout
    information = np.diag(fitted.pieces.sum()[0])
    scale = np.zeros(layout.size)
    for part in (layout.drift, layout.scale):
        places = np.concatenate([np.arange(layout.size)[part(j)] for j in range(len(layout.nodes))])
        scale[places] = np.sqrt(np.mean(information[places]))
    penalty = roughness(layout) * np.outer(scale, scale)
    scores = [held_out_chi_square(fitted, folds, model, weight * penalty) for weight in SMOOTHNESS]
    best = SMOOTHNESS[int(np.argmin(scores))]
    return best * penalty, best


def ladder_rows(names: Sequence[str], used: Cells, unseen: Cells, scale_factor: float, draws: int, seed: int) -> list[dict[str, Any]]:
    """One row a stage: held-out drift and scale-factor figures with intervals, and the same on the data used."""
    rows: list[dict[str, Any]] = [{"stage": name} for name in names]
    for kind in ("drift", "scale"):
        for key, found in ((kind, unseen), (kind + "_used", used)):
            f = figure(found, kind, scale_factor, draws, seed)
            for i, row in enumerate(rows):
                row[key] = {
                    name: float(v) if np.isfinite(v) else None
                    for name, v in (("value", f.value[i]), ("low", f.low[i]), ("high", f.high[i]), ("floor", f.floor))
                }
    return rows


def _record(
    waves: Sequence[Wave], fitted: Fitted, solution: Solution, chi2: float, drift_limit: int, scale_limit: int, valid: tuple[float, float], model: str,
    details: dict[str, Any],
) -> Calibration:  # fmt: skip
    """Coefficients and covariance cut to the band limits, and the tables with their standard deviations."""
    layout = fitted.layout
    keep = np.concatenate(
        [
            np.concatenate(
                [
                    np.arange(layout.size)[layout.drift(j)][: 1 + 2 * drift_limit],
                    np.arange(layout.size)[layout.scale(j)][: 1 + 2 * scale_limit],
                ]
            )
            for j in range(len(layout.nodes))
        ]
    )
    covariance = solution.covariance[np.ix_(keep, keep)] * chi2
    drift, scale = layout.tables(solution.coefficients)
    drift, scale = drift[:, : 1 + 2 * drift_limit], scale[:, : 1 + 2 * scale_limit]
    width = drift.shape[1] + scale.shape[1]
    angles = np.arange(TABLE_ANGLES) * np.pi / layout.mode_number / TABLE_ANGLES
    of_drift, of_scale = (harmonic_basis(angles, k, layout.mode_number) for k in (drift_limit, scale_limit))
    std = np.sqrt(np.maximum(np.diag(covariance), 0)).reshape(len(layout.nodes), width)

    def table_std(basis: Array, first: int) -> Array:
        parts = [slice(j * width + first, j * width + first + basis.shape[1]) for j in range(len(layout.nodes))]
        return np.stack([np.sqrt(np.maximum(np.einsum("ai,ij,aj->a", basis, covariance[p, p], basis), 0)) for p in parts])

    rates = [float(f(p.rate_rad_s)) for p in fitted.paths for f in (np.min, np.max)]
    temperature = layout.axis == "temperature"
    return Calibration(
        temperature_degc=layout.nodes if temperature else None,
        frequency_hz=None if temperature else layout.nodes,
        wave_angle_rad=angles,
        drift_rad_s=drift @ of_drift.T,
        drift_rad_s_std=table_std(of_drift, 0),
        scale_factor=scale @ of_scale.T,
        scale_factor_std=table_std(of_scale, drift.shape[1]),
        drift_harmonics=drift,
        drift_harmonics_std=std[:, : drift.shape[1]],
        scale_factor_harmonics=scale,
        scale_factor_harmonics_std=std[:, drift.shape[1] :],
        covariance=covariance,
        axis=layout.axis,
        model=model,
        interpolation=layout.interpolation,
        mode_number=layout.mode_number,
        gyro_id=next((w.gyro_id for w in waves if w.gyro_id), ""),
        lot_id=next((w.lot_id for w in waves if w.lot_id), ""),
        node_min=valid[0],
        node_max=valid[1],
        rate_min_rad_s=min(rates),
        rate_max_rad_s=max(rates),
        details=json.dumps(details),
    )
