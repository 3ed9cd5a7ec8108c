"""Runs of a table that turned, of which no log holds a rate, or all the same: a constant rate of
every run's own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....errors import name_some
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.base_freedom import choose_scale_factor
from ....records import Wave
from ...suspicion import Suspicion
from ..thresholds import MISTAKES_REMOVE
from .cases import Fitted, SuspectFound, fit_or_none
from .readings import SCALE_FACTOR, compute_shown_rate, estimate_own, is_turning
from .transformations import hold_rate

SAME_RATE = 1e-3
"""Part of a rate by which the logs of one and the same may differ."""
ROUNDS = 8
"""Rates of the runs and the rest of the model, in turn."""
LEAST_FALL = 0.99
"""Part of χ² that a round must not leave to be followed by another."""


def find_unlogged_rates(
    waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit
) -> SuspectFound | None:
    """Constant rates of the runs' own that take nearly all of the misfit of runs that log none, or
    one and the same; None of others, or where they do not.

    Of K and of rates that nobody knows the runs show the products: K is that of the mode's shape.

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
        The suspicion of all runs, and the fit with these rates.

    Examples
    --------
    Runs at rest (0.0002 rad/s is noise) and at ±1 rad/s, of which no log tells:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import hold_rate
    >>> from hrg_cli.stages.diagnosis.suspects.unlogged_rates import find_unlogged_rates
    >>> waves = [hold_rate(wave, 0.0) for wave in draw_waves()]
    >>> found = find_unlogged_rates(waves, fit_waves, fit_waves(waves))
    >>> found.suspicions[0].evidence[36:68]
    '0.0002291, 0.9999, -0.9995 rad/s'
    """
    turned = [wave for wave in waves if is_turning(wave)]
    if len(waves) < 2 or (turned and (len(turned) < len(waves) or not _is_one_rate(waves))):
        return None
    usual = choose_scale_factor(base.series.mode_number)
    rates = [compute_shown_rate(wave, usual) for wave in waves]
    best: ExtendedFit | None = None
    for _ in range(ROUNDS):
        turning = [hold_rate(wave, rate) for wave, rate in zip(waves, rates, strict=True)]
        fit = fit_or_none(turning, fitted)
        if fit is None or (best is not None and fit.chi2 > LEAST_FALL * best.chi2):
            break
        best, told = fit, rates
        K = fit.coordinate(SCALE_FACTOR)
        own = [estimate_own(wave, fit, SCALE_FACTOR) for wave in turning]
        if not abs(K) > 0 or any(one is None for one in own):
            break
        rates = [rate * one[0] / K for rate, one in zip(rates, own, strict=True) if one]
    before = base.chi2 / base.dof
    if best is None or best.chi2 / best.dof - 1 > (1 - MISTAKES_REMOVE) * (before - 1):
        return None
    after = best.chi2 / best.dof
    # K and the rates were fitted in turn: their products are what is known
    known = best.coordinate(SCALE_FACTOR) / usual
    each = name_some([f"{known * rate:.4g}" for rate in told])
    what, log = "rate log missing", "no run logs a rate"
    if turned:
        what = "rate log stuck"
        log = f"every run logs {np.median(np.asarray(waves[0].rate_rad_s)):.4g} rad/s"
    found = Suspicion(
        "all runs",
        what,
        f"{log}; as if turned at {each} rad/s, with the usual scale factor"
        f" {usual:.4g}, χ² per degree of freedom falls from {before:.3g} to {after:.3g}",
        "import the runs with the rate of the table, or with --constant-rate-rad-s",
    )
    return SuspectFound((found,), len(waves), base, best, after)


def _is_one_rate(waves: Sequence[Wave]) -> bool:
    """Whether the logs of all runs hold one constant rate."""
    logged = np.concatenate([np.asarray(wave.rate_rad_s, float) for wave in waves])
    logged = logged[np.isfinite(logged)]
    return bool(np.ptp(logged) <= SAME_RATE * np.abs(logged).max())
