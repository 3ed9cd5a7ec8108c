"""Diagnosis, the base model fitted to the runs: averaged along their own motion, cut where samples
seem lost."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ....errors import HrgError, name_some
from ....fitting.causes import extended_fit
from ....fitting.causes.coordinate_priors import CoordinatePriors
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.fit_point import Point
from ....fitting.causes.measured_runs import MeasuredRuns
from ....records import Wave
from ..drive.command_frame import FrameAnswers, are_all_driven
from ..drive.command_log import (
    fit_lateness,
    is_thinkable,
    predict_command_scatter,
    predict_lateness,
)
from ..drive.followed_answers import drop_whole_answers, follow_answers, follow_whole_answers
from ..drive.held_commands import allow_steps, find_likely_beats
from ..drive.ripple import Ripple
from ..drive.scatter import allow, allow_scatter, follow_walk, has_log
from ..drive.tracker_start import allow_starts
from ..fits.refits import fit_at_second_order, loosen
from ..fits.scoring import is_gross
from ..samples.lost_samples import PhaseStep
from ..samples.waveform import find_phase_steps, split_at
from ..thresholds import FAR, GROSS, WORTH
from .base_priors import choose_freedom
from .data import is_averaged_well, prepare
from .rate_step_fit import fit_rate_steps

Array = np.ndarray
AVERAGED_AGAIN = 2
"""Times that rows are averaged anew along the motion last fitted: the first may lack the splits."""

LOST_RAD = 1.0
"""Turn of a run's phase about the foretold one from which a fit of phases may have lost its way."""
FOLLOWED_AGAIN = 4
"""Times that the motion is laid anew along what loops are likely to have answered."""


def fit_base(
    pieces: Sequence[Wave],
    coarser: int = 1,
    *,
    scale_factor: float | None,
    blocks: int,
    free_phase: bool,
    quick: bool = False,
    along: Point | None = None,
) -> ExtendedFit:
    """The base model fitted to runs, averaged along the motion that it has itself.

    Parameters
    ----------
    pieces
        Of the runs.
    coarser
        Times as long as they would be that the rows are.
    scale_factor
        That is held; None: it is not known.
    blocks
        Fewest averaged rows a run.
    free_phase
        The runs are fitted by shape and angle alone.
    quick
        The first fit alone, of driven runs beside nothing that a log may have missed.
    along
        The motion that the runs are known to have beside their causes, to be averaged along
        instead.

    Returns
    -------
    ExtendedFit
        Without any cause.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> fit = fit_base(draw_waves(), scale_factor=None, blocks=100, free_phase=False)
    >>> round(fit.coordinate("scale_factor"), 2)
    0.55
    """

    def prepared(
        motion: Point | None, straight: bool = False
    ) -> tuple[MeasuredRuns, Point, CoordinatePriors]:
        series, point, _ = prepare(pieces, scale_factor, blocks, coarser, motion, straight)
        return series, point, choose_freedom(series, point, scale_factor)

    def fitted(motion: Point | None, free_phase: bool = free_phase) -> ExtendedFit:
        series, point, freedom = prepared(motion, free_phase)
        fit = extended_fit.fit(replace(series, free_phase=free_phase), point, freedom)
        return fit if quick and has_log(fit.series) else start_fit(fit)

    first = fitted(along)
    if quick:
        return first
    for _ in range(0 if along else AVERAGED_AGAIN):
        if is_averaged_well(first.series, first.point):
            break
        again = fitted(first.point)
        if is_gross(first) and again.chi2 / again.dof >= first.chi2 / first.dof:
            break  # no motion of the base model is theirs
        first = again
    if not free_phase and is_gross(first) and _is_lost_in_phases(first):
        by_shape = fitted(fitted(None, free_phase=True).point, free_phase=True)
        if GROSS * by_shape.chi2 / by_shape.dof < first.chi2 / first.dof:
            first = _fit_phases(by_shape, *prepared(by_shape.point))
    # the log's time first: what else the log may have missed is allowed for beside it, and would
    # take part of a lateness up. A gross misfit would be laid on it, but not on what the log's own
    # scatter and the loops' own gains may do, among which its cause is looked for
    late = fit_lateness(first)
    known = late if not is_gross(late) and is_thinkable(late) else first
    return _fit_beside_log(fit_rate_steps(known))


def settle_log(fit: ExtendedFit) -> ExtendedFit:
    """The fit again beside what the drive's log leaves unknown, and along the motion that this
    makes likely.

    Parameters
    ----------
    fit
        The base model's.

    Returns
    -------
    ExtendedFit
        The same where nothing is logged, or where a misfit is left that is gross beside all of
        that already, or far beyond what it could do.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.joint_fit import settle_log
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> settle_log(draw_fit()) is draw_fit()
    True
    """
    if not has_log(fit.series):
        return fit
    if fit.series.scatter is None:
        beside = _fit_beside_log(fit if is_gross(fit) else fit_lateness(fit))
        return beside if is_gross(beside) else follow_walk(beside)
    return fit if is_gross(fit) else _fit_beside_steps(fit, _fit_along_walk)


def _fit_beside_log(fit: ExtendedFit) -> ExtendedFit:
    """The fit beside what the log's rows, the frame that its commands are turned to, and the ripple
    that loops answer may have done: white in every run, or the same in all of one instrument; and
    beside the steps of held commands. The same where the misfit is far beyond all of that."""
    if not has_log(fit.series):
        return fit
    beside = _fit_beside_steps(fit, lambda fit: _fit_along_walk(allow_starts(allow_scatter(fit))))
    return fit if _is_far(beside) else beside


def _is_far(fit: ExtendedFit) -> bool:
    """Whether a misfit is far beyond what loops and their log may do."""
    return fit.chi2 > FAR * fit.dof


def _fit_along_walk(fit: ExtendedFit) -> ExtendedFit:
    """The fit beside what is the same in all runs, along the likely walk where it is not gross."""
    return fit_beside_answers(fit if is_gross(fit) else follow_walk(fit))


def _fit_beside_steps(
    fit: ExtendedFit, settled: Callable[[ExtendedFit], ExtendedFit]
) -> ExtendedFit:
    """The settled fit; where that leaves more than noise, the same beside the steps of commands
    that are held in time with the oscillation, if these leave nothing but noise."""
    beside = settled(fit)
    if fit.series.held_beat_rad_s is not None or beside.is_adequate:
        return beside
    for beat in find_likely_beats(beside):
        held = settled(allow_steps(fit, beat))
        if held.is_adequate:
            return held
    return beside


def fit_beside_answers(fit: ExtendedFit) -> ExtendedFit:
    """The fit beside what is the same in all runs of one instrument, along the motion that it makes
    likely beside the causes there are: what these have done would be laid on it, and so would be a
    gross misfit.

    What driven runs alone do not tell from the base model's coordinates is left out until the
    motion stands: along it both would change by more than columns about one motion hold.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    ExtendedFit
        Beside the frame, the ripple and the log that loops may have answered.

    Examples
    --------
    Free runs have no loops:

    >>> from hrg_cli.stages.diagnosis.base.joint_fit import fit_beside_answers
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> fit_beside_answers(draw_fit()) is draw_fit()
    True
    """
    if not has_log(fit.series):
        return fit

    first = _stand_beside(drop_whole_answers(fit))
    if _is_far(first[0]):
        return first[0]
    if is_gross(first[0]) and not first[0].converged:
        # columns about where it began may keep it from settling, those about its end do not
        first = _stand_beside(first[0])
    beside, _, ripple = _follow_while_settling(first)
    if not are_all_driven(beside.series):
        return beside
    whole = beside if is_gross(beside) else follow_whole_answers(beside, ripple)
    ripple, frames = Ripple.from_fit(whole), FrameAnswers.from_fit(whole)
    return _allow_answers(whole, ripple, ripple.spread, frames.compute_spread(whole))


Beside = tuple[ExtendedFit, FrameAnswers, Ripple]
"""A fit beside what loops may have answered, and what that is."""


def _stand_beside(fit: ExtendedFit) -> Beside:
    """The fit beside the answers that are no coordinate's, columns about its own motion."""
    frames, ripple = FrameAnswers.from_fit(fit), Ripple.from_fit(fit)
    beside = _allow_answers(fit, ripple, ripple.spread_apart, frames.compute_spread(fit))
    return beside, frames, ripple


def _follow_while_settling(first: Beside) -> Beside:
    """The fit along the likely answers, as long as these settle; of the last two motions that do
    not the one which leaves less, for a misfit has been laid on them."""
    last, now, missed = first, first, np.inf
    for _ in range(FOLLOWED_AGAIN):
        if is_gross(now[0]):
            return min(last, now, key=_find_chi2)
        before = missed
        along, missed = follow_answers(*now, before)
        if along is now[0]:
            return now if missed < before else min(last, now, key=_find_chi2)
        last, now = now, _stand_beside(along)
    return now


def _find_chi2(beside: Beside) -> float:
    """χ² that a fit beside answers leaves."""
    return beside[0].chi2


def fit_beside_delay(fit: ExtendedFit) -> ExtendedFit | None:
    """The fit of driven runs again where a lateness of their loops may have moved the scale factor
    too.

    Parameters
    ----------
    fit
        The base model's.

    Returns
    -------
    ExtendedFit or None
        None where there are free runs, or where no frame is allowed for.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.joint_fit import fit_beside_delay
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> fit_beside_delay(draw_fit()) is None
    True
    """
    if fit.series.unsettled is None or not are_all_driven(fit.series):
        return None
    ripple = Ripple.from_fit(fit)
    return _allow_answers(fit, ripple, ripple.spread, FrameAnswers.from_fit(fit).doings)


def _allow_answers(
    fit: ExtendedFit, ripple: Ripple, of_ripple: Array, of_frames: Array
) -> ExtendedFit:
    """The fit beside what loops may have answered, these columns (N, k) of the ripple and of their
    frame among it."""
    answers = [of_ripple, of_frames, predict_lateness(fit), predict_command_scatter(fit)]
    sizes = (ripple.amplitude_1_s, ripple.quadrature_1_s)
    return allow(fit, np.concatenate(answers, axis=1), sizes)


def _is_lost_in_phases(fit: ExtendedFit) -> bool:
    """Whether a run's phase turns away from what is foretold by more than a fit could follow."""
    return bool(np.ptp(fit.prediction.compute_phase_error(), axis=1).max() > LOST_RAD)


def _fit_phases(
    by_shape: ExtendedFit, series: MeasuredRuns, point: Point, freedom: CoordinatePriors
) -> ExtendedFit:
    """Runs whose phases the base model misses by far, at the motion that their shape and angle
    have: the runs' frequencies are fitted, the motion stands, and it is settled as far as that is.

    Among phases that a moving frequency has turned by radians a fit of all coordinates loses its
    way, and no cause is found from where it ends."""
    held = replace(freedom, mean=point.p, std=np.zeros(len(point.p)), loose=None)
    at_mean = replace(point, offset_rad_s=series.turn_rad_s)
    at_best = extended_fit.fit(series, at_mean, held)
    there = extended_fit.fit(series, at_best.point, freedom, most=0)
    return replace(there, converged=by_shape.converged)


def start_fit(fit: ExtendedFit) -> ExtendedFit:
    """The base fit with what is weakly known free where that is no way to hide a gross misfit.

    Parameters
    ----------
    fit
        The base model's.

    Returns
    -------
    ExtendedFit
        From which the search for causes starts.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.joint_fit import start_fit
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> bool(start_fit(draw_fit()).chi2 <= draw_fit().chi2)
    True
    """
    if not is_gross(fit) or fit.freedom.loose is None:
        return loosen(fit)
    # of a resonator, or of an equation averaged over the period
    for second_order in (1.0, 0.0):
        with contextlib.suppress(extended_fit.DivergedError):
            free = fit_at_second_order(fit, second_order)
            if not is_gross(free):
                return loosen(free)
    return fit


@dataclass(frozen=True)
class Cut:
    """Runs cut where samples seem lost: the steps, the pieces, which run each is of, the base fit;
    beside them the fit of whole runs, and which run each of its own is; and how the base model is
    fitted to such pieces."""

    steps: list[PhaseStep]
    pieces: list[Wave]
    origin: list[int]
    base: ExtendedFit
    untouched: ExtendedFit
    own: list[int]
    fit: Callable[..., ExtendedFit]

    def follow(self, nearest: ExtendedFit) -> Cut:
        """The base fit again, of rows averaged along the motion that it has beside the causes that
        leave least; the same where its rows are as good, or where these leave a gross misfit too
        and know no better."""
        if is_gross(nearest) or is_averaged_well(self.base.series, nearest.point):
            return self
        fit = partial(self.fit, along=nearest.point)
        return replace(self, fit=fit, base=fit_together(self.pieces, fit))


def cut_at_losses(
    waves: Sequence[Wave],
    fitted: Callable[..., ExtendedFit],
    near: Callable[[ExtendedFit], ExtendedFit],
) -> Cut:
    """The runs as they are to be diagnosed: cut where samples seem lost.

    They stay whole where cuts are not worth it, and where a gross misfit is left of the pieces by
    the few causes that leave least: a loss is then held against that (`instants`).

    Parameters
    ----------
    waves
        Of the runs.
    fitted
        The base model's fit to waves.
    near
        From it one that leaves as little as a few causes can.

    Returns
    -------
    Cut
        The pieces, the steps between them, and their fits.

    Raises
    ------
    HrgError
        The base model finds no fit to the runs together.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.joint_fit import cut_at_losses
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> cut = cut_at_losses(draw_waves(), lambda pieces: draw_fit(), lambda fit: fit)
    >>> len(cut.pieces), cut.steps, cut.origin
    (3, [], [0, 1, 2])
    """
    steps = find_phase_steps(waves)
    pieces, origin = split_at(waves, steps)
    base = fit_together(pieces, fitted)
    if steps:
        with contextlib.suppress(extended_fit.DivergedError):
            whole, runs = fitted(waves), list(range(len(waves)))
            if not _needs_cuts(base, whole) or is_gross(near(base)):
                return Cut([], list(waves), runs, whole, whole, runs, fitted)
            return Cut(steps, pieces, origin, base, whole, runs, fitted)
    return Cut(steps, pieces, origin, base, base, origin, fitted)


def fit_together(pieces: Sequence[Wave], fitted: Callable[..., ExtendedFit]) -> ExtendedFit:
    """The base model's fit to runs.

    Parameters
    ----------
    pieces
        Of the runs.
    fitted
        Its fit to waves.

    Returns
    -------
    ExtendedFit
        Without any cause.

    Raises
    ------
    HrgError
        There is none.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.joint_fit import fit_together
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> fit_together(draw_waves(), lambda pieces: draw_fit()) is draw_fit()
    True
    """
    try:
        return fitted(pieces)
    except extended_fit.DivergedError as error:
        raise HrgError(
            f"{name_some(dict.fromkeys(w.run_id for w in pieces))}: the base model finds no fit"
            " to these runs together; diagnose free and forced runs apart, or leave out the run"
            " that differs most"
        ) from error


def _needs_cuts(cut: ExtendedFit, whole: ExtendedFit) -> bool:
    """Whether runs cut where samples seem lost are fitted better than whole ones, by more than the
    pieces' own starts and frequencies cost."""
    rows = len(cut.residual)
    more = cut.basis.shape[1] - whole.basis.shape[1]
    return whole.chi2 * rows / len(whole.residual) - cut.chi2 > WORTH + more * np.log(rows)
