"""`hrg calibrate`: drift D(T, θ) and scale factor K(T, θ) of m·dθ/dt = −K·Ω + D from forced runs over temperature and rate, jointly."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting.tables.increments import path_of
from ..fitting.tables.joint import Fitted, Layout, Model, Solution, chi_square, fit, solve
from ..fitting.tables.shrinkage import FEWER_SWEEPS, SWEEPS, averaged, doubtful_harmonics
from ..records import Calibration, Resonator, Wave
from .calibration.checks import interpolation_doubt, noisy_angles, quadrature_left, rate_left, stray_harmonics
from .calibration.factors import build, measured_details, physical_covariance, variant
from .calibration.figures import cells, figure_rows, predictions
from .calibration.folds import choose_folds, choose_limits, choose_smoothness
from .calibration.ladder import Settings, climb, first_stages
from .calibration.programme import choose_nodes, examine
from .calibration.record import record_of
from .calibration.stability import repeats, thermal_memory, without_unstable
from .figures_of_merit import trade_figures
from .one_gyro import of_one_gyro
from .rate_table import is_rate_table
from .rate_table import summary as table_summary

Array = np.ndarray
LARGEST_LIMIT = 4
"""Highest harmonic of 2mθ that cross-validation tries."""
VARIANTS = ("table", "parametric", "quadrature", "phase", "physical")


def calibrate(
    waves: Sequence[Wave],
    resonator: Resonator | None = None,
    *,
    model: Annotated[
        Literal["table", "parametric", "quadrature", "phase", "physical", "all"],
        Field(
            description="seed A's drift model: table, parametric (10), quadrature (11), phase (12), physical; all: table, others compared"
        ),
    ] = "table",
    axis: Annotated[Literal["temperature", "frequency"], Field(description="what the nodes are of")] = "temperature",
    harmonics: Annotated[
        int | None, Field(ge=0, le=12, description="band limit of the drift in harmonics of 2mθ; none: cross-validation")
    ] = None,
    scale_factor_harmonics: Annotated[int | None, Field(ge=0, le=12, description="band limit of K; none: cross-validation")] = None,
    nodes: Annotated[list[float] | None, Field(description="nodes, °C or Hz; none: the dwells, or evenly over a sweep")] = None,
    interpolation: Annotated[
        Literal["linear", "cubic", "monotone", "smooth"], Field(description="between nodes; smooth: cubic with a penalty on curvature")
    ] = "cubic",
    ladder: Annotated[bool, Field(description="all seven stages of accuracy instead of the first three")] = False,
    stable_only: Annotated[bool, Field(description="drop harmonics that do not repeat between programmes")] = False,
    rate_rad_s: Annotated[float | None, Field(description="constant rate of runs without a rate log")] = None,
    rates_rad_s: Annotated[dict[str, float] | None, Field(description="constant rate by run_id")] = None,
    earth_rate_rad_s: Annotated[float, Field(description="Earth's rate about the sensitive axis, added to the logged rate")] = 0.0,
    programmes: Annotated[
        dict[str, str] | None, Field(description="programme by run_id; none: start_time's day, else warming against cooling")
    ] = None,
    bootstrap: Annotated[int, Field(ge=0, le=100_000, description="draws for the intervals of the figures")] = 400,
    seed: Annotated[int, Field(ge=0, description="seed of the draws")] = 0,
) -> Calibration:
    """Drift and scale-factor tables from forced whole-angle runs, by generalised least squares on increments of the wave angle.

    m(θ̄_{i+1} − θ̄_i) = ∫w[−K(T,θ)Ω + D(T,θ)]dt (seed A after (7), PHYSICS §0), D and K Fourier series in 2mθ with coefficients at
    nodes. All runs are fitted jointly; each run's white angle noise and angle random walk are estimated from its own residuals.
    A programme that cannot give the tables yields a record of status "refused" whose reasons name the missing run.

    HrgError: no runs, different gyros or mode numbers, no rate, times that go back, `physical` without a resonator.
    """
    waves = list(waves)
    _same_gyro(waves, resonator)
    if model == "physical" and resonator is None:
        raise HrgError(
            "model physical takes its coefficients from a resonator file; run `hrg identify` on free runs and give it with --resonator"
        )
    drift_most = max(harmonics if harmonics is not None else LARGEST_LIMIT, 1)
    scale_most = scale_factor_harmonics if scale_factor_harmonics is not None else LARGEST_LIMIT
    given = rates_rad_s or {}
    paths = [
        path_of(
            w,
            harmonics=max(drift_most, scale_most),
            rate_rad_s=given.get(w.run_id, rate_rad_s if w.rate_rad_s is None else None),
            earth_rate_rad_s=earth_rate_rad_s,
        )
        for w in waves
    ]
    forced, free = [p for p in paths if p.forced], [p for p in paths if not p.forced]
    remarks: list[str] = []
    if not forced:
        forced, free = free, []
        remarks.append("no run is forced: the tables are those of free runs, without the drive's own errors")
    table_nodes, low, high, words = choose_nodes(forced, axis, nodes)
    needed = 1 if harmonics is None else harmonics
    findings = examine(forced, table_nodes, axis, needed)
    refusals = [f.sentence for f in findings if f.refuses]
    remarks += words + [f.sentence for f in findings if not f.refuses]

    wanted = ["quadrature"] if model in ("quadrature", "physical", "phase", "all") or ladder else []
    wanted += ["phase", "mean_frequency"] if model in ("phase", "all") else []
    wanted += ["quadrature_drive", "main_drive"] if ladder else []
    factors, widths = build(forced, table_nodes, axis, interpolation, wanted)
    if model == "phase" and "phase" not in factors:
        raise HrgError("model phase needs frequency_hz in every run, it is missing or not finite; estimate the runs again")
    layout = Layout(table_nodes, axis, waves[0].mode_number, drift_most, scale_most, interpolation, factors, widths)
    fitted = fit(forced, layout)
    folds, held_out = choose_folds(fitted, needed)
    drift_limit, scale_limit, scores = choose_limits(fitted, harmonics, scale_factor_harmonics)
    chosen = variant("table" if model == "all" else model, layout, drift_limit, scale_limit, resonator)
    if chosen.name != "table":
        drift_limit = 1
    stability = repeats(
        fitted, _coefficients(fitted, variant("table", layout, drift_limit, scale_limit)), drift_limit, scale_limit, programmes
    )
    dropped: list[str] = []
    if stable_only and stability is not None and chosen.name == "table":
        matrix, dropped = without_unstable(layout, drift_limit, scale_limit, stability)
        chosen = Model("table", matrix)
    elif stable_only and stability is None:
        remarks.append("stable_only needs repeated programmes (several days or switch-ons, or warming and cooling); nothing was dropped")
    penalty, smoothness = choose_smoothness(fitted, chosen) if interpolation == "smooth" and chosen.name == "table" else (None, None)
    rich = fitted
    if factors:
        # what the chosen model leaves is its noise; the variants and the ladder are compared under the noise of the richest model
        fitted = fit(forced, layout, chosen, rich)
    A, b, square, rows = fitted.pieces.sum()
    solution = solve(A, b, chosen, penalty)
    stored = drift_limit, scale_limit
    written: Callable[[Array, Array, int], Solution] | None = None
    doubtful = [kind for kind, given in (("drift", harmonics), ("scale", scale_factor_harmonics)) if given is None]
    if chosen.name == "table" and doubtful and not dropped and not refusals:
        stored = (
            (layout.drift_harmonics if harmonics is None else drift_limit),
            (layout.scale_harmonics if scale_factor_harmonics is None else scale_limit),
        )
        in_doubt = doubtful_harmonics(layout, doubtful, float(np.mean(layout.tables(solution.coefficients)[1][:, 0])))
        everything = variant("table", layout, *stored).matrix

        added = 0.0 if penalty is None else penalty

        def written(information: Array, vector: Array, sweeps: int) -> Solution:
            return averaged(information + added, vector, everything, in_doubt, seed, sweeps)

        solution = written(A, b, SWEEPS)
    chi2 = chi_square(A, b, square, solution.coefficients) / max(rows - solution.degrees, 1.0)
    scale_factor = float(np.mean(layout.tables(solution.coefficients)[1][:, 0]))

    stages = [
        *first_stages(layout, drift_limit, scale_limit)[:2],
        Model("3 drift and scale factor over temperature and angle", chosen.matrix, chosen.start),
    ]
    whole, held = predictions(fitted, stages, folds, penalty)
    if written is not None:
        # the figures are those of the tables that are written: made again, the same way, without each fold
        whole[:, -1] = solution.coefficients
        for f in range(held.shape[2]):
            A_f, b_f, _, _ = fitted.pieces.sum(folds == f)
            held[:, -1, f] = written(A - A_f, b - b_f, FEWER_SWEEPS).coefficients
    found = cells(fitted, whole, held, folds)
    steps = figure_rows([m.name for m in stages], *found, scale_factor, bootstrap, seed)
    remarks += noisy_angles(fitted, drift_limit)
    if chosen.name == "table":
        moved = quadrature_left(fitted, solution) or rate_left(fitted, variant("table", layout, drift_limit, scale_limit))
        remarks += [moved] if moved is not None else []
    strays = stray_harmonics(fitted, solution)
    remarks += [s["sentence"] for s in strays if s["significant"]]
    details: dict[str, Any] = {
        "scale_factor": scale_factor,
        "figures": {
            kind: {"before": steps[0][kind], "after": steps[-1][kind + "_used"], "held_out": steps[-1][kind]} for kind in ("drift", "scale")
        },
        "held_out_by": held_out,
        "harmonics": drift_limit,
        "scale_factor_harmonics": scale_limit,
        "ladder": steps,
        "band_limit_scores": scores,
        "smoothness": smoothness,
        "chi2_per_dof": chi2,
        "stray_harmonics": strays,
        "stability": stability,
        "dropped": dropped,
        "thermal_memory": thermal_memory(fitted, chosen, solution.coefficients) if chosen.start is None else None,
        "interpolation_std": interpolation_doubt(fitted, solution, chi2, *stored),
        "measured": measured_details(chosen.name, layout, solution.coefficients, solution.covariance * chi2),
        "jumps_of_half_a_turn": fitted.jumps,
        "runs": [
            {"run_id": p.run_id, "rows": p.rows, "blocks": len(p) + 1, "white_rad": float(np.sqrt(n.white)), "walk_rad2_s": n.walk}
            for p, n in zip(fitted.paths, fitted.noises)
        ],
    }
    if model == "all":
        details["variants"] = compare(rich, folds, drift_limit, scale_limit, resonator, scale_factor, bootstrap, seed)
    if ladder:
        settings = Settings(drift_limit, scale_limit, scale_factor, bootstrap, seed)
        details["ladder"], details["final_analysis"] = climb(rich, free, folds, settings, penalty)
    if chosen.name == "physical" and resonator is not None:
        solution = _of_resonator(layout, solution, resonator, chi2)
        if chi2 > 2:
            remarks.append(
                f"the resonator's coefficients leave χ² = {chi2:.3g} a degree of freedom: these runs hold more than they explain"
            )
    record = record_of(waves, fitted, solution, chi2, stored, (low, high), chosen.name, details)
    if chosen.name == "table" and not refusals:
        record = record.replace(details=json.dumps(details | {"trade": trade_figures(record, fitted.paths)}))
    return record.judged(refusals, "refused").judged(remarks, "suspect")


def summary(record: Calibration) -> dict[str, Any]:
    """The JSON of CONTRACT.md for a calibration."""
    if is_rate_table(record):
        return table_summary(record)
    details = json.loads(record.details)
    figures = details["figures"]
    out = {
        "drift_rms_rad_s": {key: figures["drift"][key]["value"] for key in ("before", "after", "held_out")},
        "scale_factor_rms_ppm": {key: figures["scale"][key]["value"] for key in ("before", "after", "held_out")},
        "harmonics": details["harmonics"],
        "scale_factor_harmonics": details["scale_factor_harmonics"],
        "scale_factor": details["scale_factor"],
        "model": record.model,
        "nodes": [float(n) for n in record.node],
        "held_out_by": details["held_out_by"],
        "ladder": [{"stage": s["stage"], **_values(s), **({"note": s["note"]} if "note" in s else {})} for s in details.get("ladder", [])],
    }
    if "trade" in details:
        out["trade"] = details["trade"]
    if "final_analysis" in details:
        analysis = details["final_analysis"]
        out |= {key: analysis[key] for key in ("loops", "readout_matrix", "factors", "significant", "correlated", "false_rate")}
    if "variants" in details:
        out["variants"] = [{"model": s["stage"], "coefficients": s["coefficients"], **_values(s)} for s in details["variants"]]
    return out


def _values(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "drift_rms_rad_s": row["drift"]["value"],
        "scale_factor_rms_ppm": row["scale"]["value"],
        "drift_interval_rad_s": [row["drift"]["low"], row["drift"]["high"]],
        "scale_factor_interval_ppm": [row["scale"]["low"], row["scale"]["high"]],
    }


def _same_gyro(waves: Sequence[Wave], resonator: Resonator | None) -> None:
    if not waves:
        raise HrgError("calibrate needs at least one wave file of a forced run; none was given")
    of_one_gyro(waves, "calibrate", resonator)
    modes = sorted({w.mode_number for w in waves})
    if len(modes) > 1:
        raise HrgError(f"runs of mode numbers {modes} were given, one was expected; correct mode_number of the recordings")


def _coefficients(fitted: Fitted, model: Model) -> Array:
    A, b, _, _ = fitted.pieces.sum()
    return solve(A, b, model).coefficients


def compare(
    fitted: Fitted,
    folds: Array,
    drift_limit: int,
    scale_limit: int,
    resonator: Resonator | None,
    scale_factor: float,
    draws: int,
    seed: int,
) -> list[dict[str, Any]]:
    """Held-out figures of the variants, one row each; for (12) the demand on the mean frequency in numbers.

    δD = 4πr·δf: `mean_frequency_needed_hz` is the error of the mean frequency that alone makes the drift figure of the table.
    """
    models = [variant(n, fitted.layout, drift_limit, scale_limit, resonator) for n in VARIANTS if _possible(n, fitted.layout, resonator)]
    rows = figure_rows([m.name for m in models], *cells(fitted, *predictions(fitted, models, folds), folds), scale_factor, draws, seed)
    ratio = float(np.sqrt(np.mean(np.concatenate([p.ratio for p in fitted.paths]) ** 2)))
    for row, model in zip(rows, models):
        row["coefficients"] = model.free
        if model.name == "phase":
            row["quadrature_ratio_rms"] = ratio
            target = rows[0]["drift"]["value"]
            row["mean_frequency_needed_hz"] = target / (4 * np.pi * ratio) if ratio > 0 and target is not None else None
    return rows


def _possible(name: str, layout: Layout, resonator: Resonator | None) -> bool:
    return (name != "physical" or resonator is not None) and (name != "phase" or "phase" in layout.factors)


def _of_resonator(layout: Layout, solution: Solution, resonator: Resonator, chi2: float) -> Solution:
    """The solution with the resonator's own covariance, which is common to all nodes."""
    table, measured = physical_covariance(resonator)
    spread = np.zeros((layout.size, 4))
    for j in range(len(layout.nodes)):
        spread[layout.drift(j)][:3, :3] = np.eye(3)
        spread[layout.scale(j)][0, 3] = 1.0
    covariance = spread @ table @ spread.T
    place = layout.factor("quadrature")
    covariance[place, place] = measured
    return Solution(solution.coefficients, covariance / chi2, solution.degrees)
