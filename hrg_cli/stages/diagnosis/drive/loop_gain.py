"""Diagnosis, the most that a loop's gain can be: how its command follows the amplitude that it
holds.

A loop commands f = f₀ − k x − k_i ∫x of its amplitude x (a_A, or a_B). From row to row x is known
to √2 σ and f to what its log holds, so that x is regressed on f and not f on x: cov(Δx, Δf)/var(Δf)
is 1/k with an error of σ/√ΣΔf² however small x is beside its noise. What moves f and not x (the
loop's own noise, the integral's part) makes 1/k smaller, and the gain that is possible larger.
"""

from __future__ import annotations

import numpy as np

from ....fitting.causes.measured_runs import MeasuredRuns
from ....physics import ellipse

Array = np.ndarray
SIGMA = 2.0
"""Standard deviations of 1/k that a gain may be off."""


def bound_gains(series: MeasuredRuns) -> tuple[float, float]:
    """Greatest gains of the amplitude loop and of the quadrature loop that their logs and the waves
    allow.

    Parameters
    ----------
    series
        The runs' rows.

    Returns
    -------
    tuple of float
        [1/s]; 0 where a command stands still, infinite where any gain is possible.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.loop_gain import bound_gains
    >>> bound_gains(draw_fit().series)
    (0.0, 0.0)
    """
    main, quadrature, _, _ = ellipse.find_wave(series.envelope)
    return (
        _bound(series, main, series.main_drive),
        _bound(series, quadrature, series.quadrature_drive),
    )


def _bound(series: MeasuredRuns, held: Array, command: Array) -> float:
    """Of one loop, from all driven runs: one instrument has one gain."""
    along = power = variance = 0.0
    for weight, forced, x, f in zip(series.weight, series.forced, held, command, strict=True):
        good = (weight > 0) & (forced > 0)
        change, answer = np.diff(x[good]), np.diff(f[good])
        along += float(change @ answer)
        power += float(answer @ answer)
        # differences of white noise have 2σ² and −σ² with their neighbours: along any course at
        # most 2σ² + 2σ² a row
        variance += float(np.sum(4 / weight[good][1:] ** 2 * answer**2))
    if power == 0:
        return 0.0
    least = abs(along) / power - SIGMA * np.sqrt(variance) / power
    return 1 / least if least > 0 else np.inf
