"""Diagnosis, where the loops' trackers stand when a recording begins: nobody logs it, and it dies
within a tracker's own time.

A tracker that follows the wave's angle or phase and has just begun, or that the recording finds
within a manoeuvre, stands beside its steady answer by its free motion: of a second order e^{−at}
cos at and e^{−at} sin at with a = ω_n/√2, of a first order e^{−ω_n t}. Each driven run has its own,
no larger than what such a tracker leaves of the wave later on, and in phase than what one that has
begun with the mean frequency has to learn of the wave's own, over a. (In angle as much would hide a
rotation of the drive in short runs.) Without it a board whose frequency estimate settles in 0.4 s
left "a turning with the cube of the rate" at 8 σ, of a clean gyro; with the first size alone,
trackers of 25 rad/s that begin beside a split of 0.03 Hz left a "thermal frequency" of 6 σ.

One that settles for most of a run cannot be told from a frame that stands beside the wave for good,
which is a rotation of the drive: a run is worth recording once its loops have settled.
"""

from __future__ import annotations

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.measured_runs import MeasuredRuns
from .command_frame import (
    DAMPING,
    carry_turns,
    choose_natural_frequencies,
    compute_slope,
    compute_unfollowed,
    find_courses,
)
from .scatter import has_log, soften_runs

Array = np.ndarray
SETTLED_BY = 0.3
"""Part of a run by which its trackers have settled, to a thirtieth of what they began with."""
SETTLED_TO = 1 / 30
APART = 2.0
"""Ratio of neighbouring trackers' natural frequencies: what begins is a small part of what they
leave."""


def allow_starts(fit: ExtendedFit) -> ExtendedFit:
    """The fit again where the commands' frame may settle in every driven run.

    Parameters
    ----------
    fit
        Of a model.

    Returns
    -------
    ExtendedFit
        The same where no log has commands.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.tracker_start import allow_starts
    >>> allow_starts(draw_fit()) is draw_fit()
    True
    """
    if not has_log(fit.series):
        return fit
    angle, phase = find_courses(fit)
    begun = _find_largest_departure(fit.series, phase)
    angle, phase = _settling(fit.series, angle, 0.0), _settling(fit.series, phase, begun)
    return soften_runs(fit, carry_turns(fit.flow, fit.series, angle, phase))


def _settling(series: MeasuredRuns, course: Array, begun_rad_s: float) -> Array:
    """One standard deviation of every free motion beside a course (R, n), rad (R, n, k), of
    trackers that began with so much of its rate to be learned."""
    natural = choose_natural_frequencies(
        series, np.log(1 / SETTLED_TO) / SETTLED_BY / DAMPING, APART
    )
    later = np.abs(compute_unfollowed(series, course, natural, as_before=True)).max(axis=(0, 1))
    size = np.maximum(later, begun_rad_s / (DAMPING * natural))
    t = (series.time_s - series.time_s[:, :1])[..., None]
    at = DAMPING * natural * t
    modes = (np.exp(-at) * np.cos(at), np.exp(-at) * np.sin(at), np.exp(-natural * t))
    return np.concatenate([size * mode for mode in modes], axis=-1)


def _find_largest_departure(series: MeasuredRuns, course: Array) -> float:
    """Largest departure of a course's rate from its run's mean, rad/s: a tracker that knows the
    mean alone comes to stand beside the course by as much over a = ω_n/√2."""
    driven = (series.weight > 0) & (series.forced > 0)
    rate = np.where(driven, compute_slope(series.time_s, course), 0.0)
    mean = rate.sum(axis=1) / np.maximum(driven.sum(axis=1), 1)
    return float(np.max(np.abs(rate - mean[:, None]) * driven))
