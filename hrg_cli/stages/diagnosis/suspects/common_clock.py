"""The rate logs of all runs late, or early, by the same time: one recorder whose clock, or whose
filter, is beside that of the samples.

Ω was at t what the log says at t + τ, so that the logs are read there and the runs fitted again.
χ²(τ) is a parabola about its least value as far as the wave does not turn by a radian within τ, and
far beyond where the rates are smooth: its lowest place is found from the others' coordinates held,
then from the whole base model's fits at three times around it, nearer and nearer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.parabola import fit_parabola
from ....records import Array, Wave
from ...suspicion import Suspicion
from ..thresholds import MISTAKES_REMOVE, SURE_LATENESS
from .cases import Fitted, SuspectFound, fit_or_none, is_any_logged
from .readings import FINEST, LATEST, compute_misfits, has_varying_rate, search_least
from .transformations import advance_rate, advance_rate_within_log

LOOKED_AT = 3
"""Runs whose rates change most, from which the search starts."""
ROUNDS = 6
NEAR = 0.3
"""Standard deviations of a move of the parabola's lowest place that ends the search."""


@dataclass(frozen=True)
class _Lateness:
    """How late the logs are, its standard deviation at the stated noise, and the runs' fit with
    their logs set right."""

    late_s: float
    std_s: float
    fit: ExtendedFit


def find_common_lateness(
    waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit
) -> SuspectFound | None:
    """One lateness of all rate logs that takes nearly all of the misfit; None where no rate changes
    within a run, or none does.

    Parameters
    ----------
    waves
        As given, one a run.
    fitted
        The base model's fit to waves.
    base
        That of these waves.

    Returns
    -------
    SuspectFound or None
        The suspicion, told of all runs where more than one rate changes, and the fit with the logs
        set right.

    Examples
    --------
    A table swings, and its log comes 50 ms late:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_swing, draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.common_clock import find_common_lateness
    >>> waves = draw_waves()[0], draw_swing(late_s=0.05)
    >>> found = find_common_lateness(waves, fit_waves, fit_waves(waves))
    >>> found.suspicions[0].what, found.suspicions[0].evidence[:37], found.chi2_per_dof < 1.5
    ('rate log late', 'with the rate logs moved by -0.049441', True)
    """
    moving = [k for k, wave in enumerate(waves) if has_varying_rate(wave)]
    before = base.chi2 / base.dof
    found = _find_lateness(waves, moving, fitted, base) if moving else None
    if found is None:
        return None
    after = found.fit.chi2 / found.fit.dof
    std_s = found.std_s * float(np.sqrt(max(1.0, after)))
    if (
        after - 1 > (1 - MISTAKES_REMOVE) * (before - 1)
        or abs(found.late_s) < SURE_LATENESS * std_s
    ):
        return None
    way = "late" if found.late_s > 0 else "early"
    told = Suspicion(
        "all runs" if len(moving) > 1 else waves[moving[0]].run_id,
        f"rate log {way}",
        f"with the rate logs moved by {-found.late_s:+.5g} ± {std_s:.1g} s χ² per degree of freedom"
        f" falls from {before:.3g} to {after:.3g}",
        f"the rate logs come {abs(found.late_s):.5g} s too {way}: estimate these runs with"
        f" --rate-late-s {found.late_s:.5g}, or keep both on one clock",
    )
    return SuspectFound((told,), 1, base, found.fit, after)


def _find_lateness(
    waves: Sequence[Wave], moving: Sequence[int], fitted: Fitted, base: ExtendedFit
) -> _Lateness | None:
    """The lateness that leaves least, found in whole fits around where it starts; None where these
    find no lowest place."""

    def fit_moved(late_s: float, step_s: float, move: float) -> ExtendedFit | None:
        # all fits of a round on the same rows: a row more would weigh more than the lateness
        near = late_s - step_s, late_s + step_s
        moved = [
            advance_rate_within_log(wave, late_s + move * step_s, *near) if k in moving else wave
            for k, wave in enumerate(waves)
        ]
        return fit_or_none(moved, fitted, quick=is_any_logged(waves))

    span = min(float(waves[k].time_s[-1] - waves[k].time_s[0]) for k in moving)
    start = _find_start(waves, moving, base, span)
    if start is None:
        return None
    step = max(abs(start) / 4, FINEST * span)
    for _ in range(ROUNDS):
        fits = [fit_moved(start, step, move) for move in (-1.0, 0.0, 1.0)]
        if any(fit is None for fit in fits):
            return None
        low, here, high = (fit.chi2 / fit.dof for fit in fits if fit is not None)
        parabola = fit_parabola(low, here, high)
        if parabola is None:
            return None
        move = parabola.lowest * step
        start += float(np.clip(move, -4 * step, 4 * step))
        std = step * float(np.sqrt(2 / (parabola.bend * base.dof)))
        step = max(min(step, abs(move)), 3 * std)
        if abs(move) < NEAR * std * np.sqrt(max(1.0, here)):
            break
    last = fit_moved(start, 0.0, 0.0)
    return None if last is None else _Lateness(start, std, last)


def _find_start(
    waves: Sequence[Wave], moving: Sequence[int], base: ExtendedFit, span: float
) -> float | None:
    """A lateness near the lowest place, the base model's coordinates held."""
    changes = {k: np.ptp(np.asarray(waves[k].rate_rad_s, float)[waves[k].good()]) for k in moving}
    most = sorted(moving, key=lambda k: -changes[k])[:LOOKED_AT]

    def compute_each(trials: Array) -> Array:
        moved = [advance_rate(waves[k], float(late)) for late in trials for k in most]
        return compute_misfits(moved, base).reshape(len(trials), len(most)).sum(axis=1)

    return search_least(compute_each, LATEST * span, FINEST * span)
