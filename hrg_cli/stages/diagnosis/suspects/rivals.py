"""What the catalogue makes of the runs: whether it explains what a wrong run would: then no run is
blamed."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Mapping, Sequence

from ....effects.effect import Effect
from ....fitting.causes import extended_fit, fit_point
from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Wave
from ..fits.refits import QUICK_STEPS, adopt_hopeful, settle
from ..fits.scoring import score_effects
from ..fits.strike_instants import settle_instants
from ..fits.variants import Variant
from ..thresholds import MATTERS, WORTHWHILE
from ..thresholds import TAKES_NEARLY_ALL as NEARLY_ALL
from .cases import Fitted
from .logs import has_usual_scale_factor

Cause = tuple[Effect, Mapping[str, float]]
"""A cause with the values that it is fitted from."""
MOST = 2
"""Causes at once that may stand against one wrong run, beside those that take nearly all there
is."""
TRIED = 3
"""Best scores that are refitted."""


def fit_catalogue(base: ExtendedFit, candidates: Sequence[Variant], enough: float) -> float:
    """Least χ² per degree of freedom that a few causes reach with a scale factor that a resonator
    has.

    Parameters
    ----------
    base
        The fit without causes.
    candidates
        Causes of the catalogue beside `base`, as they may stand.
    enough
        χ² per degree of freedom at which it ends.

    Returns
    -------
    float
        That of the base model where no cause leaves less.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_fit
    >>> from hrg_cli.stages.diagnosis.suspects.rivals import fit_catalogue
    >>> candidates = draw_case().inquiry.candidates
    >>> round(fit_catalogue(draw_fit(), candidates, enough=1.0), 2)
    0.96
    """
    return _find_misfit(fit_nearest(base, candidates, enough))


def fit_nearest(base: ExtendedFit, candidates: Sequence[Variant], enough: float) -> ExtendedFit:
    """The fit that leaves least of those with a few causes, each chosen in few steps, with a scale
    factor that a resonator has.

    Parameters
    ----------
    base
        The fit without causes.
    candidates
        Causes of the catalogue beside `base`, as they may stand.
    enough
        χ² per degree of freedom at which it ends.

    Returns
    -------
    ExtendedFit
        The base model's where no cause leaves less.

    Examples
    --------
    Of a sound gyro no cause promises enough to be tried:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_fit
    >>> from hrg_cli.stages.diagnosis.suspects.rivals import fit_nearest
    >>> fit_nearest(draw_fit(), draw_case().inquiry.candidates, enough=1.0).point.active
    ()
    """
    fit = best = base
    for taken in itertools.count():
        worthwhile = WORTHWHILE if taken < MOST else NEARLY_ALL
        strong = [
            pair
            for pair in score_effects(fit, candidates)
            if pair[0].visible and pair[0].gain > worthwhile * fit.chi2
        ]
        fits = adopt_hopeful(fit, strong[:TRIED], QUICK_STEPS)
        likely = [one for one, _, _ in fits if has_usual_scale_factor(one)]
        if not likely:
            break
        fit = settle(min(likely, key=_find_misfit))
        fit = settle_instants(fit, {effect.name for effect, _ in fit.point.active})
        best = min(best, fit, key=_find_misfit)
        if _find_misfit(best) < enough:
            break
    return best


def _find_misfit(fit: ExtendedFit) -> float:
    return fit.chi2 / fit.dof


def fit_warming(
    fitted: Fitted,
    candidates: Sequence[Variant],
    base: ExtendedFit,
    left: float = MATTERS,
) -> Fitted | None:
    """The fit with frequency and damping that follow the temperature; None where that does not
    lower χ² of the runs much.

    Parameters
    ----------
    fitted
        The base model's fit to waves.
    candidates
        Causes of the catalogue beside `base`, as they may stand.
    base
        The fit of these runs.
    left
        Part of χ² that it may leave.

    Returns
    -------
    callable or None
        As `fitted`, with these causes too.

    Examples
    --------
    A gain mismatch follows no temperature:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_fit, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.rivals import fit_warming
    >>> fit_warming(fit_waves, draw_case().inquiry.candidates, draw_fit()) is None
    True
    """
    thermal = [variant for variant in candidates if variant.effect.scales]
    if not thermal or not base.series.has_temperature:
        return None

    causes = [(variant.effect, variant.values) for variant in thermal]
    with contextlib.suppress(extended_fit.DivergedError):
        if _with_causes(base, causes).chi2 < left * base.chi2:
            return add_causes_to_fit(fitted, causes)
    return None


def add_causes_to_fit(fitted: Fitted, causes: Sequence[Cause]) -> Fitted:
    """The base model's fit followed by that with these causes too.

    Parameters
    ----------
    fitted
        The base model's fit to waves.
    causes
        With the values that they are fitted from.

    Returns
    -------
    callable
        As `fitted`.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.rivals import add_causes_to_fit
    >>> (one,) = draw_case().inquiry.candidates
    >>> fit = add_causes_to_fit(fit_waves, [(one.effect, one.values)])(draw_waves())
    >>> bool(
    ...     abs(fit.values("gain_mismatch")["gain"])
    ...     < 3 * fit.parameter_std("gain_mismatch", "gain")
    ... )
    True
    """

    def fit(waves: Sequence[Wave], *, quick: bool = False) -> ExtendedFit:
        return _with_causes(fitted(waves, quick=quick), causes)

    return fit


def _with_causes(plain: ExtendedFit, causes: Sequence[Cause]) -> ExtendedFit:
    """A fit again, in few steps, with causes from these values on."""
    point = plain.point
    for effect, values in causes:
        point = fit_point.add_effect(point, effect, values)
    return extended_fit.fit(plain.series, point, plain.freedom, QUICK_STEPS)
