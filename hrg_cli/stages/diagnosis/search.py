"""Diagnosis, the causes: every effect's score, forward selection with refit, rivals, swaps and the
backward check."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects.effect import REFERENCE_TEMPERATURE, Effect
from ...fitting.causes import evidence, extended_fit, scales
from ...fitting.causes.evidence import Score
from ...fitting.causes.extended import Series
from ...fitting.causes.extended_fit import Fit
from ...fitting.causes.sensitivities import Wanted
from .gain import predicts_better
from .open_terms import LEAST_KELVIN
from .thresholds import (
    CLEARLY,
    GROSS,
    MOST_TYPICAL,
    SIGNIFICANT,
    SMALL_IN_MOTION,
    SMALL_IN_READOUT,
    TOGETHER,
    WORTH,
)

Array = np.ndarray
SHORTLIST, GROSS_SHORTLIST = 3, 10
"""Candidates refitted before one is chosen; the second while the misfit is gross, when a score says
little of the refit."""
QUICK_STEPS = 6
"""Steps of a first refit where many are compared."""
ROUNDS = 4
"""Shortlists tried when the refits of the first bring nothing."""


@dataclass(frozen=True)
class Variant:
    """One way an effect may stand: values of its parameters, difference steps of those fitted, and
    those of them that are secants.

    A secant leads from the neutral value to one tried, of a parameter that has no slope there.
    """

    effect: Effect
    values: Mapping[str, float]
    steps: Mapping[str, float]
    secants: tuple[str, ...] = ()

    @property
    def wanted(self) -> Wanted:
        """What its sensitivities are asked for by."""
        return self.effect, self.values, self.steps


@dataclass(frozen=True)
class Found:
    """An accepted effect: score at its acceptance, what it cannot be told from, fit with it."""

    variant: Variant
    score: Score
    tried: int
    delta_bic: float
    rivals: tuple[str, ...]


@dataclass(frozen=True)
class Search:
    """The selection's result: the fits, the accepted effects in order, the scores of all candidates
    beside the first and the last fit."""

    base: Fit
    final: Fit
    found: tuple[Found, ...]
    first: tuple[Score, ...]
    last: tuple[Score, ...]

    def without(self, cause: Found, fit: Fit, candidates: Sequence[Variant]) -> Search:
        """The search in which a cause is given up; `fit`: the fit without it."""
        left = tuple(one for one in self.found if one.variant is not cause.variant)
        last = tuple(score for score, _ in scored(fit, candidates))
        return replace(self, final=fit, found=left, last=last)


def variants(effects: Sequence[Effect], fit: Fit) -> list[Variant]:
    """All ways the candidates may stand beside this fit."""
    series = fit.series
    warm = series.temperature_degc[series.weight > 0]
    middle = float(np.round(warm.mean(), 3)) if series.has_temperature else 25.0
    there = _there(series)
    out = []
    for effect in effects:
        values = effect.values()
        if effect.follows_temperature:
            values[REFERENCE_TEMPERATURE] = middle
        steps = scales.steps_of(effect, series)
        if effect.in_the_log and np.any(getattr(series, effect.in_the_log)):
            continue
        if not set(effect.needs) <= there:
            continue
        secants = tuple(p.name for p in effect.fitted() if p.sets_in)
        for start in effect.starts(series):
            held = {name: value for name, value in start.items() if name not in secants}
            levels = {name: start[name] - values[name] for name in secants if name in start}
            out.append(Variant(effect, {**values, **held}, {**steps, **levels}, secants))
    return out


def _there(series: Series) -> set[str]:
    """What these runs hold of what effects need."""
    good = series.weight > 0
    there = set()
    if series.has_temperature and np.ptp(series.temperature_degc[good]) > LEAST_KELVIN:
        there.add("temperature")
    if any(
        np.ptp(angle[rows]) > np.pi
        for angle, rows in zip(series.table_angle_rad, good, strict=True)
        if rows.any()
    ):
        there.add("half a turn")
    return there


def scored(fit: Fit, candidates: Sequence[Variant]) -> list[tuple[Score, Variant]]:
    """Every effect's best variant with its score beside the fit, best criterion first."""
    active = {effect.name for effect, _ in fit.point.active}
    open_ones = [
        v
        for v in candidates
        if v.effect.name not in active and (_may_stand(v.effect, active) or not gross(fit))
    ]
    columns = fit.sensitivities([variant.wanted for variant in open_ones])
    best: dict[str, tuple[Score, Variant]] = {}
    found = evidence.scores(
        [variant.effect.name for variant in open_ones], fit.residual, columns, fit.basis
    )
    for score, variant in zip(found, open_ones, strict=True):
        if score.visible and not _thinkable(score, variant, fit):
            continue
        if score.name not in best or score.gain > best[score.name][0].gain:
            best[score.name] = (score, variant)
    rows = len(fit.residual)
    return sorted(
        best.values(),
        key=lambda pair: (
            -evidence.criterion(pair[0].gain, pair[0].rank, rows) if pair[0].visible else np.inf
        ),
    )


def _may_stand(effect: Effect, active: set[str]) -> bool:
    """Whether what the effect is a part of stands already; asked for while the misfit is gross,
    when a part would do for the whole."""
    return not effect.part_of or bool(active & set(effect.part_of))


def _thinkable(score: Score, variant: Variant, fit: Fit) -> bool:
    """Whether what stands out of the estimate's noise is of a size such a cause can have: small
    beside the oscillation and the signal."""
    beyond = np.sign(score.estimate) * np.maximum(np.abs(score.estimate) - 5 * score.std, 0.0)
    least = {
        name: float(v) for name, v in zip(variant.steps, beyond, strict=True) if np.isfinite(v)
    }
    values = {name: value + least.get(name, 0.0) for name, value in variant.values.items()}
    return is_small(variant.effect, values, fit)


def is_small(effect: Effect, values: Mapping[str, float], fit: Fit) -> bool:
    """Whether an effect of these values is of a thinkable size: small beside the oscillation and
    the signal along the fit's runs.

    What is neither in seconds nor in amplitudes (angles, ratios, slopes by temperature) is also
    held against its typical size; the others differ from device to device by more than that would
    allow.
    """
    for p in effect.fitted():
        pure = p.amplitude_power == 0 and scales.seconds_in(p.units) == 0
        if pure and not p.sets_in and abs(values[p.name] - p.neutral) > MOST_TYPICAL * p.typical:
            return False
    u = fit.prediction.motion
    motion, seen = scales.strength(effect, values, u, fit.flow.rows.lit(u))
    return motion <= SMALL_IN_MOTION and seen <= SMALL_IN_READOUT


def adopted(fit: Fit, score: Score, variant: Variant, most: int = extended_fit.MOST_STEPS) -> Fit:
    """The fit again with one more effect, from the score's estimate, in `most` steps; parameters
    these runs do not show stay neutral."""
    values, effect = dict(variant.values), variant.effect
    unseen = {
        name for name, std in zip(variant.steps, score.std, strict=True) if not np.isfinite(std)
    }
    if unseen and len(unseen) < len(variant.steps):
        effect = replace(
            effect,
            parameters=tuple(
                replace(p, fitted=p.fitted and p.name not in unseen) for p in effect.parameters
            ),
        )
    for (name, _), estimate in zip(variant.steps.items(), score.estimate, strict=True):
        if np.isfinite(estimate):
            values[name] += float(estimate)
    for name in variant.secants:  # where the score's estimate is a part of what sets in there
        values[name] = variant.values[name] + variant.steps[name]
    first = extended_fit.fit(
        fit.series,
        extended_fit.with_effect(fit.point, effect, values),
        fit.freedom,
        most,
        fit.flow.near,
    )
    if not any(p.fitted_then for p in effect.parameters):
        return first
    effect = replace(
        effect,
        parameters=tuple(replace(p, fitted=p.fitted or p.fitted_then) for p in effect.parameters),
    )
    values = next(dict(given) for one, given in first.point.active if one.name == effect.name)
    return extended_fit.fit(
        first.series,
        extended_fit.with_effect(first.point, effect, values),
        first.freedom,
        most,
        first.flow.near,
    )


def as_fitted(variant: Variant, fit: Fit) -> Variant:
    """The variant with its effect as it stands in the fit: unseen parameters held."""
    return replace(
        variant,
        effect=next(effect for effect, _ in fit.point.active if effect.name == variant.effect.name),
    )


def bic(fit: Fit) -> float:
    """χ² + rank·ln N."""
    return fit.chi2 + fit.basis.shape[1] * float(np.log(len(fit.residual)))


def select(base: Fit, candidates: Sequence[Variant], noise_factor: float, most: int) -> Search:
    """Forward selection with refit, swaps and a backward check; `noise_factor`: variance by which
    coloured noise exceeds the white one."""
    fit = base
    found: list[Found] = []
    ranked = scored(fit, candidates)
    first = tuple(s for s, _ in ranked)
    while True:
        freed = second_order_freed(fit, ranked)
        if freed is not None:
            fit, ranked = freed, scored(freed, candidates)
            base = base if found else fit
        if len(found) == most:
            break
        step = best_step(fit, ranked, noise_factor)
        if step is None:
            break
        fit, one = step
        fit = loosened(fit)
        found.append(one)
        ranked = scored(fit, candidates)
    chosen = fit
    reduced: dict[str, Fit] = {}
    fit, found = exchanged(fit, found, candidates, noise_factor, reduced)
    fit, found = pruned(fit, found, noise_factor, reduced)
    last = ranked if fit is chosen else scored(fit, candidates)
    return Search(base, fit, tuple(found), first, tuple(s for s, _ in last))


def best_step(
    fit: Fit, ranked: Sequence[tuple[Score, Variant]], noise_factor: float, rounds: int = ROUNDS
) -> tuple[Fit, Found] | None:
    """The best next effect, its rivals refitted too; None when nothing is significant.

    Far from a linear residual the best score may belong to an effect whose refit fails; then the
    next ones are tried.
    """
    tried = sum(s.visible for s, _ in ranked)
    if tried == 0:
        return None
    top = ranked[0][0]
    _, p = evidence.significance(top.gain / noise_factor, top.rank)
    if (
        not top.visible
        or evidence.corrected(p, tried) > SIGNIFICANT
        or evidence.criterion(top.gain / noise_factor, top.rank, len(fit.residual)) < WORTH
    ):
        return None
    close = [
        pair
        for pair in ranked
        if pair[0].visible and pair[0].gain > min(0.6 * top.gain, top.gain - 30)
    ][:SHORTLIST]
    trials = refitted(fit, close)
    if gross(fit) and not (trials and not gross(trials[0][1])):
        # so far from the data a score says little of the refit: more are refitted before one is
        # chosen
        close = [pair for pair in ranked if pair[0].visible][:GROSS_SHORTLIST]
        trials = refitted(fit, close)
    gain = (bic(fit) - trials[0][0]) / noise_factor if trials else -np.inf
    if not gain >= WORTH:
        rest = [pair for pair in ranked if not any(pair[0].name == s.name for s, _ in close)]
        return best_step(fit, rest, noise_factor, rounds - 1) if rounds > 1 and rest else None
    level, chosen, score, variant = trials[0]
    if not predicts_better(fit, chosen):
        return None
    margin = WORTH * noise_factor
    rivals = [t[3].effect.name for t in trials[1:] if t[0] < level + margin]
    rivals += [
        s.name
        for s, _ in ranked
        if s.name != score.name
        and s.visible
        and s.name not in rivals
        and evidence.alike(s, score) > TOGETHER
        and s.rank == score.rank
    ]
    return chosen, Found(as_fitted(variant, chosen), score, tried, gain, tuple(rivals))


Trial = tuple[float, Fit, Score, Variant]
"""A candidate refitted: its criterion, its fit, its score before, and how it stands."""


def refitted(fit: Fit, close: Sequence[tuple[Score, Variant]]) -> list[Trial]:
    """The candidates refitted, best first; what did not settle or came out larger than thinkable is
    none.

    Many are refitted in few steps first where the misfit is gross, and only the best of these to
    the end.
    """
    trials: list[Trial] = []
    for score, variant in close:
        with contextlib.suppress(extended_fit.DivergedError):
            trial = adopted(
                fit,
                score,
                variant,
                QUICK_STEPS if len(close) > SHORTLIST else extended_fit.MOST_STEPS,
            )
            trials.append((bic(trial), trial, score, variant))
    trials.sort(key=lambda t: t[0])
    whole: list[Trial] = []
    for level, trial, score, variant in trials[:SHORTLIST]:
        if not trial.converged:
            trial = extended_fit.fit(trial.series, trial.point, trial.freedom, near=trial.flow.near)
            level = bic(trial)
        effect, values = trial.point.active[-1]
        if trial.converged and is_small(effect, values, trial):
            whole.append((level, trial, score, variant))
    return sorted(whole, key=lambda t: t[0])


def gross(fit: Fit) -> bool:
    """Whether the model is far from the data as a whole."""
    return fit.chi2 > GROSS * fit.dof


def loosened(fit: Fit) -> Fit:
    """The fit with the scale factor free as far as these runs leave it, once the misfit is no
    longer gross enough to bend it.

    The second order's scale is that of a real resonator; one that was freed is held again where
    that costs little.
    """
    loose = fit.freedom.loose
    if gross(fit) or loose is None:
        return fit
    held = extended_fit.fit(
        fit.series,
        fit.point,
        replace(loose.holding("second_order", 1.0), loose=loose),
        near=fit.flow.near,
    )
    freed = fit.layout.coordinate("second_order") is not None
    return fit if freed and held.chi2 - fit.chi2 > CLEARLY else held


def second_order_freed(fit: Fit, ranked: Sequence[tuple[Score, Variant]]) -> Fit | None:
    """The fit with the second order's scale free, where the data ask for that more than for any
    cause: envelopes that come from plain averaging (0) and not from a resonator (1)."""
    loose = fit.freedom.loose
    if gross(fit) or loose is None or fit.layout.coordinate("second_order") is not None:
        return None
    free = extended_fit.fit(fit.series, fit.point, replace(loose, loose=loose), near=fit.flow.near)
    best = max((score.gain for score, _ in ranked if score.visible), default=0.0)
    return free if fit.chi2 - free.chi2 > max(CLEARLY, best) else None


def leaving_out(fit: Fit, name: str, base: Fit | None = None) -> Fit | None:
    """The fit again without an effect; None where no motion is left: the model cannot do without
    it.

    base: a fit without effects, from whose place the others are fitted too where the effect has led
    so far that there is no way back.
    """
    reduced: Fit | None = None
    point = extended_fit.without(fit.point, name)
    with contextlib.suppress(extended_fit.DivergedError):
        reduced = extended_fit.fit(fit.series, point, fit.freedom, near=fit.flow.near)
    if base is None or (reduced is not None and reduced.converged):
        return reduced
    with contextlib.suppress(extended_fit.DivergedError):
        again = extended_fit.fit(
            fit.series, replace(base.point, active=point.active), fit.freedom, near=base.flow.near
        )
        if reduced is None or again.chi2 < reduced.chi2:
            return again
    return reduced


def exchanged(
    fit: Fit,
    found: list[Found],
    candidates: Sequence[Variant],
    noise_factor: float,
    without: dict[str, Fit],
) -> tuple[Fit, list[Found]]:
    """Every effect against all others beside the rest of those found: what is better takes its
    place, what is as good is its rival.

    An effect may become visible only beside the later ones (a lag beside a temperature dependence),
    so its turn comes here. `without` is left with the fits without each effect that still stand.
    """
    if len(found) < 2 or fit.chi2 > GROSS * noise_factor * fit.dof:
        return fit, found
    for k, old in enumerate(found):
        reduced = leaving_out(fit, old.variant.effect.name)
        if reduced is None:
            continue
        without[old.variant.effect.name] = reduced
        lost = reduced.chi2 - fit.chi2
        needed = min(0.9 * lost, lost - 2 * WORTH * noise_factor)
        others = [
            pair
            for pair in scored(reduced, candidates)
            if pair[0].visible and pair[0].name != old.variant.effect.name
        ]
        trials = []
        for score, variant in [pair for pair in others if pair[0].gain > needed][:SHORTLIST]:
            with contextlib.suppress(extended_fit.DivergedError):
                trial = adopted(reduced, score, variant)
                trials.append(
                    (
                        bic(trial),
                        trial,
                        Found(as_fitted(variant, trial), score, old.tried, old.delta_bic, ()),
                    )
                )
        trials.sort(key=lambda t: t[0])
        here = bic(fit)
        if trials and trials[0][0] < here:
            level, fit, new = trials.pop(0)
            without.clear()
            trials.append((here, fit, old))
            old = new
        else:
            level = here
        close = [t[2].variant.effect.name for t in trials if t[0] < level + WORTH * noise_factor]
        rivals = tuple(
            dict.fromkeys([*(r for r in old.rivals if r != old.variant.effect.name), *close])
        )
        found = [*found[:k], replace(old, rivals=rivals), *found[k + 1 :]]
    return fit, found


def pruned(
    fit: Fit, found: list[Found], noise_factor: float, without: Mapping[str, Fit]
) -> tuple[Fit, list[Found]]:
    """Backward check: every effect must still be worth its price with the others there; its ΔBIC
    becomes that of leaving it out.

    `without`: fits without an effect that are known already.
    """
    changed = True
    while changed and found:
        changed = False
        losses = []
        for one in found:
            name = one.variant.effect.name
            reduced = without[name] if name in without else leaving_out(fit, name)
            losses.append(
                (np.inf, fit)
                if reduced is None
                else ((bic(reduced) - bic(fit)) / noise_factor, reduced)
            )
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
