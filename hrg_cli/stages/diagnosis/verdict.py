"""Diagnosis, the verdict: catalogued causes and open terms against each other, and the noise they are judged by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...fitting.causes import evidence, extended_fit
from ...fitting.causes.extended_fit import Fit
from .remainder import Remainder, adequacy, describe
from .search import SIGNIFICANT, WORTH, Search, Variant, adopted, select

INADEQUATE = 1e-4
"""Chance at which a clean model would be called inadequate by the residual's smooth part, and again by the open terms."""
OPEN_TERMS = 3
CLEARLY = 16.0
"""ΔBIC by which an open description must beat catalogued causes that leave nothing over."""


def reweighted(fit: Fit, level: float) -> Fit:
    """The fit again with every σ times `level`."""
    return extended_fit.fit(replace(fit.series, weight=fit.series.weight / level), fit.point, fit.freedom)


def noise_level(fit: Fit, remainder: Remainder | None) -> float | None:
    """White noise over the stated one, from second differences of what is left in the end; None where they agree."""
    if fit.series.colour is not None:
        return None
    values = np.zeros((*fit.series.weight.shape, 4))
    values[tuple(fit.rows.T)] = (remainder.fit if remainder else fit).residual
    ok = fit.series.weight > 0
    rough = np.diff(values, n=2, axis=1)[ok[:, 2:]]
    if len(rough) < 20:
        return None
    level = float(np.sqrt(np.median(rough**2) / (6 * 0.45494)))  # median of χ² with one degree of freedom
    return level if abs(level - 1) > max(0.03, 8 / np.sqrt(rough.size)) and level > 1e-9 else None


def explain(base: Fit, candidates: Sequence[Variant], most: int) -> tuple[Search, Remainder | None, float]:
    """Selection and open search; repeated with inflated noise where, after both, the residual is still not white."""
    noise_factor = 1.0
    for _ in range(2):
        search = select(base, candidates, noise_factor, most, [])
        remainder = rest(search.final, noise_factor)
        level, p = adequacy(remainder.fit if remainder else search.final)
        if p > INADEQUATE or level < 1.2 * noise_factor:
            break
        noise_factor = level
    return search, remainder, noise_factor


def rest(fit: Fit, noise_factor: float) -> Remainder | None:
    """The open search where the fit is not adequate; None where it is.

    Not adequate: the residual's smooth part is too large, or one open term of all those tried finds what is too quick for that part.
    """
    level, p = adequacy(fit)
    if level < 1.2 * noise_factor and noise_factor > 1:
        return None
    if p > INADEQUATE:
        found = describe(fit, noise_factor, OPEN_TERMS, INADEQUATE)
        return found if found.terms else None
    return describe(fit, noise_factor, OPEN_TERMS, SIGNIFICANT)


def concluded(search: Search, remainder: Remainder | None, noise_factor: float) -> tuple[str, Search, Remainder | None]:
    """The word for it; catalogued causes that open terms outdo are dropped and not blamed."""
    if not search.found:
        return ("unexplained" if remainder is not None else "adequate"), search, remainder
    alone = describe(search.base, noise_factor, OPEN_TERMS, SIGNIFICANT)
    if alone.terms and not _is_catalogued(alone, search):
        price = float(np.log(len(search.base.residual)))
        spent = (search.final.basis.shape[1] - search.base.basis.shape[1] + (remainder.rank if remainder else 0)) * price
        catalogued = (search.final.chi2 if remainder is None else remainder.chi2) + spent
        described = alone.chi2 + alone.rank * price
        # a negative damping says that the catalogue's form is not the right one;
        # what the catalogue explains in full is given up only for something clearly better; what it explains in part must earn its place
        margin = CLEARLY if remainder is None else -0.5 * WORTH
        mimic = remainder is not None and _single(alone, search) < -CLEARLY * noise_factor
        forbidden = search.base.point.p[0] > 0 > search.final.point.p[0] and alone.fit.point.p[0] > 0
        if forbidden or mimic or described < catalogued - margin * noise_factor:
            return "unexplained", replace(search, final=search.base, found=(), last=search.first), alone
    return ("explained" if remainder is None else "partly explained"), search, remainder


def _single(alone: Remainder, search: Search) -> float:
    """χ² of the first open term alone less that of the first catalogued cause alone, each with its price."""
    base, first, one = search.base, search.found[0], alone.terms[0]
    price = float(np.log(len(base.residual)))
    cause = adopted(base, first.score, first.variant)
    return (base.chi2 - one.score.gain + one.score.rank * price) - (cause.chi2 + first.score.rank * price)


def _is_catalogued(remainder: Remainder, search: Search) -> bool:
    """Whether one of the open terms is only another spelling of a catalogued effect."""
    visible = [s for s in search.first if s.visible]
    return any(evidence.alike(t.score, s) > 0.995 and s.rank <= t.score.rank for t in remainder.terms for s in visible)
