"""The ways identify can answer: likelihood, the regressions of seed A, an unknown rate; and their
comparison.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from ...errors import HrgError
from ...fitting import checks
from ...fitting.envelopes import (
    axis_crossings,
    coordinates,
    envelope_runs,
    inference,
    method_ranges,
    propagator,
    rate_offset,
    regressions,
    resampling,
    rotation_integrals,
)
from ...fitting.envelopes.base_fit import Known, base_fit, freedom, nominal_scale_factor
from ...fitting.envelopes.coordinates import DAMPING, SCALE_FACTOR, SECOND_ORDER
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...fitting.envelopes.likelihood import Fit, Freedom, State, batch, fit, respond
from ...fitting.envelopes.regressions import Regression
from ...physics import ellipse
from . import closing
from .modes import free_modes, one_channel
from .outcome import Verdict
from .splits import state_splits
from .verdict import (
    ORDER,
    POOR_FIT,
    contradictions,
    is_one_rate,
    judge_fit,
    judge_parameters,
    second_order_std,
)

Array = np.ndarray
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
    "axis-crossings",
]
ALL: tuple[RegressionMethod, ...] = get_args(RegressionMethod)


def by_likelihood(runs: Sequence[EnvelopeRun], known: Known, blocks: int) -> Verdict:
    """All runs together by maximum likelihood, judged; two modes without axes where the record
    shows no more."""
    modes = one_channel(runs)
    if modes is not None:
        return modes
    try:
        verdict = judge_fit(
            base_fit(runs, known, blocks), runs, known, lambda held: base_fit(runs, held, blocks)
        )
    except HrgError:
        modes = free_modes(runs, np.inf)
        if modes is None:
            raise
        return modes
    if verdict.chi2_per_dof > POOR_FIT:
        impossible = (
            bool(verdict.refused)
            or verdict.values["damping_split_1_s"] > verdict.values["damping_rate_1_s"]
        )
        modes = free_modes(runs, verdict.chi2_per_dof, impossible)
        contradictions(verdict, runs, lambda rest: base_fit(rest, known, blocks))
    return verdict if modes is None else modes


@dataclass(frozen=True)
class Prepared:
    """What a regression starts from: the likelihood's rows as a first-order resonator shows them at
    its own mean frequency, the likelihood's coordinates (7,) and what is free.
    """

    rows: list[EnvelopeRun]
    p: Array
    covariance: Array
    space: Freedom
    beside: Prepared | None = None
    """The same with the scale of the second order one of its standard deviations larger; None where
    that scale is held."""

    def noiseless(self, p: Array) -> list[EnvelopeRun]:
        """The rows as a resonator of coordinates p (7,) would show them, started as the runs
        did."""
        data = batch(self.rows)
        p = np.append(p[:6], 0.0)
        found = fit(
            data,
            only_second_order(p),
            np.zeros(1),
            data.envelope[:, 0],
            np.zeros((len(self.rows), 1)),
        )
        x = data.time_s / data.span_s[:, None]
        model = found.response.model * np.exp(-1j * found.response.state.phase * x)[..., None]
        return [
            dataclasses.replace(r, envelope=model[i, : len(r)]) for i, r in enumerate(self.rows)
        ]


def only_second_order(p: Array) -> Freedom:
    """All coordinates held at p, the second order at its own value: what is fitted are the runs'
    starts and phases."""
    only = np.zeros((coordinates.COUNT, 1))
    only[6, 0] = 1.0
    return Freedom(
        ("second_order",),
        np.append(p[:6], 0.0),
        only,
        np.full(1, p[SECOND_ORDER]),
        np.full(1, 1e-9),
    )


def prepare_rows(runs: Sequence[EnvelopeRun], known: Known, best: Fit) -> Prepared:
    """The rows the likelihood was fitted to, averaged along its motion, without their phases' drift
    and second order.

    Seed A's equations are of first order in |L|/ω. What the second order (rate times split or
    damping over ω) does to the envelopes is taken off them by the likelihood's model, with the
    scale the likelihood found; where it is known no better than its standard deviation, the rows
    `beside` have one more of it taken off.
    """
    if known.scale_factor is None and max(float(np.ptp(r.turn_rad)) for r in runs) == 0:
        known = dataclasses.replace(known, scale_factor=nominal_scale_factor(runs[0].mode_number))
    ready = _first_order(runs, known, best, float(best.p[SECOND_ORDER]))
    std = second_order_std(best)
    if std == 0 or _size_of_second_order(best) * std < closing.SETTLED:
        return ready
    return dataclasses.replace(
        ready, beside=_first_order(runs, known, best, float(best.p[SECOND_ORDER]) + std)
    )


def _size_of_second_order(best: Fit) -> float:
    """What the second order does to all rows, in their noise: no linear answer moves by more of its
    own standard deviations (Cauchy and Schwarz)."""
    data, state = best.response.batch, best.response.state
    first, second = (
        respond(data, State(np.append(best.p[:6], order), state.start, state.phase)).model
        for order in (0.0, 1.0)
    )
    return float(np.linalg.norm((second - first) * data.weight[..., None]))


def _first_order(runs: Sequence[EnvelopeRun], known: Known, best: Fit, scale: float) -> Prepared:
    """The likelihood's rows less `scale` times what the second order does to them."""
    data, state = best.response.batch, best.response.state
    x = data.time_s / data.span_s[:, None]
    phase = sum(state.phase[:, k - 1 : k] * x**k for k in range(1, state.phase.shape[1] + 1))
    none = np.zeros((len(data.runs), 1))
    first, second = (
        respond(data, State(np.append(best.p[:6], order), state.start, none)).model
        for order in (0.0, scale)
    )
    # the mean frequency's shift by the second order is the run's own and stays
    envelope = data.envelope * np.exp(-1j * phase)[..., None] - (second - first)
    offsets = state.offsets_rad_s(data.span_s) / (2 * np.pi)
    thin = [
        dataclasses.replace(
            r,
            envelope=envelope[i, : len(r)],
            reference_frequency_hz=r.reference_frequency_hz + float(offsets[i]),
        )
        for i, r in enumerate(data.runs)
    ]
    space = freedom(known, best.p, runs[0].mode_number, max(r.duration_s for r in runs))
    p, _, covariance = propagator.identify(
        thin, space, np.append(best.p[:6], 0.0), np.zeros(len(thin))
    )
    return Prepared(thin, p, covariance, space)


def regression(method: str, ready: Prepared, best: Fit, eliminate_rate: bool) -> Regression:
    """One method's answer; how far the scale of the second order is unknown is in its
    covariance."""
    answer = _regression(method, ready, best, eliminate_rate)
    if answer.refused or ready.beside is None:
        return answer
    moved = _regression(method, ready.beside, best, eliminate_rate, answer.spread)
    if moved.refused:
        return moved
    change = moved.p - answer.p
    return dataclasses.replace(answer, covariance=answer.covariance + np.outer(change, change))


def _regression(
    method: str,
    ready: Prepared,
    best: Fit,
    eliminate_rate: bool,
    spread: regressions.Spread | None = None,
) -> Regression:
    """One method's answer on rows of the first order; what noise does to it may be known
    (`spread`)."""
    if method == "propagator":
        space = ready.space
        return Regression(
            ready.p,
            space.directions @ ready.covariance @ space.directions.T,
            method_ranges.warnings(ready.rows, method, False),
        )
    start = np.append(best.p[:6], 0.0)
    if method == "rotation-integrals":
        return rotation_integrals.solve(ready.rows, ready.noiseless, start)
    if method == axis_crossings.METHOD:
        return axis_crossings.solve(ready.rows, ready.noiseless, start)
    return regressions.solve(
        ready.rows, ready.space, method, eliminate_rate, ready.noiseless, start, spread
    )


def by_regression(
    runs: Sequence[EnvelopeRun], known: Known, method: str, eliminate_rate: bool, blocks: int
) -> Verdict:
    """One of seed A's methods, judged by its own misfit, by its distance from the likelihood on the
    same rows, and by physics."""
    best = base_fit(runs, known, blocks)
    ready = prepare_rows(runs, known, best)
    answer = regression(method, ready, best, eliminate_rate)
    if answer.refused:
        raise HrgError(answer.refused)
    return _verdict(answer, ready, judge_parameters(best, runs, known), known, method)


def _verdict(
    answer: Regression, ready: Prepared, likelihood: Verdict, known: Known, method: str
) -> Verdict:
    """A regression's verdict; the frequency is the likelihood's, which every method has to know."""
    mode = ready.rows[0].mode_number
    values, std, covariance = physical_of(answer, mode, method, ready.rows, known)
    values["frequency_hz"], std["frequency_hz"] = (
        likelihood.values["frequency_hz"],
        likelihood.std["frequency_hz"],
    )
    covariance[0, 0] = std["frequency_hz"] ** 2
    rows = np.array([len(r) for r in ready.rows])
    own = len(answer.run_chi2) > 0
    run_chi2 = (
        answer.run_chi2 / np.maximum(1, answer.run_rows) if own else likelihood.run_chi2_per_dof
    )
    chi2, dof = (
        (float(np.nansum(answer.run_chi2)), int(answer.run_rows.sum()))
        if own
        else (likelihood.chi2_per_dof * rows.sum() * 4, 4 * rows.sum())
    )
    verdict = Verdict(
        values,
        std,
        list(ORDER),
        covariance,
        chi2 / max(1, dof),
        float("nan"),
        run_chi2,
        likelihood.run_residual_rms,
        rows,
        mode_number=mode,
    )
    verdict.details |= answer.details | state_splits(values, std, answer.p, answer.covariance)
    verdict.suspect = list(answer.warnings)
    refusing, doubting = closing.check_bounds(verdict)
    assert likelihood.fit is not None
    apart = _apart(answer, likelihood.fit)
    closing.close_verdict(
        verdict,
        [
            *checks.check_fit(
                covariance,
                answer.unsettled < closing.UNSETTLED,
                f"{method}: taking off the differences' truncation did not settle",
            ),
            *refusing,
        ],
        [
            checks.goodness(
                chi2,
                dof,
                f"χ²/dof = {chi2 / max(1, dof):.3g}: {method} leaves more than the noise of its own"
                " rows; the errors are inflated",
            ),
            checks.at_most(
                "row_truncation",
                max(answer.unsettled, likelihood.fit.truncation),
                closing.SETTLED,
                f"the length of the rows still moves {method} by"
                f" {max(answer.unsettled, likelihood.fit.truncation):.2g} σ",
            ),
            checks.at_most(
                "distance_from_likelihood",
                apart,
                closing.AGREES,
                f"{method} is {apart:.3g} of its own standard deviations away from what fits the"
                " same rows best; use likelihood",
            ),
            *(c for c in likelihood.checks if c.name == "motion_within_a_window"),
            *doubting,
        ],
    )
    if not next(c for c in likelihood.checks if c.name == "chi2_per_dof").passed:
        verdict.suspect.append(
            "no linear resonator describes these runs within their noise (χ²/dof"
            f" {likelihood.chi2_per_dof:.3g})"
        )
    return verdict


def _apart(answer: Regression, best: Fit) -> float:
    """Largest distance of a method's coordinates from the likelihood's, in the standard deviations
    of their difference; of the splits that of the vectors, whatever way they lie.

    The likelihood is efficient, so the variance of the difference is the difference of the
    variances, at most the method's own.
    """
    distance = [0.0]
    for part in ([0], [1, 2], [3, 4], [5]):
        off, covariance = answer.p[part] - best.p[part], answer.covariance[np.ix_(part, part)]
        if np.all(np.isfinite(off)) and np.all(np.isfinite(covariance)):
            distance.append(float(np.sqrt(off @ np.linalg.pinv(covariance, hermitian=True) @ off)))
    return max(distance)


def physical_of(
    answer: Regression, mode: int, method: str, thin: Sequence[EnvelopeRun], known: Known
) -> tuple[dict[str, float], dict[str, float], Array]:
    """Parameters by name, standard deviations, covariance (7, 7) in ORDER; what the method does not
    give is left out."""
    numbers, slopes = coordinates.to_parameters(np.nan_to_num(answer.p), mode)
    covariance = np.zeros((7, 7))
    own = np.nan_to_num(answer.covariance)
    covariance[1:, 1:] = slopes @ own @ slopes.T
    held = np.diag(covariance)[1:] < 1e-20 * np.einsum(
        "ij,jk,ik->i", np.abs(slopes), np.abs(own), np.abs(slopes)
    )
    covariance[1:, 1:][held] = covariance[1:, 1:][:, held] = (
        0.0  # what is held moves with nothing, not even by rounding
    )
    inference.widen_axes(covariance[1:, 1:], own, np.nan_to_num(answer.p), mode)
    present = {"frequency_hz"}
    for row, name in enumerate(ORDER[1:]):
        index = {0: [0], 1: [1, 2], 2: [1, 2], 3: [3, 4], 4: [3, 4], 5: [5]}[row]
        if np.all(np.isfinite(answer.p[index])):
            present.add(name)
    if known.scale_factor is None and max(float(np.ptp(r.turn_rad)) for r in thin) == 0:
        present.discard("scale_factor")
    if method in method_ranges.USES_AXES and any(
        "frequency split is skipped" in w for w in answer.warnings
    ):
        present -= {"frequency_split_rad_s", "stiffness_axis_rad"}
    values = {n: float(v) for n, v in zip(ORDER, [0.0, *numbers]) if n in present}
    std = dict(zip(ORDER, map(float, np.sqrt(np.maximum(0.0, np.diag(covariance))))))
    return values, std, covariance


def compare_methods(
    runs: Sequence[EnvelopeRun], known: Known, best: Verdict, eliminate_rate: bool
) -> list[dict[str, Any]]:
    """Every method on the same inputs: parameters, and the difference from the likelihood in units
    of the method's own error."""
    if best.fit is None:
        raise HrgError(
            "the methods of seed A need both channels of a resonator, these runs show modes alone;"
            " give --method likelihood for them"
        )
    ready = prepare_rows(runs, known, best.fit)
    table = [_row("likelihood", best.values, best.std, best, [], "") | _splits(best)]
    for method in ALL:
        answer = regression(method, ready, best.fit, eliminate_rate)
        if answer.refused:
            table.append(_row(method, {}, {}, best, [], answer.refused))
            continue
        verdict = _verdict(answer, ready, best, known, method)
        verdict.values.pop("frequency_hz", None)
        table.append(
            _row(
                method, verdict.values, verdict.std, best, [*verdict.refused, *verdict.suspect], ""
            )
            | _splits(verdict)
        )
    return table


def _splits(verdict: Verdict) -> dict[str, Any]:
    """What a verdict says of its splits as vectors."""
    return {key: verdict.details[key] for key in ("split_components", "weak_splits")}


def _row(
    method: str,
    values: dict[str, float],
    std: dict[str, float],
    best: Verdict,
    warnings: list[str],
    refused: str,
) -> dict[str, Any]:
    cells = {}
    for name, value in values.items():
        difference = value - best.values.get(name, value)
        if name.endswith("axis_rad"):
            period = np.pi / best.mode_number
            difference = float(np.mod(difference + period / 2, period) - period / 2)
        cells[name] = {"value": value, "std": std[name], "difference": difference}
    return {"method": method, "parameters": cells, "warnings": warnings, "refused": refused}


def unknown_rate(runs: Sequence[EnvelopeRun], known: Known, blocks: int) -> Verdict:
    """One unknown constant rate beside the resonator, added to the logged rates; refused where a
    damping split imitates it.

    K is fitted where the logs hold different rates and none is given; else it is held, for K·Ω
    alone is seen.
    """
    mode = runs[0].mode_number
    told = known.scale_factor is not None
    if not told and not _rates_differ(runs):
        known = dataclasses.replace(known, scale_factor=nominal_scale_factor(mode))
    start = 0.0
    if max(float(np.ptp(r.turn_rad)) for r in runs) == 0:  # no log: K·Ω at unit rate is the start
        turning = [dataclasses.replace(r, turn_rad=r.time_s - r.time_s[0]) for r in runs]
        factor = (
            known.scale_factor if known.scale_factor is not None else nominal_scale_factor(mode)
        )
        start = (
            float(
                base_fit(turning, dataclasses.replace(known, scale_factor=None), blocks).p[
                    SCALE_FACTOR
                ]
            )
            / factor
        )
    found = rate_offset.rate_offset(runs, known, blocks, start)
    noise = inference.inflation(found.fit)[0]
    verdict = judge_parameters(
        found.fit,
        [envelope_runs.turn_table(r, found.value) for r in runs],
        known,
        noise * found.beside,
    )
    std = found.std * float(np.sqrt(verdict.details["variance_factor"]))
    factor = float(found.fit.p[SCALE_FACTOR])
    seen = max(abs(found.value), abs(found.fit.p[DAMPING] / factor))
    unclear = not std < 0.3 * seen or (known.scale_factor is not None and is_one_rate(found.fit))
    span = 2 * max(
        float(np.ptp(ellipse.unwrap(*ellipse.wave(r.envelope, 1)[2:], 1)[0]))
        for r in found.fit.response.batch.runs
    )
    closing.close_verdict(
        verdict,
        [
            checks.holds(
                "rate_offset_converged",
                found.converged,
                "the unknown rate did not settle; give the rate, or runs at several angles",
            ),
            checks.holds(
                "rate_is_distinct",
                not unclear,
                "an unknown rate is ill-conditioned here (condition number"
                f" {verdict.condition:.3g}, {found.distinct:.1g} of its information is its own):"
                f" the wave passes {np.degrees(span):.0f}° of the 360° of 2mθ, where a steady rate"
                " and a damping split turn it alike, and the residual's own structure decides"
                " between them; give the rate, or runs at several angles",
            ),
        ],
    )
    logged = max(float(np.ptp(r.turn_rad)) for r in runs) > 0
    verdict.details["rate_rad_s"] = {
        "value": found.value,
        "std": std,
        "scale_factor": factor,
        "of": "common offset of the logged rates" if logged else "constant rate of all runs",
        "logged_mean_rad_s": [float((r.turn_rad[-1] - r.turn_rad[0]) / r.duration_s) for r in runs],
    }
    if not told and known.scale_factor is not None:
        verdict.values.pop("scale_factor", None)
    return verdict


def _rates_differ(runs: Sequence[EnvelopeRun]) -> bool:
    """Whether the runs' logged rates differ enough between or within them for K to be seen beside a
    common offset."""
    rate = np.concatenate([np.diff(r.turn_rad) / np.diff(r.time_s) for r in runs])
    low, high = np.quantile(rate, [0.01, 0.99])
    return bool(high - low > 0.1 * max(abs(low), abs(high)) > 0)


def profile_intervals(verdict: Verdict, runs: Sequence[EnvelopeRun]) -> dict[str, Any]:
    """Profile-likelihood intervals of the verdict's fit."""
    assert verdict.fit is not None
    return resampling.profile(
        verdict.fit,
        runs[0].mode_number,
        {n: verdict.std[n] for n in verdict.values},
        verdict.details["variance_factor"],
    )


def resample_errors(verdict: Verdict, draws: int, seed: int) -> None:
    """Replace the errors by those of a block bootstrap and keep its 68 and 95 % intervals."""
    assert verdict.fit is not None
    p = resampling.bootstrap(verdict.fit, draws, seed)
    mode = verdict.mode_number
    table = np.array([coordinates.to_parameters(row, mode)[0] for row in p])
    centre = coordinates.to_parameters(verdict.fit.p, mode)[0]
    period = np.pi / mode
    for axis in (2, 4):
        table[:, axis] = (
            centre[axis] + np.mod(table[:, axis] - centre[axis] + period / 2, period) - period / 2
        )
    covariance, own = np.cov(table.T), np.cov(p.T)
    inference.widen_axes(covariance, own, verdict.fit.p, mode)
    verdict.covariance[1:, 1:] = covariance
    intervals = {}
    for row, name in enumerate(ORDER[1:]):
        if name in verdict.values:
            verdict.std[name] = float(np.sqrt(covariance[row, row]))
            intervals[name] = {
                "68": [float(v) for v in np.quantile(table[:, row], [0.16, 0.84])],
                "95": [float(v) for v in np.quantile(table[:, row], [0.025, 0.975])],
            }
    verdict.details |= state_splits(verdict.values, verdict.std, verdict.fit.p, own)
    verdict.details["bootstrap"] = {
        "draws": draws,
        "blocks_a_run": resampling.BLOCKS_A_RUN,
        "intervals": intervals,
    }
