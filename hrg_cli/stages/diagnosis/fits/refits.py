"""Diagnosis, the model fitted again: with one cause more, with one less, with what is weakly known
free or held."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Sequence, Set
from dataclasses import replace
from functools import reduce

import numpy as np

from ....effects.effect import INSTANT, Effect
from ....fitting.causes import evidence, extended_fit, fit_point
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.fit_point import Point
from ....fitting.causes.sensitivities import find_base_sensitivities
from ....fitting.causes.whitened_rows import flatten_rows
from ....fitting.envelopes.coordinates import SECOND_ORDER
from ....fitting.least_squares import square_over_covariance
from ..thresholds import CLEARLY, OUTDONE, UNSETTLED_BASE, WORTH
from .scoring import compute_worth, is_gross, is_possible, price_place
from .strike_instants import is_gross_elsewhere, settle_instants
from .variants import Variant

SHORTLIST = 3
"""Candidates refitted to the end before one is chosen, at least."""
QUICK_STEPS = 6
"""Steps of a first refit where many are compared."""
HOPELESS = 10.0
"""Times the χ² that a refit leaves, and its score promised to, which another cause's score must
promise to leave for it not to be tried, and times the χ² without a cause at which the fit with it
is given up, whose start has led too far: what cannot fit takes by far the longest to say so."""


def hold_effect(effect: Effect) -> Effect:
    """The effect with none of its parameters fitted.

    Parameters
    ----------
    effect
        A cause.

    Returns
    -------
    Effect
        The same in all else.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.fits.refits import hold_effect
    >>> [p.fitted for p in hold_effect(find("gain_mismatch")).parameters]
    [False]
    """
    held = (replace(p, fitted=False, fitted_then=False) for p in effect.parameters)
    return replace(effect, parameters=tuple(held))


def free_also(effect: Effect, names: Set[str]) -> Effect:
    """The effect with these parameters fitted too.

    Parameters
    ----------
    effect
        A cause.
    names
        Of its parameters.

    Returns
    -------
    Effect
        The same in all else.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.fits.refits import free_also
    >>> [p.name for p in free_also(find("pickoff_nonlinearity"), {"quintic"}).fitted()]
    ['cubic', 'quintic']
    """
    freed = (replace(p, fitted=p.fitted or p.name in names) for p in effect.parameters)
    return replace(effect, parameters=tuple(freed))


def adopt(
    fit: ExtendedFit, score: Score, variant: Variant, most: int = extended_fit.MOST_STEPS
) -> ExtendedFit:
    """The fit again with one more effect, from the score's estimate, in `most` steps; parameters
    these runs do not show stay neutral.

    Parameters
    ----------
    fit
        Without the effect.
    score
        Of the effect, its estimate.
    variant
        How it stands.
    most
        Steps of the fit.

    Returns
    -------
    ExtendedFit
        With the effect.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import adopt
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> fit, candidates = draw_mismatched_fit(), draw_found_case().inquiry.candidates
    >>> ranked = score_effects(fit, candidates)
    >>> made = adopt(fit, *ranked[0])
    >>> round(made.values("gain_mismatch")["gain"], 3), bool(made.chi2 < fit.chi2 / 2)
    (0.02, True)
    """
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
        fit_point.add_effect(fit.point, effect, values),
        fit.freedom,
        most,
        fit.flow.near,
        worst=HOPELESS * fit.chi2,
    )
    # what changes others and does nothing alone (an instant) has no slope before these have a size
    if not any(p.fitted_then for p in effect.parameters):
        return first
    effect = free_also(effect, {p.name for p in effect.parameters if p.fitted_then})
    values = next(dict(given) for one, given in first.point.active if one.name == effect.name)
    return extended_fit.fit(
        first.series,
        fit_point.add_effect(first.point, effect, values),
        first.freedom,
        most,
        first.flow.near,
    )


def shortlist(
    ranked: Sequence[tuple[Score, Variant]], fit: ExtendedFit, slow: float
) -> list[tuple[Score, Variant]]:
    """The best candidates by their scores, and all that come within the odds of `WORTH` of the
    first: whoever is not refitted is nobody's rival.

    Parameters
    ----------
    ranked
        Best first: the score of a cause and how it stands, one pair each.
    fit
        Beside which they were scored.
    slow
        Variance of the noise over the stated one.

    Returns
    -------
    list of tuple
        Of `ranked`, in their order.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import shortlist
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> fit, candidates = draw_mismatched_fit(), draw_found_case().inquiry.candidates
    >>> ranked = score_effects(fit, candidates)
    >>> [score.name for score, _ in shortlist(ranked, fit, slow=1.0)]
    ['gain_mismatch']
    """
    level = compute_worth(*ranked[0], fit, slow) - WORTH if ranked else 0.0
    return [
        pair
        for place, pair in enumerate(ranked)
        if place < SHORTLIST or compute_worth(*pair, fit, slow) > level
    ]


def adopt_hopeful(
    fit: ExtendedFit, ranked: Sequence[tuple[Score, Variant]], most: int
) -> list[tuple[ExtendedFit, Score, Variant]]:
    """The fits with each of the candidates, those left out that promise far less than one before
    them has promised and reached, and those without a motion.

    Of a gross misfit a cause may leave much less than its score promises, and so may the next.
    Where one has left no gross misfit, those after it are fitted in few steps.

    Parameters
    ----------
    fit
        Without a candidate.
    ranked
        The score of a cause and how it stands, one pair each.
    most
        Steps of a fit.

    Returns
    -------
    list of tuple
        Fit, score and variant of each.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import adopt_hopeful
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> fit, candidates = draw_mismatched_fit(), draw_found_case().inquiry.candidates
    >>> ranked = score_effects(fit, candidates)
    >>> [
    ...     (score.name, bool(made.chi2 < fit.chi2))
    ...     for made, score, _ in adopt_hopeful(fit, ranked, 6)
    ... ]
    [('gain_mismatch', True)]
    """
    out: list[tuple[ExtendedFit, Score, Variant]] = []
    least = np.inf
    for score, variant in ranked:
        promised = fit.chi2 - score.gain
        if promised > HOPELESS * least:
            continue
        found = is_gross(fit) and any(not is_gross(trial) for trial, _, _ in out)
        made = adopt_each(fit, [(score, variant)], min(most, QUICK_STEPS) if found else most)
        least = min([least, *(max(trial.chi2, promised) for trial, _, _ in made)])
        out += made
    return out


def adopt_each(
    fit: ExtendedFit, ranked: Sequence[tuple[Score, Variant]], most: int
) -> list[tuple[ExtendedFit, Score, Variant]]:
    """The fits with each of the candidates but those without a motion.

    Parameters
    ----------
    fit
        Without a candidate.
    ranked
        The score of a cause and how it stands, one pair each.
    most
        Steps of a fit.

    Returns
    -------
    list of tuple
        Fit, score and variant of each.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import adopt_each
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> fit, candidates = draw_mismatched_fit(), draw_found_case().inquiry.candidates
    >>> ranked = score_effects(fit, candidates)
    >>> [score.name for _, score, _ in adopt_each(fit, ranked, most=6)]
    ['gain_mismatch']
    """
    out: list[tuple[ExtendedFit, Score, Variant]] = []
    for score, variant in ranked:
        with contextlib.suppress(extended_fit.DivergedError):
            out.append((adopt(fit, score, variant, most), score, variant))
    return out


def hold_unseen(variant: Variant, fit: ExtendedFit) -> Variant:
    """The variant with its effect as it stands in the fit: unseen parameters held.

    Parameters
    ----------
    variant
        Of an effect of the fit.
    fit
        With the effect.

    Returns
    -------
    Variant
        Of that effect.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.fits.refits import hold_unseen
    >>> case = draw_found_case()
    >>> held = hold_unseen(case.inquiry.candidates[0], case.search.final)
    >>> held.effect is case.search.final.effect("gain_mismatch")
    True
    """
    return replace(
        variant,
        effect=fit.effect(variant.effect.name),
    )


def compute_bic(fit: ExtendedFit) -> float:
    """χ² + rank·ln N, what the choice of their instants costs causes that happen at one, less what
    causes save whose parameters are not all needed.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    float
        Lower is better.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import compute_bic
    >>> compute_bic(draw_found_case().search.final) < compute_bic(draw_mismatched_fit()) - 500
    True
    """
    chosen = sum(price_place(effect, fit) - _saved(effect, fit) for effect, _ in fit.point.active)
    return fit.chi2 + fit.basis.shape[1] * float(np.log(len(fit.residual))) + chosen


def _saved(effect: Effect, fit: ExtendedFit) -> float:
    """What of a cause's price ln N a parameter is not owed: several found together owe
    less (`price_numbers`); less still where some of them at neutral, the others fitted again, would
    do: χ² rises by aᵀC⁻¹a of those (Wald), and which of them is a choice among as many."""
    if len(fit.layout.parameters(effect.name)) < 2:
        return 0.0
    off, _ = fit.measure_distance(effect)
    columns = fit.layout.effect(effect.name)
    C = fit.covariance[columns, columns]
    rows = len(fit.residual)
    price = float(np.log(rows))
    best = len(off) * price - evidence.price_numbers(len(off), square_over_covariance(off, C), rows)
    for count in range(1, len(off)):
        tries = 2 * float(np.log(math.comb(len(off), count)))
        for idle in itertools.combinations(range(len(off)), count):
            some = list(idle)
            rise = square_over_covariance(off[some], C[np.ix_(some, some)])
            best = max(best, count * price - tries - rise)
    return best


Trial = tuple[float, ExtendedFit, Score, Variant]
"""A candidate refitted: its criterion, its fit, its score before, and how it stands."""


def refit(
    fit: ExtendedFit,
    close: Sequence[tuple[Score, Variant]],
    ranked: Sequence[tuple[Score, Variant]],
) -> list[Trial]:
    """The candidates refitted, best first; what did not settle or came out as no such cause can be
    is none, and so is a part of others among all those ranked that may do for them.

    Many are refitted in few steps first, and to the end only the best of these and what comes
    within `WORTH` of them. A selection at another noise asks for the same: what was refitted once
    is remembered.

    Parameters
    ----------
    fit
        Without a candidate.
    close
        The score and the variant of each that is refitted.
    ranked
        Of all, best first.

    Returns
    -------
    list of tuple
        Criterion, fit, score and variant of each.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import refit
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> fit, candidates = draw_mismatched_fit(), draw_found_case().inquiry.candidates
    >>> ranked = score_effects(fit, candidates)
    >>> [(score.name, made.converged) for _, made, score, _ in refit(fit, ranked, ranked)]
    [('gain_mismatch', True)]
    """
    tried = tuple((variant.effect, tuple(variant.values.items())) for _, variant in close)
    trials: list[Trial] = fit.recall(("refitted", tried), lambda: _refitted(fit, close, ranked))
    return trials


def _refitted(
    fit: ExtendedFit,
    close: Sequence[tuple[Score, Variant]],
    ranked: Sequence[tuple[Score, Variant]],
) -> list[Trial]:
    most = QUICK_STEPS if len(close) > SHORTLIST else extended_fit.MOST_STEPS
    trials: list[Trial] = [(compute_bic(one[0]), *one) for one in adopt_hopeful(fit, close, most)]
    trials.sort(key=lambda t: t[0])
    whole: list[Trial] = []
    for place, (level, trial, score, variant) in enumerate(trials):
        if place >= SHORTLIST and level > trials[0][0] + WORTH:
            break
        # what leaves a gross misfit is no rival of what leaves none, however it may settle
        if whole and is_gross(trial) and not is_gross(whole[0][1]):
            continue
        if not trial.converged:
            if trial.chi2 > HOPELESS * fit.chi2:
                continue
            trial = settle(trial)
            level = compute_bic(trial)
        effect, _ = trial.point.active[-1]
        # what happens in one run may not stand beside a gross misfit, wherever in its row
        if effect.of_one_run and is_gross_elsewhere(trial, effect):
            continue
        if (placed := settle_instants(trial, {effect.name})) is not trial:
            trial, level = placed, compute_bic(placed)
            instant = placed.point.active[-1][1][INSTANT]
            variant = replace(variant, values={**variant.values, INSTANT: instant})
        if (
            _is_settled(fit, trial)
            and is_possible(effect, trial)
            and _may_stand(effect, fit, trial, ranked)
        ):
            whole.append((level, trial, score, variant))
    return sorted(whole, key=lambda t: t[0])


def _is_settled(fit: ExtendedFit, trial: ExtendedFit) -> bool:
    """Whether a cause's fit came to its end; or nearly so where the columns of what is unsettled
    stand about the motion of a gross misfit, along which no fit turns into the right one: they are
    made anew beside the cause."""
    if trial.series.unsettled is None or not is_gross(fit):
        return trial.converged
    return is_nearly_settled(trial, fit.chi2 - trial.chi2)


def is_nearly_settled(fit: ExtendedFit, taken: float) -> bool:
    """Whether a fit stands as nearly as a fall of χ² beside it needs.

    Parameters
    ----------
    fit
        Of the runs.
    taken
        The fall of χ².

    Returns
    -------
    bool
        It has converged, or promises to fall by a small part of that.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import is_nearly_settled
    >>> stopped = replace(draw_fit(), converged=False, promised=1.0)
    >>> is_nearly_settled(stopped, 10.0), is_nearly_settled(stopped, 1000.0)
    (False, True)
    """
    return fit.converged or fit.promised < UNSETTLED_BASE * taken


def settle(fit: ExtendedFit) -> ExtendedFit:
    """A fit that was made in few steps, to its end.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    ExtendedFit
        The same where it has converged.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import settle
    >>> settle(draw_fit()) is draw_fit()
    True
    """
    if fit.converged:
        return fit
    return extended_fit.fit(fit.series, fit.point, fit.freedom, near=fit.flow.near)


def _may_stand(
    effect: Effect,
    fit: ExtendedFit,
    trial: ExtendedFit,
    ranked: Sequence[tuple[Score, Variant]],
) -> bool:
    """Whether a cause may be taken in: while the misfit is gross and stays so, a part of what does
    not stand there would do for the whole unless it outdoes it, and what happens at an instant
    would have the misfit's own size (`instants`)."""
    if not is_gross(trial):
        return True
    active = {one.name for one, _ in fit.point.active}
    if not effect.part_of or active & set(effect.part_of):
        return not effect.of_one_run
    wholes = [pair for pair in ranked if pair[1].effect.name in effect.part_of]
    least = min(
        (other.chi2 for other, _, _ in adopt_each(fit, wholes, QUICK_STEPS)), default=np.inf
    )
    return trial.chi2 < least / OUTDONE


def loosen(fit: ExtendedFit) -> ExtendedFit:
    """The fit with the scale factor free as far as these runs leave it, once the misfit is no
    longer gross enough to bend it.

    The second order's scale is that of a real resonator; where it was that of plain averaging, it
    stays so only as long as that is clearly better.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    ExtendedFit
        The same where the misfit is gross.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import loosen
    >>> fit = draw_fit()
    >>> round(loosen(fit).coordinate("scale_factor") - fit.coordinate("scale_factor"), 4)
    0.0
    """
    loose = fit.freedom.loose
    if is_gross(fit) or loose is None:
        return fit
    real = fit_at_second_order(fit, 1.0)
    if fit.point.p[SECOND_ORDER] == 1.0:
        return real
    averaged = fit_at_second_order(fit, 0.0)
    return averaged if real.chi2 - averaged.chi2 > CLEARLY else real


def fit_at_second_order(fit: ExtendedFit, scale: float) -> ExtendedFit:
    """The fit with all that is weakly known free, at a scale of the second order.

    Parameters
    ----------
    fit
        Of the runs.
    scale
        1 of a resonator, 0 of an equation averaged over the period.

    Returns
    -------
    ExtendedFit
        Converged or not, as it says.

    Examples
    --------
    Runs at some rad/s hardly show it:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import fit_at_second_order
    >>> bool(abs(fit_at_second_order(draw_fit(), 0.0).chi2 - draw_fit().chi2) < 10)
    True
    """
    loose = fit.freedom.loose or fit.freedom
    held = replace(loose.hold("second_order", scale), loose=loose)
    return extended_fit.fit(fit.series, fit.point, held, near=fit.flow.near)


def take_plain_averaging(
    fit: ExtendedFit, ranked: Sequence[tuple[Score, Variant]]
) -> ExtendedFit | None:
    """The fit without the second order, where the data ask for that and no cause, which has a
    number of its own, is worth more: envelopes that come from an equation averaged over the period
    and from no resonator.

    A scale between 0 and 1, or beyond, is nobody's: free, it takes what a cause does. At one rate a
    gain mismatch is a damping split and −10⁴ of itself of that scale.

    Parameters
    ----------
    fit
        Of the runs.
    ranked
        Scores and variants of the causes, best first.

    Returns
    -------
    ExtendedFit or None
        None where the data do not ask for it.

    Examples
    --------
    Envelopes of a resonator do not:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import take_plain_averaging
    >>> take_plain_averaging(draw_fit(), []) is None
    True
    """
    if is_gross(fit) or fit.freedom.loose is None or fit.point.p[SECOND_ORDER] != 1.0:
        return None
    best = max((score.gain for score, _ in ranked if score.visible), default=0.0)
    asked = max(CLEARLY, best - WORTH)
    if _score_second_order(fit) < asked:
        return None
    averaged = fit_at_second_order(fit, 0.0)
    return averaged if fit.chi2 - averaged.chi2 > asked else None


def _score_second_order(fit: ExtendedFit) -> float:
    """By how much any scale of the second order makes χ² fall at most, to first order: what it does
    is 1e-3 of the motion, and linear."""
    shared = find_base_sensitivities(fit.flow)[0][..., [SECOND_ORDER]]
    column = flatten_rows(fit.series, shared)
    return evidence.score("second order", fit.residual, column, fit.basis).gain


def free_higher_orders(
    fit: ExtendedFit, ranked: Sequence[tuple[Score, Variant]]
) -> ExtendedFit | None:
    """The fit with the next order of one of its causes free, where the data ask for that more than
    for any other cause: a pick-off's fifth order beside its cubic.

    Parameters
    ----------
    fit
        Of the runs.
    ranked
        Scores and variants of the causes, best first.

    Returns
    -------
    ExtendedFit or None
        None where the data do not ask for it.

    Examples
    --------
    No cause, no order of one:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import free_higher_orders
    >>> free_higher_orders(draw_fit(), []) is None
    True
    """
    best = max((score.gain for score, _ in ranked if score.visible), default=0.0)
    for effect, values in fit.point.active:
        if all(p.fitted or not p.higher_order for p in effect.parameters):
            continue
        freed = free_also(effect, {p.name for p in effect.parameters if p.higher_order})
        point = fit_point.add_effect(fit.point, freed, dict(values))
        free = extended_fit.fit(fit.series, point, fit.freedom, near=fit.flow.near)
        if free.converged and fit.chi2 - free.chi2 > max(CLEARLY, best):
            return free
    return None


def leave_out(fit: ExtendedFit, *names: str, base: ExtendedFit | None = None) -> ExtendedFit | None:
    """The fit again without some effects, made once; None where no motion is left: the model cannot
    do without them.

    Parameters
    ----------
    fit
        With the effects.
    *names
        Of the effects.
    base
        A fit without effects, from whose place the others are fitted too where the effects have led
        so far that there is no way back.

    Returns
    -------
    ExtendedFit or None
        Without these effects.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.refits import leave_out
    >>> without = leave_out(draw_found_case().search.final, "gain_mismatch")
    >>> bool(abs(without.chi2 - draw_mismatched_fit().chi2) < 0.01)
    True
    """
    point = reduce(fit_point.remove_effect, names, fit.point)
    reduced: ExtendedFit | None = fit.recall(
        ("without", frozenset(names)), lambda: _fit_from(fit, point)
    )
    if base is None or (reduced is not None and reduced.converged):
        return reduced
    with contextlib.suppress(extended_fit.DivergedError):
        again = extended_fit.fit(
            fit.series, replace(base.point, active=point.active), fit.freedom, near=base.flow.near
        )
        if reduced is None or again.chi2 < reduced.chi2:
            return again
    return reduced


def _fit_from(fit: ExtendedFit, point: Point) -> ExtendedFit | None:
    """A fit again from a point near its motion; None where no motion is left."""
    with contextlib.suppress(extended_fit.DivergedError):
        return extended_fit.fit(fit.series, point, fit.freedom, near=fit.flow.near)
    return None
