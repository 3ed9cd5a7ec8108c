"""Diagnosis, the instant of a cause that strikes, within the row that holds it.

An instant is found from the rows beside it and is held in the fit. The row that it falls into is a
mean of before and after, in parts that a large cause shows to far less than a row: a step of a gain
of 1000 σ at an instant a hundredth of a row off leaves 10 σ in it. χ² is a parabola in that part.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ....effects.effect import INSTANT, RUN, Effect
from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ..thresholds import WORTH
from .remainder import search_rest
from .search_case import Case

PART = 0.25
"""Part of a row by which the instant is moved to see the parabola."""


def settle_instants(case: Case) -> Case:
    """The case with every instant that is held moved within its row to where χ² is least."""
    settled = fit = case.search.final
    held = {one.variant.effect.name for one in case.search.found if one.sizes is not None}
    for effect, values in fit.point.active:
        free = {p.name for p in effect.fitted()}
        if effect.strikes and INSTANT not in free and effect.name not in held:
            settled = _settle_instant(settled, effect, values)
    if settled.chi2 > fit.chi2 - WORTH * case.inquiry.noise.slow:
        return case
    case = replace(case, search=replace(case.search, final=settled))
    if case.remainder is None:
        return case
    return replace(case, remainder=search_rest(settled, case.inquiry.noise))


def _settle_instant(fit: ExtendedFit, effect: Effect, values: Mapping[str, float]) -> ExtendedFit:
    """The fit with one instant at the parabola's lowest place; as it is where that is no better."""
    series = fit.series
    runs = np.flatnonzero(series.numbers == values[RUN])
    if len(runs) == 0:
        return fit
    t = series.time_s[runs[0]][series.weight[runs[0]] > 0]
    # by whole periods: a force acts at a phase of the oscillation
    period = 1 / series.reference_frequency_hz
    step = period * round(PART * float(np.median(np.diff(t))) / period)
    if step == 0:
        return fit
    before, after = (_move_instant(fit, effect, move * step) for move in (-1.0, 1.0))
    if before is None or after is None:
        return min(filter(None, (fit, before, after)), key=lambda one: one.chi2)
    bend = before.chi2 - 2 * fit.chi2 + after.chi2
    move = (before.chi2 - after.chi2) / (2 * bend) if bend > 0 else 0.0
    # half a row at most: beyond it another row holds the instant
    whole = period * round(float(np.clip(move, -2.0, 2.0)) * step / period)
    settled = _move_instant(fit, effect, whole) if whole else None
    return min(filter(None, (fit, before, after, settled)), key=lambda one: one.chi2)


def _move_instant(fit: ExtendedFit, effect: Effect, by_s: float) -> ExtendedFit | None:
    """The fit with one effect's instant so much later; None where it finds no end."""
    active = tuple(
        (e, {**values, INSTANT: values[INSTANT] + by_s} if e.name == effect.name else values)
        for e, values in fit.point.active
    )
    with contextlib.suppress(extended_fit.DivergedError):
        return extended_fit.fit(fit.series, replace(fit.point, active=active), fit.freedom)
    return None
