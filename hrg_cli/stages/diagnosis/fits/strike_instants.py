"""Diagnosis, the instant of a cause that strikes, within the row that holds it.

An instant is found from the rows beside it and is held in the fit. The row that it falls into is a
mean of before and after, in parts that a large cause shows to far less than a row: a step of a gain
of 1000 σ at an instant a hundredth of a row off leaves 10 σ in it. χ² is a parabola in that part.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ....effects.effect import INSTANT, RUN, Effect
from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.parabola import fit_parabola
from ..thresholds import GROSS

PARTS = (1 / 4, 1 / 4, 1 / 12, 1 / 36, 1 / 108)
"""Parts of a row by which the instant is moved to see the parabola, which bends anew at every row's
end."""
OWN_ROWS = 2.0
"""Rows on either side of an instant in which its place within the row may show."""
FLAT = 0.5
"""Rise of χ² to either side that is none: no smaller move shows more."""


def settle_instants(fit: ExtendedFit, names: Collection[str]) -> ExtendedFit:
    """The fit with every instant that is held moved within its row to where χ² is least.

    Parameters
    ----------
    fit
        With causes that strike at an instant that is held.
    names
        Of the effects asked.

    Returns
    -------
    ExtendedFit
        The same where no effect is asked, or none strikes.

    Examples
    --------
    A knock at 0.5 s, moved from where its row begins:

    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_knocked_fit
    >>> from hrg_cli.stages.diagnosis.fits import refits, scoring, strike_instants, variants
    >>> start = draw_knocked_fit()
    >>> kicks = variants.list_variants([find("momentum_kick")], start)
    >>> ((score, variant),) = scoring.score_effects(start, kicks)
    >>> knock = strike_instants.settle_instants(
    ...     refits.adopt(start, score, variant), ["momentum_kick"]
    ... )
    >>> round(knock.values("momentum_kick")["time_s"], 2)
    0.5
    """
    for effect, _ in fit.point.active:
        free = {p.name for p in effect.fitted()}
        if effect.strikes and INSTANT not in free and effect.name in names:
            for part in PARTS:
                fit, rise = _settle_instant(fit, effect, part)
                if rise < FLAT:
                    break
    return fit


def is_gross_elsewhere(fit: ExtendedFit, effect: Effect) -> bool:
    """Whether the misfit is gross in rows that no move of an effect's instant within its own row
    could mend.

    Parameters
    ----------
    fit
        With the effect.
    effect
        That strikes, or not.

    Returns
    -------
    bool
        False of an effect without an instant.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_knocked_fit
    >>> from hrg_cli.stages.diagnosis.fits.strike_instants import is_gross_elsewhere
    >>> is_gross_elsewhere(draw_knocked_fit(), find("momentum_kick"))
    False
    """
    values = next((v for one, v in fit.point.active if one.name == effect.name), {})
    if INSTANT not in values or RUN not in values:
        return False
    left = np.sum(extended_fit.place_on_rows(fit, fit.residual) ** 2, axis=-1)
    runs = np.flatnonzero(fit.series.numbers == values[RUN])
    for k in runs:
        t = fit.series.time_s[k]
        row_s = float(np.median(np.diff(t[fit.series.weight[k] > 0])))
        left[k, np.abs(t - values[INSTANT]) < OWN_ROWS * row_s] = 0.0
    return float(left.sum()) > GROSS * fit.dof


def _settle_instant(fit: ExtendedFit, effect: Effect, part: float) -> tuple[ExtendedFit, float]:
    """The fit with one instant at the lowest place of the parabola through moves by a part of a
    row, or as it is where that is no better; and the largest change of χ² by these moves."""
    series = fit.series
    values = next(values for one, values in fit.point.active if one.name == effect.name)
    runs = np.flatnonzero(series.numbers == values[RUN])
    if len(runs) == 0:
        return fit, 0.0
    t = series.time_s[runs[0]][series.weight[runs[0]] > 0]
    row_s = float(np.median(np.diff(t)))
    # what moves the wave acts at a phase of the oscillation: by whole periods
    grain = 0.0 if effect.slow_jump is None else 1 / series.reference_frequency_hz
    step = _round_to(part * row_s, grain)
    before, after = (_move_instant(fit, effect, way * step) for way in (-1.0, 1.0))
    if step == 0 or before is None or after is None:
        return fit, 0.0
    rise = max(abs(before.chi2 - fit.chi2), abs(after.chi2 - fit.chi2))
    parabola = fit_parabola(before.chi2, fit.chi2, after.chi2)
    move = parabola.lowest if parabola else 0.0
    by_s = _round_to(float(np.clip(move, -2.0, 2.0)) * step, grain)
    settled = _move_instant(fit, effect, by_s) if by_s else None
    made = filter(None, (fit, before, after, settled))
    return min(made, key=lambda one: one.chi2), rise


def _round_to(value: float, grain: float) -> float:
    """To whole grains; as it is where there are none."""
    return grain * round(value / grain) if grain else value


def _move_instant(fit: ExtendedFit, effect: Effect, by_s: float) -> ExtendedFit | None:
    """The fit with one effect's instant so much later; None where it finds no end."""
    active = tuple(
        (e, {**values, INSTANT: values[INSTANT] + by_s} if e.name == effect.name else values)
        for e, values in fit.point.active
    )
    with contextlib.suppress(extended_fit.DivergedError):
        return extended_fit.fit(fit.series, replace(fit.point, active=active), fit.freedom)
    return None
