"""Diagnosis, the frame that loops command in: where their electronics see the wave, later than it
is.

The model turns a logged command to the wave's own angle and phase. Electronics read a window,
filter it, hold what they command, and follow the phase by a loop of some bandwidth, so that their
frame stands beside the wave by ε in angle and η in phase:

    F + ε e^{jφ}(f_A e_B + j f_B e_A) + jη F.

- Late by τ: ε = −τ d(mθ)/dt, η = −τ dφ/dt. The mean force then turns the wave by ντ of its own
  turn, as another scale factor K/(1 + ντ) does; driven runs alone show that one. Beside it a force
  that follows the damping along the wave makes harmonics 4θ that no K holds.
- Followed by a loop of second order (natural frequency ω_n, damping 1/√2): ε and η are the wave's
  angle and phase through −s²/(s² + √2 ω_n s + ω_n²), which passes all that is quicker than ω_n. A
  frequency split moves the phase in 4θ, and a loop of 1 Hz leaves a quarter of it where mθ turns by
  1.65 rad/s.
- Begun with a recording: such a loop has yet to learn the course's rate (`begun_alike`).
- Read in a frame whose phase is off by η, the wave of amplitudes a and b shows e_B'·u e^{−j(φ+η)} =
  (1 − jη)(−jb − εa), whose real part is nought at ε = −ηb/a: an angle loop goes there with what
  the phase loop leaves. Where the quadrature is held by a finite gain, b follows the split in 4θ
  as η does, and the frame turns in 8θ; of loops that read the ellipse itself it does not.

No log holds τ or ω_n. Any lateness that still lets loops hold the wave, and loops of any bandwidth
between a run's length and a row, are therefore allowed for, the same in all runs together: one
board has one lateness, so that a force turned alike at every rate stays a rotation of the drive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....effects.effect import find_frame
from ....fitting.causes import whitened_rows
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.causes.sensitivities import Propagation, find_base_sensitivities
from ....fitting.causes.wave_frame import to_reals
from ....fitting.envelopes.coordinates import SCALE_FACTOR
from .begun_alike import compute_begun
from .scatter import turn_forces
from .tracking import choose_natural_frequencies, compute_slope, compute_unfollowed

Array = np.ndarray
MOST_LATE_RAD = 0.3
"""Turn of the wave within a frame's lateness: a third as much force across the wave as along it is
more than a loop bears that is meant to hold it."""
LATE = 1
"""Answers of a frame that is late, which stand first."""


@dataclass(frozen=True)
class FrameAnswers:
    """By how much one standard deviation of every answer of a late frame turns the commands' angle,
    (R, n, k), and their phase, (R, n, l), rad, and what they all do to the waves, over σ
    (N, k + l)."""

    angle: Array
    phase: Array
    doings: Array

    @classmethod
    def from_fit(cls, fit: ExtendedFit) -> FrameAnswers:
        """Beside a fit."""
        series, courses = fit.series, find_courses(fit)
        turning = float(np.max(np.abs(compute_slope(series.time_s, courses[0]))))
        begun = compute_begun(fit, *courses)
        angle, phase = (
            np.concatenate([_answers(series, course, turning), one], axis=-1)
            for course, one in zip(courses, begun, strict=True)
        )
        # a late frame is one that was right when it was read
        angle = np.concatenate([angle, read_angle(fit, phase[..., LATE:])], axis=-1)
        moved = fit.flow.whiten_read_out(carry_turns(fit.flow, series, angle, phase))
        return cls(angle, phase, whitened_rows.flatten_own(series, moved))

    def compute_spread(self, fit: ExtendedFit) -> Array:
        """What one standard deviation of each does, over σ (N, k + l); driven runs alone show that
        scale factor which their loops make of it."""
        return _set_scale_factor_apart(fit, self.doings)

    def compute_turn(self, size: Array) -> Array:
        """Turn of the frame by answers of these sizes (k + l,), rad (R, n, 2)."""
        angle, phase = np.split(size, [self.angle.shape[-1]])
        return np.stack([self.angle @ angle, self.phase @ phase], axis=-1)


def are_all_driven(series: MeasuredRuns) -> bool:
    """Whether no run is free.

    Parameters
    ----------
    series
        The runs' rows.

    Returns
    -------
    bool
        Every run is driven somewhere.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_frame import are_all_driven
    >>> are_all_driven(draw_fit().series)
    False
    """
    return bool(np.all(np.any(series.forced > 0, axis=1)))


def _set_scale_factor_apart(fit: ExtendedFit, doings: Array) -> Array:
    """Columns (N, k) less what another scale factor does, where no run is free: driven runs alone
    show the one that their loops make of it."""
    if not are_all_driven(fit.series):
        return doings
    shared = whitened_rows.flatten_own(fit.series, find_base_sensitivities(fit.flow)[0])
    column = shared[:, SCALE_FACTOR]
    size = float(column @ column)
    return doings - np.outer(column, column @ doings / size) if size > 0 else doings


def carry_turns(flow: Propagation, series: MeasuredRuns, angle: Array, phase: Array) -> Array:
    """How turns of the commands' frame change the motion.

    Parameters
    ----------
    flow
        Of the fit.
    series
        The runs' rows.
    angle, phase
        Turns [rad], (R, n, k) and (R, n, l).

    Returns
    -------
    ndarray
        (R, n, 4, k + l), per turn: the angles', then the phases'.

    Examples
    --------
    Where nothing is commanded a turned frame changes nothing:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_frame import carry_turns
    >>> fit = draw_fit()
    >>> one = np.ones((*fit.series.time_s.shape, 1))
    >>> changed = carry_turns(fit.flow, fit.series, one, one)
    >>> changed.shape, bool(changed.any())
    ((3, 50, 4, 2), False)
    """
    answers = angle, phase
    between = tuple((a[:, 1:] + a[:, :-1]) / 2 for a in answers)
    at_rows, at_middle = (
        np.concatenate(
            [
                to_reals(stage.pass_forcers(motion, force))[..., None] * answer[..., None, :]
                for force, answer in zip(turn_forces(runs, motion), beside, strict=True)
            ],
            axis=-1,
        )
        for runs, stage, motion, beside in (
            (series, flow.rows, flow.prediction.motion, answers),
            (flow.centre, flow.halves, flow.middle, between),
        )
    )
    return flow.propagate(at_rows, at_middle)


def find_courses(fit: ExtendedFit) -> tuple[Array, Array]:
    """Angle mθ and phase of the wave over the rows of driven runs.

    Parameters
    ----------
    fit
        Of a model.

    Returns
    -------
    tuple of ndarray
        [rad], (R, n) each; 0 where a run is free.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_frame import find_courses
    >>> angle, phase = find_courses(draw_fit())
    >>> angle.shape, bool(angle.any())
    ((3, 50), False)
    """
    series, v = fit.series, fit.flow.prediction.motion
    turn, e_A, _, _ = find_frame(v, series.phase_rad)
    driven = np.where(series.weight > 0, series.forced, 0.0)
    angle = np.unwrap(np.arctan2(e_A[..., 1], e_A[..., 0]), axis=1)
    return driven * angle, driven * np.unwrap(np.angle(turn), axis=1)


def read_angle(fit: ExtendedFit, phase: Array) -> Array:
    """By how much a frame stands beside the wave's angle that is read where its phase is off.

    Parameters
    ----------
    fit
        Of a model.
    phase
        Of the frame beside the wave's [rad], (R, n, k).

    Returns
    -------
    ndarray
        −ηb/a [rad], (R, n, k).

    Examples
    --------
    A straight wave is read where it is:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_frame import read_angle
    >>> one = np.ones((*draw_fit().series.time_s.shape, 1))
    >>> bool(np.abs(read_angle(draw_fit(), one)[:, 0]).max() < 1e-3)
    True
    """
    v = fit.flow.prediction.motion
    turn, e_A, e_B, _ = find_frame(v, fit.series.phase_rad)
    a, b = (np.conj(turn) * np.sum(axis * v, axis=-1) for axis in (e_A, e_B))
    return np.asarray((b.imag / a.real)[..., None] * phase)


def _answers(series: MeasuredRuns, course: Array, turning_rad_s: float) -> Array:
    """By how much the commands' frame stands beside a course (R, n), for one standard deviation of
    its lateness and for every loop that may follow it, (R, n, k)."""
    late_s = MOST_LATE_RAD / turning_rad_s if turning_rad_s > 0 else 0.0
    late = -late_s * compute_slope(series.time_s, course)
    left = compute_unfollowed(series, course, choose_natural_frequencies(series))
    return np.concatenate([late[..., None], left], axis=-1)
