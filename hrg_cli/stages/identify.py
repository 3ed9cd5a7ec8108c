"""identify: free run-downs -> the resonator's mechanical parameters with covariance, and how far
each can be trusted."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting.envelopes import condensed, free_windows, growing
from ..fitting.envelopes.base_fit import check_runs
from ..fitting.envelopes.base_freedom import Known
from ..fitting.envelopes.envelope_runs import turn_table
from ..fitting.envelopes.frozen import CORRECTION, find_frozen
from ..physics.resonator import PARAMETERS
from ..records import Resonator, Wave
from .diagnosis.thresholds import GROWN
from .earth_rate import AxisAzimuth, AxisTilt, EarthRate, Latitude, find_earth_rate
from .identification.by_likelihood import identify_by_likelihood
from .identification.by_regression import compare_methods, identify_by_regression
from .identification.methods import RegressionMethod
from .identification.monitored import monitor_working_mode
from .identification.outcome import Verdict
from .identification.rate_cuts import cut_at_rate_steps
from .identification.resampled_errors import profile_intervals, resample_errors
from .identification.unknown_rate import identify_with_unknown_rate
from .identification.unmodelled import doubt_beside_causes
from .one_gyro import need_each_once, need_same_gyro
from .shared_noise import need_own_noise
from .usable import Usable, drop_refused, name_apart, restrict_to_known_rates

Array = np.ndarray
ROWS_AT_ONCE = 1 << 16

Method = Literal["likelihood", RegressionMethod, "working-mode", "all"]


def identify(
    waves: Sequence[Wave],
    *,
    method: Annotated[
        Method,
        Field(
            description=(
                "method of identification; all: every one beside the likelihood, in one table"
            )
        ),
    ] = "likelihood",
    rate_rad_s: Annotated[
        float | None, Field(description="constant rate about the axis instead of the waves' own")
    ] = None,
    fit_rate: Annotated[
        bool,
        Field(
            description=(
                "fit one unknown constant rate, added to the logged ones; K is held unless the logs"
                " hold several rates"
            )
        ),
    ] = False,
    scale_factor: Annotated[
        float | None, Field(gt=0, description="known scale factor K, held")
    ] = None,
    damping_axis_rad: Annotated[float | None, Field(description="known damping axis, held")] = None,
    stiffness_axis_rad: Annotated[
        float | None, Field(description="known stiffness axis, held")
    ] = None,
    eliminate_rate: Annotated[
        bool,
        Field(
            description="fixed-axes with the published elimination of the rate, which halves the"
            " damping split"
        ),
    ] = False,
    window: Annotated[
        Literal["auto", "none"],
        Field(description="auto: cut free windows out of records whose drive switches off"),
    ] = "auto",
    most_different: Annotated[
        int | None, Field(ge=1, description="use only so many windows, the most different ones")
    ] = None,
    profile: Annotated[
        bool, Field(description="profile-likelihood intervals of every parameter")
    ] = False,
    bootstrap: Annotated[
        int,
        Field(ge=0, le=100_000, description="block-bootstrap draws for the errors, 0: none"),
    ] = 0,
    seed: Annotated[int, Field(ge=0, description="seed of the bootstrap")] = 0,
    blocks: Annotated[
        int,
        Field(ge=20, description="fewest averaged rows per run; more are taken as the wave turns"),
    ] = 300,
    earth_rate_deg_h: EarthRate = None,
    latitude_deg: Latitude = None,
    axis_tilt_deg: AxisTilt = 0.0,
    axis_azimuth_deg: AxisAzimuth = 0.0,
) -> Resonator:
    """Resonator parameters from free runs; every run keeps its own start and frequency.

    The likelihood of u' = L u, L = −ν − νδμ R(2mθ_μ) + jδω R(2mθ_ω) + KΩ J (PHYSICS §0), on the
    envelopes of all runs at their stated noise; the other methods are those of seed A.

    Parameters
    ----------
    waves
        Run-downs of one gyro, each (n,) rows with angles in rad and times in s.

    Returns
    -------
    Resonator
        Frequency [Hz], ν and νδμ [1/s], δω [rad/s], axes [rad], K, their covariance, the checks.

    Raises
    ------
    HrgError
        No usable run, mixed mode numbers or gyros, a run driven throughout (but for
        `working-mode`).

    Examples
    --------
    >>> from hrg_cli import collect, demodulate, estimate, identify, simulate
    >>> config = {
    ...     "device": {"frequency_hz": 1000.0, "quality_factor": 20_000.0},
    ...     "readout": {"noise": 1e-4},
    ...     "recording": {"sample_rate_hz": 8000.0, "duration_s": 3.0},
    ... }
    >>> recording = collect(simulate(config, model="slow"))
    >>> wave = collect(estimate(collect(demodulate(recording, periods_per_window=20))))
    >>> value, std, units = identify([wave]).parameters()["damping_rate_1_s"]
    >>> units, abs(value - 3.14159265 * 1000 / 20_000) < 5 * std
    ('s-1', True)
    """
    waves = list(waves)
    if not waves:
        raise HrgError("there is no run; give at least one wave file of a free run-down")
    need_same_gyro(waves, "identify")
    need_each_once(waves)
    need_own_noise(waves)
    usable = _cut_to_usable(waves, rate_rad_s, method, window)
    waves = usable.waves
    with usable.blame_refusals():
        if method == "working-mode":
            whole = [w.rows(0, len(w)) for w in waves]
            return usable.judge(
                _make_resonator_record(monitor_working_mode(whole, rate_rad_s), waves, method)
            )
        known = Known(scale_factor, damping_axis_rad, stiffness_axis_rad)
        earth = find_earth_rate(earth_rate_deg_h, latitude_deg, axis_tilt_deg, axis_azimuth_deg)
        runs = condensed.read_runs(waves, rate_rad_s, earth, known, blocks)
        check_runs(runs)
        if most_different is not None:
            chosen = free_windows.choose_different(runs, most_different)
            runs, waves = [runs[i] for i in chosen], [waves[i] for i in chosen]
        if fit_rate:
            verdict = identify_with_unknown_rate(runs, known, blocks)
            found = verdict.details["rate_rad_s"]["value"]
            earth, runs = earth + found, [turn_table(run, found) for run in runs]
        elif method in ("likelihood", "all"):
            verdict = identify_by_likelihood(runs, known, blocks)
            if profile:
                verdict.details["profile"] = profile_intervals(verdict, runs)
            if bootstrap:
                resample_errors(verdict, bootstrap, seed)
        else:
            verdict = identify_by_regression(runs, known, method, eliminate_rate, blocks)
        if method == "all" and not fit_rate:
            verdict.details["methods"] = compare_methods(runs, known, verdict, eliminate_rate)
        doubt_beside_causes(verdict, runs, waves, rate_rad_s, earth, scale_factor, blocks)
        return usable.judge(_make_resonator_record(verdict, waves, method))


def _cut_to_usable(
    waves: Sequence[Wave], rate_rad_s: float | None, method: Method, window: str
) -> Usable:
    """The windows that are free run-downs at a known rate, between its steps."""
    usable, whole = drop_refused(waves), method == "working-mode"
    usable = replace(usable, waves=list(name_apart(usable.waves)))
    if window == "auto" and not whole:
        free = [part for wave in usable.waves for part in free_windows.cut_free_windows(wave)]
        usable = replace(usable, waves=free)
    given = [] if rate_rad_s is None else [w.run_id for w in usable.waves]
    usable = restrict_to_known_rates(usable, given)
    return usable if whole or rate_rad_s is not None else cut_at_rate_steps(usable)


def _make_resonator_record(verdict: Verdict, waves: Sequence[Wave], method: str) -> Resonator:
    """The verdict as a record: parameters in the contract's order, unknown ones left out."""
    units = dict(PARAMETERS)
    names = [n for n, _ in PARAMETERS if n in verdict.values]
    index = [verdict.order.index(n) for n in names]
    temperature, span = _temperature(waves)
    resonator = Resonator(
        name=np.array(names, dtype=object),
        value=np.array([verdict.values[n] for n in names]),
        std=np.array([verdict.std[n] for n in names]),
        units=np.array([units[n] for n in names], dtype=object),
        covariance=verdict.covariance[np.ix_(index, index)],
        method=method,
        mode_number=waves[0].mode_number,
        gyro_id=waves[0].gyro_id,
        lot_id=waves[0].lot_id,
        chi2_per_dof=verdict.chi2_per_dof,
        condition=verdict.condition,
        temperature_degc=temperature,
        temperature_span_degc=span,
        flat_directions=json.dumps(verdict.flat, ensure_ascii=False),
        details=json.dumps(
            verdict.details | {"checks": [c.to_json() for c in verdict.checks]}, ensure_ascii=False
        ),
        run=np.array([w.run_id for w in waves], dtype=object),
        run_chi2_per_dof=verdict.run_chi2_per_dof,
        run_residual_rms=verdict.run_residual_rms,
        run_rows=verdict.run_rows,
    )
    if not names or not all(np.isfinite(resonator.value)):
        raise HrgError("the fit gives no finite parameters; look at the runs' envelopes")
    stuck = [
        f"{wave.run_id}: {one.what} stuck ({one.evidence}); {CORRECTION}"
        for wave, found in zip(waves, find_frozen(waves), strict=True)
        for one in found
    ]
    backwards = [
        f"{waves[one.run].run_id}: samples run backwards ({one.evidence}); {growing.CORRECTION}"
        for one in growing.find_growing(waves, GROWN)
    ]
    return resonator.judged(verdict.suspect, "suspect").judged(
        [*verdict.refused, *stuck, *backwards], "refused"
    )


def _temperature(waves: Sequence[Wave]) -> tuple[float | None, float | None]:
    """Mean and range of the runs' logged temperatures, °C; None where a run logs none."""
    means, lows, highs = [], [], []
    for wave in waves:
        total, count = 0.0, 0
        for part in wave.only(("time_s", "temperature_degc")).blocks(ROWS_AT_ONCE):
            log = np.asarray([] if part.temperature_degc is None else part.temperature_degc, float)
            log = log[np.isfinite(log)]
            if len(log):
                total, count = total + float(log.sum()), count + len(log)
                lows.append(float(log.min()))
                highs.append(float(log.max()))
        if not count:
            return None, None
        means.append(total / count)
    return float(np.mean(means)), max(highs) - min(lows)


def summarise(resonator: Resonator) -> dict[str, Any]:
    """The JSON of an identification.

    Parameters
    ----------
    resonator
        Made by `identify`.

    Returns
    -------
    dict
        Parameters with standard deviation and unit, χ² per degree of freedom and condition (None
        where they are none), runs, flat directions, checks; a parameter that was held says that it
        is assumed.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.identify import summarise
    >>> found = Resonator(
    ...     name=np.array(["scale_factor"]),
    ...     units=np.array(["1"]),
    ...     value=np.array([0.55]),
    ...     std=np.array([1e-3]),
    ...     covariance=np.array([[1e-6]]),
    ...     details='{"assumed": ["scale_factor"]}',
    ... )
    >>> summarise(found)["parameters"]["scale_factor"]
    {'value': 0.55, 'std': 0.001, 'units': '1', 'assumed': True}
    """
    details = json.loads(resonator.details)
    assumed = details.get("assumed", [])
    return {
        "parameters": {
            n: {"value": v, "std": s, "units": u} | ({"assumed": True} if n in assumed else {})
            for n, (v, s, u) in resonator.parameters().items()
        },
        "chi2_per_dof": resonator.chi2_per_dof if np.isfinite(resonator.chi2_per_dof) else None,
        "runs": [] if resonator.run is None else [str(r) for r in resonator.run],
        "identifiability": {
            "condition": resonator.condition if np.isfinite(resonator.condition) else None,
            "flat_directions": json.loads(resonator.flat_directions),
        },
        "method": resonator.method,
        "checks": details.pop("checks", []),
        "details": details,
    }
