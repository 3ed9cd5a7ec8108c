"""Diagnosis, trackers that begin with a recording, all runs of one board alike: on the wave, and
with what a board knows of its rate.

Of the angle that is what the table turns it by, −K∫Ω, of the phase one nominal frequency, or the
mean of a run. What the wave does beside that a tracker of second order has to learn: where the
wave's rate is off by d at the start, it comes to stand d e^{−at} sin(at)/a beside the wave, a =
ω_n/√2, which is several times what it leaves later on, as it follows a split in 4θ. What d is the
model knows of every run, so that a loop of any bandwidth is one number for all of them, and hides
nothing that stands in every run alike. Trackers of 15 rad/s that begin so left a "thermal
frequency" of 4 to 5 σ in five clean gyros of five.
"""

from __future__ import annotations

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.envelopes.coordinates import SCALE_FACTOR
from .tracking import choose_settling_frequencies, compute_unfollowed

Array = np.ndarray


def compute_begun(fit: ExtendedFit, angle: Array, phase: Array) -> tuple[Array, Array]:
    """By how much trackers that begin so stand beside the wave.

    Parameters
    ----------
    fit
        Of a model.
    angle, phase
        Courses of the driven runs [rad], (R, n).

    Returns
    -------
    tuple of ndarray
        Of the angle and of the phase [rad], (R, n, k) and (R, n, l).

    Examples
    --------
    No free run has a tracker:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.begun_alike import compute_begun
    >>> from hrg_cli.stages.diagnosis.drive.command_frame import find_courses
    >>> begun = compute_begun(draw_fit(), *find_courses(draw_fit()))
    >>> [one.shape for one in begun], any(one.any() for one in begun)
    ([(3, 50, 3), (3, 50, 6)], False)
    """
    series = fit.series
    driven = (series.weight > 0) & (series.forced > 0)
    natural = choose_settling_frequencies(series)
    turned = angle + fit.point.p[SCALE_FACTOR] * series.table_angle_rad
    own = _find_mean_rates(series, phase, driven)
    common = own[driven.any(axis=1)].mean() if driven.any() else 0.0

    def begun(course: Array) -> Array:
        return compute_unfollowed(series, np.where(driven, course, 0.0), natural, "on its value")

    rates = (np.full(len(own), common), own)
    at_rates = [begun(phase - rate[:, None] * series.time_s) for rate in rates]
    return begun(turned), np.concatenate(at_rates, axis=-1)


def _find_mean_rates(series: MeasuredRuns, course: Array, driven: Array) -> Array:
    """Mean rate of a course in every run, rad/s (R,); 0 where it is free."""
    out = np.zeros(len(course))
    for k, (t, x, good) in enumerate(zip(series.time_s, course, driven, strict=True)):
        if np.count_nonzero(good) > 1:
            out[k] = (x[good][-1] - x[good][0]) / (t[good][-1] - t[good][0])
    return out
