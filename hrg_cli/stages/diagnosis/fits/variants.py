"""Diagnosis, the ways in which the catalogue's causes may stand beside a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ....effects.effect import REFERENCE_TEMPERATURE, RUN, Effect
from ....fitting.causes import scales
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.causes.sensitivities import Wanted
from .open_terms import LEAST_KELVIN


@dataclass(frozen=True)
class Variant:
    """One way an effect may stand: values of its parameters, difference steps of those fitted, and
    those of them that are secants.

    A secant leads from the neutral value to one tried, of a parameter that has no slope there.
    anywhere: it happens at an instant that is still to be found beside a fit (`places`).
    """

    effect: Effect
    values: Mapping[str, float]
    steps: Mapping[str, float]
    secants: tuple[str, ...] = ()
    anywhere: bool = False

    @property
    def wanted(self) -> Wanted:
        """What its sensitivities are asked for by."""
        return self.effect, self.values, self.steps


def list_variants(effects: Sequence[Effect], fit: ExtendedFit) -> list[Variant]:
    """All ways the candidates may stand beside this fit.

    Parameters
    ----------
    effects
        Of the catalogue.
    fit
        Beside which they may stand.

    Returns
    -------
    list of Variant
        None of effects whose needs the runs do not hold.

    Examples
    --------
    A knock strikes at an instant that is still to be found:

    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.variants import list_variants
    >>> effects = [find(name) for name in ("gain_mismatch", "momentum_kick")]
    >>> [(one.effect.name, one.anywhere) for one in list_variants(effects, draw_fit())]
    [('gain_mismatch', False), ('momentum_kick', True)]
    """
    # where a run is struck is a search of its own, and the same beside one fit
    found: list[Variant] = fit.recall(
        ("variants", *effects), partial(_list_beside, effects, fit.series)
    )
    return [*found]


def _list_beside(effects: Sequence[Effect], series: MeasuredRuns) -> list[Variant]:
    """All ways the candidates may stand beside these runs."""
    warm = series.temperature_degc[series.weight > 0]
    middle = float(np.round(warm.mean(), 3)) if series.has_temperature else 25.0
    there = _list_available(series)
    out = []
    for effect in effects:
        values = effect.values()
        if effect.follows_temperature:
            values[REFERENCE_TEMPERATURE] = middle
        steps = scales.list_steps(effect, series)
        if effect.in_the_log and np.any(getattr(series, effect.in_the_log)):
            continue
        if not set(effect.needs) <= there:
            continue
        secants = tuple(p.name for p in effect.fitted() if p.sets_in)
        for start in effect.starts(series):
            if start.get(RUN) in series.coarse:
                continue
            held = {name: value for name, value in start.items() if name not in secants}
            levels = {name: start[name] - values[name] for name in secants if name in start}
            out.append(Variant(effect, {**values, **held}, {**steps, **levels}, secants))
        if effect.strikes:
            out.append(Variant(effect, values, steps, secants, anywhere=True))
    return out


def _list_available(series: MeasuredRuns) -> set[str]:
    """What these runs hold of what effects need."""
    good = series.weight > 0
    there = set()
    if series.has_temperature and np.ptp(series.temperature_degc[good]) > LEAST_KELVIN:
        there.add("temperature")
    if any(
        np.ptp(angle[rows]) > np.pi
        for angle, rows in zip(series.table_angle_rad, good, strict=True)
        if rows.any()
    ):
        there.add("half a turn")
    return there
