"""`hrg calibrate`: drift D(T, θ) and scale factor K(T, θ) of m·dθ/dt = −K·Ω + D from forced runs
over temperature and rate, jointly."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting.checks import list_failures
from ..fitting.tables.joint import Fitted
from ..records import Calibration, Resonator, Wave, list_doubts, name_record
from .calibration.accuracy_stages import LadderSettings
from .calibration.chosen import LEAST_REPEATED, Chosen
from .calibration.folds import choose_folds, choose_limits
from .calibration.interpolation import check_between
from .calibration.ladder import climb
from .calibration.odd_run import OddRuns, find_odd_runs
from .calibration.preparation import KnownRates, PreparedRuns, need_one_gyro, prepare
from .calibration.prices import forecast_hour_more
from .calibration.repeatability import say_unstable
from .calibration.residual_checks import (
    find_noisy_angles,
    find_stray_harmonics,
    say_harmonics_above,
)
from .calibration.shown_thermometer import ShownThermometer, doubt_thermometer
from .calibration.summary import summarise as summarise
from .calibration.thermal_memory import find_shown_memory, tell_one_way
from .calibration.trials import (
    FullFit,
    add_loop_columns,
    fit_everything,
    take_coefficients,
    try_again,
    try_models,
)
from .calibration.variant_solutions import Wanted
from .earth_rate import AxisAzimuth, AxisTilt, EarthRate, Latitude, find_earth_rate
from .figures_of_merit import compute_trade_figures

Array = np.ndarray
LARGEST_LIMIT = 4
"""Highest harmonic of 2mθ that cross-validation tries."""


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
                "drift model: table, parametric, quadrature or phase (of the paper, (10) to (12)),"
                " combined (table and quadrature),"
                " physical (resonator files); auto: of those that fit, the one that predicts data"
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
    earth_rate_deg_h: EarthRate = None,
    latitude_deg: Latitude = None,
    axis_tilt_deg: AxisTilt = 0.0,
    axis_azimuth_deg: AxisAzimuth = 0.0,
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

    Parameters
    ----------
    waves
        Forced runs of one gyro, each (n,) rows with the logged rate [rad/s] and temperature [°C].
    resonator
        Identified resonators, one a node, for `model="physical"`.

    Returns
    -------
    Calibration
        D [rad/s] and K (nodes, angles), their harmonics (nodes, 1 + 2k) and covariance.

    Raises
    ------
    HrgError
        No runs, different gyros or mode numbers, no rate, times that go back, `physical` without a
        resonator.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Wave, calibrate
    >>> t, ones = np.arange(0.0, 60.0, 0.05), np.ones(1200)
    >>> waves = []
    >>> for k, rate in enumerate((-0.6, -0.3, 0.3, 0.6)):
    ...     noise = 1e-5 * np.random.default_rng(k).standard_normal(1200)
    ...     waves.append(
    ...         Wave(
    ...             time_s=t,
    ...             flags=np.zeros(1200, "u1"),
    ...             main_amplitude=ones,
    ...             quadrature_amplitude=0 * t,
    ...             wave_angle_rad=0.1 - 0.55 * rate * t / 2 + noise,
    ...             phase_rad=0 * t,
    ...             carrier_phase_rad=0 * t,
    ...             main_amplitude_std=1e-5 * ones,
    ...             quadrature_amplitude_std=1e-5 * ones,
    ...             wave_angle_rad_std=1e-5 * ones,
    ...             phase_rad_std=1e-5 * ones,
    ...             carrier_phase_rad_std=0 * t,
    ...             residual_rms=0 * t,
    ...             signal_std=1e-5 * ones,
    ...             iterations=np.zeros(1200, "i4"),
    ...             frequency_hz=1e3 * ones,
    ...             reference_frequency_hz=1e3,
    ...             window_s=0.05,
    ...             mode="forced",
    ...             rate_rad_s=rate * ones,
    ...             temperature_degc=20.0 * ones,
    ...             gyro_id="A",
    ...             run_id=str(k),
    ...         )
    ...     )
    >>> tables = calibrate(waves, harmonics=1, scale_factor_harmonics=0, model="table")
    >>> bool(abs(tables.scale_factor_harmonics[0, 0] - 0.55) < 1e-4)
    True
    """
    waves = list(waves)
    given = _given_resonators(resonator, model)
    need_one_gyro(waves, given)
    limits = _looked_at(harmonics, scale_factor_harmonics, interpolation)
    needed = 1 if harmonics is None else harmonics
    earth = find_earth_rate(earth_rate_deg_h, latitude_deg, axis_tilt_deg, axis_azimuth_deg)
    rates = KnownRates(rates_rad_s or {}, rate_rad_s, earth)
    needed_scale = 1 if scale_factor_harmonics is None else scale_factor_harmonics
    runs = prepare(waves, rates, axis, nodes, max(limits), (needed, needed_scale))
    refused = bool(runs.refusals)

    whole = fit_everything(runs, limits, axis, interpolation)
    fitted, late = whole.fitted, whole.late
    folds, held_out_by = choose_folds(fitted, needed)
    coefficients = take_coefficients(given, model, axis, runs, interpolation)
    wanted = Wanted(harmonics, scale_factor_harmonics, seed, not refused)
    tried = try_models(whole, folds, wanted, coefficients, model, refused)

    chosen = Chosen.from_answer(fitted, folds, tried.answer, wanted, programmes)
    chosen = chosen.drop_unstable() if stable_only else chosen
    chosen = chosen.smooth() if interpolation == "smooth" else chosen
    strays = find_stray_harmonics(fitted, fitted.solution)
    again = partial(try_again, wanted=wanted, resonators=coefficients, model=model)
    doubted, fixed = bool(chosen.answer.failed and not refused), coefficients[0] is not None
    odd = find_odd_runs(runs, whole, needed, again, fixed, doubted)
    wrong = odd or doubt_thermometer(runs, whole, needed, again)
    refusals, remarks = _judge(runs, whole, chosen, strays, wrong, given)

    details = chosen.list_details(bootstrap, seed) | {
        "held_out_by": held_out_by,
        "band_limit_scores": choose_limits(fitted, harmonics, scale_factor_harmonics)[2],
        "stray_harmonics": strays,
        "rate_log": None if late is None else late.to_json(),
        "suspect_runs": wrong.to_json() if wrong else None,
        "driven": any(wave.mode == "forced" for wave in runs.usable.waves),
        **tried.list_details(chosen, model in ("auto", "all"), bootstrap, seed),
    }
    if ladder and not refusals:
        details |= _climb_all_stages(chosen, whole, bootstrap, seed)
    record = chosen.make_record(runs.usable.waves, runs.valid, details)
    if not refusals:
        record = _with_notes(_with_use(record, details, fitted), chosen)
    return runs.judge(record, refusals, remarks)


def _climb_all_stages(chosen: Chosen, whole: FullFit, draws: int, seed: int) -> dict[str, Any]:
    """All seven stages of accuracy, and the analysis of what the last one leaves."""
    settings = LadderSettings(*chosen.answer.limits, chosen.scale_factor, draws, seed)
    stages, analysis = climb(
        add_loop_columns(whole.fitted), whole.free, chosen.folds, settings, chosen.penalty
    )
    return {"ladder": stages, "final_analysis": analysis}


def _judge(
    runs: PreparedRuns,
    whole: FullFit,
    chosen: Chosen,
    strays: Sequence[Mapping[str, Any]],
    wrong: OddRuns | ShownThermometer | None,
    given: Sequence[Resonator],
) -> tuple[list[str], list[str]]:
    """Why the tables are refused, and what else speaks against them: of runs that the others
    contradict, or whose mended thermometer leaves nothing to say, these alone, since they show as
    any fault."""
    if isinstance(wrong, OddRuns):
        return wrong.sentences, []
    warm = [wrong.suspicion.sentence] if wrong else []
    late = [whole.late.sentence] if whole.late is not None and whole.late.taken_s else []
    remarks = [*late, *runs.remarks, *chosen.not_dropped]
    if runs.refusals:
        return [*warm, *runs.refusals], remarks
    if wrong and wrong.mended:
        return [], [*warm, *remarks]
    remarks = [*warm, *remarks]
    told, doubts = list(chosen.answer.failed), [*remarks, *_doubts_of(chosen, strays)]
    if not chosen.answer.tried.foreign:
        return [], [*doubts, *told]
    return told, [*doubts, *list_doubts((name_record(one), one) for one in given)]


def _doubts_of(chosen: Chosen, strays: Sequence[Mapping[str, Any]]) -> list[str]:
    """What the answer's residuals and its repeats between programmes speak against."""
    # a harmonic that no check sees is too small to be worth a table's coefficients
    above = say_harmonics_above(chosen.fitted) if chosen.answer.failed else []
    return [
        *list_failures(chosen.own_checks),
        *above,
        *find_noisy_angles(chosen.fitted, chosen.answer.limits[0]),
        *(s["sentence"] for s in strays if s["significant"]),
        *find_shown_memory(chosen.thermal_memory),
        *say_unstable(chosen.stability, chosen.dropped),
    ]


def _with_use(record: Calibration, details: dict[str, Any], fitted: Fitted) -> Calibration:
    """The record with the figures of merit of its tables, and what an hour more would buy."""
    use = {
        "trade": compute_trade_figures(record, fitted.paths),
        "hour": forecast_hour_more(record, fitted.paths),
    }
    return record.replace(details=json.dumps(details | use))


def _with_notes(record: Calibration, chosen: Chosen) -> Calibration:
    """The record with the checks of what its tables do not know between nodes, and what they take
    for granted of the thermometer; it stays valid, since its standard deviations hold the one, and
    the other is said."""
    between, details = check_between(record), json.loads(record.details)
    details["checks"] += [check.to_json() for check in between]
    told = list(dict.fromkeys(list_failures(between)))
    if not find_shown_memory(chosen.thermal_memory):
        told += tell_one_way(chosen.fitted, chosen.answer.tried.solution.coefficients)
    return record.replace(details=json.dumps(details)).judged(told, "valid")


def _given_resonators(
    resonator: Resonator | Sequence[Resonator] | None, model: str
) -> list[Resonator]:
    """The resonators as a list. HrgError: none, and the model takes its coefficients from them."""
    given = [resonator] if isinstance(resonator, Resonator) else list(resonator or [])
    if model == "physical" and not given:
        raise HrgError(
            "model physical takes its coefficients from a resonator file; run `hrg identify` on"
            " free runs and give it with --resonator"
        )
    return given


def _looked_at(
    harmonics: int | None, scale_factor_harmonics: int | None, interpolation: str
) -> tuple[int, int]:
    """Harmonics of 2mθ fitted for the drift and for K: one more than asked for, so that what is
    left out is looked at (monotone weights of an absent one are those of its noise)."""
    beyond, least = (0, 1) if interpolation == "monotone" else (1, LEAST_REPEATED)
    drift, scale = (
        LARGEST_LIMIT if asked is None else max(asked + beyond, least)
        for asked in (harmonics, scale_factor_harmonics)
    )
    return drift, scale
