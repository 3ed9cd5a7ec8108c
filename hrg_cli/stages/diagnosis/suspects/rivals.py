"""What the catalogue makes of the runs: whether it explains what a wrong run would: then no run is
blamed."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence

from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import Fit
from ....records import Wave
from ..refits import QUICK_STEPS, adopted
from ..scoring import scored
from ..variants import Variant
from .logs import usual_scale_factor

MOST = 2
"""Causes at once that may stand against one wrong run."""
MATTERS = 0.7
"""Part of χ² that a temperature dependence may leave for the thermometers to be looked at."""
WORTHWHILE = 0.3
"""Part of χ² that a cause's score must promise to be refitted."""
TRIED = 3
"""Best scores that are refitted."""


def catalogued(base: Fit, candidates: Sequence[Variant], enough: float) -> float:
    """Least χ² a degree of freedom that a few causes reach with a scale factor that a resonator
    has; it ends where that is `enough`."""
    return _left(nearest(base, candidates, enough))


def nearest(base: Fit, candidates: Sequence[Variant], enough: float) -> Fit:
    """The fit that leaves least of those with a few causes, found in few steps, with a scale factor
    that a resonator has; it ends where χ² a degree of freedom is `enough`."""
    fit = best = base
    for _ in range(MOST):
        strong = [
            pair
            for pair in scored(fit, candidates)
            if pair[0].visible and pair[0].gain > WORTHWHILE * fit.chi2
        ]
        fits = []
        for score, variant in strong[:TRIED]:
            with contextlib.suppress(extended_fit.DivergedError):
                fits.append(adopted(fit, score, variant, QUICK_STEPS))
        likely = [one for one in fits if usual_scale_factor(one)]
        if not likely:
            break
        fit = min(likely, key=_left)
        best = min(best, fit, key=_left)
        if _left(best) < enough:
            break
    return best


def _left(fit: Fit) -> float:
    return fit.chi2 / fit.dof


def warmed(
    fitted: Callable[[Sequence[Wave]], Fit], candidates: Sequence[Variant], base: Fit
) -> Callable[[Sequence[Wave]], Fit] | None:
    """The fit with frequency and damping that follow the temperature; None where that does not
    lower χ² of the runs much."""
    thermal = [variant for variant in candidates if variant.effect.scales]
    if not thermal or not base.series.has_temperature:
        return None

    def fit(waves: Sequence[Wave]) -> Fit:
        plain = fitted(waves)
        point = plain.point
        for variant in thermal:
            point = extended_fit.with_effect(point, variant.effect, variant.values)
        return extended_fit.fit(plain.series, point, plain.freedom, QUICK_STEPS)

    with contextlib.suppress(extended_fit.DivergedError):
        series = base.series
        point = base.point
        for variant in thermal:
            point = extended_fit.with_effect(point, variant.effect, variant.values)
        if extended_fit.fit(series, point, base.freedom, QUICK_STEPS).chi2 < MATTERS * base.chi2:
            return fit
    return None
