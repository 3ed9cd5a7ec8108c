"""The likelihood's optimum judged: parameters with honest errors, what these runs cannot tell, and
which runs disagree."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...errors import HrgError, name_some
from ...fitting import checks
from ...fitting.causes.evidence import find_significance
from ...fitting.envelopes import inference
from ...fitting.envelopes.base_freedom import Known, choose_scale_factor, choose_scale_factor_spread
from ...fitting.envelopes.coordinates import SCALE_FACTOR, SECOND_ORDER
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...fitting.envelopes.likelihood import Fit
from ...physics import ellipse
from ...physics.resonator import PARAMETERS
from . import closing
from .outcome import Verdict
from .pooled_frequency import join_frequency, pool_frequencies
from .splits import state_splits

Array = np.ndarray
POOR_FIT = 1.5
"""χ² per degree of freedom above which the model does not hold within the noise."""
CONTRADICTION = 30.0
"""χ² per degree of freedom from which single runs are left out to see whether one contradicts the
rest, and the fall that shows it."""
DISAGREES = 5.0
"""Shift of the answer by one run, as improbable as so many σ of a single number, above which it
disagrees with the rest: six in ten million runs by chance, however many numbers a run tells."""
POSSIBLE = 3.0
"""Standard deviations of what is known of K of all resonators within which one is possible."""
CANDIDATES = 3
"""Runs at most that are left out one at a time."""
ORDER = tuple(name for name, _ in PARAMETERS)
"""Parameters in the contract's order, as the covariance has them."""
WORDS = {
    "damping": "the mean decay",
    "damping_cos": "the damping split along the electrodes",
    "damping_sin": "the damping split between the electrodes",
    "split_cos": "the frequency split along the electrodes",
    "split_sin": "the frequency split between the electrodes",
    "scale_factor": "the scale factor",
}


def judge_fit(
    fit: Fit, runs: Sequence[EnvelopeRun], known: Known, again: Callable[[Known], Fit]
) -> Verdict:
    """Judge a fit; a scale factor no run can tell is held and the rest fitted `again`.

    Parameters
    ----------
    fit
        The likelihood's optimum.
    runs
        Those it was fitted to.
    known
        What was held.
    again
        Fits the same runs with more held.

    Returns
    -------
    Verdict
        K is not among its values where no run tells it.

    Examples
    --------
    Nothing turned:

    >>> from hrg_cli.fitting.envelopes.base_fit import fit_base_model
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.verdict import judge_fit
    >>> runs = [draw_run_down(0.1, seed=1), draw_run_down(0.8, seed=2)]
    >>> fit = fit_base_model(runs)
    >>> verdict = judge_fit(fit, runs, Known(), lambda held: fit_base_model(runs, held))
    >>> print(verdict.flat[0].split(";")[0], "scale_factor" in verdict.values)
    scale_factor is not determined: no run was rotated False
    """
    notes: list[str] = []
    beside = None
    turning = max(float(np.ptp(r.turn_rad)) for r in runs)
    mode = runs[0].mode_number
    one_rate = is_one_rate(fit)
    if known.scale_factor is None and (turning == 0 or _flat_in(fit, "scale_factor") or one_rate):
        # held, not given up: the splits are told beside a K that theory knows to its spread
        nominal = choose_scale_factor(mode)
        beside_nominal = dataclasses.replace(known, scale_factor=nominal)
        held = again(beside_nominal)
        if not (turning and one_rate and _contradicts(held, fit, mode)):
            fit, known = held, beside_nominal
            notes.append(_say_held(nominal, turning, one_rate))
            if turning:
                spread = choose_scale_factor_spread(mode)
                beside = inference.widen_by_held(fit, SCALE_FACTOR, spread)
                notes[-1] += f"; the other errors hold for K = {nominal:g} ± {spread:g}"
    verdict = judge_parameters(fit, runs, known, beside)
    if notes:
        del verdict.values["scale_factor"]  # nobody said it and no run shows it
    verdict.flat = notes + verdict.flat
    return verdict


def _say_held(nominal: float, turning: float, one_rate: bool) -> str:
    """Why a scale factor is not told, `turning` being how far the table turned [rad]."""
    if turning == 0:
        why = "no run was rotated"
    elif one_rate:
        why = "at one rate and through part of a period only a damping split imitates it"
    else:
        why = f"the runs turn the table by {turning:.2g} rad at most"
    return (
        f"scale_factor is not determined: {why}; it is held at {nominal:g}, add runs at both signs"
        " of a larger rate"
    )


def _contradicts(held: Fit, free: Fit, mode: int) -> bool:
    """Whether runs show a scale factor that a resonator may have, and will have nothing of one that
    is held: a damping split that imitated it would make up for that."""
    factor, _ = inference.estimate_variance_inflation(free)
    beside = abs(free.p[SCALE_FACTOR] - choose_scale_factor(mode))
    possible = beside < POSSIBLE * choose_scale_factor_spread(mode)
    return bool(possible and held.chi2 - free.chi2 > CONTRADICTION * factor)


def is_one_rate(fit: Fit) -> bool:
    """Whether the runs' own systematic residual forbids telling K·Ω from a damping split.

    It does at one rate, over less than a period of 2mθ, where χ² is poor.

    Parameters
    ----------
    fit
        The likelihood's optimum.

    Returns
    -------
    bool
        False where the rates differ by a tenth, a wave passes the period, or the fit leaves noise.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.base_fit import fit_base_model
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.verdict import is_one_rate
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> is_one_rate(fit_base_model(runs))
    False
    """
    data = fit.response.batch
    # KΩ turns a wave evenly, a damping split by sin 2mθ: over less than a period of 2mθ, and at
    # one rate, the two look alike but for noise
    rates = np.concatenate([r[s > 0] for r, s in zip(data.step_rate, data.step_s)])
    differ = float(np.ptp(rates)) > 0.1 * float(np.abs(rates).max())
    spans = [
        float(np.ptp(ellipse.unwrap(*ellipse.find_wave(r.envelope, 1)[2:], 1)[0])) * 2
        for r in data.runs
    ]
    factor, _ = inference.estimate_variance_inflation(fit)
    return not differ and max(spans) < 2 * np.pi and factor > 2


def judge_parameters(
    fit: Fit, runs: Sequence[EnvelopeRun], known: Known, beside: Array | None = None
) -> Verdict:
    """Parameters, errors and sentences of one fit.

    Parameters
    ----------
    fit
        The likelihood's optimum.
    runs
        Those it was fitted to.
    known
        What was held.
    beside
        Covariance of z (k, k) by what stands beside it; None: nothing.

    Returns
    -------
    Verdict
        With the closing checks, flat directions and runs that disagree.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.base_fit import fit_base_model
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.verdict import judge_parameters
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> verdict = judge_parameters(fit_base_model(runs), runs, Known())
    >>> verdict.flat, verdict.suspect, all(check.passed for check in verdict.checks)
    ([], [], True)
    """
    mode = runs[0].mode_number
    factor, colour = inference.estimate_variance_inflation(fit)
    between = np.zeros((len(fit.freedom.names),) * 2) if beside is None else beside
    # runs that disagree by more than their noise: what one run says moves the mean of all, and
    # that spread is added to what noise alone would leave
    if fit.chi2 / fit.dof > POOR_FIT:
        between = between + inference.compute_between_runs(fit)
    of_z = inference.compute_covariance_z(fit, factor) + between
    values, covariance = inference.compute_parameter_covariance(fit, factor, mode, between)

    pooled = pool_frequencies(inference.estimate_run_frequencies(fit, factor))
    full = join_frequency(fit, covariance, of_z, pooled.runs, pooled.weight, mode)
    full[0, 0] += pooled.more_variance
    order = list(ORDER)
    std = dict(zip(order, np.sqrt(np.maximum(0.0, np.diag(full)))))
    condition, flat = inference.find_flat_directions(fit, factor)
    rows = np.array([len(r) for r in fit.response.batch.runs])
    run_dof = np.maximum(1, 4 * rows - 4 - fit.response.state.phase.shape[1])
    verdict = Verdict(
        dict(zip(order, [pooled.mean_hz, *map(float, values)])),
        std,
        order,
        full,
        fit.chi2 / fit.dof,
        condition,
        fit.run_chi2 / run_dof,
        _residual_rms(fit),
        rows,
        flat=[_describe_flat_direction(f, fit, runs) for f in flat],
        mode_number=mode,
        fit=fit,
    )
    verdict.details = pooled.list_details() | _details_of(fit, known, mode, factor, colour)
    verdict.details |= state_splits(
        verdict.values, verdict.std, fit.p, _expand_covariance(fit, of_z)
    )
    _check_fit(verdict, fit, runs, colour)
    verdict.suspect.extend(verdict.flat)
    verdict.suspect.extend(_disagreements(verdict, fit, runs))
    return verdict


def _residual_rms(fit: Fit) -> Array:
    """Rms residual (r,) of each run in the units of its envelopes."""
    return np.array(
        [
            float(np.sqrt(c / len(r) / 4) * r.std.mean())
            for c, r in zip(fit.run_chi2, fit.response.batch.runs)
        ]
    )


def _details_of(fit: Fit, known: Known, mode: int, factor: float, colour: float) -> dict[str, Any]:
    """What the record keeps of the fit: its order, noise, what was held, and the least σ there
    is (Cramér–Rao)."""
    _, bound = inference.compute_parameter_covariance(fit, 1.0, mode)
    least = map(float, np.sqrt(np.maximum(0.0, np.diag(bound))))
    return {
        "phase_order": int(fit.response.state.phase.shape[1]),
        "second_order": {"value": float(fit.p[SECOND_ORDER]), "std": read_second_order_std(fit)},
        "iterations": fit.iterations,
        "variance_factor": factor,
        "colour": colour,
        "held": {k: v for k, v in dataclasses.asdict(known).items() if v is not None},
        "cramer_rao_std": dict(zip(list(ORDER)[1:], least)),
    }


def _expand_covariance(fit: Fit, z: Array) -> Array:
    """Covariance (7, 7) of the coordinates by that of z (k, k)."""
    return np.asarray(fit.freedom.directions @ z @ fit.freedom.directions.T)


def read_second_order_std(fit: Fit) -> float:
    """Standard deviation of the second-order scale, 0 where it is held.

    Parameters
    ----------
    fit
        The likelihood's optimum.

    Returns
    -------
    float
        Of the coordinate `second_order`, dimensionless.

    Examples
    --------
    Among coordinates without it:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.identification.verdict import read_second_order_std
    >>> read_second_order_std(Told(freedom=Told(names=("damping", "scale_factor"))))
    0.0
    """
    return (
        float(np.sqrt(fit.compute_covariance_z()[-1, -1]))
        if fit.freedom.names[-1] == "second_order"
        else 0.0
    )


def _check_fit(verdict: Verdict, fit: Fit, runs: Sequence[EnvelopeRun], colour: float) -> None:
    """The closing checks into the verdict: bounds, what the residuals are, truncation, blur."""
    refusing, doubting = closing.check_bounds(verdict)
    residual = fit.response.compute_residual()
    left = [
        np.concatenate([r[: len(run)].real, r[: len(run)].imag], axis=1)
        for r, run in zip(residual, fit.response.batch.runs)
    ]
    statistics = checks.check_statistics(
        fit.chi2,
        fit.dof,
        left,
        sentence=(
            f"χ²/dof = {verdict.chi2_per_dof:.3g}: the linear resonator leaves more than the noise;"
            " the errors are inflated, run diagnose to see why"
        ),
        coloured=(
            f"the residuals are coloured: their slow part is {colour:.2g} times white noise of the"
            " same power; the errors are inflated by that"
        ),
    )
    truncated = checks.check_at_most(
        "row_truncation",
        fit.truncation,
        closing.SETTLED,
        f"averaging finer or along the better motion still moves the answer by {fit.truncation:.2g}"
        " σ; give shorter or fewer runs",
    )
    settled = (
        f"the fit did not settle in {fit.iterations} iterations; look at the runs' residuals or"
        " give fewer, cleaner runs"
    )
    closing.close_verdict(
        verdict,
        [*checks.check_fit(verdict.covariance, fit.converged, settled), *refusing],
        [*statistics, truncated, closing.blur(fit, runs), *doubting],
    )


def _disagreements(verdict: Verdict, fit: Fit, runs: Sequence[EnvelopeRun]) -> list[str]:
    """A sentence for each run that moves the answer or fits far worse than the rest; one of
    all where half of them or more do: a wrong run takes the answer with it, and so does a wrong
    model."""
    moved, directions = inference.measure_run_shifts(fit, verdict.details["variance_factor"])
    shifts = np.array([find_significance(*one)[0] for one in zip(moved, directions, strict=True)])
    typical = np.median(verdict.run_chi2_per_dof)
    if len(runs) == 2 and shifts.max() > DISAGREES:
        return [
            f"the two runs disagree (by {shifts.max():.2g} σ); two cannot tell which is wrong:"
            " check both rate logs, or add a third run"
        ]
    odd = [
        (run.run_id or "a run", shift, chi2)
        for run, shift, chi2 in zip(runs, shifts, verdict.run_chi2_per_dof)
        if shift > DISAGREES or (len(runs) > 2 and chi2 > 3 * typical and chi2 > POOR_FIT)
    ]
    if len(runs) > 2 and 2 * len(odd) >= len(runs):
        return [
            f"{name_some([name for name, *_ in odd])} each disagree with the rest (shifts up to"
            f" {shifts.max():.2g} σ): which of them is wrong, or whether the model is, these runs"
            " do not tell; run diagnose, or leave them out in turn and compare"
        ]
    return [
        f"{name} disagrees with the rest (χ²/dof {chi2:.3g}, shift {shift:.2g} σ); leave it out and"
        " compare"
        for name, shift, chi2 in odd
    ]


def refuse_contradictions(
    verdict: Verdict, runs: Sequence[EnvelopeRun], again: Callable[[Sequence[EnvelopeRun]], Fit]
) -> None:
    """Refuse a fit that one run spoils: the worst are left out in turn, those named that spoil it.

    Two runs can only say that they contradict each other, and of three, two left over agree easily:
    then none is named, or all that may be the wrong one.

    Parameters
    ----------
    verdict
        Of all runs; its `refused` is added to.
    runs
        Those it was fitted to.
    again
        Fits what is left of them.

    Examples
    --------
    The rate log of the first run has the wrong sign:

    >>> from dataclasses import replace
    >>> from hrg_cli.fitting.envelopes.base_fit import fit_base_model
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.verdict import judge_parameters, refuse_contradictions
    >>> rates = {"a": 0.5, "b": -0.5, "c": 0.25, "d": -0.25}
    >>> runs = [draw_run_down(k, rates[n], run_id=n, seed=k) for k, n in enumerate(rates)]
    >>> runs[0] = replace(runs[0], turn_rad=-runs[0].turn_rad)
    >>> verdict = judge_parameters(fit_base_model(runs, blocks=100), runs, Known())
    >>> refuse_contradictions(verdict, runs, lambda rest: fit_base_model(rest, blocks=100))
    >>> print(*(sentence.split(" (χ²")[0] for sentence in verdict.refused))  # doctest: +ELLIPSIS
    χ²/dof = ...: the runs contradict each other; leave out a
    """
    if len(runs) < 2 or verdict.chi2_per_dof < CONTRADICTION:
        return
    found, unlogged = [], []
    for i in np.argsort(-verdict.run_chi2_per_dof)[:CANDIDATES]:
        try:
            fit = again([r for k, r in enumerate(runs) if k != i])
        except HrgError:
            continue
        if fit.chi2 / fit.dof < verdict.chi2_per_dof / CONTRADICTION:
            name = runs[i].run_id or f"run {i + 1}"
            found.append(f"{name} (χ²/dof {fit.chi2 / fit.dof:.3g} without it)")
            unlogged += [] if runs[i].rate_logged else [name]
    if not found:
        return
    bad = f"χ²/dof = {verdict.chi2_per_dof:.3g}: the"
    without = f" ({' and '.join(unlogged)} logs none)" if unlogged else ""
    if len(runs) == 2:
        verdict.refused.append(
            f"{bad} two runs contradict each other, though each alone is a resonator's; two cannot"
            f" tell which is wrong: check both rate logs{without}, or add a third run"
        )
    elif len(runs) == 3 and len(found) > 1:
        verdict.refused.append(
            f"{bad} three runs contradict each other; without {' or '.join(found)} the other two"
            f" agree, so it cannot be told which is wrong: check the rate logs{without}, or add a"
            " run"
        )
    else:
        mend = "correct its rate log" if len(unlogged) < len(found) else "log its rate"
        verdict.refused.append(
            f"{bad} runs contradict each other; leave out {' or '.join(found)}, or {mend}{without}"
        )


def _flat_in(fit: Fit, name: str) -> bool:
    """Whether a coordinate is known worse than 30 % of its natural scale."""
    if name not in fit.freedom.names:
        return False
    i = fit.freedom.names.index(name)
    factor, _ = inference.estimate_variance_inflation(fit)
    std = float(np.sqrt(fit.compute_covariance_z()[i, i] * factor))
    return std > inference.FLAT_FRACTION * float(inference.compute_natural_scales(fit)[i])


def _describe_flat_direction(flat: inference.Flat, fit: Fit, runs: Sequence[EnvelopeRun]) -> str:
    """A flat direction in words: what is mixed, how badly it is known, and the run that would fix
    it."""
    large = [int(i) for i in np.argsort(-np.abs(flat.direction)) if abs(flat.direction[i]) > 0.3]
    mixed = " and ".join(WORDS[fit.freedom.names[i]] for i in large)
    still = max(float(np.ptp(r.turn_rad)) for r in runs) == 0
    size = "not at all" if not flat.std < 10 else f"to {flat.std:.1g} of its natural size only"
    if len(runs) == 1 and still:
        tail = (
            "one run-down at rest fixes only the mean decay, net drift and net quadrature growth;"
            " add a run at another angle"
        )
    elif still:
        tail = "add a run-down from another angle, or one that rotates"
    else:
        tail = "add run-downs from other angles and at both signs of rotation"
    return f"{mixed} {'together are' if len(large) > 1 else 'is'} known {size}: {tail}"
