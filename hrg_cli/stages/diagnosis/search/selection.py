"""Diagnosis, the causes: forward selection with refit, rivals, swaps and the backward check."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....fitting.causes import evidence, extended_fit
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit
from ..base.joint_fit import settle_log
from ..fits.refits import (
    HOPELESS,
    adopt_hopeful,
    bic,
    free_second_order,
    hold_unseen,
    leave_out,
    loosen,
    refit,
    shortlist,
)
from ..fits.scoring import is_gross, is_possible, number_of_places, score_effects, worth
from ..fits.variants import Variant
from ..thresholds import GROSS, SIGNIFICANT, TOGETHER, WORTH
from . import stand_in
from .gain import predicts_better
from .inquiry import Inquiry, NoiseLevel
from .pairs import find_better_pair

GROSS_SHORTLIST = 10
"""Candidates refitted while the misfit is gross, when a score says little of the refit."""
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


@dataclass(frozen=True)
class Search:
    """The selection's result: the fits, the accepted effects in order, the scores of all candidates
    beside the first and the last fit."""

    base: ExtendedFit
    final: ExtendedFit
    found: tuple[Found, ...]
    first: tuple[Score, ...]
    last: tuple[Score, ...]

    def without(self, cause: Found, fit: ExtendedFit, candidates: Sequence[Variant]) -> Search:
        """The search in which a cause is given up; `fit`: the fit without it."""
        left = tuple(one for one in self.found if one.variant is not cause.variant)
        last = tuple(score for score, _ in score_effects(fit, candidates))
        return replace(self, final=fit, found=left, last=last)


def select(base: ExtendedFit, inquiry: Inquiry) -> Search:
    """Forward selection with refit, swaps of one cause and of two, and a backward check."""
    candidates, noise = inquiry.candidates, inquiry.noise
    ranked = score_effects(base, candidates)
    first = tuple(s for s, _ in ranked)
    selected = _take_forward(Selected(base, base, [], ranked), inquiry)
    reduced: dict[str, ExtendedFit] = {}
    fit, found = exchange_causes(selected.fit, selected.found, candidates, noise, reduced)
    two = _exchange_two(fit, found, inquiry)
    if two is not None:
        reduced = {}
        selected = _take_forward(
            Selected(selected.base, *two, score_effects(two[0], candidates)), inquiry
        )
        fit, found = selected.fit, selected.found
    fit, found = prune_causes(fit, found, noise, reduced)
    ranked = selected.ranked if fit is selected.fit else score_effects(fit, candidates)
    return Search(selected.base, fit, tuple(found), first, tuple(s for s, _ in ranked))


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
        freed = free_second_order(fit, ranked)
        if freed is not None:
            fit, ranked = freed, score_effects(freed, inquiry.candidates)
            base = base if found else fit
        if len(found) >= inquiry.most:
            break
        step = best_step(fit, ranked, inquiry.noise)
        if step is None:
            break
        fit, one = step
        fit = settle_log(loosen(fit))
        found.append(one)
        ranked = score_effects(fit, inquiry.candidates)
    return Selected(base, fit, found, ranked)


def best_step(
    fit: ExtendedFit,
    ranked: Sequence[tuple[Score, Variant]],
    noise: NoiseLevel,
    rounds: int = ROUNDS,
) -> tuple[ExtendedFit, Found] | None:
    """The best next effect, its rivals refitted too; None when nothing is significant.

    Far from a linear residual the best score may belong to an effect whose refit fails; then the
    next ones are tried.
    """
    tried = sum(s.visible for s, _ in ranked)
    if tried == 0:
        return None
    top, first = ranked[0]
    _, p = evidence.significance(top.gain / noise.slow, top.rank)
    if (
        not top.visible
        or evidence.correct_for_tries(p, tried * number_of_places(first.effect, fit)) > SIGNIFICANT
        or worth(top, first, fit, noise.slow) < WORTH
    ):
        return None
    close = shortlist(
        [
            pair
            for pair in ranked
            if pair[0].visible and pair[0].gain > min(0.6 * top.gain, top.gain - 30)
        ],
        fit,
        noise.slow,
    )
    trials = refit(fit, close)
    if is_gross(fit) and not (trials and not is_gross(trials[0][1])):
        # so far from the data a score says little of the refit: more are refitted before one is
        # chosen
        close = [pair for pair in ranked if pair[0].visible][:GROSS_SHORTLIST]
        trials = refit(fit, close)
    gain = (bic(fit) - trials[0][0]) / noise.slow if trials else -np.inf
    if not gain >= WORTH:
        rest = [pair for pair in ranked if not any(pair[0].name == s.name for s, _ in close)]
        return best_step(fit, rest, noise, rounds - 1) if rounds > 1 and rest else None
    level, chosen, score, variant = trials[0]
    if not predicts_better(fit, chosen):
        return None
    margin = WORTH * noise.slow
    rivals = [t[3].effect.name for t in trials[1:] if t[0] < level + margin]
    rivals += [
        s.name
        for s, _ in ranked
        if s.name != score.name
        and s.visible
        and s.name not in rivals
        and evidence.correlate_spaces(s, score) > TOGETHER
        and s.rank == score.rank
    ]
    tried *= number_of_places(variant.effect, fit)
    return chosen, Found(hold_unseen(variant, chosen), score, tried, gain, tuple(rivals))


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
    """
    if len(found) < 2 or fit.chi2 > GROSS * noise.slow * fit.dof:
        return fit, found
    for k, old in enumerate(found):
        if stand_in.has_none(fit, old.variant.effect.name, candidates):
            continue
        reduced = leave_out(fit, old.variant.effect.name)
        if reduced is None:
            continue
        without[old.variant.effect.name] = reduced
        lost = reduced.chi2 - fit.chi2
        needed = min(0.9 * lost, lost - 2 * WORTH * noise.slow)
        others = [
            pair
            for pair in score_effects(reduced, candidates)
            if pair[0].visible and pair[0].name != old.variant.effect.name
        ]
        near = [
            pair
            for pair in others
            if pair[0].gain > needed and reduced.chi2 - pair[0].gain < HOPELESS * fit.chi2
        ]
        trials = [
            (
                bic(trial),
                trial,
                Found(hold_unseen(variant, trial), score, old.tried, old.delta_bic, ()),
            )
            for trial, score, variant in adopt_hopeful(
                reduced, shortlist(near, reduced, noise.slow), extended_fit.MOST_STEPS
            )
            if is_possible(variant.effect, trial)
        ]
        trials.sort(key=lambda t: t[0])
        here = bic(fit)
        if trials and trials[0][0] < here:
            level, fit, new = trials.pop(0)
            without.clear()
            trials.append((here, fit, old))
            old = new
        else:
            level = here
        close = [t[2].variant.effect.name for t in trials if t[0] < level + WORTH * noise.slow]
        rivals = tuple(
            dict.fromkeys([*(r for r in old.rivals if r != old.variant.effect.name), *close])
        )
        found = [*found[:k], replace(old, rivals=rivals), *found[k + 1 :]]
    return fit, found


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
    """
    changed = True
    while changed and found:
        changed = False
        losses = []
        for one in found:
            name = one.variant.effect.name
            possible = is_possible(one.variant.effect, fit)
            if possible and name not in without and stand_in.is_beyond_question(fit, name):
                wald = fit.away(one.variant.effect)[1]
                losses.append((evidence.criterion(wald / noise.slow, *_size(fit, name)), fit))
                continue
            reduced = without[name] if name in without else leave_out(fit, name)
            if reduced is None:
                losses.append((np.inf, fit))
            else:
                lost = (bic(reduced) - bic(fit)) / noise.slow
                losses.append((lost if possible else -np.inf, reduced))
        worst = int(np.argmin([loss for loss, _ in losses]))
        if losses[worst][0] < WORTH:
            fit = losses[worst][1]
            found = [f for k, f in enumerate(found) if k != worst]
            changed, without = True, {}
        else:
            found = [
                replace(one, delta_bic=float(loss))
                for one, (loss, _) in zip(found, losses, strict=True)
            ]
    return fit, found


def _size(fit: ExtendedFit, name: str) -> tuple[int, int]:
    """Parameters of an active effect, and rows."""
    return len(fit.layout.parameters(name)), len(fit.residual)
