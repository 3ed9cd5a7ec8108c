"""Diagnosis, the scatter of a drive's log: a log of single values of a noisy or rippling command
does not hold what the drive did between its rows, one of means does, and nobody says which it is.

What the log's rows hold beside the drive's own means is at most their scatter from row to row, s.
A part q s of it, white in time, is the log's own: the wave then walks beside its prediction with
covariance C = 1 + q² S Sᵀ over σ (S: what s in one row of the log's means does), and residual and
sensitivities are whitened by C^{−1/2}. A row's mean acts half before its middle and half behind it.

The frame that the commands are turned to is measured too, and its noise is in no log. Loops that
look at windows of noise σ see angle and phase with σ/a: f_A σ/a across the wave, as white as the
windows, and the wave walks by νT of the σ of its own mean in a time T. Loops that see the state
itself have none of it, a filter takes a part off: it has a q of its own.

q is not known. Every q up to 1 is as likely beforehand; the residual judges them (REML), and the
mean of q² is taken, so that a walk too weak to be seen is still part of every σ. Judged is the
residual beside all that could be taken for a walk: every run has a resonator of its own, and what
is slower than `SLOW` half cycles a run is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....effects.effect import find_frame
from ....fitting.causes import designs, extended_fit, whitened_rows
from ....fitting.causes.designs import Basis, Softened
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.causes.sensitivities import find_base_sensitivities
from ....fitting.causes.slow_prediction import predict
from ....fitting.causes.walks import LogPieces, Walk, WalkPart
from ....fitting.causes.wave_frame import find_directions, to_reals
from ....fitting.noise.difference_noise import measure_noise_of_means
from ..thresholds import MOST_SCATTER, SCATTER_COUNTS, SCATTER_TOLD

Array = np.ndarray
SLOW = 4
"""Half cycles a run up to which nothing is taken for scatter: what no cause of the catalogue holds
is mostly slow."""
PIECES = 120
"""Pieces of a run over which scatter is one value: what is quicker moves the wave too little."""
FEWEST = 20
"""Rows from which a scatter is looked for."""
PARTS = MOST_SCATTER * np.linspace(0, 1, 81) ** 2
"""Values of q, closer where a large scatter leaves a little of it."""
WEAKEST = 1e-2
"""Variance over that of the windows below which a direction is left alone."""
INDEPENDENT = 1e-8


@dataclass(frozen=True)
class Scatter:
    """White scatter of the two commands from row to row (R, 2), amplitude/s, and the walk s h √n
    that it makes of the wave in a run, over σ (R,)."""

    size: Array
    walk: Array

    @classmethod
    def from_commands(cls, series: MeasuredRuns) -> Scatter:
        """Of the logged commands; 0 where none is logged, or too few rows."""
        size, walk = np.zeros((len(series.names), 2)), np.zeros(len(series.names))
        for k, weight in enumerate(series.weight):
            good = weight > 0
            rows = int(np.count_nonzero(good))
            if rows < FEWEST or not series.forced[k].any():
                continue
            time_s = series.time_s[k][good]
            done = np.stack([series.main_impulse[k][good], series.quadrature_impulse[k][good]])
            # rows in which the command was switched are few
            size[k] = measure_noise_of_means(time_s, done, 4)
            step = float(np.median(np.diff(time_s)))
            walk[k] = size[k].max() * step * np.sqrt(rows) * float(np.median(weight[good]))
        return cls(size, walk)

    @classmethod
    def from_frame(cls, series: MeasuredRuns) -> Scatter:
        """White noise of the angle and of the phase to which the commands are turned, rad (R, 2),
        as the windows' own noise makes it."""
        size, walk = np.zeros((len(series.names), 2)), np.zeros(len(series.names))
        for k, weight in enumerate(series.weight):
            good = weight > 0
            rows = int(np.count_nonzero(good))
            force = np.hypot(series.main_drive[k], series.quadrature_drive[k])[good]
            if rows < FEWEST or not series.forced[k].any() or not force.any():
                continue
            amplitude = float(np.median(np.linalg.norm(series.envelope[k][good], axis=-1)))
            std = float(np.median(1 / weight[good]))
            size[k] = std / amplitude
            step = float(np.median(np.diff(series.time_s[k][good])))
            walk[k] = float(np.median(force)) * size[k, 0] * step * np.sqrt(rows) / std
        return cls(size, walk)

    def find_moved_runs(self, series: MeasuredRuns) -> Array:
        """Runs (R,) in which it moves the wave by what could be seen."""
        rows = np.count_nonzero(series.weight > 0, axis=1)
        return np.asarray(self.walk * np.sqrt(rows) > SCATTER_COUNTS)

    @property
    def worst(self) -> int:
        """The run where it does most."""
        return int(np.argmax(self.walk))


@dataclass(frozen=True)
class _Run:
    """One run's rows, what the scatter does to them (N, k), and what else could be taken for it."""

    number: int
    rows: slice
    doings: Array
    beside: Array


def soften_runs(fit: ExtendedFit, changed: Array) -> ExtendedFit:
    """The fit again where changes of the driven runs' motion may stand beside it in each of them.

    Parameters
    ----------
    fit
        Of a model.
    changed
        Changes of standard deviation 1, (R, n, 4, k).

    Returns
    -------
    ExtendedFit
        The same where they could not be seen.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.scatter import soften_runs
    >>> soften_runs(draw_fit(), np.zeros((3, 50, 4, 1))) is draw_fit()
    True
    """
    doings = whitened_rows.flatten_rows(fit.series, fit.flow.whiten_read_out(changed))
    driven = np.any(fit.series.forced > 0, axis=1)
    runs = [
        _Run(k, rows, doings[rows], np.zeros((0, 0)))
        for k, (rows, _, _) in enumerate(fit.design.own)
        if driven[k] and np.linalg.norm(doings[rows], axis=0).max(initial=0.0) > SCATTER_COUNTS
    ]
    return _soften(fit, runs, None, 1.0, fit.series.scatter_part) if runs else fit


def allow_scatter(fit: ExtendedFit) -> ExtendedFit:
    """The fit again beside as much of the log's scatter and of its frame's noise as the waves leave
    possible.

    Parameters
    ----------
    fit
        Of a model.

    Returns
    -------
    ExtendedFit
        The same where none could be seen.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.scatter import allow_scatter
    >>> allow_scatter(draw_fit()) is draw_fit()
    True
    """
    if not has_log(fit.series):
        return fit
    for scatter, forces in (
        (Scatter.from_commands(fit.series), _predict_command_forces),
        (Scatter.from_frame(fit.series), _predict_frame_forces),
    ):
        if np.any(scatter.find_moved_runs(fit.series)):
            pieces = _pieces(fit, scatter.size, forces(fit))
            runs = _runs(fit, scatter, pieces)
            part = _estimate_part(fit.residual, runs)
            told = part if forces is _predict_command_forces else fit.series.scatter_part
            fit = _soften(fit, runs, replace(pieces, jumps=part * pieces.jumps), part, told)
    return fit


def follow_walk(fit: ExtendedFit) -> ExtendedFit:
    """The fit again along the motion that the waves make likely.

    Loops take back what they see of a walk, by commands that the log does hold: the motion
    predicted from these alone has the walk with the other sign, and whatever follows it would be
    correlated with the residual, which is the walk.

    Parameters
    ----------
    fit
        Beside the walk that is allowed for.

    Returns
    -------
    ExtendedFit
        The same where the log holds all.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.scatter import follow_walk
    >>> follow_walk(draw_fit()) is draw_fit()
    True
    """
    series, walk = fit.series, fit.series.walk
    if walk is None or series.scatter is None or not walk.parts:
        return fit
    still = walk.stand_still()
    walked = replace(still, jumps=walk.estimate_jumps(fit.residual, series.scatter))
    seen = [
        predict(replace(series, walk=one), fit.point, fit.flow.near).seen for one in (still, walked)
    ]
    series = replace(series, walk=replace(walked, seen=seen[1] - seen[0]))
    return extended_fit.fit(series, fit.point, fit.freedom, near=fit.flow.near)


def has_log(series: MeasuredRuns) -> bool:
    """Whether a command is logged in any run.

    Parameters
    ----------
    series
        The runs' rows.

    Returns
    -------
    bool
        One moves within a run.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.scatter import has_log
    >>> has_log(draw_fit().series)
    False
    """
    commands = np.stack([series.main_drive, series.quadrature_drive])
    return bool(np.any(np.ptp(commands, axis=-1) > 0))


def find_row_length_s(series: MeasuredRuns) -> float:
    """Length of the rows, of the run that has the shortest.

    Parameters
    ----------
    series
        The runs' rows.

    Returns
    -------
    float
        [s]

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.scatter import find_row_length_s
    >>> round(find_row_length_s(draw_fit().series), 3)
    0.02
    """
    lengths = [np.median(h[h > 0]) for h in series.step_s if np.any(h > 0)]
    return float(min(lengths))


def _soften(
    fit: ExtendedFit, runs: Sequence[_Run], pieces: LogPieces | None, part: float, told: float
) -> ExtendedFit:
    """The fit again where what `part` of the scatter does to these runs may stand beside it, and
    may have walked by these pieces, if it walks; `told` is what that makes of the log's scatter."""
    own, turns = [], []
    for run in runs:
        Q, power, turn = _directions(part * run.doings)
        own.append((run.rows, Q, power))
        turns.append(WalkPart(run.number, pieces, turn))
    known, walk, new = fit.series.scatter, fit.series.walk, Softened(tuple(own))
    motion = fit.prediction.motion
    series = replace(
        fit.series,
        scatter=Softened((*(() if known is None else known.own), *new.own)),
        walk=replace(
            Walk.make_still(motion) if walk is None else walk.stand_still(),
            parts=(*(() if walk is None else walk.parts), *turns),
        ),
        scatter_part=told,
        unsettled=_whitened(fit.series.unsettled, new),
    )
    return extended_fit.fit(series, fit.point, fit.freedom, near=fit.flow.near)


def allow(
    fit: ExtendedFit, columns: Array, answers_1_s: tuple[float, float] | None = None
) -> ExtendedFit:
    """The fit again where columns may stand beside all runs together, in place of what else was
    allowed so.

    Parameters
    ----------
    fit
        Of a model.
    columns
        Over σ, of standard deviation 1 each, (N, k); those that move the waves by less than could
        be seen are left.
    answers_1_s
        Standard deviations of the loops' answers to a ripple that are among them.

    Returns
    -------
    ExtendedFit
        The same where none is left.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.scatter import allow
    >>> allow(draw_fit(), np.zeros((len(draw_fit().residual), 1))) is draw_fit()
    True
    """
    U, size, _ = np.linalg.svd(columns, full_matrices=False)
    seen = size > SCATTER_COUNTS
    if not np.any(seen):
        return fit
    known = fit.series.unsettled
    basis = Basis(() if known is None else known.own, U[:, seen], size[seen] ** 2)
    series = replace(fit.series, unsettled=basis, answers_1_s=answers_1_s)
    return extended_fit.fit(series, fit.point, fit.freedom, near=fit.flow.near)


def describe_scatter(fit: ExtendedFit) -> str:
    """What is to be said of a log that scatters.

    Parameters
    ----------
    fit
        Of a model.

    Returns
    -------
    str
        A sentence; empty where it hardly moves the wave.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.scatter import describe_scatter
    >>> describe_scatter(draw_fit())
    ''
    """
    scatter = Scatter.from_commands(fit.series)
    walk = scatter.walk[scatter.worst] * fit.series.scatter_part
    if walk < SCATTER_TOLD:
        return ""
    size = float(np.max(scatter.size[scatter.worst]))
    allowed = "; so much is in every standard deviation" if fit.series.scatter is not None else ""
    return (
        f"the drive's log scatters by {size:.2g} amplitude/s from row to row; the"
        f" {100 * min(fit.series.scatter_part, 1.0):.2g} % of it that the waves do not exclude move"
        f" them by {walk:.2g} σ within a run{allowed}; log the drive's means"
    )


def find_corner_hz(fit: ExtendedFit) -> float:
    """Distance from the resonance at which the walk that is allowed for is as strong as the noise,
    s/2πσ.

    The walk's density is s²h/(2πf)², that of the noise σ²h.

    Parameters
    ----------
    fit
        Of a model.

    Returns
    -------
    float
        [Hz]; 0 where no walk is allowed for.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.scatter import find_corner_hz
    >>> find_corner_hz(draw_fit())
    0.0
    """
    if fit.series.scatter is None:
        return 0.0
    size = Scatter.from_commands(fit.series).size.max(axis=1)
    weights = [float(np.median(w[w > 0])) if w.any() else 0.0 for w in fit.series.weight]
    return float(np.max(size * weights)) / (2 * np.pi)


def _runs(fit: ExtendedFit, scatter: Scatter, pieces: LogPieces) -> list[_Run]:
    """The runs whose scatter counts."""
    series, moves = fit.series, scatter.find_moved_runs(fit.series)
    moved = fit.flow.whiten_read_out(fit.flow.carry_jumps(pieces.build_jumps()))
    doings = whitened_rows.flatten_rows(series, moved)
    shared = whitened_rows.flatten_rows(series, find_base_sensitivities(fit.flow)[0])
    slow = whitened_rows.flatten_rows(series, _slow(fit))
    out = []
    for k, (rows, _, own) in enumerate(fit.design.own):
        if moves[k]:
            beside = np.concatenate([own, shared[rows], slow[rows]], axis=1)
            out.append(_Run(k, rows, doings[rows], beside))
    return out


def _predict_command_forces(fit: ExtendedFit) -> tuple[Array, Array]:
    """Forces (R, n − 1, 2) in the steps' middles of one unit of either command, in phasors."""
    turn, e_A, e_B, _ = find_frame(fit.flow.middle, fit.flow.centre.phase_rad)
    return turn[..., None] * e_A, -1j * turn[..., None] * e_B


def _predict_frame_forces(fit: ExtendedFit) -> tuple[Array, Array]:
    """The same of one radian by which the commands' angle, and their phase, stand beside the
    wave's."""
    return turn_forces(fit.flow.centre, fit.flow.middle)


def turn_forces(series: MeasuredRuns, v: Array) -> tuple[Array, Array]:
    """Forces that a radian between the commands' frame and the wave's makes: e^{jφ}(f_A e_B + j f_B
    e_A) in angle and jF in phase.

    Parameters
    ----------
    series
        The runs' rows.
    v
        Envelopes (R, n, 2).

    Returns
    -------
    tuple of ndarray
        (R, n, 2) each, amplitude per second.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.scatter import turn_forces
    >>> angle, phase = turn_forces(draw_fit().series, draw_fit().prediction.motion)
    >>> angle.shape, bool(angle.any() or phase.any())
    ((3, 50, 2), False)
    """
    turn, e_A, e_B, _ = find_frame(v, series.phase_rad)
    main = series.main_drive[..., None] * turn[..., None]
    quadrature = series.quadrature_drive[..., None] * turn[..., None]
    return main * e_B + 1j * quadrature * e_A, 1j * main * e_A + quadrature * e_B


Forces = Callable[[ExtendedFit], tuple[Array, Array]]


def _pieces(fit: ExtendedFit, size: Array, forces: tuple[Array, Array]) -> LogPieces:
    """The log's pieces, and the jumps by one σ of scatter in the row before a step or behind it."""
    series, rows = fit.series, fit.series.time_s.shape[1]
    jumps = [
        to_reals(unit) * (series.step_s * size[:, n, None] / 2)[..., None]
        for n, unit in enumerate(forces)
    ]
    return LogPieces(np.stack(jumps, axis=-1), np.arange(rows) * min(PIECES, rows) // rows)


def _slow(fit: ExtendedFit) -> Array:
    """Half cycles over a run of the wave's four components, over σ, (R, n, 4, 4 · SLOW)."""
    t = fit.series.time_s
    waves = np.cos(
        np.pi * np.arange(SLOW) * ((t - t[:, :1]) / np.ptp(t, axis=1)[:, None])[..., None]
    )
    along = np.moveaxis(to_reals(find_directions(fit.prediction.seen)), -2, -1)
    columns = along[..., None] * waves[..., None, None, :]
    return fit.prediction.whiten_judged(columns.reshape(*t.shape, 4, -1))


def _estimate_part(residual: Array, runs: Sequence[_Run]) -> float:
    """The part q of the scatter, from the mean of q² over all that the residual leaves possible."""
    powers, squares = [], []
    for run in runs:
        beside = designs.orthonormalise(run.beside, INDEPENDENT)
        Q, power, _ = _directions(run.doings - beside @ (beside.T @ run.doings))
        powers.append(power)
        squares.append((Q.T @ residual[run.rows]) ** 2)
    power, square = np.concatenate(powers), np.concatenate(squares)
    spread = 1 + PARTS[:, None] ** 2 * power
    # −2 ln of the likelihood of every q: along Q the residual has variance 1 + q²Λ
    score = np.sum(np.log(spread) + square / spread, axis=1)
    # every q is as likely beforehand, and the grid is no even one: its spacing weighs
    likely = np.exp((score.min() - score) / 2) * np.gradient(PARTS)
    return float(np.sqrt(np.sum(likely * PARTS**2) / np.sum(likely)))


def _directions(doings: Array) -> tuple[Array, Array, Array]:
    """Orthonormal Q (N, r), variances Λ (r,) and V (k, r) of D = Q√Λ Vᵀ, from the small Gram matrix
    DᵀD; those below `WEAKEST` left out."""
    power, turn = np.linalg.eigh(doings.T @ doings)
    keep = power > WEAKEST
    turn, power = turn[:, keep], power[keep]
    return doings @ (turn / np.sqrt(power)), power, turn


def _whitened(known: Basis | None, soft: Softened) -> Basis | None:
    """What is unsettled, as it stands in the whitened rows."""
    if known is None:
        return None
    own = []
    for rows, Q in known.own:
        whole = np.zeros((known.shape[0], Q.shape[1]))
        whole[rows] = Q
        own.append((rows, designs.orthonormalise(soft.whiten(whole)[rows], INDEPENDENT)))
    return Basis(tuple(own), soft.whiten(known.shared), known.variance)
