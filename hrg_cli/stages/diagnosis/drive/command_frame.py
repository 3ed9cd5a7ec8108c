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
from .scatter import find_row_length_s, turn_forces

Array = np.ndarray
MOST_LATE_RAD = 0.3
"""Turn of the wave within a frame's lateness: a third as much force across the wave as along it is
more than a loop bears that is meant to hold it."""
APART = 1.25
"""Ratio of neighbouring loops' natural frequencies: what one between two of them leaves is a
combination of what all leave, to a thousandth. At a ratio of 2, to 4 %: of a phase that a split
turns by 0.05 rad that was 20 σ over a run, and eight clean gyros of ten had an "angle that changes
with wave angle"."""
FINER = 4
"""Instants a row at which a loop's answer is followed."""
DAMPING = 0.5**0.5
"""Of the loops: what one with up to four times as much leaves is a combination of theirs to 2 %,
with half of it to a sixth."""


@dataclass(frozen=True)
class FrameAnswers:
    """By how much one standard deviation of every answer of a late frame turns the commands' angle,
    and their phase, rad (R, n, k), and what they all do to the waves, over σ (N, 2k)."""

    angle: Array
    phase: Array
    doings: Array

    @classmethod
    def from_fit(cls, fit: ExtendedFit) -> FrameAnswers:
        """Beside a fit."""
        series, courses = fit.series, find_courses(fit)
        turning = float(np.max(np.abs(compute_slope(series.time_s, courses[0]))))
        angle, phase = (_answers(series, course, turning) for course in courses)
        moved = fit.flow.whiten_read_out(carry_turns(fit.flow, series, angle, phase))
        return cls(angle, phase, whitened_rows.flatten_own(series, moved))

    def compute_spread(self, fit: ExtendedFit) -> Array:
        """What one standard deviation of each does, over σ (N, 2k); driven runs alone show that
        scale factor which their loops make of it."""
        return _set_scale_factor_apart(fit, self.doings)

    def compute_turn(self, size: Array) -> Array:
        """Turn of the frame by answers of these sizes (2k,), rad (R, n, 2)."""
        angle, phase = np.split(size, 2)
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
        Turns [rad], (R, n, k) each.

    Returns
    -------
    ndarray
        (R, n, 4, 2k), per turn: the angles', then the phases'.

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


def compute_slope(time_s: Array, course: Array) -> Array:
    """Rate of change over the rows.

    Parameters
    ----------
    time_s
        [s], (R, n).
    course
        (R, n).

    Returns
    -------
    ndarray
        (R, n), the course's unit per second; 0 where rows are padded.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drive.command_frame import compute_slope
    >>> compute_slope(np.array([[0.0, 0.5, 1.0]]), np.array([[0.0, 1.0, 2.0]])).tolist()
    [[2.0, 2.0, 2.0]]
    """
    step = np.gradient(time_s, axis=1)
    return np.divide(np.gradient(course, axis=1), step, out=np.zeros_like(course), where=step > 0)


def _answers(series: MeasuredRuns, course: Array, turning_rad_s: float) -> Array:
    """By how much the commands' frame stands beside a course (R, n), for one standard deviation of
    its lateness and for every loop that may follow it, (R, n, k)."""
    late_s = MOST_LATE_RAD / turning_rad_s if turning_rad_s > 0 else 0.0
    late = -late_s * compute_slope(series.time_s, course)
    left = compute_unfollowed(series, course, choose_natural_frequencies(series))
    return np.concatenate([late[..., None], left], axis=-1)


def choose_natural_frequencies(
    series: MeasuredRuns, slowest: float = 2 * np.pi, apart: float = APART
) -> Array:
    """ω_n of the loops allowed for, from a run's length to a row's.

    Parameters
    ----------
    series
        The runs' rows.
    slowest
        Times the run's inverse length with which they begin.
    apart
        Ratio of neighbours at most.

    Returns
    -------
    ndarray
        [rad/s], rising.

    Examples
    --------
    Rows of 20 ms within 1 s:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_frame import choose_natural_frequencies
    >>> found = choose_natural_frequencies(draw_fit().series, apart=3.0)
    >>> found.round(1).tolist()
    [6.4, 17.9, 50.0]
    """
    lengths = [np.ptp(t[w > 0]) for t, w in zip(series.time_s, series.weight, strict=True)]
    least, most = slowest / max(lengths), 1 / find_row_length_s(series)
    most = max(most, least)
    return np.geomspace(least, most, 1 + max(1, int(np.ceil(np.log(most / least) / np.log(apart)))))


def compute_unfollowed(
    series: MeasuredRuns, course: Array, natural_rad_s: Array, *, as_before: bool = False
) -> Array:
    """What loops of second order leave of a course: −s²/(s² + √2 ω_n s + ω_n²), by the bilinear
    rule on a fine grid.

    Loops have followed the run's mean line when it begins.

    Parameters
    ----------
    series
        The runs' rows.
    course
        (R, n).
    natural_rad_s
        ω_n of the loops [rad/s].
    as_before
        The course is one like the run's own, turned about its start, so that nothing begins and
        what is left is what the course alone leaves.

    Returns
    -------
    ndarray
        (R, n, loops), in the course's unit.

    Examples
    --------
    A loop that is fast beside a course of 1 Hz leaves less of it:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_frame import compute_unfollowed
    >>> series = draw_fit().series
    >>> left = compute_unfollowed(series, np.sin(2 * np.pi * series.time_s), np.array([3.0, 30.0]))
    >>> left.shape, bool(np.ptp(left[0, :, 1]) < np.ptp(left[0, :, 0]))
    ((3, 50, 2), True)
    """
    from scipy import signal

    out = np.zeros((*course.shape, len(natural_rad_s)))
    for k, (t, weight) in enumerate(zip(series.time_s, series.weight, strict=True)):
        good = weight > 0
        if not course[k].any():
            continue
        grid = np.linspace(t[good][0], t[good][-1], FINER * int(np.count_nonzero(good)))
        values = np.interp(grid, t[good], course[k][good])
        values -= values[0]
        # a course turned about its start is odd: it goes on through the start without a bend, and
        # nothing begins
        whole = np.concatenate([-values[:0:-1], values]) if as_before else values
        steps = np.arange(len(whole))
        # loops of second order follow a line without error once they are settled
        whole -= np.polynomial.Polynomial.fit(steps, whole, 1)(steps)
        for loop, natural in enumerate(natural_rad_s):
            rule = signal.bilinear(
                [-1.0, 0.0, 0.0],
                [1.0, 2 * DAMPING * natural, natural**2],
                1 / (grid[1] - grid[0]),
            )
            left = signal.lfilter(*rule, whole)[-len(values) :]
            out[k, :, loop] = np.interp(t, grid, left)
    return out
