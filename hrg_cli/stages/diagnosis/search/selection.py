"""Diagnosis, the causes: forward selection with refit, rivals, swaps and the backward check."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ....fitting.causes import evidence, extended_fit
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit
from ..base.joint_fit import settle_log
from ..drive.followed_walk import correct_for_walk, is_along_walk
from ..fits.refits import (
    HOPELESS,
    Trial,
    adopt_hopeful,
    compute_bic,
    free_higher_orders,
    hold_unseen,
    leave_out,
    loosen,
    refit,
    shortlist,
    take_plain_averaging,
)
from ..fits.scoring import compute_worth, count_places, is_gross, is_possible, score_effects
from ..fits.variants import Variant
from ..thresholds import GROSS, OUTDONE, SIGNIFICANT, TOGETHER, WORTH
from . import stand_in
from .gain import predicts_better
from .inquiry import Inquiry, NoiseLevel
from .pairs import TRIED, find_better_pair, find_hidden_pair, fit_pair, list_promising_pairs
from .remainder import is_told_by_one_term

Array = np.ndarray
GROSS_SHORTLIST = 10
"""Candidates refitted while the misfit is gross, when a score says little of the refit."""
PART_OF_BEST, BELOW_BEST = 0.6, 30.0
"""Part of the best score's gain in χ², or that much less of it, down to which causes are refitted
beside it."""
ROUNDS = 4
"""Shortlists tried when the refits of the first bring nothing."""


@dataclass(frozen=True)
class Found:
    """An accepted effect: score at its acceptance, what it cannot be told from, fit with it.

    sizes: of its parameters, with σ, where they do not come from the fit and are held in it.
    """

    variant: Variant
    score: Score
    tried: int
    delta_bic: float
    rivals: tuple[str, ...]
    sizes: Mapping[str, tuple[float, float]] | None = None

    @property
    def name(self) -> str:
        """Of the cause."""
        return self.variant.effect.name

    def add_rivals(self, names: Iterable[str]) -> Found:
        """The same, not told from these either; nothing is its own rival."""
        rivals = dict.fromkeys([*self.rivals, *names])
        rivals.pop(self.name, None)
        return replace(self, rivals=tuple(rivals))


@dataclass(frozen=True)
class Begun:
    """With what a selection begins: a fit, and the causes in it, which are not put to the choice
    again."""

    fit: ExtendedFit
    found: tuple[Found, ...] = ()


@dataclass(frozen=True)
class Search:
    """The selection's result: the fits, the accepted effects in order, the scores of all candidates
    beside the first and the last fit, and what it began with."""

    base: ExtendedFit
    final: ExtendedFit
    found: tuple[Found, ...]
    first: tuple[Score, ...]
    last: tuple[Score, ...]
    begun: Begun | None = None

    @property
    def start(self) -> Begun:
        """With what the choice began: the base fit where nothing else."""
        return Begun(self.base) if self.begun is None else self.begun

    def give_up(self, cause: Found, fit: ExtendedFit, candidates: Sequence[Variant]) -> Search:
        """The search in which a cause is given up; `fit`: the fit without it."""
        left = tuple(one for one in self.found if one.variant is not cause.variant)
        last = tuple(score for score, _ in score_effects(fit, candidates))
        return replace(self, final=fit, found=left, last=last)


def select(base: ExtendedFit, inquiry: Inquiry, begun: Begun | None = None) -> Search:
    """Forward selection with refit, swaps of one cause and of two, and a backward check.

    Parameters
    ----------
    base
        The fit without causes.
    inquiry
        What is asked for, and how many at most.
    begun
        With what it begins; None: the base fit.

    Returns
    -------
    Search
        The fits and the causes found.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.selection import select
    >>> search = select(draw_mismatched_fit(), draw_found_case().inquiry)
    >>> [one.score.name for one in search.found], bool(search.final.chi2 / search.final.dof < 1.5)
    (['gain_mismatch'], True)
    """
    candidates, noise = inquiry.candidates, inquiry.noise
    ranked = score_effects(base, candidates)
    first = tuple(s for s, _ in ranked)
    begun = Begun(base) if begun is None else begun
    kept = [*begun.found]
    if kept:
        ranked = score_effects(begun.fit, candidates)
    selected = _take_forward(Selected(base, begun.fit, kept, ranked), inquiry)
    if is_gross(selected.fit) and not is_told_by_one_term(base, noise):
        selected = _begin_with_two(base, ranked, selected, inquiry)
    reduced: dict[str, ExtendedFit] = {}
    chosen = selected.found[len(kept) :]
    fit, chosen = exchange_causes(selected.fit, chosen, candidates, noise, reduced)
    # one by one first: most lists end there, and a pair is only asked of what no single exchange
    # betters. What a better pair frees may be taken by further causes
    two = _exchange_two(fit, chosen, inquiry)
    if two is not None:
        # the fits without one of the causes were made beside the others of the old list
        reduced = {}
        found = [*kept, *two[1]]
        selected = _take_forward(
            Selected(selected.base, two[0], found, score_effects(two[0], candidates)), inquiry
        )
        fit, chosen = selected.fit, selected.found[len(kept) :]
    fit, chosen = prune_causes(fit, chosen, noise, reduced)
    kept = [replace(one, delta_bic=_loss_without(one, fit, noise, {})[0]) for one in kept]
    if any(one.delta_bic < WORTH for one in kept):  # others do all that it was taken for
        return select(base, inquiry)
    ranked = selected.ranked if fit is selected.fit else score_effects(fit, candidates)
    last = tuple(s for s, _ in ranked)
    return Search(selected.base, fit, (*kept, *chosen), first, last, begun if kept else None)


@dataclass(frozen=True)
class Selected:
    """A selection on its way: the base fit, the fit with the causes found, these, and all others
    ranked beside it."""

    base: ExtendedFit
    fit: ExtendedFit
    found: list[Found]
    ranked: list[tuple[Score, Variant]]


def _take_forward(selected: Selected, inquiry: Inquiry) -> Selected:
    """With all further causes that are worth their price, the best first."""
    base, fit, found, ranked = selected.base, selected.fit, list(selected.found), selected.ranked
    while True:
        freed = take_plain_averaging(fit, ranked)
        if freed is not None:
            fit, ranked = freed, score_effects(freed, inquiry.candidates)
            base = base if found else fit
        higher = free_higher_orders(fit, ranked)
        if higher is not None:
            fit, ranked = higher, score_effects(higher, inquiry.candidates)
        if found and is_gross(fit) and is_told_by_one_term(base, inquiry.noise):
            break
        step = _find_next(fit, ranked, inquiry, inquiry.most - len(found))
        if step is None:
            break
        fit = settle_log(loosen(step[0]))
        found += step[1]
        ranked = score_effects(fit, inquiry.candidates)
    return Selected(base, fit, found, ranked)


def _find_next(
    fit: ExtendedFit, ranked: Sequence[tuple[Score, Variant]], inquiry: Inquiry, most: int
) -> tuple[ExtendedFit, list[Found]] | None:
    """The next cause, or two that are worth their price together alone; None where nothing is."""
    step = find_best_step(fit, ranked, inquiry.noise) if most > 0 else None
    if step is not None:
        return step[0], [step[1]]
    # a misfit of any size has pairs that take some of it, and so has what runs may have walked
    if most < 2 or is_gross(fit) or is_along_walk(fit):
        return None
    hidden = find_hidden_pair(fit, ranked, inquiry.noise.slow)
    if hidden is None:
        return None
    trial, both, names = hidden
    return trial, [
        one.add_rivals(names) for one in _list_found(fit, trial, both, ranked, inquiry.noise)
    ]


def _list_found(
    fit: ExtendedFit,
    trial: ExtendedFit,
    both: tuple[tuple[Score, Variant], tuple[Score, Variant]],
    ranked: Sequence[tuple[Score, Variant]],
    noise: NoiseLevel,
) -> list[Found]:
    """Two causes of a trial that came in together beside a fit."""
    gain = (compute_bic(fit) - compute_bic(trial)) / noise.slow
    tried = sum(score.visible for score, _ in ranked)
    return [
        Found(hold_unseen(variant, trial), score, tried**2 // 2, gain, ())
        for score, variant in both
    ]


def _begin_with_two(
    base: ExtendedFit, ranked: list[tuple[Score, Variant]], taken: Selected, inquiry: Inquiry
) -> Selected:
    """The selection that begins with two causes which together promise most, where it leaves far
    less than what one by one came to; else that one.

    Of several gross causes the best first one may be another, of many parameters, that does some of
    what all do: nothing that follows makes up for it.
    """
    slow, best = inquiry.noise.slow, taken
    for pair in list_promising_pairs(base, ranked, slow)[:TRIED]:
        both = fit_pair(base, pair)
        if both is None:
            continue
        found = _list_found(base, *both, ranked, inquiry.noise)
        fit = settle_log(loosen(both[0]))
        begun = Selected(taken.base, fit, found, score_effects(fit, inquiry.candidates))
        whole = _take_forward(begun, inquiry)
        if whole.fit.chi2 < best.fit.chi2 / OUTDONE:
            best = whole
        if not is_gross(best.fit):
            break
    return best


def find_best_step(
    fit: ExtendedFit,
    ranked: Sequence[tuple[Score, Variant]],
    noise: NoiseLevel,
    rounds: int = ROUNDS,
) -> tuple[ExtendedFit, Found] | None:
    """The best next effect, its rivals refitted too; None when nothing is significant.

    Far from a linear residual the best score may belong to an effect whose refit fails; then the
    next ones are tried.

    Parameters
    ----------
    fit
        Of the runs.
    ranked
        Scores and variants beside it, best first.
    noise
        That gains are judged by.
    rounds
        Shortlists that are tried.

    Returns
    -------
    tuple or None
        The fit with it, and the cause.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.selection import find_best_step
    >>> ranked = score_effects(draw_mismatched_fit(), draw_found_case().inquiry.candidates)
    >>> fit, cause = find_best_step(draw_mismatched_fit(), ranked, STATED)
    >>> cause.score.name, round(fit.values("gain_mismatch")["gain"], 2)
    ('gain_mismatch', 0.02)
    """
    tried = sum(score.visible for score, _ in ranked)
    ranked = _drop_followers(fit, ranked, noise, tried)
    if not ranked or not _is_significant(fit, *ranked[0], noise, tried):
        return None
    close, trials = _refit_near_best(fit, ranked, noise)
    gain = (compute_bic(fit) - trials[0][0]) / noise.slow if trials else -np.inf
    if not gain >= WORTH:
        names = {score.name for score, _ in close}
        others = [pair for pair in ranked if pair[0].name not in names]
        return find_best_step(fit, others, noise, rounds - 1) if rounds > 1 and others else None
    _, chosen, score, variant = trials[0]
    # χ² falls with any parameter; what predicts rows it has not seen no better has learned these by
    # heart
    if not predicts_better(fit, chosen):
        return None
    rivals = _rivals_of_best(trials, ranked, noise)
    tried *= count_places(variant.effect, fit)
    return chosen, Found(hold_unseen(variant, chosen), score, tried, gain, rivals)


def _drop_followers(
    fit: ExtendedFit, ranked: Sequence[tuple[Score, Variant]], noise: NoiseLevel, tried: int
) -> Sequence[tuple[Score, Variant]]:
    """Without the causes, of those in front of the first that stands, which are significant by what
    they earn in following the runs' likely walk alone."""
    if not is_along_walk(fit):
        return ranked
    for k, (score, variant) in enumerate(ranked):
        corrected = score
        if _is_significant(fit, score, variant, noise, tried):
            corrected = correct_for_walk(fit, score, partial(_make_columns, variant=variant))
        if corrected is score or _is_significant(fit, corrected, variant, noise, tried):
            return ranked[k:]
    return []


def _make_columns(fit: ExtendedFit, variant: Variant) -> Array:
    """Sensitivities of a cause beside a fit."""
    return fit.find_sensitivities([variant.wanted])[0]


def _is_significant(
    fit: ExtendedFit, score: Score, variant: Variant, noise: NoiseLevel, tried: int
) -> bool:
    """Whether a cause is more than the best of so many is by chance, and worth its price."""
    if not score.visible:
        return False
    _, p = evidence.find_significance(score.gain / noise.slow, score.rank)
    tries = tried * count_places(variant.effect, fit)
    if evidence.correct_for_tries(p, tries) > SIGNIFICANT:
        return False
    return compute_worth(score, variant, fit, noise.slow) >= WORTH


def _refit_near_best(
    fit: ExtendedFit, ranked: Sequence[tuple[Score, Variant]], noise: NoiseLevel
) -> tuple[Sequence[tuple[Score, Variant]], list[Trial]]:
    """The causes that may turn out to be the best, and their refits, the best first.

    A score is exact where the residual answers linearly; its error grows with what it promises, so
    that what comes near the best in part or in χ² is refitted too.
    """
    top = ranked[0][0].gain
    least = min(PART_OF_BEST * top, top - BELOW_BEST)
    visible = [pair for pair in ranked if pair[0].visible]
    close = shortlist([pair for pair in visible if pair[0].gain > least], fit, noise.slow)
    trials = refit(fit, close, ranked)
    if is_gross(fit) and not (trials and not is_gross(trials[0][1])):
        # so far from the data a score says little of the refit: more are refitted before one is
        # chosen
        close = visible[:GROSS_SHORTLIST]
        trials = refit(fit, close, ranked)
    return close, trials


def _rivals_of_best(
    trials: Sequence[Trial], ranked: Sequence[tuple[Score, Variant]], noise: NoiseLevel
) -> tuple[str, ...]:
    """What the best of the refits is not told from: refits as good as it, and causes, refitted or
    not, that do the same beside this fit."""
    level, _, best, _ = trials[0]
    limit = level + WORTH * noise.slow
    rivals = [variant.effect.name for other, _, _, variant in trials[1:] if other < limit]
    for score, _ in ranked:
        if not score.visible or score.name in (best.name, *rivals):
            continue
        if score.rank == best.rank and evidence.correlate_spaces(score, best) > TOGETHER:
            rivals.append(score.name)
    return tuple(rivals)


def exchange_causes(
    fit: ExtendedFit,
    found: list[Found],
    candidates: Sequence[Variant],
    noise: NoiseLevel,
    without: dict[str, ExtendedFit],
) -> tuple[ExtendedFit, list[Found]]:
    """Every effect against all others beside the rest of those found: what is better takes its
    place, what is as good is its rival.

    An effect may become visible only beside the later ones (a lag beside a temperature dependence),
    so its turn comes here. `without` is left with the fits without each effect that still stand.

    Parameters
    ----------
    fit
        With the causes found.
    found
        The causes.
    candidates
        Ways in which causes may stand.
    noise
        That gains are judged by.
    without
        Fits without each effect, filled.

    Returns
    -------
    tuple
        The fit and the causes.

    Examples
    --------
    One cause alone is left as it is:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.selection import exchange_causes
    >>> case = draw_found_case()
    >>> search, candidates = case.search, case.inquiry.candidates
    >>> fit, found = exchange_causes(search.final, list(search.found), candidates, STATED, {})
    >>> fit is search.final, len(found)
    (True, 1)
    """
    if len(found) < 2 or fit.chi2 > GROSS * noise.slow * fit.dof:
        return fit, found
    for k, old in enumerate(found):
        name = old.variant.effect.name
        if stand_in.has_none(fit, name, candidates):
            continue
        reduced = leave_out(fit, name)
        if reduced is None:
            continue
        without[name] = reduced
        trials = _refit_in_place(fit, reduced, old, candidates, noise)
        if trials and trials[0].level < compute_bic(fit):
            # the one that leaves is now a rival of the one that takes its place; the fits without
            # one of the others were made beside it
            left = InPlace(compute_bic(fit), fit, old)
            best, *trials = trials
            fit, one, level = best.fit, best.cause, best.level
            trials.append(left)
            without.clear()
        else:
            one, level = old, compute_bic(fit)
        limit = level + WORTH * noise.slow
        one = one.add_rivals(t.cause.variant.effect.name for t in trials if t.level < limit)
        found = [*found[:k], one, *found[k + 1 :]]
    return fit, found


@dataclass(frozen=True)
class InPlace:
    """A cause in the place of another: BIC, the fit, and the cause."""

    level: float
    fit: ExtendedFit
    cause: Found


def _refit_in_place(
    fit: ExtendedFit,
    reduced: ExtendedFit,
    old: Found,
    candidates: Sequence[Variant],
    noise: NoiseLevel,
) -> list[InPlace]:
    """All others that may do what a cause does beside the rest of those found, the best first;
    `reduced`: the fit without it."""
    lost = reduced.chi2 - fit.chi2
    # a score bends with its cause's size: a tenth of what is lost is forgiven, or twice the odds
    needed = min(0.9 * lost, lost - 2 * WORTH * noise.slow)
    near = [
        (score, variant)
        for score, variant in score_effects(reduced, candidates)
        if score.visible
        and score.name != old.variant.effect.name
        and score.gain > needed
        and reduced.chi2 - score.gain < HOPELESS * fit.chi2
    ]
    hopeful = shortlist(near, reduced, noise.slow)
    trials = []
    for trial, score, variant in adopt_hopeful(reduced, hopeful, extended_fit.MOST_STEPS):
        if is_possible(variant.effect, trial):
            cause = Found(hold_unseen(variant, trial), score, old.tried, old.delta_bic, ())
            trials.append(InPlace(compute_bic(trial), trial, cause))
    return sorted(trials, key=lambda one: one.level)


def _exchange_two(
    fit: ExtendedFit, found: Sequence[Found], inquiry: Inquiry
) -> tuple[ExtendedFit, list[Found]] | None:
    """The fit and the causes with two of them exchanged for two others that are clearly better;
    None where none are."""
    slow = inquiry.noise.slow
    for old in itertools.combinations(found, 2):
        names = {one.variant.effect.name for one in old}
        better = find_better_pair(fit, names, inquiry.candidates, slow)
        if better is None or not predicts_better(fit, better[0]):
            continue
        trial, scored = better
        new = [
            Found(hold_unseen(variant, trial), score, before.tried, before.delta_bic, ())
            for (score, variant), before in zip(scored, old, strict=True)
        ]
        return trial, [*new, *(one for one in found if one not in old)]
    return None


def prune_causes(
    fit: ExtendedFit,
    found: list[Found],
    noise: NoiseLevel,
    without: Mapping[str, ExtendedFit],
) -> tuple[ExtendedFit, list[Found]]:
    """Backward check: every effect must still be worth its price with the others there, and be one
    that can be; its ΔBIC becomes that of leaving it out.

    `without`: fits without an effect that are known already; what is beyond question is not fitted
    without.

    Parameters
    ----------
    fit
        With the causes found.
    found
        The causes.
    noise
        That gains are judged by.
    without
        Fits without an effect that are known already.

    Returns
    -------
    tuple
        The fit and the causes that stand.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.selection import prune_causes
    >>> search = draw_found_case().search
    >>> _, found = prune_causes(search.final, list(search.found), STATED, {})
    >>> [(one.score.name, round(one.delta_bic)) for one in found]
    [('gain_mismatch', 845)]
    """
    while found:
        losses = [_loss_without(one, fit, noise, without) for one in found]
        worst = int(np.argmin([loss for loss, _ in losses]))
        if losses[worst][0] >= WORTH:
            found = [
                replace(one, delta_bic=float(loss))
                for one, (loss, _) in zip(found, losses, strict=True)
            ]
            break
        # one at a time: of two that do nearly the same each looks needless beside the other
        fit = losses[worst][1]
        found = [one for k, one in enumerate(found) if k != worst]
        without = {}
    return fit, found


def _loss_without(
    one: Found, fit: ExtendedFit, noise: NoiseLevel, without: Mapping[str, ExtendedFit]
) -> tuple[float, ExtendedFit]:
    """(ΔBIC of leaving a cause out, the fit without it): −∞ for one that cannot be, ∞ where the
    model has no fit without it."""
    name = one.variant.effect.name
    possible = is_possible(one.variant.effect, fit)
    if possible and name not in without and stand_in.is_beyond_question(fit, name):
        wald = fit.measure_distance(one.variant.effect)[1]
        return evidence.find_bic_gain(wald / noise.slow, *_size(fit, name)), fit
    reduced = without[name] if name in without else leave_out(fit, name)
    if reduced is None:
        return np.inf, fit
    return (
        (compute_bic(reduced) - compute_bic(fit)) / noise.slow if possible else -np.inf
    ), reduced


def _size(fit: ExtendedFit, name: str) -> tuple[int, int]:
    """Parameters of an active effect, and rows."""
    return len(fit.layout.parameters(name)), len(fit.residual)
