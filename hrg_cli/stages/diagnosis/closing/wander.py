"""Diagnosis, the wander: what the final residual looks like as noise, component by component. It is
told, never used as an excuse.

The fit stays the least-squares one at the windows' own σ: weights made from a residual that a wrong
model leaves would steer the next fit. The colour widens σ (`NoiseLevel.slow`) and stands in the
report.
"""

from __future__ import annotations

from typing import Any

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.noise import channel_noise, colour
from ..search.remainder import judge_adequacy
from ..thresholds import INADEQUATE

HOUR = 3600.0


def describe_wander(fit: ExtendedFit) -> list[dict[str, Any]]:
    """The wander of every component that a fit leaves.

    Parameters
    ----------
    fit
        The final one.

    Returns
    -------
    list of dict
        Standard deviation after an hour, correlation time of its rate, white level over the stated
        σ; empty where the residual is white as far as its smooth part can tell.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.wander import describe_wander
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> describe_wander(draw_fit())
    []
    """
    if judge_adequacy(fit)[1] > INADEQUATE:
        return []
    series = fit.series
    seen = channel_noise.whiten(series.whitening, series.envelope)
    noises = colour.estimate_noises(
        series.time_s, series.weight, seen, fit.prediction.compute_residual()
    )
    if not noises:
        return []
    return [
        {
            "component": name,
            "after_one_hour": noise.compute_std_after(HOUR) if noise.wander_1_s > 0 else 0.0,
            "units": "1" if name in ("amplitude", "ellipticity") else "rad",
            "correlation_s": noise.correlation_s,
            "white_over_stated": noise.white,
        }
        for name, noise in zip(colour.COMPONENTS, noises, strict=True)
    ]
