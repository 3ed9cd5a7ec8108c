"""Diagnosis, causes that fail a check of their own are not named.

A cause beside what no cause explains may be given a size by it: the closing checks ask each cause
whether it stands off zero with all that widens its σ, whether it is what struck at its instant,
whether it can be. One that fails is given up, the weakest first, and what is left is looked at again.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..fits.refits import leave_out
from ..search.case import Case
from ..search.selection import Found
from .closing_checks import checks_of_causes
from .sized import Sized

OWN = ("stands_off_zero", "is_possible", "is_what_struck")
"""Ends of the names of the checks that take a cause's name away. Of causes that are not told apart
the verdict is taken away, not the group."""


def keep_proven(case: Case) -> tuple[Case, Sized]:
    """The case without the causes that fail a check of their own, and its sizes; causes of another
    form than the catalogue's, and those whose sizes come from the runs' frequencies, are judged
    there."""
    sized = Sized.of(case)
    while case.form is None:
        failing = _failing(case, sized)
        if not failing:
            break
        weakest = min(failing, key=lambda one: sized.sigma_off(one.variant.effect))
        without = leave_out(case.search.final, weakest.variant.effect.name, base=case.search.base)
        if without is None:
            break
        case = case.without(weakest, without)
        sized = Sized.of(case)
    return case, sized


def _failing(case: Case, sized: Sized) -> Sequence[Found]:
    failed = {check.name for check in checks_of_causes(case, sized) if not check.passed}
    return [
        one
        for one in case.search.found
        if one.sizes is None and any(f"{one.variant.effect.name}_{told}" in failed for told in OWN)
    ]
