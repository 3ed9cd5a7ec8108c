"""Diagnosis, the verdict: catalogued causes and open terms against each other, and the noise they
are judged by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...fitting.causes import evidence, extended_fit
from ...fitting.causes.evidence import Score
from ...fitting.causes.extended_fit import Fit
from .remainder import Remainder, adequacy, describe
from .search import Found, Search, Variant, adopted, bic, loosened, scored, select
from .thresholds import BOUND_COST, CLEARLY, INADEQUATE, NEVER_LESS, SAME, SIGNIFICANT, WORTH

OPEN_TERMS = 3
"""Open terms that describe a rest; a rest that needs more is not described."""


def reweighted(fit: Fit, level: float) -> Fit:
    """The fit again with every σ times `level`."""
    return extended_fit.fit(
        replace(fit.series, weight=fit.series.weight / level), fit.point, fit.freedom
    )


def noise_level(fit: Fit, remainder: Remainder | None) -> float | None:
    """White noise over the stated one, from second differences of what is left in the end; None
    where they agree."""
    values = np.zeros((*fit.series.weight.shape, 4))
    values[tuple(fit.rows.T)] = (remainder.fit if remainder else fit).residual
    ok = fit.series.weight > 0
    rough = np.diff(values, n=2, axis=1)[ok[:, 2:]]
    if len(rough) < 20:
        return None
    level = float(
        np.sqrt(np.median(rough**2) / (6 * 0.45494))
    )  # median of χ² with one degree of freedom
    return level if abs(level - 1) > max(0.03, 8 / np.sqrt(rough.size)) and level > 1e-9 else None


def explain(
    base: Fit, candidates: Sequence[Variant], most: int
) -> tuple[Search, Remainder | None, float]:
    """Selection and open search; repeated with inflated noise where, after both, the residual is
    still not white."""
    noise_factor = 1.0
    for _ in range(2):
        search = select(base, candidates, noise_factor, most)
        remainder = rest(search.final, noise_factor)
        level, p = adequacy(remainder.fit if remainder else search.final)
        if p > INADEQUATE or level < NEVER_LESS * noise_factor:
            break
        noise_factor = level
    return search, remainder, noise_factor


def rest(fit: Fit, noise_factor: float) -> Remainder | None:
    """The open search where the fit is not adequate; None where it is.

    Not adequate: the residual's smooth part is too large, or one open term of all those tried finds
    what is too quick for that part.
    """
    level, p = adequacy(fit)
    if level < NEVER_LESS * noise_factor and noise_factor > 1:
        return None
    if p > INADEQUATE:
        found = describe(fit, noise_factor, OPEN_TERMS, INADEQUATE)
        return found if found.terms else None
    return describe(fit, noise_factor, OPEN_TERMS, SIGNIFICANT)


def concluded(
    search: Search, remainder: Remainder | None, noise_factor: float, candidates: Sequence[Variant]
) -> tuple[Search, Remainder | None]:
    """The search and what is left over; catalogued causes that open terms outdo are dropped and not
    blamed.

    Every beginning of the list of causes is held, with open terms beside it, against the whole
    list; where the list leaves nothing over, one open term alone is, which is all that could be a
    smaller claim than a list that explains everything.
    """
    if not search.found:
        return search, remainder
    price = float(np.log(len(search.base.residual)))
    full = (search.final.chi2 if remainder is None else remainder.chi2) + price * _rank(
        search.final, remainder
    )
    best: tuple[float, Search, Remainder] | None = None
    start = search.base
    for count, following in enumerate(search.found):
        described = describe(
            start, noise_factor, OPEN_TERMS if remainder is not None else 1, SIGNIFICANT
        )
        ranked = search.first if count == 0 else tuple(s for s, _ in scored(start, candidates))
        try:
            beyond = loosened(adopted(start, following.score, following.variant))
        except extended_fit.DivergedError:
            beyond = None
        if described.terms and not _is_catalogued(described, ranked, search.found[count:]):
            value = described.chi2 + price * _rank(start, described)
            # a damping at its bound says that the catalogue's form is not the right one; what the
            # catalogue explains in full is given up only for something clearly better; what it
            # explains in part must earn its place
            margin = CLEARLY if remainder is None else -0.5 * WORTH
            mimic = (
                remainder is not None
                and beyond is not None
                and _single(start, described, beyond) < -CLEARLY * noise_factor
            )
            forbidden = (
                search.final.bound_cost > BOUND_COST * noise_factor > described.fit.bound_cost
            )
            # nothing is given up for a description that leaves clearly more over
            near = value < full + CLEARLY * noise_factor
            outdone = (near and (forbidden or mimic)) or value < full - margin * noise_factor
            # beside open terms too a cause must earn its place
            if outdone and (best is None or value < best[0] - CLEARLY * noise_factor):
                best = (
                    value,
                    replace(search, final=start, found=search.found[:count], last=ranked),
                    described,
                )
            if mimic and near:  # an open term does better than the next cause: the list ends here
                break
        if beyond is None or remainder is None:
            break
        start = beyond
    if best is not None:
        return best[1], best[2]
    return search, remainder


def _rank(fit: Fit, beside: Remainder | None) -> int:
    return fit.basis.shape[1] + (beside.rank if beside else 0)


def _single(start: Fit, described: Remainder, beyond: Fit) -> float:
    """χ² of the first open term alone less that with the next catalogued cause, each with its
    price."""
    one = described.terms[0].score
    return bic(start) - bic(beyond) - evidence.criterion(one.gain, one.rank, len(start.residual))


def _is_catalogued(remainder: Remainder, ranked: Sequence[Score], found: Sequence[Found]) -> bool:
    """Whether one of the open terms is only another spelling of a catalogued effect, or a special
    case of one that was found."""
    visible = [s for s in ranked if s.visible]
    names = {one.variant.effect.name for one in found}
    return any(
        evidence.alike(t.score, s) > SAME
        and (s.rank <= t.score.rank or (s.name in names and t.score.rank == 1))
        for t in remainder.terms
        for s in visible
    )
