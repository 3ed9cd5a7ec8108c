"""Diagnosis, catalogued causes and open terms against each other: a cause that an open description
outdoes is not blamed."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ....fitting.causes import evidence, extended_fit
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.refits import adopt, compute_bic, loosen
from ..fits.scoring import score_effects
from ..thresholds import BOUND_COST, CLEARLY, FURTHER, OUTDONE, SAME, SIGNIFICANT, WORTH
from .remainder import OPEN_TERMS, Remainder, describe
from .search_case import Case, compute_criterion
from .selection import Found
from .stand_in import takes_nearly_all


@dataclass(frozen=True)
class Rival:
    """The first `count` causes with open terms beside them, against the whole list: the fit with
    these causes, what describes the rest of it, and the fit with the next cause (None: there is
    none)."""

    count: int
    fit: ExtendedFit
    described: Remainder
    ranked: tuple[Score, ...]
    beyond: ExtendedFit | None

    @property
    def criterion(self) -> float:
        """χ² + rank·ln N."""
        return compute_criterion(self.fit, self.described)

    def is_clearly_better(self, case: Case) -> bool:
        """Whether one open term does clearly better than the next cause, where the list of causes
        leaves something over."""
        if case.remainder is None or self.beyond is None:
            return False
        one = self.described.terms[0].score
        worth = evidence.find_bic_gain(one.gain, one.rank, len(self.fit.residual))
        more = compute_bic(self.fit) - compute_bic(self.beyond) - worth
        return more < -CLEARLY * case.inquiry.noise.slow


def give_way_to_open_terms(case: Case) -> Case:
    """The case without the catalogued causes that open terms outdo.

    What the runs' frequencies showed at the start is no matter of their rows, and stays. Every
    further beginning of the list of causes is held, with open terms beside it, against the whole
    list; where the list leaves nothing over, one open term alone is, which is all that could be a
    smaller claim than a list that explains everything. One that does better, but not by as much as
    the catalogue's claim is smaller, takes nothing away, and is remembered.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    Case
        With the same causes where nothing is given up.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.open_rivals import give_way_to_open_terms
    >>> [one.score.name for one in give_way_to_open_terms(draw_found_case()).search.found]
    ['gain_mismatch']
    """
    clearly = CLEARLY * case.inquiry.noise.slow
    full = case.criterion
    best: Rival | None = None
    near_by: list[Rival] = []
    start, begun = case.search.start.fit, len(case.search.start.found)
    for count, following in enumerate(case.search.found[begun:], begun):
        beyond = _take_cause(start, following)
        if beyond is not None and case.remainder is not None and takes_nearly_all(start, beyond):
            start = beyond
            continue
        rival = _rival(case, start, count, beyond)
        if _is_open(rival, case.search.found[count:], case.inquiry.noise.slow):
            near_by.append(rival)
            mimic = rival.is_clearly_better(case)
            # nothing is given up for a description that leaves clearly more over
            near = rival.criterion < full + clearly
            # beside open terms too a cause must earn its place
            if _is_better(rival, case, full, near and mimic) and (
                best is None or rival.criterion < best.criterion - clearly
            ):
                best = rival
            if mimic and near:  # an open term does better than the next cause: the list ends here
                break
        if rival.beyond is None or case.remainder is None:
            break
        start = rival.beyond
    if best is None:
        return replace(case, outdone=_say_outdone(case, near_by))
    found = case.search.found[: best.count]
    search = replace(case.search, final=best.fit, found=found, last=best.ranked)
    return replace(case, search=search, remainder=best.described)


def _say_outdone(case: Case, rivals: Sequence[Rival]) -> str:
    """The open description that does better than causes that leave nothing over; empty where none
    does."""
    better = case.criterion - OUTDONE * case.inquiry.noise.slow
    ahead = [one for one in rivals if one.criterion < better]
    if case.remainder is not None or not ahead:
        return ""
    rival = min(ahead, key=lambda one: one.criterion)
    names = " and ".join(one.variant.effect.name for one in case.search.found[rival.count :])
    term = rival.described.terms[0].score.name
    return (
        f"{term}, which the catalogue does not hold, leaves {case.criterion - rival.criterion:.3g}"
        f" less of χ² than {names}"
    )


def _take_cause(start: ExtendedFit, following: Found) -> ExtendedFit | None:
    """The fit with the next cause; None where it has no motion."""
    with contextlib.suppress(extended_fit.DivergedError):
        return loosen(adopt(start, following.score, following.variant))
    return None


def _rival(case: Case, start: ExtendedFit, count: int, beyond: ExtendedFit | None) -> Rival:
    search, inquiry = case.search, case.inquiry
    most = OPEN_TERMS if case.remainder is not None else 1
    described = describe(start, inquiry.noise, most, SIGNIFICANT)
    ranked = (
        search.first
        if count == 0
        else tuple(s for s, _ in score_effects(start, inquiry.candidates))
    )
    return Rival(count, start, described, ranked, beyond)


def _is_better(rival: Rival, case: Case, full: float, mimics: bool) -> bool:
    """Whether open terms are the better description.

    A damping at its bound says that the catalogue's form is not the right one; what the catalogue
    explains in full is given up only for something clearly better, by less the more causes it
    takes; what it explains in part must earn its place.
    """
    slow = case.inquiry.noise.slow
    # of a list that leaves something over each cause must be better than open terms by half of what
    # it had to earn: there the catalogue is no longer the smaller claim
    further = len(case.search.found) - rival.count - 1
    margin = max(0.0, CLEARLY - FURTHER * further) if case.remainder is None else -0.5 * WORTH
    bound = BOUND_COST * slow
    forbidden = case.search.final.bound_cost > bound > rival.described.fit.bound_cost
    near = rival.criterion < full + CLEARLY * slow
    return mimics or (near and forbidden) or rival.criterion < full - margin * slow


def _is_open(rival: Rival, found: Sequence[Found], slow: float) -> bool:
    """Whether there are open terms, and none is only another spelling of a catalogued effect, which
    does as well, or a special case of one that was found."""
    visible = [s for s in rival.ranked if s.visible]
    names = {one.variant.effect.name for one in found}
    return bool(rival.described.terms) and not any(
        evidence.correlate_spaces(t.score, s) > SAME
        # of a gross misfit half a percent, which such forms may differ by, is much
        and t.score.gain - s.gain < CLEARLY * slow
        and (s.rank <= t.score.rank or (s.name in names and t.score.rank == 1))
        for t in rival.described.terms
        for s in visible
    )
