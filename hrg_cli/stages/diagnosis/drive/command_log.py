"""Diagnosis, the time of a drive's log: its rows stand for the command at an instant, over the step
about it, or until the next row, and nobody says which.

A command that is held until the next row acts half a step later than a row about its own time, and
a converter, a filter or a delay add to that. How late the log is, τ, f(t) = f_log(t − τ), is taken
as the waves show it, the same in all runs, and no cause is judged by what a change of τ can do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ....fitting.causes import extended_fit, whitened_rows
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.causes.slow_equation import RungeKuttaStage
from ....fitting.causes.wave_frame import to_reals
from ....fitting.samples.course import average_over_windows, integrate_means
from ....records import Wave
from ..fits.refits import HOPELESS
from ..thresholds import GROSS, THINKABLE_LATENESS
from .scatter import Scatter, find_row_length_s, has_log

Array = np.ndarray
COMMANDS = (("main_drive", "main_impulse"), ("quadrature_drive", "quadrature_impulse"))
"""The commands and their integrals."""
ROUNDS = 4
REACH = 0.5
"""Standard deviation of τ beforehand, in the shortest run's row length: what is later than a row
would have been seen as such."""
SETTLED = 0.03
"""Part of its standard deviation by which τ may still move."""
CLEAR = 3.0
"""σ of the commands' scatter from which a part of them is more than that."""
STEP = 1e-3
"""Change of τ for its effect, in row lengths: the model is linear in it."""


def fit_lateness(fit: ExtendedFit) -> ExtendedFit:
    """The fit again with the commands as late as the waves show them.

    Parameters
    ----------
    fit
        Of a model.

    Returns
    -------
    ExtendedFit
        The same where no command is logged.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_log import fit_lateness
    >>> fit_lateness(draw_fit()) is draw_fit()
    True
    """
    if not has_log(fit.series):
        return fit
    before = 1 / (REACH * find_row_length_s(fit.series)) ** 2
    for _ in range(ROUNDS):
        column = fit.basis.project_out(
            whitened_rows.flatten_rows(fit.series, differentiate_by_lateness(fit))
        )
        if _is_beside_the_point(fit, column):
            break
        told = fit.basis.project_out(
            whitened_rows.flatten_rows(
                fit.series, differentiate_by_lateness(fit, remove_command_scatter)
            )
        )
        # two-stage least squares (Theil 1953): the lateness is found along `told`, of the commands
        # beyond their scatter, which the windows' noise did not make; along the whole column it
        # would follow the noise that loops answer
        along, power = float(told @ column), max(float(told @ told), np.finfo(float).tiny)
        information = along**2 / power + before
        late = fit.series.drive_late_s
        step = (along / power * float(told @ fit.residual) - late * before) / information
        fit = extended_fit.fit(delay_commands(fit.series, step), fit.point, fit.freedom)
        if step**2 * information < SETTLED**2:
            break
    return fit


def is_thinkable(fit: ExtendedFit) -> bool:
    """Whether the commands' lateness is one that a log may have, or all that is wrong with the
    runs: others are a misfit laid on the log's time.

    Parameters
    ----------
    fit
        With its lateness.

    Returns
    -------
    bool
        It may stand.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_log import is_thinkable
    >>> is_thinkable(draw_fit())
    True
    """
    late, usual = abs(fit.series.drive_late_s), REACH * find_row_length_s(fit.series)
    return late <= THINKABLE_LATENESS * usual or fit.is_adequate


def _is_beside_the_point(fit: ExtendedFit, column: Array) -> bool:
    """Whether the misfit is gross and would be with the commands at any time: no refit says
    more."""
    size = max(float(column @ column), np.finfo(float).tiny)
    left = fit.chi2 - float(column @ fit.residual) ** 2 / size
    return left > HOPELESS * GROSS * fit.dof


def predict_lateness(fit: ExtendedFit) -> Array:
    """What one standard deviation of the log's lateness does to the waves.

    Of what the commands do beyond their scatter: loops answer the windows' noise, which the
    residual is, and to take the whole column off it would leave the rest of that column in its
    place.

    Parameters
    ----------
    fit
        Of a model.

    Returns
    -------
    ndarray
        Over σ, (N, 1).

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_log import predict_lateness
    >>> column = predict_lateness(draw_fit())
    >>> len(column) == len(draw_fit().residual), bool(column.any())
    (True, False)
    """
    column = whitened_rows.flatten_own(
        fit.series, differentiate_by_lateness(fit, remove_command_scatter)
    )
    return REACH * find_row_length_s(fit.series) * column[:, None]


def predict_command_scatter(fit: ExtendedFit) -> Array:
    """What the commands' scatter from row to row does to the waves: how much of it was the drive's
    own nobody knows.

    Single values of a noisy command hold noise that the drive's mean did not, and what follows from
    it would be followed by the waves in part: as if every command were so much too large.

    Parameters
    ----------
    fit
        Of a model.

    Returns
    -------
    ndarray
        Of either command over σ, (N, 2); (N, 0) where it moves no run.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_log import predict_command_scatter
    >>> predict_command_scatter(draw_fit()).shape[1]
    0
    """
    series = fit.series
    if not np.any(Scatter.from_commands(series).find_moved_runs(series)):
        return np.zeros((len(fit.residual), 0))
    smooth, columns = remove_command_scatter(series), []
    for command, integral in COMMANDS:
        part = getattr(series, command) - getattr(smooth, command)
        area = np.zeros_like(part)
        area[:, 1:] = np.cumsum(series.step_s * (part[:, 1:] + part[:, :-1]) / 2, axis=1)
        changed = replace(
            series,
            **{
                command: getattr(series, command) + STEP * part,
                integral: getattr(series, integral) + STEP * area,
            },
        )
        columns.append(whitened_rows.flatten_own(series, _change(fit, changed) / STEP))
    return np.stack(columns, axis=-1)


def differentiate_by_lateness(
    fit: ExtendedFit, part: Callable[[MeasuredRuns], MeasuredRuns] = lambda series: series
) -> Array:
    """What is seen of a lateness of one second.

    Parameters
    ----------
    fit
        Of a model.
    part
        Which part of the commands is late.

    Returns
    -------
    ndarray
        Over σ, per second, (R, n, 4).

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_log import differentiate_by_lateness
    >>> differentiate_by_lateness(draw_fit()).shape
    (3, 50, 4)
    """
    small = STEP * find_row_length_s(fit.series)
    return _change(fit, delay_commands(fit.series, small, part(fit.series))) / small


def _change(fit: ExtendedFit, other: MeasuredRuns) -> Array:
    """By how much the waves change, over σ (R, n, 4), with the commands of another series."""
    flow, point = fit.flow, fit.point
    motion, rows = fit.prediction.motion, RungeKuttaStage(other, point)
    halves = RungeKuttaStage(other.middles, point)
    at_rows = to_reals(rows.compute_source(motion) - flow.rows.compute_source(motion))[..., None]
    at_middle = to_reals(
        halves.compute_source(flow.middle) - flow.halves.compute_source(flow.middle)
    )[..., None]
    direct = to_reals(rows.read_out(motion) - flow.rows.read_out(motion))[..., None]
    carried = flow.read_out(flow.propagate(at_rows, at_middle))
    return fit.prediction.whiten_judged(carried + direct)[..., 0]


def remove_command_scatter(series: MeasuredRuns) -> MeasuredRuns:
    """The commands without their scatter: coefficients c over orthonormal cosines less (3s)²/c of
    them.

    s is the white scatter from row to row. Loops on noisy envelopes answer the noise that the fit
    leaves, which would be taken for a lateness of what they command.

    Parameters
    ----------
    series
        The runs' rows.

    Returns
    -------
    MeasuredRuns
        With smoother commands.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_log import remove_command_scatter
    >>> bool(remove_command_scatter(draw_fit().series).main_drive.any())
    False
    """
    from scipy.fft import dct, idct

    size = Scatter.from_commands(series).size
    columns = {}
    for n, name in enumerate(("main_drive", "quadrature_drive")):
        values = getattr(series, name).copy()
        for k, weight in enumerate(series.weight):
            good = weight > 0
            c = dct(values[k, good], norm="ortho")
            power = np.maximum(c**2, np.finfo(float).tiny)
            # the non-negative garrote (Breiman 1995): a large coefficient stays whole, where a
            # Wiener filter would shrink it and so make the commands too small
            values[k, good] = idct(
                c * np.maximum(1 - (CLEAR * size[k, n]) ** 2 / power, 0.0), norm="ortho"
            )
        columns[name] = values
    return replace(series, **columns)


def delay_commands(
    series: MeasuredRuns, late_s: float, moving: MeasuredRuns | None = None
) -> MeasuredRuns:
    """The commands later still by a time τ that is short against the rows: f − τḟ, and ∫f − τf.

    Parameters
    ----------
    series
        The runs' rows.
    late_s
        τ [s].
    moving
        The series whose commands f are late, where that is a part of them.

    Returns
    -------
    MeasuredRuns
        With later commands.

    Examples
    --------
    A command that rises by 2 per second:

    >>> from dataclasses import replace
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.command_log import delay_commands
    >>> series = draw_fit().series
    >>> rising = replace(series, main_drive=2 * series.time_s)
    >>> late = delay_commands(rising, 1e-3)
    >>> float((late.main_drive - rising.main_drive)[0, 20].round(9))
    -0.002
    """
    moving = series if moving is None else moving
    width = np.gradient(series.time_s, axis=1)
    width = np.where(width > 0, width, np.inf)
    changes = {}
    for command, integral in COMMANDS:
        values = getattr(moving, command)
        changes[command] = getattr(series, command) - late_s * np.gradient(values, axis=1) / width
        changes[integral] = getattr(series, integral) - late_s * values
    return replace(series, drive_late_s=series.drive_late_s + late_s, **changes)


def shift_commands(wave: Wave, late_s: float) -> Wave:
    """The wave with the commands in its log's rows at the times at which they act.

    Parameters
    ----------
    wave
        Of a run.
    late_s
        By how much they are late [s].

    Returns
    -------
    Wave
        The same in all else.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.drive.command_log import shift_commands
    >>> wave = draw_waves()[0]
    >>> driven = wave.replace(drive_main=np.asarray(wave.time_s, float))
    >>> float((driven.drive_main - shift_commands(driven, 0.01).drive_main)[20].round(9))
    0.01
    """

    def at(values: Array | None) -> Array | None:
        if values is None or late_s == 0:
            return values
        known = np.isfinite(values)
        log = integrate_means(t[known], np.asarray(values, float)[known])
        return np.where(known, average_over_windows(log, t - late_s, wave.window_s), np.nan)

    t = np.asarray(wave.time_s, float)
    return wave.replace(drive_main=at(wave.drive_main), drive_quadrature=at(wave.drive_quadrature))
