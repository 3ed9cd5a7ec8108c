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
from dataclasses import replace

import numpy as np

from ....fitting.causes import damping_bound, extended_fit, scales
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import DAMPING, DAMPING_SPLIT
from ..fits.refits import adopt, bic, hold_unseen
from ..fits.scoring import is_possible, score_effects
from ..fits.variants import Variant
from ..thresholds import WORTH
from .case import Case
from .damping_form import Form, TriedForm
from .inquiry import Inquiry, NoiseLevel
from .remainder import search_rest
from .selection import Found, Search, prune_causes
from .shapes import (
    FREE,
    NAME,
    PASSIVE,
    SUPPLIED,
    DampingShape,
    effect_of,
    fit_shape,
    level_of,
    power_of,
    to_catalogue,
    values,
)

Array = np.ndarray
FORBIDDEN = 2.0
"""σ by which the linear damping must be beyond the passive bound to count as forbidden."""
DIFFERENT = 4.0
"""σ by which a fitted power must differ from the catalogue's."""
PROMISING, SHORTLIST, QUICK = 4.0, 6, 5
"""Score in σ from which a cause is refitted beside the new form, the most that are, and in how many
steps."""


def least_damping(fit: ExtendedFit) -> tuple[float, float]:
    """(ν − |νδμ|, σ): the linear damping along the weaker axis."""
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
    """
    search, inquiry, noise = case.search, case.inquiry, case.inquiry.noise
    place = next((f for f in search.found if f.variant.effect.name == NAME), None)
    if place is None or _serves(search, place, noise):
        return case
    with contextlib.suppress(extended_fit.DivergedError):
        old = (
            search.final
            if len(search.found) == 1
            else adopt(search.base, place.score, place.variant)
        )
        inflate, amplitude = noise.slow**0.5, scales.amplitude_of(old.series)
        low, low_std = least_damping(old)
        forbidden = _forbidden(old, noise)
        free = fit_shape(old, FREE)
        if not forbidden and not (free and _another(old, free, noise)):
            return case
        if free is not None and (not forbidden or not _forbidden(free, noise)):
            shape, fit = FREE, free
            tried: tuple[TriedForm, ...] = ()
        else:
            allowed = _allowed(old, noise)
            if not allowed:
                return case
            shape, fit = min(allowed, key=lambda pair: bic(pair[1]))
            tried = tuple(TriedForm(s, f.chi2) for s, f in allowed)
        fit, others = _beside(fit, replace(inquiry, most=inquiry.most - 1))
        # what a missing cause would do must not be taken for a forbidden damping: a model that
        # physics allows has to be beaten
        if not _forbidden(search.final, noise) and bic(fit) > bic(search.final):
            return case
        final = to_catalogue(fit, shape, amplitude)

        def real(value: float, std: float) -> tuple[float, float]:
            return value, inflate * std

        linear = real(
            float(final.point.p[DAMPING]), final.coordinate_std("damping") if shape.linear else 0.0
        )
        numbers = (real(*power_of(final)), real(*level_of(final, amplitude)), linear, amplitude)
        form = Form(
            shape,
            *numbers,
            forbidden,
            real(low, low_std),
            old.chi2,
            final.chi2,
            place.rivals,
            tried,
        )
        fitted = {p.name: 1.0 for p in effect_of(shape).fitted()}
        own = replace(place, variant=Variant(effect_of(shape), values(final), fitted))
        last = tuple(s for s, _ in score_effects(final, inquiry.candidates))
        search = replace(search, final=final, found=(own, *others), last=last)
        return replace(case, search=search, form=form, remainder=search_rest(final, noise))
    return case


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
    return bic(freed) > bic(search.final)


def _forbidden(fit: ExtendedFit, noise: NoiseLevel) -> bool:
    """Whether the damping stands at the bound of a passive resonator, and would be clearly beyond
    it if it might."""
    return fit.bound_cost > FORBIDDEN**2 * noise.slow


def _another(old: ExtendedFit, free: ExtendedFit, noise: NoiseLevel) -> bool:
    """Whether the power, left free, is another than the catalogue's."""
    power, power_std = power_of(free)
    return (
        abs(power - 2) > DIFFERENT * power_std * noise.slow**0.5
        and old.chi2 - free.chi2 > WORTH * noise.slow
    )


def _allowed(old: ExtendedFit, noise: NoiseLevel) -> list[tuple[DampingShape, ExtendedFit]]:
    """The shapes without a forbidden linear damping that the data do not tell from the best of
    them."""
    fits = [
        (shape, fit) for shape in (PASSIVE, *SUPPLIED) if (fit := fit_shape(old, shape)) is not None
    ]
    fits = [(s, f) for s, f in fits if not s.linear or not _forbidden(f, noise)]
    level = min((bic(f) for _, f in fits), default=0.0)
    return [(s, f) for s, f in fits if bic(f) < level + WORTH * noise.slow]


def _beside(fit: ExtendedFit, inquiry: Inquiry) -> tuple[ExtendedFit, list[Found]]:
    """Forward selection with every promising cause refitted; of causes not told apart the one with
    the fewest parameters stands first."""
    noise, found = inquiry.noise, list[Found]()
    while len(found) < inquiry.most:
        ranked = [
            (s, v)
            for s, v in score_effects(fit, inquiry.candidates)
            if s.visible and s.z > PROMISING * noise.slow**0.5
        ]
        trials = []
        for score, variant in ranked[:SHORTLIST]:
            with contextlib.suppress(extended_fit.DivergedError):
                trials.append((adopt(fit, score, variant, QUICK), score, variant))
        trials = [t for t in trials if bic(fit) - bic(t[0]) > WORTH * noise.slow]
        trials = [t for t in trials if is_possible(t[2].effect, t[0])]
        if not trials:
            break
        level = min(bic(t[0]) for t in trials)
        near = [t for t in trials if bic(t[0]) < level + WORTH * noise.slow]
        best, score, variant = min(near, key=lambda t: (t[1].rank, t[0].chi2))
        rivals = tuple(t[2].effect.name for t in near if t[0] is not best)
        found.append(
            Found(
                hold_unseen(variant, best),
                score,
                len(ranked),
                (bic(fit) - bic(best)) / noise.slow,
                rivals,
            )
        )
        fit = extended_fit.fit(best.series, best.point, best.freedom)
    return fit, found
