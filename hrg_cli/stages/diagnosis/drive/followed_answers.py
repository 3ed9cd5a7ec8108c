"""Diagnosis, what loops answered, followed: the motion that the waves make likely has it.

What nobody knows of the loops stands beside the fit in columns of first order, about the motion
that the fit has without it. Answers turn the wave by up to hundredths, and columns are then wrong
by as large a part of what they do, which may be thousands of σ. So the likely answers are laid on
the motion, c = Dᵀ C⁻¹ r, and the columns stand about that; what the measured waves are compared
with stays the same to first order, so that the likelihood, which knows the answers' size with its
covariance, does too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.fit_point import Point
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.causes.sensitivities import Propagation, linearise_flow
from ....fitting.causes.slow_prediction import predict
from ....fitting.causes.walks import Walk
from ....fitting.causes.wave_frame import to_complex
from .command_frame import FrameAnswers, are_all_driven, carry_turns
from .ripple import Ripple, gather_answers

Array = np.ndarray
MOST_TURNED_RAD = 1.0
"""Turn of the commands' frame beyond which they would not hold the wave that they were made for."""
MISSED = 0.1
"""Part of a σ that columns about a motion which has moved since may miss of what they do."""


def follow_answers(
    fit: ExtendedFit, frames: FrameAnswers, ripple: Ripple, last: float = np.inf
) -> tuple[ExtendedFit, float]:
    """The same point along the motion that the loops' likely answers make, not fitted again: the
    columns of what is unsettled stand about the other motion.

    Of a frame late by 80 ms, in which the wave turns by 0.06 rad, the force along the wave lacks
    two thousandths; loops of 20 1/s at 640 Hz answer the oscillation's ripple by 12 000 σ of a run
    in 1e-5 of noise, and columns about a motion without that leave 14 σ of them.

    Parameters
    ----------
    fit
        Beside these answers.
    frames
        Of late frames, one standard deviation each; driven runs alone do not know them from their
        scale factor, and have none followed.
    ripple
        Answers to the oscillation's ripple.
    last
        What columns about the motion before this one missed, over σ: loops' answers are missed by
        less from one motion to the next, and what is missed by more than the last time is a misfit
        that has been laid on them.

    Returns
    -------
    tuple
        The fit, and what the columns beside it missed, over σ. The same fit where nothing moves any
        more, where it moves farther than the last time, or where no frame of loops that hold a wave
        is likely: a gross misfit would be laid on it.

    Examples
    --------
    Without driven runs nothing is unsettled:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.followed_answers import follow_answers
    >>> follow_answers(draw_fit(), None, None)[0] is draw_fit()
    True
    """
    series = fit.series
    if series.unsettled is None:
        return fit, 0.0
    of_ripple, of_frames = _find_likely(fit, ripple), None
    if not are_all_driven(series):
        of_frames = frames.doings.T @ series.unsettled.project_out(fit.residual)
        turn = frames.compute_turn(of_frames)
        if np.abs(turn).max() > MOST_TURNED_RAD:
            return fit, np.inf
        if of_frames.any():
            series = replace(series, frame_turn=turn)

    def move(flow: Propagation) -> Array:
        moved = flow.carry_jumps(ripple.gather_along(fit, flow)) @ of_ripple
        if of_frames is not None:
            moved += carry_turns(flow, series, frames.angle, frames.phase) @ of_frames
        return moved

    series = _lay_on(fit, series, fit.point, ripple.jumps @ of_ripple, move)
    missed = _find_missed(fit, series)
    return (fit.stand_along(series) if MISSED <= missed < last else fit), missed


def follow_whole_answers(fit: ExtendedFit, ripple: Ripple) -> ExtendedFit:
    """The same motion by the likely answers whole, and by what is left of the coordinates that
    driven runs alone show: as much less as the answers do of them.

    Parameters
    ----------
    fit
        Beside the part of the answers that is no coordinate's.
    ripple
        Answers to the oscillation's ripple.

    Returns
    -------
    ExtendedFit
        Not fitted again.

    Examples
    --------
    Without driven runs nothing is unsettled:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.followed_answers import follow_whole_answers
    >>> follow_whole_answers(draw_fit(), None) is draw_fit()
    True
    """
    if fit.series.unsettled is None or ripple.shares is None:
        return fit
    size, p = _find_likely(fit, ripple), fit.point.p.copy()
    p[: len(ripple.shares)] -= ripple.shares @ size
    point = replace(fit.point, p=p)

    def move(flow: Propagation) -> Array:
        return flow.carry_jumps(gather_answers(fit, flow)) @ size

    series = _lay_on(fit, fit.series, point, gather_answers(fit, fit.flow) @ size, move)
    return fit.stand_along(series, point)


def drop_whole_answers(fit: ExtendedFit) -> ExtendedFit:
    """The same without the answers that driven runs alone were laid along whole: to begin with the
    part that is no coordinate's.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    ExtendedFit
        Not fitted again; the same where a run is free, or nothing is followed.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.followed_answers import drop_whole_answers
    >>> drop_whole_answers(draw_fit()) is draw_fit()
    True
    """
    walk = fit.series.walk
    if walk is None or walk.answers is None or not are_all_driven(fit.series):
        return fit
    series = replace(fit.series, walk=replace(walk, answers=None, answered=None, along=None))
    return fit.stand_along(series)


def _find_likely(fit: ExtendedFit, ripple: Ripple) -> Array:
    """The likeliest sizes (8,) of a ripple's answers, c = Dᵀ C⁻¹ r, of a fit beside these."""
    assert fit.series.unsettled is not None
    left = fit.series.unsettled.project_out(fit.residual)
    return np.asarray(ripple.std * (ripple.spread_apart.T @ left))


def _lay_on(
    fit: ExtendedFit,
    series: MeasuredRuns,
    point: Point,
    jumps: Array,
    move: Callable[[Propagation], Array],
) -> MeasuredRuns:
    """The runs with answers that jump so in the steps (R, n − 1, 4), and with what these have moved
    along the motion that they make, (R, n, 4)."""
    walk = Walk.make_still(fit.prediction.motion) if series.walk is None else series.walk
    walk = replace(walk, answers=to_complex(jumps))
    flow = linearise_flow(predict(replace(series, walk=walk), point, fit.flow.near))
    answered = to_complex(flow.read_out(move(flow)[..., None])[..., 0])
    walk = replace(walk, answered=answered, along=flow.prediction.motion)
    return replace(series, walk=walk)


def _find_missed(fit: ExtendedFit, series: MeasuredRuns) -> float:
    """What columns about the motion of a fit's own runs miss of what answers do that others hold,
    over σ: as large a part as jumps, frame or motion are off, over the wave's amplitude."""
    amplitude = np.linalg.norm(series.envelope, axis=-1).max(axis=1)
    jumps, turn = (
        np.subtract(*pair) for pair in zip(_held(series), _held(fit.series), strict=True)
    )
    off = [jumps / amplitude[:, None, None], turn]
    known = fit.series.walk
    if known is not None and known.along is not None:
        off.append((fit.prediction.motion - known.along) / amplitude[:, None, None])
    assert series.walk is not None and series.walk.answered is not None
    moved = [_held(series)[0], series.walk.answered]
    done, missing = (np.max([_find_most(one) for one in many], axis=0) for many in (moved, off))
    return float(np.max(done * series.weight.max(axis=1) * missing))


def _held(series: MeasuredRuns) -> tuple[Array, Array]:
    """Answers that runs hold: jumps added up (R, n − 1, 2), and the turn of the frame (R, n, 2)."""
    none = np.zeros(series.envelope.shape)
    answers = None if series.walk is None else series.walk.answers
    jumps = none[:, 1:] if answers is None else np.cumsum(answers, axis=1)
    return jumps, none if series.frame_turn is None else series.frame_turn


def _find_most(values: Array) -> Array:
    """Largest size in every run, (R,)."""
    return np.asarray(np.abs(values).max(axis=(1, 2)))
