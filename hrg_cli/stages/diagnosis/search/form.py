"""Diagnosis, the functional form of a damping that changes: the power of the amplitude it follows,
and what physics forbids.

A passive resonator's linear damping is nowhere negative: ν − |νδμ| ≥ 0. A catalogued damping that
needs it negative has the wrong form, and so has one whose power, left free, comes out as another.
Another shape takes its place. Where ν is forbidden even with the power free, those that physics
allows stand against each other, and the ones that χ² does not tell from the best are named beside
it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....fitting.causes import damping_bound, extended_fit, scales
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import DAMPING, DAMPING_SPLIT
from ..fits.refits import adopt, compute_bic, hold_unseen
from ..fits.scoring import is_possible, score_effects
from ..fits.variants import Variant
from ..thresholds import ANOTHER_POWER, FORBIDDEN_DAMPING, WORTH
from .damping_form import Form, TriedForm
from .inquiry import Inquiry, NoiseLevel
from .remainder import search_rest
from .search_case import Case
from .selection import Found, Search, prune_causes
from .shapes import (
    FREE,
    NAME,
    PASSIVE,
    SUPPLIED,
    DampingShape,
    compute_level,
    fit_shape,
    make_damping_effect,
    measure_level_sigma,
    read_damping_values,
    read_power,
    to_catalogue,
)

Array = np.ndarray
PROMISING, SHORTLIST, QUICK = 4.0, 6, 5
"""Score in σ from which a cause is refitted beside the new form, the most that are, and in how many
steps."""


def find_least_damping(fit: ExtendedFit) -> tuple[float, float]:
    """(ν − |νδμ|, σ): the linear damping along the weaker axis.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    tuple of float
        [1/s].

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.form import find_least_damping
    >>> least, std = find_least_damping(draw_fit())
    >>> round(least, 1), std < 0.01
    (0.5, True)
    """
    p = fit.point.p
    size = float(np.hypot(*p[DAMPING_SPLIT]))
    slope = np.array([1.0, *(-p[DAMPING_SPLIT] / size if size > 0 else (0.0, 0.0))])
    index = [fit.layout.coordinate(name) for name in damping_bound.CONE]
    there = [k for k in range(3) if index[k] is not None]
    rows = [column for column in index if column is not None]
    variance = slope[there] @ fit.covariance[np.ix_(rows, rows)] @ slope[there] if there else 0.0
    return float(p[DAMPING]) - size, float(np.sqrt(max(variance, 0.0)))


def take_better_form(case: Case) -> Case:
    """The case with the damping's better form in the catalogue's place, or as it was where that
    serves.

    Causes that the search added to a form that fits only roughly are sought again beside the better
    one.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    Case
        The same where nothing is given up.

    Examples
    --------
    No damping that changes was found:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.form import take_better_form
    >>> take_better_form(draw_found_case()) is draw_found_case()
    True
    """
    search, noise = case.search, case.inquiry.noise
    place = next((f for f in search.found if f.variant.effect.name == NAME), None)
    if place is None or _serves(search, place, noise):
        return case
    with contextlib.suppress(extended_fit.DivergedError):
        alone = len(search.found) == 1
        old = search.final if alone else adopt(search.base, place.score, place.variant)
        better = _choose_form(old, noise)
        if better is None:
            return case
        inquiry = replace(case.inquiry, most=case.inquiry.most - 1)
        fit, others = _take_beside(better.fit, inquiry)
        # what a missing cause would do must not be taken for a forbidden damping: a model that
        # physics allows has to be beaten
        if not _forbidden(search.final, noise) and compute_bic(fit) > compute_bic(search.final):
            return case
        amplitude = scales.measure_amplitude(old.series)
        final = to_catalogue(fit, better.shape, amplitude)
        effect = make_damping_effect(better.shape)
        variant = Variant(
            effect, read_damping_values(final), {p.name: 1.0 for p in effect.fitted()}
        )
        last = tuple(score for score, _ in score_effects(final, inquiry.candidates))
        found = (replace(place, variant=variant), *others)
        return replace(
            case,
            search=replace(search, final=final, found=found, last=last),
            form=_describe_form(better, old, final, noise, place.rivals),
            remainder=search_rest(final, noise),
        )
    return case


@dataclass(frozen=True)
class BetterForm:
    """A shape that takes the catalogue's place, the fit with it, whether physics forbids the
    catalogue's, and the shapes that the data do not tell from it where it does."""

    shape: DampingShape
    fit: ExtendedFit
    forbidden: bool
    tried: tuple[TriedForm, ...] = ()


def _choose_form(old: ExtendedFit, noise: NoiseLevel) -> BetterForm | None:
    """The shape to take in the place of the catalogue's in `old`; None where that stands.

    A free power comes first: it contains the catalogue's form and says by how much it errs. Only
    where physics forbids the linear damping with any power do other shapes stand against each
    other.
    """
    forbidden = _forbidden(old, noise)
    free = fit_shape(old, FREE)
    if not forbidden and not (free and _has_another_power(old, free, noise)):
        return None
    if free is not None and (not forbidden or not _forbidden(free, noise)):
        return BetterForm(FREE, free, forbidden)
    allowed = _allowed(old, noise)
    if not allowed:
        return None
    shape, fit = min(allowed, key=lambda pair: compute_bic(pair[1]))
    tried = tuple(TriedForm(other, trial.chi2) for other, trial in allowed)
    return BetterForm(shape, fit, forbidden, tried)


def _describe_form(
    better: BetterForm,
    old: ExtendedFit,
    final: ExtendedFit,
    noise: NoiseLevel,
    rivals: tuple[str, ...],
) -> Form:
    """What the report says of the form, every σ that of wandering noise."""
    shape, amplitude = better.shape, scales.measure_amplitude(old.series)
    inflate = noise.slow**0.5

    def inflated(value: float, std: float) -> tuple[float, float]:
        return value, inflate * std

    linear_std = final.coordinate_std("damping") if shape.linear else 0.0
    return Form(
        shape,
        z=measure_level_sigma(final) / inflate,
        power=inflated(*read_power(final)),
        level_1_s=inflated(*compute_level(final, amplitude)),
        linear_1_s=inflated(float(final.point.p[DAMPING]), linear_std),
        amplitude=amplitude,
        forbidden=better.forbidden,
        catalogue_1_s=inflated(*find_least_damping(old)),
        chi2_catalogue=old.chi2,
        chi2=final.chi2,
        rivals=rivals,
        tried=better.tried,
    )


def _serves(search: Search, place: Found, noise: NoiseLevel) -> bool:
    """Whether the catalogue's form stands beside the other causes found: physics allows it there,
    and with the power free and the causes given up that are then not worth their price the data
    are not described better.

    Alone it could only be judged where nothing else was found: what a missing cause does bends the
    damping, and the search for a form that serves alone takes many causes to come back.
    """
    others = [one for one in search.found if one is not place]
    if not others or _forbidden(search.final, noise):
        return False
    free = fit_shape(search.final, FREE)
    if free is None:
        return False
    freed, _ = prune_causes(free, others, noise, {})
    return compute_bic(freed) > compute_bic(search.final)


def _forbidden(fit: ExtendedFit, noise: NoiseLevel) -> bool:
    """Whether the damping stands at the bound of a passive resonator, and would be clearly beyond
    it if it might."""
    return fit.bound_cost > FORBIDDEN_DAMPING**2 * noise.slow


def _has_another_power(old: ExtendedFit, free: ExtendedFit, noise: NoiseLevel) -> bool:
    """Whether the power, left free, is another than the catalogue's."""
    power, power_std = read_power(free)
    return (
        abs(power - 2) > ANOTHER_POWER * power_std * noise.slow**0.5
        and old.chi2 - free.chi2 > WORTH * noise.slow
    )


def _allowed(old: ExtendedFit, noise: NoiseLevel) -> list[tuple[DampingShape, ExtendedFit]]:
    """The shapes without a forbidden linear damping that the data do not tell from the best of
    them."""
    fits = []
    for shape in (PASSIVE, *SUPPLIED):
        fit = fit_shape(old, shape)
        if fit is not None and not (shape.linear and _forbidden(fit, noise)):
            fits.append((shape, fit))
    level = min((compute_bic(fit) for _, fit in fits), default=0.0)
    return [(shape, fit) for shape, fit in fits if compute_bic(fit) < level + WORTH * noise.slow]


def _take_beside(fit: ExtendedFit, inquiry: Inquiry) -> tuple[ExtendedFit, list[Found]]:
    """Forward selection with every promising cause refitted; of causes not told apart the one with
    the fewest parameters stands first."""
    noise, found = inquiry.noise, list[Found]()
    while len(found) < inquiry.most:
        ranked = [
            (score, variant)
            for score, variant in score_effects(fit, inquiry.candidates)
            if score.visible and score.z > PROMISING * noise.slow**0.5
        ]
        trials = _try_quickly(fit, ranked[:SHORTLIST], noise)
        if not trials:
            break
        level = min(compute_bic(trial) for trial, _, _ in trials)
        near = [one for one in trials if compute_bic(one[0]) < level + WORTH * noise.slow]
        best, score, variant = min(near, key=lambda one: (one[1].rank, one[0].chi2))
        rivals = tuple(other.effect.name for trial, _, other in near if trial is not best)
        gain = (compute_bic(fit) - compute_bic(best)) / noise.slow
        found.append(Found(hold_unseen(variant, best), score, len(ranked), gain, rivals))
        fit = extended_fit.fit(best.series, best.point, best.freedom)
    return fit, found


def _try_quickly(
    fit: ExtendedFit, ranked: Sequence[tuple[Score, Variant]], noise: NoiseLevel
) -> list[tuple[ExtendedFit, Score, Variant]]:
    """The refits, in a few steps each, of causes that are worth their price and can be."""
    trials = []
    for score, variant in ranked:
        with contextlib.suppress(extended_fit.DivergedError):
            trial = adopt(fit, score, variant, QUICK)
            worth_it = compute_bic(fit) - compute_bic(trial) > WORTH * noise.slow
            if worth_it and is_possible(variant.effect, trial):
                trials.append((trial, score, variant))
    return trials
