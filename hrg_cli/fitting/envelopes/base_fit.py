"""From free runs to the likelihood's optimum: rough guess, propagator, exact averaging into blocks,
Gauss–Newton, phase order."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...errors import HrgError
from . import phase_course, propagator, rows
from .base_freedom import Known, freedom, nominal_scale_factor, without_second_order
from .coordinates import COUNT, SCALE_FACTOR, SECOND_ORDER
from .envelope_runs import EnvelopeRun
from .likelihood import Batch, Fit, Freedom, fit, make_batch

Array = np.ndarray
MAX_PHASE_ORDER = 9
AVERAGINGS = 8
SHARES = (0.1, 0.3, 0.6, 1.0)
"""Parts of the runs over which a fit that does not settle grows."""
WRAPPED_RAD = 0.7
"""Turn of the wave within one window from which its ellipse may turn half way round unseen."""
SETTLED = 0.1
"""Part of a standard deviation by which rows averaged along the fit's own motion, or twice as many,
may still move the fit."""
PHASE_GAIN = 30.0
"""Δχ² for which two further orders of a run's phase are taken in."""
SECOND_ORDER_REACH = 3.0
"""Distance from 0.5 above which the scale of the second-order correction, truly 0 or 1, is held at
1."""
MISFIT = 1.5
"""χ² per degree of freedom above which something else than noise moves the scale of the second
order."""
SECOND_ORDER_DECIDED = 16.0
"""Difference of χ² between the scales 0 and 1 for which the better one is held, and distance² up to
which it counts as met."""


def check_runs(runs: Sequence[EnvelopeRun]) -> None:
    """HrgError: no run, or runs of different mode numbers."""
    if not runs:
        raise HrgError("there is no run; give at least one wave file of a free run-down")
    modes = sorted({r.mode_number for r in runs})
    if len(modes) > 1:
        raise HrgError(
            f"the runs have mode numbers {', '.join(map(str, modes))}, one was expected; identify"
            " them apart"
        )


def start_from_propagator(
    runs: Sequence[EnvelopeRun], known: Known, from_shortest: bool = False
) -> tuple[Array, Array, Array, Freedom]:
    """Coordinates (7,), frequency offsets (R,), covariance of z and its freedom, by the propagator
    from a rough guess, over lags from the longest that it follows, or from the shortest."""
    span = max(r.duration_s for r in runs)
    p, offsets = propagator.guess_roughly(runs)
    if known.scale_factor is not None:
        p[SCALE_FACTOR] = known.scale_factor
    most = max(propagator.START_BLOCKS, rows.MOST_ROWS // len(runs))
    thin = propagator.thin_to_beats(runs, p, offsets, propagator.START_BLOCKS, most)
    space = freedom(known, p, runs[0].mode_number, span)
    p = space.origin + space.directions @ np.linalg.pinv(space.directions) @ (p - space.origin)
    p, offsets, covariance = propagator.identify(thin, space, p, offsets, from_shortest)
    return p, offsets, covariance, space


def fit_base_model(
    runs: Sequence[EnvelopeRun], known: Known | None = None, blocks: int = 300
) -> Fit:
    """The likelihood's optimum over free runs; averaged envelopes, phase orders as the data demand.

    HrgError: no run, mixed mode numbers, or nothing that can be fitted.
    """
    check_runs(runs)
    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            best = _fit_free_runs(runs, known or Known(), blocks)
    except np.linalg.LinAlgError:
        best = None
    if best is None or has_run_away(best):
        raise HrgError(
            f"{runs[0].run_id or 'the run'}{' and others' if len(runs) > 1 else ''}: no run-down of"
            f" a resonator can be fitted; {_advice(runs, known or Known())}"
        )
    return best


def has_run_away(result: Fit) -> bool:
    """Whether a fit has left what numbers can hold: not finite, or its information is not."""
    with np.errstate(over="ignore", invalid="ignore"):
        seen = (result.p, result.chi2, np.square(result.root), np.square(result.data_root))
    return not all(np.all(np.isfinite(values)) for values in seen)


def _advice(runs: Sequence[EnvelopeRun], known: Known) -> str:
    """What to do where nothing can be fitted: shorter windows where the table turns the wave by
    much within one."""
    factor = (
        known.scale_factor
        if known.scale_factor is not None
        else nominal_scale_factor(runs[0].mode_number)
    )
    turning = [rows.estimate_speed(r, np.eye(COUNT)[5] * factor) * r.window_s for r in runs]
    worst = int(np.argmax(turning))
    if turning[worst] < WRAPPED_RAD:
        return "look at the envelopes"
    return (
        f"{runs[worst].run_id or 'the run'} turns by {turning[worst]:.2g} rad within one window of"
        f" {runs[worst].window_s:.3g} s, so its turns are lost: demodulate with windows of at most"
        f" {runs[worst].window_s * 0.25 / turning[worst]:.2g} s"
    )


def _fit_free_runs(runs: Sequence[EnvelopeRun], known: Known, blocks: int) -> Fit | None:
    courses = phase_course.find_bends(runs, _rough_scale_factor(runs, known))
    # normal modes that decay unequally hand the wave over, which bends its phase too: that is the
    # model's own, and taken off as a course it would be missed
    plain = None if courses is None else _fit_at_once(runs, known, blocks)
    if plain is not None:
        courses = None
    result = plain or _first_fit(
        runs if courses is None else phase_course.straighten_phases(runs, courses), known, blocks
    )
    if result is None or has_run_away(result):
        return None
    if courses is not None:
        seen, phase = phase_course.bend_back(
            result.response.batch, runs, courses, result.response.state.phase
        )
        data = make_batch(seen)
        result = solve(data, result.freedom, result.z, data.envelope[:, 0], phase)
    result = settle_averages(runs, grow_phase_orders(result), blocks)
    held = None if has_run_away(result) else decide_second_order(result)
    if held is not None:
        space = without_second_order(result.freedom, held)
        state = result.response.state
        result = settle_averages(
            runs,
            grow_phase_orders(
                solve(result.response.batch, space, result.z[:-1], state.start, state.phase)
            ),
            blocks,
        )
    return result


def _rough_scale_factor(runs: Sequence[EnvelopeRun], known: Known) -> float:
    """K as told, or roughly as the runs show it, within what any resonator may have."""
    if known.scale_factor is not None:
        return known.scale_factor
    if max(float(np.ptp(r.turn_rad)) for r in runs) == 0:
        return 0.0
    return float(np.clip(propagator.guess_roughly(runs)[0][5], -1.0, 1.0))


def _first_fit(runs: Sequence[EnvelopeRun], known: Known, blocks: int) -> Fit | None:
    """From the propagator's start, or, where that leads nowhere, from other ones: the best of them, by
    χ² a degree of freedom, for their rows differ."""
    best: Fit | None = None
    for p, offsets in _starts(runs, known):
        for held_first in (False, True):
            result = _fit_from_start(runs, known, blocks, p, offsets, held_first)
            if result is None or has_run_away(result):
                continue
            if best is None or result.chi2 / result.dof < best.chi2 / best.dof:
                best = result
            if _is_noise(best):
                return best
    return best


def _fit_at_once(runs: Sequence[EnvelopeRun], known: Known, blocks: int) -> Fit | None:
    """From the propagator's start; None where that does not lead to the noise."""
    p, offsets, _, _ = start_from_propagator(runs, known)
    result = _fit_from_start(runs, known, blocks, p, offsets, held_first=False)
    return result if result is not None and _is_noise(result) else None


def _is_noise(result: Fit) -> bool:
    return not has_run_away(result) and result.converged and result.chi2 < MISFIT * result.dof


def _starts(runs: Sequence[EnvelopeRun], known: Known) -> Iterator[tuple[Array, Array]]:
    """Coordinates (7,) and frequency offsets (R,): by the propagator over what a rough guess follows,
    over all lags (a weak normal mode that beats is not seen to be missed), and roughly."""
    first, of_runs, _, _ = start_from_propagator(runs, known)
    yield first, of_runs
    p, offsets, _, _ = start_from_propagator(runs, known, from_shortest=True)
    if not (np.array_equal(p, first) and np.array_equal(offsets, of_runs)):
        yield p, offsets
    plain, offsets = propagator.guess_roughly(runs)
    plain[5] = known.scale_factor if known.scale_factor is not None else plain[5]
    yield plain, offsets


def grow_phase_orders(result: Fit) -> Fit:
    """The fit with further orders of the runs' phases as long as one of them gains much by two
    more."""
    while (
        result.response.state.phase.shape[1] < MAX_PHASE_ORDER and result.phase_demand > PHASE_GAIN
    ):
        state = result.response.state
        phase = np.concatenate([state.phase, np.zeros((len(state.phase), 2))], axis=1)
        result = fit(result.response.batch, result.freedom, result.z, state.start, phase)
    return result


def settle_averages(runs: Sequence[EnvelopeRun], result: Fit, blocks: int) -> Fit:
    """The fit to rows averaged along its own motion: averaged and fitted again until that moves it
    by less than a tenth of σ.

    Where the rate changes within a run the rows are also doubled until that moves nothing. What the
    last change was is kept (`Fit.truncation`, in standard deviations of whatever combination moved
    most).
    """
    last = np.inf
    for _ in range(AVERAGINGS):
        blocks = rows.count_rows(result.p, runs, blocks)
        if not np.all(np.isfinite(result.p)):
            return result
        before, result = result, _averaged_again(runs, result, blocks)
        last = measure_distance(before, result)
        if last > SETTLED:
            continue
        most = max(len(r) for r in runs)
        if blocks >= most or not _rate_varies(result.response.batch):
            break
        finer = min(2 * blocks, most)
        if finer * len(runs) > rows.MOST_ROWS:
            break
        before, result = result, _averaged_again(runs, result, finer)
        last = measure_distance(before, result)
        if last < SETTLED:
            break
        blocks = finer
    return replace(result, truncation=last)


def _averaged_again(runs: Sequence[EnvelopeRun], result: Fit, blocks: int) -> Fit:
    """The same fit to rows averaged along its own motion."""
    data = make_batch(rows.average_along(runs, result.response, blocks))
    state = result.response.state
    shift = data.span_s / result.response.batch.span_s
    phase = state.phase * shift[:, None] ** np.arange(1, state.phase.shape[1] + 1)
    return grow_phase_orders(solve(data, result.freedom, result.z, data.envelope[:, 0], phase))


def measure_distance(before: Fit, after: Fit) -> float:
    """Distance of two fits in standard deviations, along the combination of coordinates that moved
    most."""
    change = after.root @ (after.z - before.z)
    return float(np.linalg.norm(change) / np.sqrt(max(1.0, after.chi2 / after.dof)))


def decide_second_order(result: Fit) -> float | None:
    """0 or 1 where the data tell which of them scales the second-order correction, 1 where a misfit
    pulls at it; None: it stays free."""
    information = float(result.data_root[-1, -1]) ** 2  # the last coordinate, all others free
    mean, std = float(result.freedom.prior_mean[-1]), float(result.freedom.prior_std[-1])
    alone = float(result.p[SECOND_ORDER]) + (float(result.p[SECOND_ORDER]) - mean) / (
        std**2 * max(information, 1e-300)
    )  # without the prior
    distance2 = (
        (alone - np.array([0.0, 1.0])) ** 2 * information / max(1.0, result.chi2 / result.dof)
    )
    near = int(np.argmin(distance2))
    if distance2[near] < SECOND_ORDER_DECIDED < distance2[1 - near] - distance2[near]:
        return float(near)
    misfit = result.chi2 / result.dof > MISFIT
    return 1.0 if misfit or abs(result.p[SECOND_ORDER] - 0.5) > SECOND_ORDER_REACH else None


def _fit_from_start(
    runs: Sequence[EnvelopeRun],
    known: Known,
    blocks: int,
    p: Array,
    offsets: Array,
    held_first: bool,
) -> Fit | None:
    """Blocks along a first motion and Gauss–Newton from it; None where it leads nowhere.

    held_first: with the second order held until the phases have orders enough; one that bends pulls
    its scale to thousands, and the rest after it.
    """
    if not (np.all(np.isfinite(p)) and np.all(np.isfinite(offsets))):
        return None
    space = freedom(known, p, runs[0].mode_number, max(r.duration_s for r in runs))
    p = p.copy()
    p[SECOND_ORDER] = 1.0
    data = make_batch(propagator.thin_rows(runs, p, offsets, rows.count_rows(p, runs, blocks)))
    z = np.linalg.pinv(space.directions) @ (p - space.origin)
    start, phase = data.envelope[:, 0], (offsets * data.span_s)[:, None]
    try:
        if held_first:
            near = grow_phase_orders(solve(data, without_second_order(space), z[:-1], start, phase))
            state = near.response.state
            z, start, phase = np.append(near.z, 1.0), state.start, state.phase
        result = solve(data, space, z, start, phase)
    except np.linalg.LinAlgError:
        return None
    return result if np.isfinite(result.chi2) else None


def _rate_varies(data: Batch) -> bool:
    """Whether the rate changes within a run by more than 1 % of the largest rate."""
    rate, step = data.step_rate, data.step_s > 0
    ranges = [float(np.ptp(r[s])) for r, s in zip(rate, step)]
    return max(ranges) > 0.01 * float(np.abs(rate).max(initial=0.0))


def solve(data: Batch, space: Freedom, z: Array, first: Array, phase: Array) -> Fit:
    """Gauss–Newton; where it does not settle, again over growing parts of the runs from their
    beginning on.

    First with straight phases alone: higher orders that a tenth of a run fixes lead anywhere beyond
    it. A phase that bends by turns needs them all the same.
    """
    result = fit(data, space, z, first, phase)
    if result.converged:
        return result
    with contextlib.suppress(np.linalg.LinAlgError):
        straight = _grown(data, space, z, first, phase[:, :1], phase.shape[1])
        if straight.converged:
            return straight
    return _grown(data, space, z, first, phase, phase.shape[1])


def _grown(data: Batch, space: Freedom, z: Array, first: Array, phase: Array, orders: int) -> Fit:
    """Gauss–Newton over growing parts of the runs, each from where the last one ended; the whole with
    so many orders of phase."""
    for share in SHARES:
        kept = np.arange(data.time_s.shape[1]) < max(12, share * data.time_s.shape[1])
        part = replace(data, weight=data.weight * kept)
        if share == 1.0:
            phase = np.pad(phase, ((0, 0), (0, orders - phase.shape[1])))
        result = fit(part, space, z, first, phase)
        z, first, phase = result.z, result.response.state.start, result.response.state.phase
    return result
