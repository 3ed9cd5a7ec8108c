"""The ways identify can answer: likelihood, the regressions of seed A, monitoring in the working mode, an unknown rate; and their
comparison.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np

from ...errors import HrgError
from ...fitting.envelopes import (
    coordinates,
    envelope_runs,
    method_ranges,
    propagator,
    regressions,
    resampling,
    rotation_integrals,
    working_mode,
)
from ...fitting.envelopes.base_fit import Known, base_fit, check, nominal_scale_factor, start
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...fitting.envelopes.likelihood import Fit, Freedom, State, batch, fit, respond
from ...fitting.envelopes.regressions import Regression
from ...physics import ellipse
from ...records import Wave
from .modes import free_modes, one_channel
from .verdict import ORDER, POOR_FIT, Verdict, contradictions, from_fit, judged, one_rate

Array = np.ndarray
REGRESSION_ROWS = 300
RegressionMethod = Literal[
    "propagator",
    "stokes",
    "products",
    "increments",
    "moving-axes",
    "moving-axes-small-quadrature",
    "fixed-axes",
    "fixed-axes-weighted",
    "fixed-axes-groups",
    "frozen-axes",
    "rotation-integrals",
]
ALL: tuple[RegressionMethod, ...] = get_args(RegressionMethod)


def by_likelihood(runs: Sequence[EnvelopeRun], known: Known, blocks: int) -> Verdict:
    """All runs together by maximum likelihood, judged; two modes without axes where the record shows no more."""
    modes = one_channel(runs)
    if modes is not None:
        return modes
    try:
        verdict = from_fit(base_fit(runs, known, blocks), runs, known, lambda held: base_fit(runs, held, blocks))
    except HrgError:
        modes = free_modes(runs, np.inf)
        if modes is None:
            raise
        return modes
    if verdict.chi2_per_dof > POOR_FIT:
        impossible = bool(verdict.refused) or verdict.values["damping_split_1_s"] > verdict.values["damping_rate_1_s"]
        modes = free_modes(runs, verdict.chi2_per_dof, impossible)
        contradictions(verdict, runs, lambda rest: base_fit(rest, known, blocks))
    return verdict if modes is None else modes


def prepared(runs: Sequence[EnvelopeRun], known: Known, best: Fit | None = None) -> tuple[list[EnvelopeRun], Array, Array, Freedom]:
    """Averaged runs against their own mean frequency, the propagator's coordinates and covariance, and what is free.

    Seed A's equations are of first order in |L|/ω. What the second order (rate times split or damping over ω) does to the envelopes is
    taken off them by the likelihood's model, with the scale the likelihood found (`best`) or finds.
    """
    if known.scale_factor is None and max(float(np.ptp(r.turn_rad)) for r in runs) == 0:
        known = dataclasses.replace(known, scale_factor=nominal_scale_factor(runs[0].mode_number))
    p, offsets, covariance, space = start(runs, known)
    thin = propagator.thinned(runs, p, offsets, REGRESSION_ROWS)
    thin = [envelope_runs.retuned(r, o) for r, o in zip(thin, offsets)]
    try:
        full = (best or base_fit(runs, known)).p
    except HrgError:
        return thin, p, covariance, space
    data = batch(thin)
    first, second = (
        respond(data, State(np.append(full[:6], order), data.envelope[:, 0], np.zeros((len(thin), 1)))).model for order in (0.0, full[6])
    )
    # the mean frequency's shift by the second order is the run's own and stays
    thin = [dataclasses.replace(r, envelope=r.envelope - (second - first)[i, : len(r)]) for i, r in enumerate(thin)]
    p, _, covariance = propagator.identify(thin, space, p, np.zeros(len(thin)))
    return thin, p, covariance, space


def regression(method: str, thin: Sequence[EnvelopeRun], p: Array, covariance: Array, space: Freedom, eliminate_rate: bool) -> Regression:
    """One method's answer."""
    if method == "propagator":
        full = space.directions @ covariance @ space.directions.T
        return Regression(p, full, method_ranges.warnings(thin, method, False))
    if method == "rotation-integrals":
        return rotation_integrals.solve(thin)
    return regressions.solve(thin, space, method, eliminate_rate)


def by_regression(runs: Sequence[EnvelopeRun], known: Known, method: str, eliminate_rate: bool) -> Verdict:
    """One of seed A's methods, judged: its parameters, its own warnings, and the χ² its parameters leave in the likelihood."""
    thin, p, covariance, space = prepared(runs, known)
    answer = regression(method, thin, p, covariance, space, eliminate_rate)
    if answer.refused:
        raise HrgError(answer.refused)
    return _verdict(answer, thin, known, method)


def _verdict(answer: Regression, thin: Sequence[EnvelopeRun], known: Known, method: str) -> Verdict:
    mode = thin[0].mode_number
    values, std, covariance = _physical(answer, mode, method, thin, known)
    data = batch(thin)
    p = np.nan_to_num(answer.p)
    if not np.isfinite(answer.p[5]):
        p[5] = known.scale_factor if known.scale_factor is not None else nominal_scale_factor(mode)
    p[6] = 1.0
    only = np.zeros((coordinates.COUNT, 1))
    only[6, 0] = 1.0
    held = Freedom(("second_order",), np.append(p[:6], 0.0), only, np.ones(1), np.ones(1))
    result = fit(data, held, np.ones(1), data.envelope[:, 0], np.zeros((len(thin), 1)))
    rows = np.array([len(r) for r in thin])
    verdict = Verdict(
        values,
        std,
        list(ORDER),
        covariance,
        result.chi2 / result.dof,
        float("nan"),
        result.run_chi2 / np.maximum(1, 4 * rows - 5),
        np.array([float(np.sqrt(c / n / 4) * r.std.mean()) for c, n, r in zip(result.run_chi2, rows, thin)]),
        rows,
    )
    verdict.suspect = list(answer.warnings)
    frequency = np.array([r.reference_frequency_hz for r in thin]) + result.response.state.offsets_rad_s(data.span_s) / (2 * np.pi)
    values["frequency_hz"] = float(frequency.mean())
    std["frequency_hz"] = float(
        max(
            frequency.std(ddof=1) if len(frequency) > 1 else 0.0, (thin[0].std / np.abs(thin[0].envelope).max()).mean() / thin[0].duration_s
        )
    )
    covariance[0, 0] = std["frequency_hz"] ** 2
    return verdict


def _physical(
    answer: Regression, mode: int, method: str, thin: Sequence[EnvelopeRun], known: Known
) -> tuple[dict[str, float], dict[str, float], Array]:
    """Parameters by name, standard deviations, covariance (7, 7) in ORDER; what the method does not give is left out."""
    numbers, slopes = coordinates.physical(np.nan_to_num(answer.p), mode)
    covariance = np.zeros((7, 7))
    covariance[1:, 1:] = slopes @ np.nan_to_num(answer.covariance) @ slopes.T
    present = {"frequency_hz"}
    for row, name in enumerate(ORDER[1:]):
        index = {0: [0], 1: [1, 2], 2: [1, 2], 3: [3, 4], 4: [3, 4], 5: [5]}[row]
        if np.all(np.isfinite(answer.p[index])):
            present.add(name)
    if known.scale_factor is not None or max(float(np.ptp(r.turn_rad)) for r in thin) == 0:
        present.discard("scale_factor")
    if method in method_ranges.USES_AXES and any("frequency split is skipped" in w for w in answer.warnings):
        present -= {"frequency_split_rad_s", "stiffness_axis_rad"}
    values = {n: float(v) for n, v in zip(ORDER, [0.0, *numbers]) if n in present}
    std = dict(zip(ORDER, map(float, np.sqrt(np.maximum(0.0, np.diag(covariance))))))
    return values, std, covariance


def compared(runs: Sequence[EnvelopeRun], known: Known, best: Verdict, eliminate_rate: bool) -> list[dict[str, Any]]:
    """Every method on the same inputs: parameters, and the difference from the likelihood in units of the method's own error."""
    thin, p, covariance, space = prepared(runs, known, best.fit)
    table = [_row("likelihood", best.values, best.std, best, [], "")]
    for method in ALL:
        answer = regression(method, thin, p, covariance, space, eliminate_rate)
        if answer.refused:
            table.append(_row(method, {}, {}, best, [], answer.refused))
            continue
        values, std, _ = _physical(answer, runs[0].mode_number, method, thin, known)
        values.pop("frequency_hz", None)
        table.append(_row(method, values, std, best, answer.warnings, ""))
    return table


def _row(method: str, values: dict[str, float], std: dict[str, float], best: Verdict, warnings: list[str], refused: str) -> dict[str, Any]:
    cells = {}
    for name, value in values.items():
        difference = value - best.values.get(name, value)
        if name.endswith("axis_rad"):
            period = np.pi / best.mode_number
            difference = float(np.mod(difference + period / 2, period) - period / 2)
        cells[name] = {"value": value, "std": std[name], "difference": difference}
    return {"method": method, "parameters": cells, "warnings": warnings, "refused": refused}


def unknown_rate(runs: Sequence[EnvelopeRun], known: Known, blocks: int) -> Verdict:
    """One unknown constant rate beside the resonator; refused where a damping split imitates it."""
    mode = runs[0].mode_number
    factor = known.scale_factor if known.scale_factor is not None else nominal_scale_factor(mode)
    turning = [dataclasses.replace(r, turn_rad=r.time_s - r.time_s[0]) for r in runs]
    result = base_fit(turning, dataclasses.replace(known, scale_factor=None), blocks)
    verdict = judged(result, turning, Known())
    if one_rate(result) or not verdict.std["scale_factor"] < 0.3 * max(abs(result.p[5]), abs(result.p[0])):
        span = 2 * max(float(np.ptp(ellipse.unwrap(*ellipse.wave(r.envelope, 1)[2:], 1)[0])) for r in result.response.batch.runs)
        verdict.refused.append(
            f"an unknown rate is ill-conditioned here (condition number {verdict.condition:.3g}): the wave passes "
            f"{np.degrees(span):.0f}° of the 360° of 2mθ, "
            "where a steady rate and a damping split turn it alike, and the residual's own structure decides "
            "between them; give the rate, or runs at several angles"
        )
    rate, std = result.p[5] / factor, verdict.std["scale_factor"] / factor
    verdict.details["rate_rad_s"] = {"value": float(rate), "std": float(std), "scale_factor": factor}
    verdict.values.pop("scale_factor", None)
    return verdict


def monitored(waves: Sequence[Wave], rate_rad_s: float | None) -> Verdict:
    """Frequency and damping split of a driven gyro, with the sensitivity of the second and the mean-frequency trap in numbers."""
    runs = [envelope_runs.from_wave(w, rate_rad_s) for w in waves]
    check(runs)
    p, offsets = propagator.rough(runs)
    p[0] = 0.0
    thin = [envelope_runs.retuned(r, o) for r, o in zip(propagator.thinned(runs, p, offsets, 2000), offsets)]
    found = working_mode.monitor(thin)
    mode = runs[0].mode_number
    vector = np.array([np.nan, found.value[3], found.value[4], found.value[1], found.value[2], np.nan, 0.0])
    covariance = np.zeros((7, 7))
    order = [3, 4, 1, 2]
    covariance[1:5, 1:5] = found.covariance[np.ix_(order, order)]
    values, std, full = _physical(Regression(vector, covariance), mode, "working-mode", thin, Known())
    frequency = np.array([r.reference_frequency_hz for r in thin])
    values["frequency_hz"] = float(frequency.mean())
    # the driven wave's frequency moves with its angle by the split itself
    std["frequency_hz"] = float(np.hypot(frequency.std(), np.hypot(found.value[1], found.value[2]) / (2 * np.pi)))
    full[0, 0] = std["frequency_hz"] ** 2
    crossings = working_mode.stiffness_axes(thin, mode, float(found.value[0]))
    period = np.pi / mode
    offsets_of_axes = [float(np.mod(a - values["stiffness_axis_rad"] + period / 2, period) - period / 2) for a, _ in crossings]
    scatter = float(np.sqrt(np.mean(np.square(offsets_of_axes)))) if crossings else 0.0
    nan = np.full(len(runs), np.nan)
    verdict = Verdict(
        values, std, list(ORDER), full, float("nan"), float("nan"), nan, nan, np.array([len(r) for r in thin]), mode_number=mode
    )
    verdict.details = {
        "quadrature_damping_1_s": {"value": float(found.value[0]), "std": float(np.sqrt(found.covariance[0, 0]))},
        "quadrature_rms": found.quadrature_rms,
        "damping_split_per_mhz_1_s": found.trap_1_s_per_mhz,
        "stiffness_axes": [{"value": a, "std": max(s, scatter)} for a, s in crossings],
        "stiffness_axis_of_crossings": working_mode.combined_axis(crossings, mode),
    }
    verdict.flat = [
        f"the damping split enters the phase with 2·a_B/a_A = {2 * found.quadrature_rms:.2g} only: "
        f"1 mHz of unnoticed frequency drift reads as {found.trap_1_s_per_mhz:.2g} 1/s of damping split",
        "the drive hides the mean decay: the quadrature's own damping is ν with a force drive and about 2ν with a ring electrode",
    ]
    if std["damping_split_1_s"] > 0.3 * abs(found.value[0]):
        verdict.suspect.append("damping_split_1_s is not determined in the working mode with so little quadrature; use a free run-down")
    return verdict


def profiles(verdict: Verdict, runs: Sequence[EnvelopeRun]) -> dict[str, Any]:
    """Profile-likelihood intervals of the verdict's fit."""
    assert verdict.fit is not None
    return resampling.profile(
        verdict.fit, runs[0].mode_number, {n: verdict.std[n] for n in verdict.values}, verdict.details["variance_factor"]
    )


def resampled(verdict: Verdict, draws: int, seed: int) -> None:
    """Replace the errors by those of a block bootstrap and keep its 68 and 95 % intervals."""
    assert verdict.fit is not None
    p = resampling.bootstrap(verdict.fit, draws, seed)
    mode = verdict.mode_number
    table = np.array([coordinates.physical(row, mode)[0] for row in p])
    centre = coordinates.physical(verdict.fit.p, mode)[0]
    period = np.pi / mode
    for axis in (2, 4):
        table[:, axis] = centre[axis] + np.mod(table[:, axis] - centre[axis] + period / 2, period) - period / 2
    covariance = np.cov(table.T)
    verdict.covariance[1:, 1:] = covariance
    intervals = {}
    for row, name in enumerate(ORDER[1:]):
        if name in verdict.values:
            verdict.std[name] = float(np.sqrt(covariance[row, row]))
            intervals[name] = {
                "68": [float(v) for v in np.quantile(table[:, row], [0.16, 0.84])],
                "95": [float(v) for v in np.quantile(table[:, row], [0.025, 0.975])],
            }
    verdict.details["bootstrap"] = {"draws": draws, "blocks_a_run": resampling.BLOCKS_A_RUN, "intervals": intervals}
