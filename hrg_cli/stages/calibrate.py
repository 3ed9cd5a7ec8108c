"""`hrg calibrate`: drift D(T, θ) and scale factor K(T, θ) of m·dθ/dt = −K·Ω + D from forced runs
over temperature and rate, jointly."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting.checks import failures
from ..fitting.tables.increments import path_of
from ..fitting.tables.joint import Fitted, Layout, Model, chi_square, fit
from ..records import Calibration, Resonator, Wave
from .calibration.checks import interpolation_doubt, noisy_angles, stray_harmonics
from .calibration.choice import Wanted, again, answers, best, compared, possible, told
from .calibration.factors import build
from .calibration.figures import cells, figure_rows, predictions
from .calibration.folds import choose_folds, choose_limits, choose_smoothness
from .calibration.guards import noise_told
from .calibration.ladder import Settings, climb, first_stages
from .calibration.programme import choose_nodes, examine
from .calibration.record import record_of
from .calibration.resonators import Coefficients, over
from .calibration.stability import repeats, thermal_memory, unstable, without_unstable
from .calibration.variants import FACTORS, measured_details, variant
from .figures_of_merit import trade_figures
from .one_gyro import of_one_gyro
from .rate_table import is_rate_table
from .rate_table import summary as table_summary

Array = np.ndarray
LARGEST_LIMIT = 4
"""Highest harmonic of 2mθ that cross-validation tries."""
LEAST_REPEATED = 2
"""Harmonics of 2mθ whose repeat between programmes is looked at, at least."""


def calibrate(
    waves: Sequence[Wave],
    resonator: Resonator | Sequence[Resonator] | None = None,
    *,
    model: Annotated[
        Literal[
            "auto", "table", "parametric", "quadrature", "phase", "combined", "physical", "all"
        ],
        Field(
            description=(
                "seed A's drift model: table, parametric (10), quadrature (11), phase (12),"
                " combined (table and quadrature), "
                "physical (resonator files); auto: of those that fit, the one that predicts data"
                " left out best; all: table, the others compared"
            )
        ),
    ] = "auto",
    axis: Annotated[
        Literal["temperature", "frequency"], Field(description="what the nodes are of")
    ] = "temperature",
    harmonics: Annotated[
        int | None,
        Field(
            ge=0,
            le=12,
            description="band limit of the drift in harmonics of 2mθ; none: cross-validation",
        ),
    ] = None,
    scale_factor_harmonics: Annotated[
        int | None, Field(ge=0, le=12, description="band limit of K; none: cross-validation")
    ] = None,
    nodes: Annotated[
        list[float] | None,
        Field(description="nodes, °C or Hz; none: the dwells, or evenly over a sweep"),
    ] = None,
    interpolation: Annotated[
        Literal["linear", "cubic", "monotone", "smooth"],
        Field(description="between nodes; smooth: cubic with a penalty on curvature"),
    ] = "cubic",
    ladder: Annotated[
        bool, Field(description="all seven stages of accuracy instead of the first three")
    ] = False,
    stable_only: Annotated[
        bool, Field(description="drop harmonics that do not repeat between programmes")
    ] = False,
    rate_rad_s: Annotated[
        float | None, Field(description="constant rate of runs without a rate log")
    ] = None,
    rates_rad_s: Annotated[
        dict[str, float] | None, Field(description="constant rate by run_id")
    ] = None,
    earth_rate_rad_s: Annotated[
        float, Field(description="Earth's rate about the sensitive axis, added to the logged rate")
    ] = 0.0,
    programmes: Annotated[
        dict[str, str] | None,
        Field(
            description="programme by run_id; none: start_time's day, else warming against cooling"
        ),
    ] = None,
    bootstrap: Annotated[
        int, Field(ge=0, le=100_000, description="draws for the intervals of the figures")
    ] = 400,
    seed: Annotated[int, Field(ge=0, description="seed of the draws")] = 0,
) -> Calibration:
    """Drift and scale-factor tables from forced whole-angle runs, by generalised least squares on
    increments of the wave angle.

    m(θ̄_{i+1} − θ̄_i) = ∫w[−K(T,θ)Ω + D(T,θ)]dt (seed A after (7), PHYSICS §0), D and K Fourier
    series in 2mθ with coefficients at nodes. All runs are fitted jointly; each run's white angle
    noise and angle random walk are estimated from its own residuals. A programme that cannot give
    the tables yields a record of status "refused" whose reasons name the missing run.

    HrgError: no runs, different gyros or mode numbers, no rate, times that go back, `physical`
    without a resonator.
    """
    waves = list(waves)
    resonators = (
        []
        if resonator is None
        else [resonator]
        if isinstance(resonator, Resonator)
        else list(resonator)
    )
    _same_gyro(waves, resonators)
    if model == "physical" and not resonators:
        raise HrgError(
            "model physical takes its coefficients from a resonator file; run `hrg identify` on"
            " free runs and give it with --resonator"
        )
    # one harmonic more than asked for, so that what is left out is looked at (monotone weights of
    # an absent one are those of its noise)
    beyond, least = (0, 1) if interpolation == "monotone" else (1, LEAST_REPEATED)
    drift_most, scale_most = (
        LARGEST_LIMIT if asked is None else max(asked + beyond, least)
        for asked in (harmonics, scale_factor_harmonics)
    )
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
        remarks.append(
            "no run is forced: the tables are those of free runs, without the drive's own errors"
        )
    table_nodes, low, high, words = choose_nodes(forced, axis, nodes)
    needed = 1 if harmonics is None else harmonics
    findings = examine(forced, table_nodes, axis, needed)
    refusals = [f.sentence for f in findings if f.refuses]
    remarks += words + [f.sentence for f in findings if not f.refuses]

    factors, widths = build(forced, table_nodes, axis, interpolation, FACTORS)
    if model == "phase" and "phase" not in factors:
        raise HrgError(
            "model phase needs frequency_hz and a quadrature in every run, one is missing or not"
            " finite; estimate the runs again"
        )
    layout = Layout(
        table_nodes,
        axis,
        waves[0].mode_number,
        drift_most,
        scale_most,
        interpolation,
        factors,
        widths,
    )
    # every table, measured part and suspected cause is free: what is left is the noise at which
    # each variant is judged
    fitted = fit(forced, layout)
    folds, held_out_by = choose_folds(fitted, needed)
    coefficients, why_not = _of_resonators(
        resonators, model, axis, table_nodes, low, high, interpolation
    )
    names, not_tried = possible(layout, coefficients, why_not)
    wanted = Wanted(harmonics, scale_factor_harmonics, seed, not refusals)
    if model == "auto" and refusals:
        names = ["table"]
    elif model not in ("auto", "all"):
        if model in not_tried:
            raise HrgError(f"model {model} cannot be tried: {not_tried[model]}")
        names = [model]
    tried = answers(fitted, folds, names, wanted, coefficients)
    answer = best(tried) if model == "auto" else tried[0]
    drift_limit, scale_limit = answer.limits
    stability = repeats(
        fitted,
        answer.tried.solution.coefficients,
        max(drift_limit, LEAST_REPEATED),
        max(scale_limit, LEAST_REPEATED),
        programmes,
    )
    dropped: list[str] = []
    penalty, smoothness = None, None
    if stable_only and stability is not None and answer.name == "table":
        matrix, dropped = without_unstable(layout, drift_limit, scale_limit, stability)
        answer = again(fitted, folds, answer, Model("table", matrix), wanted)
    elif stable_only and stability is None:
        remarks.append(
            "stable_only needs repeated programmes (several days or switch-ons, or warming and"
            " cooling); nothing was dropped"
        )
    elif stable_only and answer.name != "table":
        remarks.append(
            f"stable_only drops harmonics of model table, {answer.name} is written: nothing was"
            " dropped; give --model table"
        )
    if interpolation == "smooth" and not answer.tried.foreign and not dropped:
        plain = variant(answer.name, layout, *answer.limits)
        penalty, smoothness = choose_smoothness(fitted, plain)
        answer = again(fitted, folds, answer, plain, wanted, penalty)
    solution, chosen = answer.tried.solution, answer.tried.model
    A, b, square, rows = fitted.pieces.sum()
    chi2 = chi_square(A, b, square, solution.coefficients) / max(rows - solution.degrees, 1.0)
    # a fit may find more noise than it was judged at, never less than there is; coefficients from
    # elsewhere keep their own errors
    inflation = 1.0 if answer.tried.foreign else max(chi2, 1.0)
    scale_factor = float(np.mean(layout.tables(solution.coefficients)[1][:, 0]))

    whole, held = predictions(fitted, first_stages(layout, drift_limit, scale_limit)[:2], folds)
    whole = np.concatenate([whole, solution.coefficients[:, None]], axis=1)
    held = np.concatenate(
        [held, np.stack([s.coefficients for s in answer.tried.held], axis=1)[:, None]], axis=1
    )
    names_of_stages = [m.name for m in first_stages(layout, drift_limit, scale_limit)]
    steps = figure_rows(
        names_of_stages, *cells(fitted, whole, held, folds), scale_factor, bootstrap, seed
    )
    strays = stray_harmonics(fitted, fitted.solution)
    if not refusals:
        remarks += noisy_angles(fitted, drift_limit)
        remarks += [s["sentence"] for s in strays if s["significant"]]
        remarks += unstable(stability, dropped)
        if answer.tried.foreign:
            refusals += answer.failed
        else:
            remarks += answer.failed
    details: dict[str, Any] = {
        "scale_factor": scale_factor,
        "figures": {
            kind: {
                "before": steps[0][kind],
                "after": steps[-1][kind + "_used"],
                "held_out": steps[-1][kind],
            }
            for kind in ("drift", "scale")
        },
        "held_out_by": held_out_by,
        "harmonics": drift_limit,
        "scale_factor_harmonics": scale_limit,
        "ladder": steps,
        "band_limit_scores": choose_limits(fitted, harmonics, scale_factor_harmonics)[2],
        "smoothness": smoothness,
        "chi2_per_dof": chi2,
        "checks": [check.table() for check in answer.checks],
        "choice": told(fitted, tried, answer, not_tried) if model in ("auto", "all") else None,
        "noise": noise_told(fitted),
        "stray_harmonics": strays,
        "stability": stability,
        "dropped": dropped,
        "thermal_memory": (
            thermal_memory(fitted, chosen, solution.coefficients) if chosen.start is None else None
        ),
        "interpolation_std": interpolation_doubt(fitted, solution, inflation, *answer.stored),
        "measured": measured_details(
            chosen.name,
            layout,
            solution.coefficients,
            solution.covariance * inflation,
            fitted.paths,
        ),
        "resonator": None if coefficients is None else coefficients.table(),
        "jumps_of_half_a_turn": fitted.jumps,
        "runs": [
            {
                "run_id": p.run_id,
                "rows": p.rows,
                "blocks": len(p) + 1,
                "white_rad": float(np.sqrt(n.white)),
                "walk_rad2_s": n.walk,
            }
            for p, n in zip(fitted.paths, fitted.noises)
        ],
    }
    if len(tried) > 1:
        details["variants"] = compared(fitted, folds, tried, scale_factor, bootstrap, seed)
    if ladder:
        settings = Settings(drift_limit, scale_limit, scale_factor, bootstrap, seed)
        details["ladder"], details["final_analysis"] = climb(
            _with_loops(fitted), free, folds, settings, penalty
        )
    record = record_of(
        waves, fitted, solution, inflation, answer.stored, (low, high), chosen.name, details
    )
    if not refusals:
        record = record.replace(
            details=json.dumps(details | {"trade": trade_figures(record, fitted.paths)})
        )
    return record.judged(refusals, "refused").judged(remarks, "suspect")


def _with_loops(fitted: Fitted) -> Fitted:
    """The same runs with the columns of the ladder's factors."""
    old = fitted.layout
    factors, widths = build(
        fitted.paths,
        old.nodes,
        old.axis,
        old.interpolation,
        ["quadrature", "quadrature_drive", "main_drive"],
    )
    return fit(fitted.paths, replace(old, factors=factors, factor_columns=widths))


def _of_resonators(
    resonators: Sequence[Resonator],
    model: str,
    axis: str,
    nodes: Array,
    low: float,
    high: float,
    interpolation: str,
) -> tuple[Coefficients | None, str | None]:
    """The resonators' coefficients over the nodes' quantity, or why there are none; an error where
    they were asked for by name."""
    if not resonators:
        return None, None
    try:
        found = over(resonators, axis, nodes, low, high, interpolation)
    except HrgError as error:
        if model == "physical":
            raise
        return None, str(error)
    disagree = failures(found.checks)
    if disagree and model == "physical":
        raise HrgError(disagree[0])
    return (None, disagree[0]) if disagree else (found, None)


def summary(record: Calibration) -> dict[str, Any]:
    """The JSON of CONTRACT.md for a calibration."""
    if is_rate_table(record):
        return table_summary(record)
    details = json.loads(record.details)
    figures = details["figures"]
    out = {
        "drift_rms_rad_s": {
            key: figures["drift"][key]["value"] for key in ("before", "after", "held_out")
        },
        "scale_factor_rms_ppm": {
            key: figures["scale"][key]["value"] for key in ("before", "after", "held_out")
        },
        "harmonics": details["harmonics"],
        "scale_factor_harmonics": details["scale_factor_harmonics"],
        "scale_factor": details["scale_factor"],
        "model": record.model,
        "nodes": [float(n) for n in record.node],
        "held_out_by": details["held_out_by"],
        "ladder": [
            {"stage": s["stage"], **_values(s), **({"note": s["note"]} if "note" in s else {})}
            for s in details.get("ladder", [])
        ],
    }
    if "trade" in details:
        out["trade"] = details["trade"]
    if "final_analysis" in details:
        analysis = details["final_analysis"]
        out |= {
            key: analysis[key]
            for key in (
                "loops",
                "readout_matrix",
                "factors",
                "significant",
                "correlated",
                "false_rate",
            )
        }
    out |= {
        key: details[key]
        for key in ("choice", "checks", "noise", "resonator")
        if details.get(key) is not None
    }
    if details.get("stability") is not None:
        out["stability"] = details["stability"]
    if "variants" in details:
        own = ("coefficients", "held_out_chi2_per_row", "passed", "why_not")
        out["variants"] = [
            {"model": s["stage"], **{key: s[key] for key in own}, **_values(s)}
            for s in details["variants"]
        ]
    return out


def _values(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "drift_rms_rad_s": row["drift"]["value"],
        "scale_factor_rms_ppm": row["scale"]["value"],
        "drift_interval_rad_s": [row["drift"]["low"], row["drift"]["high"]],
        "scale_factor_interval_ppm": [row["scale"]["low"], row["scale"]["high"]],
    }


def _same_gyro(waves: Sequence[Wave], resonators: Sequence[Resonator]) -> None:
    if not waves:
        raise HrgError("calibrate needs at least one wave file of a forced run; none was given")
    of_one_gyro(waves, "calibrate")
    for resonator in resonators:
        of_one_gyro(waves, "calibrate", resonator)
    modes = sorted({w.mode_number for w in waves})
    if len(modes) > 1:
        raise HrgError(
            f"runs of mode numbers {modes} were given, one was expected; correct mode_number of the"
            " recordings"
        )
