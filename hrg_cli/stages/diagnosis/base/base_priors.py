"""Diagnosis, what is known of the base model's coordinates before a fit: weak priors, and whether
the runs tell the scale factor at all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....fitting.causes.coordinate_priors import CoordinatePriors
from ....fitting.causes.fit_point import Point
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.envelopes.base_freedom import choose_scale_factor
from ....fitting.envelopes.coordinates import SCALE_FACTOR
from ....fitting.envelopes.envelope_runs import EnvelopeRun
from ....fitting.envelopes.weak_priors import DIAGNOSED, SHAPES, find_natural_sizes
from ....records import Wave

Array = np.ndarray
DIFFERENT_RATES = 0.1
"""Part of the greatest rate by which rates must differ to count as different."""


def choose_freedom(
    series: MeasuredRuns, point: Point, scale_factor: float | None
) -> CoordinatePriors:
    """Weak priors on the splits; while the misfit is gross, K is held where these runs cannot tell
    it.

    With one rate and less than a turn of the wave, K Ω does what a damping split does: a scale
    factor fitted there takes up any misfit. Once it is not gross, K may be any that a mode shape
    makes (`SHAPES`; a pendulum's is 1). The second order's scale is held at a resonator's.

    Parameters
    ----------
    series
        The runs' rows.
    point
        Where the fit starts.
    scale_factor
        That is held; None: it is not known.

    Returns
    -------
    CoordinatePriors
        Of the coordinates, and what they become once the misfit is not gross.

    Examples
    --------
    The damping rate is free, K is not while nothing is known of the misfit:

    >>> from hrg_cli.stages.diagnosis.base.base_priors import choose_freedom
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> fit = draw_fit()
    >>> priors = choose_freedom(fit.series, fit.point, 0.55)
    >>> float(priors.std[0]), float(priors.std[5])
    (inf, 0.0)
    """
    nominal = choose_scale_factor(series.mode_number) if scale_factor is None else scale_factor
    loose = DIAGNOSED.scale_by(*find_natural_sizes(point.p, float(series.time_s.max())))
    shown = scale_factor is None and shows_scale_factor(series, nominal)
    if not shown:
        free = scale_factor is None and series.mode_number > 1
        loose[SCALE_FACTOR] = SHAPES * nominal if free else 0.0
    std = loose.copy()
    if not shown:
        std[SCALE_FACTOR] = 0.0
    mean = np.array([0, 0, 0, 0, 0, nominal, 1.0])
    return CoordinatePriors(mean, std, loose=CoordinatePriors(mean, loose))


def shows_scale_factor(series: MeasuredRuns, nominal: float) -> bool:
    """Whether the runs tell K: at rates that differ, or at one that turns the wave through a whole
    period of its splits.

    Parameters
    ----------
    series
        The runs' rows.
    nominal
        K of that mode.

    Returns
    -------
    bool
        It may be fitted.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.base_priors import shows_scale_factor
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> shows_scale_factor(draw_fit().series, 0.55)
    True
    """
    good = series.weight > 0
    turned = [
        float(np.ptp(angle[rows]))
        for angle, rows in zip(series.table_angle_rad, good, strict=True)
        if rows.any()
    ]
    return _tell(series.rate_rad_s[good], turned, nominal)


def _tell(rates: Array, turned: Sequence[float], nominal: float) -> bool:
    """Whether logged rates, and the table's turn in every run, tell K."""
    if len(rates) and np.ptp(rates) > DIFFERENT_RATES * np.abs(rates).max():
        return True
    # 2KΩt is the angle by which R(4θ) turns: after a whole period of it K Ω is no damping split
    return bool(2 * abs(nominal) * max(turned, default=0.0) > 2 * np.pi)


def choose_held_scale_factor(
    waves: Sequence[Wave], runs: Sequence[EnvelopeRun], scale_factor: float | None
) -> float | None:
    """The scale factor to be held from the guess on.

    Parameters
    ----------
    waves
        Of the runs.
    runs
        Their envelopes.
    scale_factor
        The user's; None: there is none.

    Returns
    -------
    float or None
        The user's, or, where no run tells it, the nominal one; None where it is free.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.base_priors import choose_held_scale_factor
    >>> from hrg_cli.stages.diagnosis.base.data import prepare
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> _, _, runs = prepare(draw_waves(), None, 100)
    >>> choose_held_scale_factor(draw_waves(), runs, None) is None
    True
    >>> choose_held_scale_factor(draw_waves()[:1], runs[:1], None)
    0.55
    """
    if scale_factor is not None:
        return scale_factor
    logs = [np.asarray(w.rate_rad_s, float) for w in waves if w.rate_rad_s is not None]
    rates = np.concatenate([np.zeros(0), *(log[np.isfinite(log)] for log in logs)])
    nominal = choose_scale_factor(waves[0].mode_number)
    turned = [float(np.ptp(run.turn_rad)) for run in runs]
    return None if _tell(rates, turned, nominal) else nominal
