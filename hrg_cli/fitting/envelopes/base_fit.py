"""From free runs to the likelihood's optimum: rough guess, propagator, exact averaging into blocks,
Gauss–Newton, phase order."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...errors import HrgError
from . import phase_course, propagator, rows
from .base_freedom import Known, choose_scale_factor, hold_second_order, make_freedom
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
MISFIT = 1.5
"""χ² per degree of freedom above which something else than noise moves the scale of the second
order."""
SECOND_ORDER_DECIDED = 16.0
"""Difference of χ² between the scales 0 and 1 of the second-order correction for which the better
one is held, and distance² up to which it counts as met; where neither is, it is held at 1."""


def check_runs(runs: Sequence[EnvelopeRun]) -> None:
    """That there is a run, and that all have one mode number.

    Parameters
    ----------
    runs
        To be fitted together.

    Raises
    ------
    HrgError
        No run, or runs of different mode numbers.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_fit import check_runs
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> t = np.arange(3.0)
    >>> runs = [
    ...     EnvelopeRun("", t, np.ones((3, 2)), 0 * t + 1, 0 * t, None, 5e3, m, 1.0) for m in (2, 3)
    ... ]
    >>> check_runs(runs)
    Traceback (most recent call last):
    hrg_cli.errors.HrgError: the runs have mode numbers 2, 3, one was expected; identify them apart
    """
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
    """A start by the propagator from a rough guess.

    Parameters
    ----------
    runs
        R free ones.
    known
        What is held.
    from_shortest
        Whether over all lags, not from the longest that the guess follows.

    Returns
    -------
    tuple of ndarray and Freedom
        Coordinates (7,), frequency offsets (R,) [rad/s], covariance of z, and its freedom.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_fit import start_from_propagator
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 20.0, 0.05), np.array([0.1, 0.02, 0.01, 0.2, 0.1, 0.3, 0.0])
    >>> u = exponentiate(build_generator(p, 1.0, 3e4) + 0.7j * np.eye(2), t) @ [1.0, 0.1j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, t, None, 5e3, 2, 0.05)
    >>> found, offsets, _, _ = start_from_propagator([run], Known())
    >>> found[:6].round(3).tolist(), offsets.round(3).tolist()
    ([0.1, 0.02, 0.01, 0.2, 0.1, 0.3], [0.7])
    """
    span = max(r.duration_s for r in runs)
    p, offsets = propagator.guess_roughly(runs)
    if known.scale_factor is not None:
        p[SCALE_FACTOR] = known.scale_factor
    most = max(propagator.START_BLOCKS, rows.MOST_ROWS // len(runs))
    thin = propagator.thin_to_beats(runs, p, offsets, propagator.START_BLOCKS, most)
    space = make_freedom(known, p, runs[0].mode_number, span)
    p = space.origin + space.directions @ space.locate(p)
    p, offsets, covariance = propagator.identify(thin, space, p, offsets, from_shortest)
    return p, offsets, covariance, space


def fit_base_model(
    runs: Sequence[EnvelopeRun], known: Known | None = None, blocks: int = 300
) -> Fit:
    """The likelihood's optimum over free runs; averaged envelopes, phase orders as the data demand.

    Parameters
    ----------
    runs
        Free ones of one gyro.
    known
        What is held; None: nothing.
    blocks
        Rows to which each run is averaged at least.

    Returns
    -------
    Fit
        The optimum.

    Raises
    ------
    HrgError
        No run, mixed mode numbers, or nothing that can be fitted.

    Examples
    --------
    A frequency that falls by 0.2 rad/s² beside the motion of a resonator:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_fit import fit_base_model
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 20.0, 0.05), np.array([0.1, 0.02, 0.01, 0.2, 0.1, 0.3, 1.0])
    >>> u = exponentiate(build_generator(p, 1.0, 2 * np.pi * 5e3), t) @ [1.0, 0.1j]
    >>> u = u * np.exp(-0.1j * t**2)[:, None]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, t, None, 5e3, 2, 0.05)
    >>> fit_base_model([run]).p[:6].round(4).tolist()
    [0.1, 0.02, 0.01, 0.2, 0.1, 0.3]
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
    """Whether a fit has left what numbers can hold: not finite, or its information is not.

    Parameters
    ----------
    result
        A fit.

    Returns
    -------
    bool
        True where it has.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_fit import has_run_away
    >>> known = dict(p=np.zeros(7), chi2=3.0, data_root=np.eye(2))
    >>> has_run_away(SimpleNamespace(root=np.eye(2), **known))
    False
    >>> has_run_away(SimpleNamespace(root=1e200 * np.eye(2), **known))
    True
    """
    with np.errstate(over="ignore", invalid="ignore"):
        seen = (result.p, result.chi2, np.square(result.root), np.square(result.data_root))
    return not all(np.all(np.isfinite(values)) for values in seen)


def _advice(runs: Sequence[EnvelopeRun], known: Known) -> str:
    """What to do where nothing can be fitted: shorter windows where the table turns the wave by
    much within one."""
    factor = (
        known.scale_factor
        if known.scale_factor is not None
        else choose_scale_factor(runs[0].mode_number)
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
        space = hold_second_order(result.freedom, held)
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
    """From the propagator's start, or, where that leads nowhere, from other ones: the best of them,
    by χ² per degree of freedom, for their rows differ."""
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
    """Coordinates (7,) and frequency offsets (R,): by the propagator over what a rough guess
    follows, over all lags (a weak normal mode that beats is not seen to be missed), and roughly."""
    first, of_runs, _, _ = start_from_propagator(runs, known)
    yield first, of_runs
    p, offsets, _, _ = start_from_propagator(runs, known, from_shortest=True)
    if not (np.array_equal(p, first) and np.array_equal(offsets, of_runs)):
        yield p, offsets
    plain, offsets = propagator.guess_roughly(runs)
    plain[5] = known.scale_factor if known.scale_factor is not None else plain[5]
    yield plain, offsets


def grow_phase_orders(result: Fit) -> Fit:
    """The fit with further orders of the runs' phases as long as a run gains much by two more.

    Parameters
    ----------
    result
        A fit.

    Returns
    -------
    Fit
        With up to `MAX_PHASE_ORDER` orders; the same one where none is asked for.

    Examples
    --------
    A phase of 0.1·t² asks for more than a straight line:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_fit import grow_phase_orders
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 5.0, 101)
    >>> u = np.outer(np.exp(-0.1 * t + 0.1j * t**2), [1, 0j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.05)
    >>> space = free_coordinates(["damping"], np.zeros(7))
    >>> straight = fit(make_batch([run]), space, np.array([0.1]), u[:1], np.zeros((1, 1)))
    >>> grow_phase_orders(straight).response.state.phase.round(4) + 0
    array([[0. , 2.5, 0. ]])
    """
    while (
        result.response.state.phase.shape[1] < MAX_PHASE_ORDER and result.phase_demand > PHASE_GAIN
    ):
        state = result.response.state
        phase = np.concatenate([state.phase, np.zeros((len(state.phase), 2))], axis=1)
        result = fit(result.response.batch, result.freedom, result.z, state.start, phase)
    return result


def settle_averages(runs: Sequence[EnvelopeRun], result: Fit, blocks: int) -> Fit:
    """The fit to rows averaged along its own motion, until that moves it by less than a tenth of σ.

    Where the rate changes within a run the rows are also doubled until that moves nothing.

    Parameters
    ----------
    runs
        With all their windows.
    result
        A fit to averages of them.
    blocks
        Rows of each run at least.

    Returns
    -------
    Fit
        What the last change was is kept in `truncation`, in standard deviations of whatever
        combination moved most.

    Examples
    --------
    A run averaged along no motion at all, put right:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_fit import settle_averages
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.propagator import thin_rows
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 20.0, 2001)
    >>> u = np.outer(np.exp(-0.5 * t), [1, 0j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.01)
    >>> space = free_coordinates(["damping"], np.zeros(7))
    >>> data = make_batch(thin_rows([run], np.zeros(7), np.zeros(1), 20))
    >>> rough = fit(data, space, np.array([0.4]), data.envelope[:, 0], np.zeros((1, 1)))
    >>> found = settle_averages([run], rough, 20)
    >>> bool(found.chi2 < 1e-6 < rough.chi2), round(float(found.p[0]), 6), found.truncation < 0.1
    (True, 0.5, True)
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
    """Distance of two fits, along the combination of coordinates that moved most.

    Parameters
    ----------
    before, after
        Of the same coordinates.

    Returns
    -------
    float
        In standard deviations of the later one.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_fit import measure_distance
    >>> after = SimpleNamespace(z=np.array([3.0, 4.0]), root=np.eye(2), chi2=90.0, dof=100)
    >>> measure_distance(SimpleNamespace(z=np.zeros(2)), after)
    5.0
    """
    change = after.root @ (after.z - before.z)
    return float(np.linalg.norm(change) / np.sqrt(max(1.0, after.chi2 / after.dof)))


def decide_second_order(result: Fit) -> float | None:
    """What scales the second-order correction, where the data or a misfit tell.

    Parameters
    ----------
    result
        A fit with the correction as its last coordinate.

    Returns
    -------
    float or None
        0 or 1, the better one by far; 1 where a misfit pulls at it; None: it stays free.

    Examples
    --------
    A scale of 0.9 ± 0.1, which 1 is near and 0 is not, and one of 0.6 ± 0.4:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_fit import decide_second_order
    >>> def make_fit(scale, std):
    ...     prior = SimpleNamespace(prior_mean=np.array([0.5]), prior_std=np.array([0.5]))
    ...     p, root = np.append(np.zeros(6), scale), np.array([[1 / std]])
    ...     return SimpleNamespace(p=p, data_root=root, freedom=prior, chi2=100.0, dof=100)
    >>> decide_second_order(make_fit(0.9, 0.1)), decide_second_order(make_fit(0.6, 0.4))
    (1.0, None)
    """
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
    # neither is met: something else moves it, at one rate a gain mismatch that no χ² shows beside
    return (
        1.0 if result.chi2 / result.dof > MISFIT or distance2[near] > SECOND_ORDER_DECIDED else None
    )


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
    space = make_freedom(known, p, runs[0].mode_number, max(r.duration_s for r in runs))
    p = p.copy()
    p[SECOND_ORDER] = 1.0
    data = make_batch(propagator.thin_rows(runs, p, offsets, rows.count_rows(p, runs, blocks)))
    z = space.locate(p)
    start, phase = data.envelope[:, 0], (offsets * data.span_s)[:, None]
    try:
        if held_first:
            near = grow_phase_orders(solve(data, hold_second_order(space), z[:-1], start, phase))
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
    """Gauss–Newton; where it does not settle, again over growing parts of the runs.

    First with straight phases alone: higher orders that a tenth of a run fixes lead anywhere beyond
    it. A phase that bends by turns needs them all the same.

    Parameters
    ----------
    data
        The runs, R of them.
    space
        What is fitted, k directions.
    z
        First guess (k,).
    first
        Start states (R, 2), complex.
    phase
        Coefficients (R, orders) of (t/T)¹… [rad].

    Returns
    -------
    Fit
        Settled or not (`converged`).

    Examples
    --------
    A split of 4 rad/s guessed as 3.8, which is 4 rad off at the end of the run:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_fit import solve
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.likelihood import free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 20.0, 801)
    >>> u = np.stack([np.exp((4j - 0.1) * t), np.exp((-4j - 0.1) * t)], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.025)
    >>> space = free_coordinates(["damping", "split_cos"], np.zeros(7))
    >>> found = solve(make_batch([run]), space, np.array([0.1, 3.8]), u[:1], np.zeros((1, 1)))
    >>> found.converged, found.p[[0, 3]].round(4).tolist()
    (True, [0.1, 4.0])
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
    """Gauss–Newton over growing parts of the runs, each from where the last one ended; the whole
    with so many orders of phase."""
    for share in SHARES:
        kept = np.arange(data.time_s.shape[1]) < max(12, share * data.time_s.shape[1])
        part = replace(data, weight=data.weight * kept)
        if share == 1.0:
            phase = np.pad(phase, ((0, 0), (0, orders - phase.shape[1])))
        result = fit(part, space, z, first, phase)
        z, first, phase = result.z, result.response.state.start, result.response.state.phase
    return result
