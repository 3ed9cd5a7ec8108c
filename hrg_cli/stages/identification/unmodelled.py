"""Whether something of the catalogue, too small for any other check, moves the resonator that is
told.

A damping that falls with the amplitude may take 60 off the χ² of 16 000 values, which is white and
1.00 to every test of the residual, and stand for 20 σ of the damping. Given that it is there, of
sensitivity S and estimate p̂ beside the resonator, the parameters stand by C Jᵀ S p̂ elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...effects import EFFECTS
from ...effects.effect import Effect
from ...fitting.causes import evidence
from ...fitting.causes.evidence import Score
from ...fitting.causes.extended_fit import ExtendedFit
from ...fitting.causes.moves import move_by_causes
from ...fitting.checks import Check, check_at_most
from ...fitting.envelopes import condensed, coordinates
from ...fitting.envelopes.averaged_waves import to_wave
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...records import Wave
from ..diagnosis.base.data import bridge_gaps
from ..diagnosis.base.joint_fit import fit_base
from ..diagnosis.closing.summed import find_moves_of_summed
from ..diagnosis.fits.refits import take_plain_averaging
from ..diagnosis.fits.scoring import compute_worth, is_gross, score_effects
from ..diagnosis.fits.variants import Variant, list_variants
from ..diagnosis.suspects.cases import fit_or_none
from ..diagnosis.suspects.transformations import hold_rate, offset_rate
from ..diagnosis.thresholds import INADEQUATE, WORTH
from .closing import close_verdict
from .outcome import Verdict
from .splits import state_splits

Array = np.ndarray
MOVED = 3.0
"""Standard deviations of its own by which a cause that is there may move a parameter that is told
without a word."""


@dataclass(frozen=True)
class Mover:
    """A cause that stands out of the noise: what it is worth, its z, and the parameter that it
    moves most, by how many of that one's σ."""

    cause: str
    worth: float
    z: float
    parameter: str
    moved: float


def doubt_beside_causes(
    verdict: Verdict,
    runs: Sequence[EnvelopeRun],
    waves: Sequence[Wave],
    rate_rad_s: float | None,
    earth_rad_s: float,
    scale_factor: float | None,
    rows: int,
) -> None:
    """Add to a verdict the check that no cause which these runs show moves its parameters.

    Nothing is asked where the resonator does not hold the runs. More windows than fit into memory
    are asked by the averages that the answer rests on.

    Parameters
    ----------
    verdict
        Of all runs, closed but for this.
    runs
        That were fitted, on the table as it turned.
    waves
        Of the runs.
    rate_rad_s
        Constant rate of the table; None: as logged.
    earth_rad_s
        The Earth's part along the axis, which no log shows.
    scale_factor
        That is held; None: it is not known.
    rows
        Fewest averaged rows a run.

    Examples
    --------
    Of a record that shows two modes and no ellipse nothing is asked:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.identification.unmodelled import doubt_beside_causes
    >>> verdict = Told(values={"frequency_hz": 1e3, "damping_rate_1_s": 0.1}, refused=[], checks=[])
    >>> doubt_beside_causes(verdict, [], [], None, 0.0, None, 300)
    >>> verdict.checks
    []
    """
    modes_alone = "damping_split_1_s" not in verdict.values
    if modes_alone or verdict.refused:
        return
    if sum(map(len, waves)) > condensed.IN_MEMORY:  # the runs' turn holds their rates already
        logged = rate_rad_s is None
        turned = [_average(run, wave, logged) for run, wave in zip(runs, waves, strict=True)]
    else:
        turned = [_turn(wave, rate_rad_s, earth_rad_s) for wave in waves]
    fitted = partial(fit_base, scale_factor=scale_factor, blocks=rows, free_phase=False)
    fit = fit_or_none(turned, fitted)
    # rows of its own may lose their way where the answer's have not
    if fit is None or is_gross(fit):
        return
    candidates = list_variants([one for one in EFFECTS if not one.of_one_run], fit)
    ranked = score_effects(fit, candidates)
    averaged = take_plain_averaging(fit, ranked)
    if averaged is not None:
        fit, ranked = averaged, score_effects(averaged, candidates)
    close_verdict(
        verdict, doubtful=[_check(list(_list_movers(fit, ranked, len(candidates), verdict)))]
    )
    _widen_by_sums(fit, candidates, verdict)


def _average(run: EnvelopeRun, wave: Wave, logged: bool) -> Wave:
    """The wave of a run's averages; in its gaps the table goes on as logged, or evenly."""
    names = ("time_s", "temperature_degc", *(("rate_rad_s",) if logged else ()))
    every = max(1, len(wave) // condensed.SAMPLE)
    log = wave.only(names)
    thin = {
        name: np.asarray(column)[::every]
        for name in names
        if (column := getattr(log, name)) is not None
    }
    return to_wave(bridge_gaps(run, log.replace(**thin)), wave)


def _turn(wave: Wave, rate_rad_s: float | None, earth_rad_s: float) -> Wave:
    """A wave at the rate that it was identified at."""
    if rate_rad_s is not None or wave.rate_rad_s is None:
        wave = hold_rate(wave, rate_rad_s or 0.0)
    return offset_rate(wave, earth_rad_s)


def _list_movers(
    fit: ExtendedFit, ranked: Sequence[tuple[Score, Variant]], tried: int, verdict: Verdict
) -> Iterator[Mover]:
    """The causes that stand out of the noise as sure as they do for a diagnosis, and what each
    moves.

    What happens at an instant of one run is that run's, which is held against the others."""
    noise = float(verdict.details.get("variance_factor", 1.0))
    for score, variant in ranked:
        worth = compute_worth(score, variant, fit, noise) if score.visible else 0.0
        if worth < WORTH:
            continue
        z, p = evidence.find_significance(score.gain / noise, score.rank)
        if evidence.correct_for_tries(p, tried) < INADEQUATE:
            yield Mover(score.name, worth, z, *_find_moved_most(fit, score, verdict))


def _find_moved_most(fit: ExtendedFit, score: Score, verdict: Verdict) -> tuple[str, float]:
    """The parameter that a cause of the estimated size moves most, and by how many σ."""
    _, slopes = coordinates.to_parameters(fit.point.p, verdict.mode_number)
    moved = slopes @ move_by_causes(fit, [score])
    told = {
        name: abs(by) / verdict.std[name]
        for name, by in zip(verdict.order[1:], moved, strict=True)
        if name in verdict.values and verdict.std[name] > 0
    }
    return max(told.items(), key=lambda pair: pair[1])


def _widen_by_sums(fit: ExtendedFit, candidates: Sequence[Variant], verdict: Verdict) -> None:
    """Put into the covariance what a read-out does that these runs, at one rate, show as splits,
    and say of which parameters they show the sum."""
    of_read_out = [one for one in candidates if "another rate" in one.effect.shown_by]
    sums = find_moves_of_summed(fit, of_read_out)
    _, slopes = coordinates.to_parameters(fit.point.p, verdict.mode_number)
    names = verdict.order[1:]
    told = np.array([name in verdict.values and verdict.std[name] > 0 for name in names])
    moved: dict[str, set[str]] = {}
    more = np.zeros((len(names), len(names)))
    for cause, moves in sums.items():
        by = told[:, None] * (slopes @ moves)  # what was held stays held
        for name, size in zip(names, np.linalg.norm(by, axis=1), strict=True):
            if size > verdict.std[name]:
                moved.setdefault(name, set()).add(cause)
        more += by @ by.T
    if not moved:
        return
    verdict.covariance[1:, 1:] += more
    _bound_axes(verdict)
    verdict.details["sum_with"] = {name: sorted(causes) for name, causes in moved.items()}
    spread = np.sqrt(np.maximum(np.diag(verdict.covariance), 0.0))
    verdict.std.update(zip(verdict.order, map(float, spread), strict=True))
    whole = fit.coordinate_covariance() + sum(one @ one.T for one in sums.values())
    verdict.details |= state_splits(verdict.values, verdict.std, fit.point.p, whole)
    every = ", ".join(_describe_usual(one.effect) for one in of_read_out if one.effect.name in sums)
    verdict.flat.append(
        f"{', '.join(moved)}: at one rate these runs show the sum with what the read-out does"
        f" (usual sizes: {every}); the errors hold for what is usual, and for what is larger as"
        " far as these runs show it; add runs at another rate,"
        " best of the other sign"
    )


def _describe_usual(effect: Effect) -> str:
    """A cause of one number with its usual size."""
    (size,) = effect.fitted()
    return f"{effect.name} {size.typical:g}{'' if size.units == '1' else f' {size.units}'}"


def _bound_axes(verdict: Verdict) -> None:
    """An axis that nothing is known of is uniform over its period."""
    for place, name in enumerate(verdict.order):
        std = float(np.sqrt(verdict.covariance[place, place]))
        most = np.pi / verdict.mode_number / np.sqrt(12)
        if name.endswith("axis_rad") and std > most:
            verdict.covariance[place] *= most / std
            verdict.covariance[:, place] *= most / std


def _check(movers: Sequence[Mover]) -> Check:
    """The closing check of what the likely cause moves most, or one that is as likely."""
    if not movers:
        return check_at_most("unmoved_by_causes", 0.0, MOVED)
    best = max(movers, key=lambda one: one.worth)
    as_likely = [one for one in movers if one.worth > best.worth - WORTH]
    worst = max(as_likely, key=lambda one: one.moved)
    what = f"{best.cause} ({best.z:.2g} σ) or what is like it"
    if worst is not best:
        what = f"{best.cause} ({best.z:.2g} σ) or, as likely, {worst.cause}"
    return check_at_most(
        "unmoved_by_causes",
        worst.moved,
        MOVED,
        f"the runs show {what}, which moves {worst.parameter} by {worst.moved:.2g} of its standard"
        " deviations; run diagnose, which says what it is, or give runs without it",
    )
