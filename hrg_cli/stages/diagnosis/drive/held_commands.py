"""Diagnosis, boards whose commands step in time with the oscillation.

A board holds a command f until the next one, T later. Beside their course that is a saw tooth,
f'(T/π)Σ sin(nω_u t)/n, and where a harmonic n of the steps ω_u comes near 2ω it has (f'/ω) sin(2ωt
+ Dt + β), D = nω_u − 2ω. Forces move the envelopes by u' = f − f* e^{−2jωt}, whose mean then holds

    (j/2ω) f'* e^{j(Dt + β)}.

With commands F and Q of a wave that turns by ψ', f' = e^{jφ}[(F' + jQψ') e_A + (Fψ' − jQ') e_B]:
some Fψ'/2ω a second across the wave or in quadrature. A board that reads the wave once a step, or
over a window as short as the step, takes for its angle also the ripple −(j/2ω)u'* e^{−2jωt}, and
turns its forces by (ψ'/2ω) sin(Dt + β). No log holds ω_u or β. So a beat D that is slow enough to
be seen is looked for in what driven runs leave: one in all runs of a board, of any phase in each.

It is asked where more than noise is left, must be of the size of steps, stand out of all that
another linear resonator, read-out or drive could leave of each run by itself (harmonics 0 and 4θ),
and leave nothing. Steps in time with the oscillation itself, whose beat is none, must stand out of
another base model of each run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....effects.effect import find_frame
from ....fitting.causes import designs, whitened_rows
from ....fitting.causes.extended_fit import ExtendedFit, place_on_rows
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.causes.sensitivities import Propagation, find_base_sensitivities
from ....fitting.causes.wave_frame import to_complex, to_reals
from ....fitting.envelopes.coordinates import BASIS
from ..thresholds import WORTH
from .command_log import remove_command_scatter
from .scatter import soften_runs
from .tracking import compute_slope

Array = np.ndarray
FINER = 4
"""Beats tried for one that a run resolves, 2π over its length."""
SLOW = 3
"""Resolved beats on either side of none that are all asked: of what they do, the fit took a
part."""
PEAKS = 3
"""Highest peaks of what is left that are asked beside these."""
PARTS = 6
"""Columns of a beat: cosine and sine, each of three vectors."""
REFINED = 3
"""Times that the likeliest beat is sought between its neighbours, each time `FINER` times as
finely."""
LARGEST = 5.0
"""Times the size of steps up to which what is left may be theirs; beyond, it is a misfit."""
INDEPENDENT = 1e-8
TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
LINEAR = [one * part for one in (np.eye(2), *BASIS[1:3], TURN) for part in (1, 1j)]
"""Linear maps of the envelopes, of which any other is a sum."""


@dataclass(frozen=True)
class _Left:
    """What is left of one run: its rows, what else could have left it, and the rest."""

    rows: slice
    beside: Array
    rest: Array

    def compute_log_odds(self, doings: Array) -> float:
        """ln of the odds for these doings (N, k) of standard deviation 1 each against none; none
        where they would be larger than steps are."""
        free = doings - self.beside @ (self.beside.T @ doings)
        power = np.eye(doings.shape[1]) + free.T @ free
        along = free.T @ self.rest
        size = np.linalg.solve(power, along)
        if np.abs(size).max() > LARGEST:
            return -np.inf
        # the likelihood of r ~ N(0, 1 + DDᵀ) over that of noise alone, by D's few columns
        # (Woodbury)
        return float(along @ size - np.linalg.slogdet(power)[1]) / 2


def find_likely_beats(fit: ExtendedFit) -> list[float]:
    """The beats D of the commands' steps with the oscillation that are likely in what is left of
    driven runs.

    Parameters
    ----------
    fit
        Of a model.

    Returns
    -------
    list of float
        [rad/s]; 0 where none is likely too, empty where neither is.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.held_commands import find_likely_beats
    >>> find_likely_beats(draw_fit())
    []
    """
    left = _find_remainder(fit, _span_linear_maps(fit.flow))
    if not left:
        return []
    lengths = [np.ptp(t[w > 0]) for t, w in zip(fit.series.time_s, fit.series.weight, strict=True)]
    step = 2 * np.pi / max(lengths) / FINER
    fastest = np.pi / float(np.median(fit.series.step_s[fit.series.step_s > 0]))
    beats = step * np.arange(-np.floor(fastest / step), np.floor(fastest / step) + 1)
    asked = np.abs(beats) <= SLOW * FINER * step
    for peak in _peaks(_spectrum(fit, left, beats)):
        asked |= np.abs(beats - beats[peak]) <= FINER * step
    # the evidence is ln of the odds, `WORTH` twice that; each of so many beats is as likely
    # beforehand
    price, out = WORTH / 2 + np.log(len(beats)), []
    best, evidence = _likeliest(fit, left, beats[asked])
    if evidence > price:
        for _ in range(REFINED):
            best, _ = _likeliest(fit, left, best + step * np.linspace(-1, 1, 2 * FINER + 1))
            step /= FINER
        out.append(best)
    if 0.0 not in out and _likeliest(fit, _find_remainder(fit), np.zeros(1))[1] > price:
        out.append(0.0)
    return out


def allow_steps(fit: ExtendedFit, beat_rad_s: float) -> ExtendedFit:
    """The fit again where the steps of held commands may stand beside it in every driven run.

    Parameters
    ----------
    fit
        Of a model.
    beat_rad_s
        D of the steps with the oscillation [rad/s].

    Returns
    -------
    ExtendedFit
        The same in free runs, which have no commands.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.held_commands import allow_steps
    >>> allow_steps(draw_fit(), 3.0).chi2 == draw_fit().chi2
    True
    """
    series = replace(fit.series, held_beat_rad_s=beat_rad_s)
    flow = replace(fit.flow, prediction=replace(fit.prediction, series=series))
    return soften_runs(replace(fit, flow=flow), _moved(fit, np.array([beat_rad_s])))


def _find_remainder(fit: ExtendedFit, besides: Array | None = None) -> list[_Left]:
    """Of every driven run, beside what the base model of its own could leave, and changes of what
    is seen (R, n, 4, k)."""
    series, shared = fit.series, find_base_sensitivities(fit.flow)[0]
    if besides is not None:
        shared = np.concatenate([shared, besides], axis=-1)
    shared = whitened_rows.flatten_rows(series, shared)
    driven, out = np.any(series.forced > 0, axis=1), []
    for k, (rows, _, own) in enumerate(fit.design.own):
        if driven[k]:
            Q = designs.orthonormalise(np.concatenate([own, shared[rows]], axis=1), INDEPENDENT)
            rest = fit.residual[rows]
            out.append(_Left(rows, Q, rest - Q @ (Q.T @ rest)))
    return out


def _likeliest(fit: ExtendedFit, left: Sequence[_Left], beats: Array) -> tuple[float, float]:
    """Which of these beats has most evidence, and how much."""
    moved = whitened_rows.flatten_rows(fit.series, fit.flow.whiten_read_out(_moved(fit, beats)))
    found = [
        sum(run.compute_log_odds(moved[run.rows, PARTS * k : PARTS * (k + 1)]) for run in left)
        for k in range(len(beats))
    ]
    best = int(np.argmax(found))
    return float(beats[best]), found[best]


def _span_linear_maps(flow: Propagation) -> Array:
    """What any linear map of the wave, of what is seen of it, and of the forces does, over σ
    (R, n, 4, 24)."""

    def mapped(u: Array) -> list[Array]:
        return [to_reals(np.einsum("ij,rnj->rni", one, u)) for one in LINEAR]

    prediction = flow.prediction
    at_rows, at_middle = (
        np.stack([*mapped(v), *mapped(_force(series, v))], axis=-1)
        for series, v in ((prediction.series, prediction.motion), (flow.centre, flow.middle))
    )
    moved = flow.whiten_read_out(flow.propagate(at_rows, at_middle))
    return np.concatenate(
        [moved, prediction.whiten_judged(np.stack(mapped(prediction.seen), axis=-1))], axis=-1
    )


def _force(series: MeasuredRuns, v: Array) -> Array:
    """The commanded force on envelopes v (R, n, 2)."""
    turn, e_A, e_B, _ = find_frame(v, series.phase_rad)
    main, quadrature = series.main_drive[..., None], series.quadrature_drive[..., None]
    return turn[..., None] * (main * e_A - 1j * quadrature * e_B)


def _moved(fit: ExtendedFit, beats: Array) -> Array:
    """By how much the steps of these beats D (k,) change the motion, (R, n, 4, PARTS k)."""
    flow, series = fit.flow, fit.series
    change, turned = _of_commands(series, flow.prediction.motion)
    middle = [(one[:, 1:] + one[:, :-1]) / 2 for one in (change, turned)]
    return flow.propagate_products(
        _means(series, flow.prediction.motion, change, turned),
        _means(flow.centre, flow.middle, *middle),
        _swings(series.time_s, beats),
        _swings(flow.centre.time_s, beats),
    )


def _of_commands(series: MeasuredRuns, v: Array) -> tuple[Array, Array]:
    """Along the wave and across it (R, n, 2): f' of the commands beyond their scatter, and what of
    it the wave's own turn makes, (F' + jQψ', Fψ' − jQ') and (jQψ', Fψ')."""
    smooth = remove_command_scatter(series)
    _, e_A, _, _ = find_frame(v, series.phase_rad)
    turning = compute_slope(series.time_s, np.unwrap(np.arctan2(e_A[..., 1], e_A[..., 0]), axis=1))
    main, quadrature = smooth.main_drive, smooth.quadrature_drive
    turned = np.stack([1j * quadrature * turning, main * turning], axis=-1)
    own = [compute_slope(series.time_s, main), -1j * compute_slope(series.time_s, quadrature)]
    return turned + np.stack(own, axis=-1), turned


def _means(series: MeasuredRuns, v: Array, change: Array, turned: Array) -> Array:
    """(j/2ω) f'*, the same a quarter later, and what a wave read beside itself makes of its turn,
    for one amplitude of the beat, as reals (R, n, 4, 3)."""
    turn, e_A, e_B, _ = find_frame(v, series.phase_rad)

    def vector(parts: Array) -> Array:
        return turn[..., None] * (parts[..., :1] * e_A + parts[..., 1:] * e_B)

    over = 1 / (4 * np.pi * series.reference_frequency_hz)
    held = 1j * over * np.conj(change)
    return np.stack([to_reals(vector(one)) for one in (held, 1j * held, over * turned)], axis=-1)


def _swings(time_s: Array, beats: Array) -> Array:
    """Cosines and sines of the beats (k,), side by side, (R, n, 2 k)."""
    phase = time_s[..., None] * beats
    return np.stack([np.cos(phase), np.sin(phase)], axis=-1).reshape(*time_s.shape, -1)


def _spectrum(fit: ExtendedFit, left: Sequence[_Left], beats: Array) -> Array:
    """Power of what is left across the wave and in quadrature at every beat of either sign,
    (k,)."""
    series, rest = fit.series, np.zeros(len(fit.residual))
    for run in left:
        rest[run.rows] = run.rest
    turn, _, e_B, _ = find_frame(fit.prediction.motion, series.phase_rad)
    beside = np.conj(turn) * np.sum(e_B * to_complex(place_on_rows(fit, rest)), axis=-1)
    power = np.zeros(len(beats))
    for t, z, weight in zip(series.time_s, beside, series.weight, strict=True):
        good = weight > 0
        power += np.abs(np.exp(-1j * np.outer(beats, t[good])) @ z[good]) ** 2
    return power + power[::-1]


def _peaks(power: Array) -> list[int]:
    """The highest of the peaks that are a resolved beat apart."""
    out: list[int] = []
    for k in np.argsort(-power):
        if all(abs(k - other) > FINER for other in out):
            out.append(int(k))
        if len(out) == PEAKS:
            break
    return out
