"""`hrg rate`: the rate a run shows, free or driven, from the identified resonator as reference
model (seed A's last task)."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting import checks
from ..fitting.checks import Check
from ..fitting.envelopes.rate_driven import fit_driven_rate
from ..fitting.envelopes.rate_estimate import MOST_NODES, RateEstimate, integrate_cardinals
from ..fitting.envelopes.rate_fit import HOPELESS, SETTLED
from ..fitting.envelopes.rate_from_model import TOO_COARSE, fit_free_rate
from ..fitting.samples.rate_log import describe_left_out, find_stretches
from ..records import Calibration, Compensated, Resonator, Wave, list_doubts, name_record
from ..units import DEGREE_PER_HOUR, round_down
from .calibration.programme import SINGLE_NODE_MARGIN_DEGC
from .earth_rate import AxisAzimuth, AxisTilt, EarthRate, Latitude, find_earth_rate
from .rate_by_tables import TableRate, rate_by_tables
from .rate_logged import measure_bends_of_log
from .rate_loops import check_loops
from .rate_nodes import DOUBTFUL, DOUBTFUL_PIECE, Bends, follow

Array = np.ndarray
TEMPERATURES_ALIKE = 0.05
"""Range of a run's temperatures [°C] below which one is told of it."""
APART = 5.0
"""Standard deviations of both by which the rates of model and tables may differ."""


def rate(
    wave: Wave,
    resonator: Resonator,
    calibration: Calibration | None = None,
    *,
    nodes: Annotated[
        int | None,
        Field(
            ge=4,
            description=(
                "times at which the rate is fitted; by default 20 or more, as the run asks; fewer"
                " for a short one"
            ),
        ),
    ] = None,
    earth_rate_deg_h: EarthRate = None,
    latitude_deg: Latitude = None,
    axis_tilt_deg: AxisTilt = 0.0,
    axis_azimuth_deg: AxisAzimuth = 0.0,
    main_phase_error_rad: Annotated[
        float, Field(description="known phase error of the main force of a driven run")
    ] = 0.0,
    quadrature_phase_error_rad: Annotated[
        float, Field(description="known phase error of its quadrature force")
    ] = 0.0,
    loop_delay_s: Annotated[
        float | None,
        Field(
            ge=0,
            description=(
                "how late a driven run's main force stands behind the wave, which `hrg calibrate"
                " --ladder` tells from forced and free runs; none: taken for 0, and said"
            ),
        ),
    ] = None,
) -> Compensated:
    """Ω(t) of a run and the angle turned, each with its standard deviation, from the resonator, and
    beside it −m·(dθ/dt)/K, which has the drift in it.

    The linear slow model u' = L(Ω) u, L = −ν − νδμ R(2mθ_μ) + jδω R(2mθ_ω) + KΩ J (PHYSICS §0;
    the last task of seed A), is fitted to the run's envelopes by least squares: Ω a cubic spline of
    its values at the nodes, the resonator known to its covariance. A gyro shows the rate against
    the stars; with the Earth's rate given the answer is the rate against the ground, as a table
    logs it.

    Parameters
    ----------
    wave
        A run of the gyro, (n,) rows with angles in rad and times in s.
    resonator
        The identified resonator with its covariance; it has to know K.
    calibration
        Tables of the gyro, whose rate is given beside.

    Returns
    -------
    Compensated
        At each node: time [s], Ω [rad/s] and its integral from the first node [rad], each with its
        standard deviation; where a rate was logged, what the plain and the fitted estimate leave of
        it [rad/s]; with a calibration the mean rate by its tables about each node [rad/s].

    Raises
    ------
    HrgError
        Another gyro or mode number, a refused resonator or one without K, phase errors of a free
        run, too few windows for the nodes.

    Examples
    --------
    >>> from hrg_cli import collect, demodulate, estimate, identify, simulate
    >>> from hrg_cli.stages.rate import rate
    >>> config = {
    ...     "device": {"frequency_hz": 1000.0, "quality_factor": 20_000.0},
    ...     "readout": {"noise": 1e-4},
    ...     "recording": {"sample_rate_hz": 8000.0, "duration_s": 3.0},
    ...     "run": [
    ...         {"run_id": "left", "environment": {"rate_rad_s": 1.0}},
    ...         {"run_id": "right", "environment": {"rate_rad_s": -1.0}},
    ...     ],
    ... }
    >>> samples = [collect(simulate(config, model="slow", run=run)) for run in ("left", "right")]
    >>> waves = [collect(estimate(collect(demodulate(r, periods_per_window=20)))) for r in samples]
    >>> found = rate(waves[0].replace(rate_rad_s=None), identify(waves), nodes=5)
    >>> len(found.time_s), float(found.rate_estimate_rad_s.mean().round(2))
    (5, 1.0)
    """
    name = f"run {wave.run_id or '?'}"
    wave = _read_whole(wave)
    _need_resonator_of(wave, resonator, name)
    if wave.mode == "forced":
        errors = (main_phase_error_rad, quadrature_phase_error_rad, loop_delay_s or 0.0)

        def fit(count: int | None) -> RateEstimate:
            return fit_driven_rate(wave, resonator, count, *errors)

    elif main_phase_error_rad or quadrature_phase_error_rad or loop_delay_s:
        raise HrgError(
            f"{name}: is a free run, which no force acts on; leave the phase errors and the loops'"
            " delay out"
        )
    else:

        def fit(count: int | None) -> RateEstimate:
            return fit_free_rate(wave, resonator, count)

    found, bends = follow(fit(nodes), fit, nodes is None, partial(measure_bends_of_log, wave))
    earth = find_earth_rate(earth_rate_deg_h, latitude_deg, axis_tilt_deg, axis_azimuth_deg)
    found = dataclasses.replace(
        found, rate_rad_s=found.rate_rad_s - earth, plain_rate_rad_s=found.plain_rate_rad_s - earth
    )
    impossible, doubtful = _make_closing_checks(found, bends)
    elsewhere = _check_temperature(wave, resonator)
    doubtful = [*elsewhere, *check_loops(wave, resonator, found), *doubtful]
    beside = None
    if calibration is not None:
        where = (earth_rate_deg_h, latitude_deg, axis_tilt_deg, axis_azimuth_deg)
        beside = rate_by_tables(wave, calibration, found.time_s, found.rate_rad_s, *where)
        warm = bool(checks.list_failures(elsewhere))
        doubtful += _check_tables(found, beside, wave, resonator, warm)
    notes = _tell_granted_delay(wave, resonator) if loop_delay_s is None else []
    notes += [] if quadrature_phase_error_rad else _tell_granted_phase(wave, resonator)
    notes += [*_tell_unseen_nodes(wave, found), *_tell_moving_frequency(found)]
    result = _record_of(wave, found, beside, [*impossible, *doubtful], notes)
    refusals = checks.list_failures(impossible)
    doubts = [why for why in checks.list_failures(doubtful) if why not in refusals]
    # what the tables inherit is told by `rate_by_tables` beside their rate
    return (
        result.judged(refusals, "refused")
        .judged(doubts, "suspect")
        .judged(list_doubts((name_record(one), one) for one in (wave, resonator)), "suspect")
    )


def _record_of(
    wave: Wave,
    found: RateEstimate,
    beside: TableRate | None,
    checked: Sequence[Check],
    notes: Sequence[str],
) -> Compensated:
    """The estimate as a record, with what it leaves of the logged rate and what the tables say."""
    # The log may begin late, end early or have gaps: only what it covers is compared.
    stretch = find_stretches(wave)
    before, after = (
        _subtract_log(values, wave, stretch, found.time_s)
        for values in (found.plain_rate_rad_s, found.rate_rad_s)
    )
    angle, angle_std = found.integrate()
    figures = _figures(found, before, after) | {"checks": [check.to_json() for check in checked]}
    if beside is not None:
        figures["tables"] = beside.to_json()
    result = Compensated(
        time_s=found.time_s,
        rate_estimate_rad_s=found.rate_rad_s,
        rate_estimate_rad_s_std=found.rate_rad_s_std,
        angle_estimate_rad=angle,
        angle_estimate_rad_std=angle_std,
        residual_before_rad_s=before,
        residual_after_rad_s=after,
        table_rate_rad_s=None if beside is None else beside.rate_rad_s,
        gyro_id=wave.gyro_id,
        run_id=wave.run_id,
        lot_id=wave.lot_id,
        mode_number=wave.mode_number,
        details=json.dumps(figures),
    )
    outside = describe_left_out(wave, stretch > 0)
    told = [f"{outside} of the comparison with it"] if outside else []
    noted = result.judged([*told, *_tell_apart_from_log(found, after), *notes], "valid")
    return noted if beside is None else noted.judged(beside.reasons, beside.status)


def _tell_apart_from_log(found: RateEstimate, after: Array | None) -> list[str]:
    """That the logged rate is another on the whole, where errors of the estimate do not explain it:
    a log may be a mere set point, and the estimate is none the worse."""
    if after is None or not np.isfinite(after).all():
        return []
    mean = float(np.mean(after))
    std = float(np.sqrt(found.covariance.sum())) / len(after)
    if not 0 < APART * std < abs(mean):
        return []
    logged = float(np.mean(found.rate_rad_s - after))
    part = f", {abs(mean / logged):.2g} of it" if abs(logged) > abs(mean) else ""
    return [
        f"the logged rate is {abs(mean):.2g} rad/s {'below' if mean > 0 else 'above'} the estimate"
        f" on the whole{part}, {abs(mean) / std:.2g} of its errors: the scale factor, or the log,"
        " is another"
    ]


def _check_temperature(wave: Wave, resonator: Resonator) -> list[Check]:
    """Whether the run is as warm as the resonator was, as near as tables of one node hold it: its
    K and splits are those of its own temperature."""
    own, span = resonator.temperature_degc, resonator.temperature_span_degc or 0.0
    logged = np.asarray([] if wave.temperature_degc is None else wave.temperature_degc, float)
    logged = logged[np.isfinite(logged)]
    if own is None or not np.isfinite(own) or not len(logged):
        return []
    low, high = float(logged.min()), float(logged.max())
    told = f"{low:.4g}" if high - low < TEMPERATURES_ALIKE else f"{low:.4g} to {high:.4g}"
    return [
        checks.check_at_most(
            "resonator_of_this_temperature",
            max(own - span / 2 - low, high - own - span / 2, 0.0),
            SINGLE_NODE_MARGIN_DEGC,
            f"the run is at {told} °C, the resonator was identified at {own:.4g} °C: how its scale"
            " factor and splits go with temperature is not known, and is not in the errors;"
            " identify the resonator at the run's temperature",
        )
    ]


def _check_tables(
    found: RateEstimate, beside: TableRate, wave: Wave, resonator: Resonator, elsewhere: bool
) -> list[Check]:
    """Whether the tables' mean rate is the model's within the errors of both; what would part them:
    a resonator of a temperature `elsewhere`, or which delay of the loops."""
    apart = beside.mean_difference_rad_s
    own = np.hypot(np.sqrt(found.covariance.sum()) / len(found.time_s), beside.own_std_rad_s)
    if apart is None or not own > 0:
        return []
    damping = _damping_of(resonator)
    share = apart / float(found.rate_rad_s.mean())
    if elsewhere:
        why = "the resonator's other temperature would do so"
    elif wave.mode == "forced" and damping > 0 and share > 0:
        late_ms = 1e3 * share / damping
        why = f"loops that act {late_ms:.3g} ms late would do so (--loop-delay-s), or the gyro is"
        why += " another than it was"
    else:
        why = "the gyro is another than it was, or the tables hold what the loops of their runs add"
    sentence = (
        f"the tables' mean rate is {apart:.3g} ± {own:.1g} rad/s off the reference model's: {why}"
    )
    return [checks.check_at_most("agrees_with_tables", abs(apart) / float(own), APART, sentence)]


def _damping_of(resonator: Resonator) -> float:
    """ν; 0 where the file holds none."""
    return float(resonator.parameters().get("damping_rate_1_s", (0.0, 0.0, ""))[0])


def _tell_granted_phase(wave: Wave, resonator: Resonator) -> list[str]:
    """What is taken for granted of the quadrature loop's force, and what it would be worth: at a
    phase error β its part βδω sin 2m(θ − θ_ω) turns the wave, as a rate of that over K would."""
    told = resonator.parameters()
    split, K = (
        abs(told[name][0]) if name in told else 0.0
        for name in ("frequency_split_rad_s", "scale_factor")
    )
    if wave.mode != "forced" or not (split > 0 and K > 0):
        return []
    return [
        "the quadrature loop's force is taken to be in phase: each milliradian beside it makes the"
        f" rate wrong by up to {1e-3 * split / K / DEGREE_PER_HOUR:.3g} °/h; give"
        " --quadrature-phase-error-rad"
    ]


def _tell_moving_frequency(found: RateEstimate) -> list[str]:
    """That the frequency was followed, where it moves."""
    if not found.frequency_moves_hz:
        return []
    return [
        f"the frequency moves by {found.frequency_moves_hz:.2g} Hz within the run, which turns the"
        " phase of both channels alike: it is fitted beside the rate"
    ]


def _tell_unseen_nodes(wave: Wave, found: RateEstimate) -> list[str]:
    """Which nodes stand in a gap of the windows, where only their neighbours hold them."""
    seen = np.asarray(wave.time_s, float)[wave.good()]
    after = np.clip(np.searchsorted(seen, found.time_s), 1, len(seen) - 1)
    apart = np.minimum(np.abs(found.time_s - seen[after - 1]), np.abs(found.time_s - seen[after]))
    unseen = apart > max(wave.window_s, (found.time_s[1] - found.time_s[0]) / 2)
    if not unseen.any():
        return []
    at, worst = found.time_s[unseen], float(found.rate_rad_s_std[unseen].max())
    return [
        f"no window shows the rate at {int(unseen.sum())} nodes between {at[0]:.4g} and"
        f" {at[-1]:.4g} s: their standard deviations reach {worst:.2g} rad/s"
    ]


def _tell_granted_delay(wave: Wave, resonator: Resonator) -> list[str]:
    """What is taken for granted of a driven run's loops, and what it would be worth: K/(1 + ντ)
    stands for K where they act τ late, which no wave shows."""
    damping = _damping_of(resonator)
    if wave.mode != "forced" or not damping > 0:
        return []
    return [
        f"the loops are taken to act at once: every millisecond they are late makes the rate"
        f" {damping * 1e3:.3g} ppm too small; give --loop-delay-s, which `hrg calibrate --ladder`"
        " tells from forced and free runs that turn"
    ]


def _need_resonator_of(wave: Wave, resonator: Resonator, name: str) -> None:
    """HrgError: the resonator is of another gyro or mode, or refused."""
    if wave.gyro_id and resonator.gyro_id and wave.gyro_id != resonator.gyro_id:
        raise HrgError(
            f"{name}: is of gyro {wave.gyro_id}, the resonator is of {resonator.gyro_id}; identify"
            " the same gyro"
        )
    if wave.mode_number != resonator.mode_number:
        raise HrgError(
            f"{name}: has mode_number {wave.mode_number}, the resonator has"
            f" {resonator.mode_number}; use one of the same mode"
        )
    if resonator.status == "refused":
        why = "; ".join(resonator.status_reasons) or "no reason is given"
        raise HrgError(f"the resonator is refused ({why}); identify it from better runs")


def _make_closing_checks(found: RateEstimate, bends: Bends) -> tuple[list[Check], list[Check]]:
    """The closing checks of a rate: (what refuses it, what makes it suspect); bends: what its nodes
    are foretold to lose between them."""
    count, more = len(found.time_s), _more_nodes(found)
    poor = (
        f"χ²/dof = {found.chi2_per_dof:.3g}: the reference model leaves more than the noise"
        f" (another resonator, or a rate that changes faster than {count} nodes follow: then"
        f" {more}); the errors are inflated by it"
    )
    impossible = [
        *checks.check_fit(
            found.covariance,
            found.converged or found.adequate,
            f"the rate did not settle on {count} nodes; give other nodes",
        ),
        checks.check_at_most("rate_is_found", found.chi2_per_dof, HOPELESS, poor),
    ]
    noise = checks.check_statistics(
        found.chi2_per_dof * found.dof,
        found.dof,
        [found.residual],
        sentence=poor,
        coloured=(
            f"what the reference model leaves is coloured: the rate changes within {count}"
            f" nodes' distance ({more}), or the resonator is another; the errors are those of"
            " white noise"
        ),
    )
    return impossible, [*noise, *_check_nodes(found, bends)]


def _check_nodes(found: RateEstimate, bends: Bends) -> list[Check]:
    """Whether rows and nodes are close enough for the rate that was found."""
    count, more = len(found.time_s), _more_nodes(found)
    gained = found.finer.z if found.finer is not None else 0.0
    unsettled = (
        f"the rate on {count} nodes still moves by a hundredth of its standard deviation, as"
        " where the wave is gone in the noise or windows are missing: cut there (--to-s), or"
        " give other nodes"
    )
    return [
        checks.check_holds("rate_settles", found.converged or not found.adequate, unsettled),
        checks.check_at_most(
            "row_truncation",
            found.truncation,
            2 * SETTLED,
            f"averaging along the rate found still moves it by {found.truncation:.2g} σ",
        ),
        checks.check_at_most(
            "nodes_follow",
            gained,
            TOO_COARSE,
            f"the rate changes faster than {count} nodes follow: with twice as many χ² falls by"
            f" {gained:.2g} of its standard deviations more than by chance, so the errors"
            f" hold at smooth places only; {more}",
        ),
        *_check_bends(bends, count, more),
    ]


def _check_bends(bends: Bends, count: int, more: str) -> list[Check]:
    """Whether the rate bends less between its nodes than their errors say: all along the run, and
    where that holds at the place where it bends most."""
    of_log = checks.check_at_most(
        "nodes_follow_log",
        bends.logged,
        DOUBTFUL,
        f"the logged rate swings between {count} nodes: beside it the errors are"
        f" {np.sqrt(1 + bends.logged):.2g} times those stated; {more}",
    )
    if not of_log.passed:
        return [of_log]
    along = checks.check_at_most(
        "nodes_are_dense",
        bends.whole,
        DOUBTFUL,
        f"the rate bends between {count} nodes: by what fewer lose, the errors are"
        f" {np.sqrt(1 + bends.whole):.2g} times those stated, most between {bends.begin_s:.4g}"
        f" and {bends.end_s:.4g} s; {more}",
    )
    if not along.passed:
        return [of_log, along]
    somewhere = checks.check_at_most(
        "nodes_are_dense_everywhere",
        bends.worst,
        DOUBTFUL_PIECE,
        f"the rate jumps or bends sharply between {bends.begin_s:.4g} and {bends.end_s:.4g} s:"
        f" the errors there are {np.sqrt(1 + bends.worst):.2g} times those stated; {more}",
    )
    return [of_log, along, somewhere]


def _more_nodes(found: RateEstimate) -> str:
    """What to do for twice as many nodes: ask for them, or give shorter windows or runs."""
    wanted = 2 * len(found.time_s) - 1
    if wanted <= found.most_nodes:
        return f"ask for more nodes, {wanted} say"
    if wanted > MOST_NODES:
        return "cut the run into shorter ones"
    # rounded down: windows of the length that is named have to carry the nodes
    shorter = round_down(found.window_s * found.most_nodes / wanted)
    return f"demodulate with windows of at most {shorter:g} s, which carry {wanted} nodes"


def summarise(record: Compensated) -> dict[str, Any]:
    """Figures of an estimated rate for the JSON.

    Parameters
    ----------
    record
        Made by `rate`.

    Returns
    -------
    dict
        What its details hold.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.rate import summarise
    >>> summarise(SimpleNamespace(details='{"nodes": 5}'))
    {'nodes': 5}
    """
    return dict(json.loads(record.details))


def _read_whole(wave: Wave) -> Wave:
    """The wave with every column read: one run-down fits into memory, and the fit needs all of it
    at once."""
    columns = {f.name: getattr(wave, f.name) for f in dataclasses.fields(wave)}
    return wave.replace(
        **{
            n: np.asarray(v[:])
            for n, v in columns.items()
            if hasattr(v, "dtype") and getattr(v, "ndim", 0) > 0
        }
    )


def _subtract_log(estimate: Array, wave: Wave, stretch: Array, time_s: Array) -> Array | None:
    """The estimate less the logged rate, NaN where the log does not reach (`stretch`: the windows'
    stretch of it, 0 outside); None without a log."""
    if wave.rate_rad_s is None or not stretch.any():
        return None
    logged = np.asarray(wave.rate_rad_s, float)
    known = np.isfinite(logged) & (stretch > 0)
    at, half = np.asarray(wave.time_s, float)[known], wave.window_s / 2
    place = np.searchsorted(at, time_s)
    before, after = np.maximum(place - 1, 0), np.minimum(place, len(at) - 1)
    reached = (stretch[known][before] == stretch[known][after]) | (
        np.minimum(np.abs(time_s - at[before]), np.abs(time_s - at[after])) <= half
    )
    reached &= (time_s >= at[0] - half) & (time_s <= at[-1] + half)
    return np.where(reached, estimate - np.interp(time_s, at, logged[known]), np.nan)


def _figures(found: RateEstimate, before: Array | None, after: Array | None) -> dict[str, Any]:
    """Mean rate and angle turned with their errors, the plain estimate's, their difference (the
    drift), and what either leaves of the logged rate (`before`, `after`).

    A mean is that over time, what was turned over how long it took: of all nodes alike the first
    and the last would count twice."""
    count = len(found.time_s)
    distance = float(found.time_s[1] - found.time_s[0])
    angle, angle_std = found.integrate()
    weights = integrate_cardinals(found.time_s, found.time_s[-1:])[:, 0] / np.ptp(found.time_s)
    apart = found.plain_rate_rad_s - found.rate_rad_s
    figures: dict[str, Any] = {
        "nodes": count,
        "node_distance_s": distance,
        "bandwidth_hz": 1 / (2 * distance),
        "chi2_per_dof": found.chi2_per_dof,
        "mean_rate_rad_s": {
            "value": float(weights @ found.rate_rad_s),
            "std": float(angle_std[-1] / np.ptp(found.time_s)),
        },
        "median_std_rad_s": float(np.median(found.rate_rad_s_std)),
        "turned_rad": {"value": float(angle[-1]), "std": float(angle_std[-1])},
        "plain_rate": {
            "equation": "-m*dtheta/dt/K",
            "mean_rad_s": float(weights @ found.plain_rate_rad_s),
            "difference_mean_rad_s": float(weights @ apart),
            "difference_rms_rad_s": float(np.sqrt(np.mean(apart**2))),
        },
    }
    for name, left in (("plain_error_rms_rad_s", before), ("error_rms_rad_s", after)):
        if left is not None and np.isfinite(left).any():
            figures[name] = float(np.sqrt(np.nanmean(left**2)))
    return figures
