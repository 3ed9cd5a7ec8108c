"""Diagnosis, where the loops' trackers stand when a recording begins: nobody logs it, and it dies
within a tracker's own time.

A tracker that the recording finds within a manoeuvre stands beside its steady answer by its free
motion: of a second order e^{−at} cos at and e^{−at} sin at with a = ω_n/√2, of a first order
e^{−ω_n t}. Each driven run has its own, no larger than what such a tracker leaves of the wave later
on; what those have to learn that begin with the recording is the same in all runs (`begun_alike`).
Without it a board whose frequency estimate settles in 0.4 s left "a turning with the cube of the
rate" at 8 σ, of a clean gyro.

One that settles for most of a run cannot be told from a frame that stands beside the wave for good,
which is a rotation of the drive: a run is worth recording once its loops have settled.
"""

from __future__ import annotations

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.measured_runs import MeasuredRuns
from .command_frame import carry_turns, find_courses, read_angle
from .scatter import has_log, soften_runs
from .tracking import DAMPING, choose_settling_frequencies, compute_unfollowed

Array = np.ndarray


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
    angle, phase = (_settling(fit.series, course) for course in find_courses(fit))
    angle = np.concatenate([angle, read_angle(fit, phase)], axis=-1)
    return soften_runs(fit, carry_turns(fit.flow, fit.series, angle, phase))


def _settling(series: MeasuredRuns, course: Array) -> Array:
    """One standard deviation of every free motion beside a course (R, n), rad (R, n, k)."""
    natural = choose_settling_frequencies(series)
    size = np.abs(compute_unfollowed(series, course, natural, "long before")).max(axis=(0, 1))
    t = (series.time_s - series.time_s[:, :1])[..., None]
    at = DAMPING * natural * t
    modes = (np.exp(-at) * np.cos(at), np.exp(-at) * np.sin(at), np.exp(-natural * t))
    return np.concatenate([size * mode for mode in modes], axis=-1)
