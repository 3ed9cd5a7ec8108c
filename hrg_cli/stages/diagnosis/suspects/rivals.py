"""Whether the catalogue explains what a wrong run would: then no run is blamed."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import Fit
from ..search import Variant, adopted, scored

MOST = 2
"""Causes at once that may stand against one wrong run."""
WORTHWHILE = 0.3
"""Part of χ² that a cause's score must promise to be refitted."""
TRIED = 4
"""Best scores that are refitted."""


def catalogued(base: Fit, candidates: Sequence[Variant], target: float) -> bool:
    """Whether one or two causes reach a χ² a degree of freedom of `target`."""
    fit = base
    for _ in range(MOST):
        fits = []
        strong = [pair for pair in scored(fit, candidates) if pair[0].visible and pair[0].gain > WORTHWHILE * fit.chi2]
        for score, variant in strong[:TRIED]:
            with contextlib.suppress(extended_fit.DivergedError):
                fits.append(adopted(fit, score, variant))
        if not fits:
            return False
        best = min(fits, key=lambda f: f.chi2 / f.dof)
        if best.chi2 / best.dof < target:
            return True
        if best.chi2 > 0.9 * fit.chi2:
            return False
        fit = best
    return False
