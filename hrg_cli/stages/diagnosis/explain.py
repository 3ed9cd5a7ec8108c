"""Diagnosis, from the base fit to the case: causes and what they leave over, at the noise that both
are judged by, and every step in which a cause may be lost again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...fitting.causes import extended_fit
from ...fitting.causes.extended_fit import ExtendedFit
from .beside_misfit import drop_indistinct
from .between import take_from_frequencies
from .case import Case
from .forecast import drop_misleading
from .form import take_better_form
from .inquiry import Inquiry, NoiseLevel
from .instants import take_strikes
from .open_rivals import give_way_to_open_terms
from .remainder import Remainder, adequacy, search_rest
from .search import select
from .thresholds import GROSS, INADEQUATE, NEVER_LESS
from .variants import Variant

LEAST_CHANGE = 0.03
"""Relative difference of the noise from the stated one that is let be."""


def explain(base: ExtendedFit, candidates: Sequence[Variant], most: int) -> Case:
    """The causes beside the base fit: searched, held against the runs' frequencies, against open
    terms, against other forms, against data held out, and against what is left over.

    Where the white noise between windows is not what they state, all is done again at the noise
    that is there; the case's `inquiry.noise` says so, and the closing checks judge it.
    """
    case = _searched(base, Inquiry(tuple(candidates), most))
    white = noise_level(case.search.final, case.remainder)
    if white is not None:
        inquiry = Inquiry(tuple(candidates), most, NoiseLevel(white=white))
        case = _searched(reweighted(base, white), inquiry)
    for step in (
        take_from_frequencies,
        give_way_to_open_terms,
        take_better_form,
        drop_misleading,
        take_strikes,
        drop_indistinct,
    ):
        case = step(case)
    return case


def _searched(base: ExtendedFit, inquiry: Inquiry) -> Case:
    """Selection and open search; repeated with inflated noise where, after both, the residual is
    still not white."""
    for _ in range(2):
        search = select(base, inquiry)
        case = Case(inquiry, search, search_rest(search.final, inquiry.noise))
        slow, p = adequacy(case.remainder.fit if case.remainder else search.final)
        if p > INADEQUATE or slow < NEVER_LESS * inquiry.noise.slow:
            break
        inquiry = replace(inquiry, noise=replace(inquiry.noise, slow=slow))
        case = replace(case, inquiry=inquiry)
    return case


def reweighted(fit: ExtendedFit, level: float) -> ExtendedFit:
    """The fit again with every σ times `level`."""
    series = fit.series
    scatter = None if series.scatter is None else series.scatter.over(level)
    unsettled = None if series.unsettled is None else series.unsettled.over(level)
    series = replace(series, weight=series.weight / level, scatter=scatter, unsettled=unsettled)
    return extended_fit.fit(series, fit.point, fit.freedom)


def noise_level(fit: ExtendedFit, remainder: Remainder | None) -> float | None:
    """White noise over the stated one, from second differences of what is left in the end; None
    where they agree, and where a gross misfit is left, however large the noise."""
    values = extended_fit.on_rows(fit, (remainder.fit if remainder else fit).residual)
    ok = fit.series.weight > 0
    rough = np.diff(values, n=2, axis=1)[ok[:, 2:]]
    if len(rough) < 20:
        return None
    level = float(
        np.sqrt(np.median(rough**2) / (6 * 0.45494))
    )  # median of χ² with one degree of freedom
    if fit.chi2 > GROSS * fit.dof * max(level, 1.0) ** 2:
        return None
    return (
        level
        if abs(level - 1) > max(LEAST_CHANGE, 8 / np.sqrt(rough.size)) and level > 1e-9
        else None
    )
