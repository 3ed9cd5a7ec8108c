"""Diagnosis, from the base fit to the case: causes and what they leave over, at the noise that both
are judged by, and every step in which a cause may be lost again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.variants import Variant
from ..thresholds import GROSS, INADEQUATE, NEVER_LESS, SLOWER_NOISE
from .beside_misfit import drop_indistinct
from .between import begin_with_frequencies, take_from_frequencies
from .forecast import drop_misleading
from .form import take_better_form
from .inquiry import Inquiry, NoiseLevel
from .instants import place_strikes, take_strikes
from .open_rivals import give_way_to_open_terms
from .remainder import Remainder, judge_adequacy, search_rest
from .search_case import Case
from .selection import select
from .separability import name_doubles

LEAST_CHANGE = 0.03
"""Relative difference of the noise from the stated one that is let be."""
SLOWER, FEWEST_ROUGH = (4, 8), 20
"""Rows of the means that are asked where neighbours scatter by less than they state, and the rows
of second differences from which they are."""


def explain(
    base: ExtendedFit,
    candidates: Sequence[Variant],
    most: int,
    sampling_step_s: float | None = None,
) -> Case:
    """The causes beside the base fit: searched, held against the runs' frequencies, against open
    terms, against other forms, against data held out, and against what is left over.

    Where the white noise between windows is not what they state, all is done again at the noise
    that is there; the case's `inquiry.noise` says so, and the closing checks judge it.

    Parameters
    ----------
    base
        The fit without causes.
    candidates
        Ways in which causes may stand beside it.
    most
        Causes that are taken in at most.
    sampling_step_s
        Of the runs' even sampling [s]; None where it is not known or not one.

    Returns
    -------
    Case
        The causes and what they leave over.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.explain import explain
    >>> case = explain(draw_mismatched_fit(), draw_found_case().inquiry.candidates, most=1)
    >>> [one.score.name for one in case.search.found], case.remainder
    (['gain_mismatch'], None)
    """
    asked = Inquiry(tuple(candidates), most, sampling_step_s=sampling_step_s)
    case = _searched(base, asked)
    white = estimate_noise_level(case.search.final, case.remainder)
    if white is not None:
        inquiry = replace(asked, noise=NoiseLevel(white=white))
        case = _searched(reweight_fit(base, white), inquiry)
    # each step judges what those before it left. Causes that only the frequencies of the runs show
    # are taken before any is given up for want of them; a cause that open terms outdo needs no
    # better form; data held out judge the form that stays; what strikes does so at one place of its
    # row; only then is what is left over a misfit that nothing explains, out of which strikes, and
    # in the end every cause, have to stand
    for step in (
        take_from_frequencies,
        give_way_to_open_terms,
        take_better_form,
        drop_misleading,
        place_strikes,
        take_strikes,
        drop_indistinct,
        name_doubles,
    ):
        case = step(case)
    return case


def _searched(base: ExtendedFit, inquiry: Inquiry) -> Case:
    """Selection and open search; repeated with inflated noise where, after both, the residual is
    still not white."""
    # not until it settles: with more noise fewer causes are taken and more is left over, so that
    # each round would inflate the next. The level of the last one is kept for judging
    for _ in range(2):
        search = select(base, inquiry, begin_with_frequencies(base, inquiry))
        case = Case(inquiry, search, search_rest(search.final, inquiry.noise))
        slow, p = judge_adequacy(case.remainder.fit if case.remainder else search.final)
        if p > INADEQUATE or slow < NEVER_LESS * inquiry.noise.slow:
            break
        inquiry = replace(inquiry, noise=replace(inquiry.noise, slow=slow))
        case = replace(case, inquiry=inquiry)
    return case


def reweight_fit(fit: ExtendedFit, level: float) -> ExtendedFit:
    """The fit again with every σ times `level`.

    Parameters
    ----------
    fit
        Of the runs.
    level
        By which every σ is multiplied.

    Returns
    -------
    ExtendedFit
        Of the same causes.

    Examples
    --------
    Of twice the noise χ² is a quarter:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.explain import reweight_fit
    >>> round(reweight_fit(draw_fit(), 2.0).chi2 / draw_fit().chi2, 3)
    0.25
    """
    series = fit.series
    scatter = None if series.scatter is None else series.scatter.scale_noise(level)
    unsettled = None if series.unsettled is None else series.unsettled.scale_noise(level)
    series = replace(series, weight=series.weight / level, scatter=scatter, unsettled=unsettled)
    return extended_fit.fit(series, fit.point, fit.freedom)


def estimate_noise_level(fit: ExtendedFit, remainder: Remainder | None) -> float | None:
    """White noise over the stated one, from second differences of what is left in the end; None
    where they agree, and where a gross misfit is left, however large the noise.

    Neighbours that scatter by less than they state may be correlated (a lock-in's filter), and
    state what is slow: only as far as means of several rows scatter by less too is the noise less.

    Parameters
    ----------
    fit
        Of the runs.
    remainder
        What the open search says of it, or None.

    Returns
    -------
    float or None
        σ over the stated one.

    Examples
    --------
    Noise as stated, and stated twice as large:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.explain import estimate_noise_level, reweight_fit
    >>> estimate_noise_level(draw_fit(), None) is None
    True
    >>> round(estimate_noise_level(reweight_fit(draw_fit(), 2.0), None), 1)
    0.5
    """
    values = extended_fit.place_on_rows(fit, (remainder.fit if remainder else fit).residual)
    found = _roughness(values, fit.series.weight, 1)
    if found is None:
        return None
    level, count = found
    if level < 1:
        slower = [_roughness(values, fit.series.weight, rows) for rows in SLOWER]
        more = [
            one for one, n in filter(None, slower) if one > level * (1 + SLOWER_NOISE / np.sqrt(n))
        ]
        level = min(1.0, max([level, *more]))
    if fit.chi2 > GROSS * fit.dof * max(level, 1.0) ** 2:
        return None
    # 8/√n is five standard deviations of the level: its median scatters by 1.6/√n
    return (
        level if abs(level - 1) > max(LEAST_CHANGE, 8 / np.sqrt(count)) and level > 1e-9 else None
    )


def _roughness(values: np.ndarray, weight: np.ndarray, rows: int) -> tuple[float, int] | None:
    """σ of residuals (R, n, 4) by second differences of means of so many rows, as white noise would
    have it, and the number of these; None where there are too few."""
    count = values.shape[1] // rows
    parts = values[:, : count * rows].reshape(len(values), count, rows, -1).sum(axis=2)
    ok = np.min(weight[:, : count * rows].reshape(len(values), count, rows), axis=2) > 0
    rough = np.diff(parts, n=2, axis=1)[ok[:, 2:] & ok[:, 1:-1] & ok[:, :-2]]
    if len(rough) < FEWEST_ROUGH:
        return None
    # of a squared normal number the median is 0.455 of the mean; a second difference has 6 σ²
    return float(np.sqrt(np.median(rough**2) / (6 * rows * 0.45494))), rough.size
