"""Diagnosis, the fit whose numbers are told, with what widens their standard deviations."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ....effects.effect import Effect
from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.least_squares import square_over_covariance
from ..fits.refits import adopt, leave_out
from ..fits.scoring import score_effects
from ..search.beside_misfit import drop_indistinct
from ..search.open_rivals import give_way_to_open_terms
from ..search.search_case import Case
from ..search.selection import Found
from ..search.stand_in import takes_nearly_all
from ..thresholds import OWN_SIGMA
from .held_shapes import refit_one_sigma_off
from .next_orders import refit_next_orders

Array = np.ndarray


@dataclass(frozen=True)
class Sized:
    """The fit whose numbers are told, its variances times `factor`, and the fit beside the open
    terms where there are any.

    What the catalogue does not hold pulls at every number: what it leaves over widens the noise,
    and by how much a number moves once it is described as well as it can be counts as an error of
    its own.
    """

    fit: ExtendedFit
    beside: ExtendedFit
    factor: float
    off: Mapping[str, ExtendedFit] = field(default_factory=dict)
    """Refits with the held shape of a cause moved by one σ (`held_shapes`), by its name, or with
    its next order (`next_orders`), by its name and the order."""
    in_place: Sequence[ExtendedFit] = ()
    """Refits with a rival in the place of a cause that it is not told from: base values that differ
    between them are not known better than that."""

    @classmethod
    def from_case(cls, case: Case) -> Sized:
        """From the final fit of the catalogue's causes and what is left over."""
        final = case.search.final
        factor = max(case.inquiry.noise.slow, final.chi2 / final.dof, 1.0)
        beside = final if case.remainder is None else case.remainder.fit
        return cls(
            final,
            beside,
            factor,
            refit_one_sigma_off(final, factor) | refit_next_orders(final, factor),
            refit_with_rivals(case),
        )

    def std(self, std: float, value: float, others: Sequence[float]) -> float:
        """Standard deviation of a number with σ `std` in the fit, which stands at `others` in each
        of the other fits."""
        return float(np.sqrt(self.factor * std**2 + sum((value - v) ** 2 for v in others)))

    def measure_sigma_off(self, effect: Effect) -> float:
        """How many of the standard deviations that are told an effect of the fit stands off
        neutral: aᵀ C⁻¹ a with what is left over and the other fits in C (Wald), as a square
        root."""
        off, covariance = self._measure_off(effect)
        wald = square_over_covariance(off, covariance)
        return float(np.sqrt(max(wald, 0.0))) if np.isfinite(wald) else float("nan")

    def measure_clearest_sigma(self, effect: Effect) -> float:
        """How many σ the clearest number of an effect stands off neutral by itself, at most what
        they all do: numbers that only together are off zero, none of them known, are what a rest
        bends first."""
        off, covariance = self._measure_off(effect)
        alone = np.abs(off) / np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        return float(min(self.measure_sigma_off(effect), np.max(alone, initial=0.0)))

    def _measure_off(self, effect: Effect) -> tuple[Array, Array]:
        """An effect's distance from neutral (k,) and its covariance (k, k) with what is left over
        and the other fits in it."""
        columns = self.fit.layout.effect(effect.name)
        covariance = self.factor * self.fit.covariance[columns, columns]
        off, _ = self.fit.measure_distance(effect)
        for other in self.find_others(effect.name):
            moved = off - other.measure_distance(effect)[0]
            covariance = covariance + np.outer(moved, moved)
        return off, covariance

    @property
    def others(self) -> list[ExtendedFit]:
        """Fits in which a number stands elsewhere by what counts as an error of its own."""
        return [self.beside, *self.off.values()]

    def find_others(self, cause: str) -> list[ExtendedFit]:
        """Those that hold a cause, and in which its own numbers mean the same."""
        there = [self.beside, *(fit for name, fit in self.off.items() if name != cause)]
        return [fit for fit in there if cause in {one.name for one, _ in fit.point.active}]


def give_up_unsized(case: Case) -> tuple[Case, Sized]:
    """The case without the causes that, beside a rest, are not off zero by their own σ.

    Open terms that describe the rest take such a cause's place, or the rest moves it by as much as
    itself: it is a part of what is not understood. The weakest goes first; a cause that takes
    nearly all of a gross misfit stays, whatever its size.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    tuple
        The case, and its sizes.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.sized import give_up_unsized
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case
    >>> case, sized = give_up_unsized(draw_case())
    >>> case is draw_case(), sized.factor >= 1
    (True, True)
    """
    sized = Sized.from_case(case)
    while case.remainder is not None and (weakest := _find_weakest(case, sized)) is not None:
        # what came in beside it was judged beside it
        case = drop_indistinct(give_way_to_open_terms(case.give_up(*weakest)))
        sized = Sized.from_case(case)
    return case, sized


def _find_weakest(case: Case, sized: Sized) -> tuple[Found, ExtendedFit] | None:
    """The cause whose clearest number stands off zero least, by less than `OWN_SIGMA`, and the fit
    without it; None where there is none."""
    judged = [
        (sized.measure_clearest_sigma(one.variant.effect), number, one)
        for number, one in enumerate(case.search.found)
        if one.sizes is None
    ]
    for sigma, _, one in sorted(judged):
        if not sigma < OWN_SIGMA:
            break
        final = case.search.final
        without = leave_out(final, one.variant.effect.name, base=case.search.base)
        if without is not None and not takes_nearly_all(without, final):
            return one, without
    return None


def refit_with_rivals(case: Case) -> list[ExtendedFit]:
    """The final fit with each rival in the place of its cause.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    list of ExtendedFit
        Those that have one.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.sized import refit_with_rivals
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case
    >>> refit_with_rivals(draw_case())
    []
    """
    out: list[ExtendedFit] = []
    for one in case.search.found:
        if not one.rivals:
            continue
        reduced = leave_out(case.search.final, one.variant.effect.name, base=case.search.base)
        if reduced is None:
            continue
        for score, variant in score_effects(reduced, case.inquiry.candidates):
            if score.name in one.rivals and score.visible:
                with contextlib.suppress(extended_fit.DivergedError):
                    fit = adopt(reduced, score, variant)
                    if fit.converged:
                        out.append(fit)
    return out
