"""Diagnosis, the gain: how much better runs are predicted that the extended model was not fitted
to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....effects.effect import find_frame
from ....fitting.causes import left_out_folds
from ....fitting.causes.coordinate_priors import build_coordinate_rows
from ....fitting.causes.extended_fit import ExtendedFit, place_on_rows
from ....fitting.causes.left_out_folds import HeldOut
from ....fitting.causes.wave_frame import to_complex, to_reals
from ....fitting.causes.whitened_rows import flatten_rows
from ....units import DEGREE_PER_HOUR
from ..fits.scoring import is_gross
from ..thresholds import LEAST_INFORMATION

Array = np.ndarray
FEWEST_RUNS = 4
TIME_BLOCKS = 5
PIECES = 4
"""Pieces of a run, over each of which the angle's error is taken as a drift."""
PPM = 1e6


@dataclass(frozen=True)
class Gain:
    """Held out by whole "runs" or blocks of "time": squared errors over σ, and what they are as
    drift, angle and amplitude."""

    kind: str
    errors: HeldOut
    quantities: dict[str, dict[str, float]]


def choose_left_out_folds(
    fit: ExtendedFit, origin: Sequence[int] | None = None, fewest_runs: int = FEWEST_RUNS
) -> tuple[str, list[Array]]:
    """("runs", one fold a run) with four runs or more, else ("time", blocks of time across all
    runs): indices into the residual.

    `origin`: which recorded run each of the fit's runs is a piece of.

    Parameters
    ----------
    fit
        Of the runs.
    origin
        Recorded run that each of the fit's runs is a piece of; None: each is one.
    fewest_runs
        From which whole runs are left out.

    Returns
    -------
    tuple
        The kind, and of each fold its places in the residual (k,).

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.gain import choose_left_out_folds
    >>> kind, folds = choose_left_out_folds(draw_fit())
    >>> kind, [len(fold) for fold in folds]
    ('time', [120, 120, 120, 120, 120])
    """
    run, row = fit.rows[:, 0], fit.rows[:, 1]
    whole = np.asarray(origin if origin is not None else range(len(fit.series.names)))[run]
    runs = np.unique(whole)
    if len(runs) >= fewest_runs:
        return "runs", [np.flatnonzero(whole == k) for k in runs]
    time = fit.series.time_s[run, row]
    block = np.zeros(len(run), int)
    for k in runs:
        own = whole == k
        first, last = time[own].min(), time[own].max()
        block[own] = np.minimum(
            (time[own] - first) / (last - first) * TIME_BLOCKS, TIME_BLOCKS - 1
        ).astype(int)
    return "time", [np.flatnonzero(block == b) for b in range(TIME_BLOCKS)]


def predict_folds(
    fit: ExtendedFit, kind: str, folds: list[Array], least_information: float = 0.0
) -> Array:
    """Whitened residual (N,) of every fold, predicted from the others (linearised at the optimum);
    what these hold less information on than a part of all stays where it is.

    Parameters
    ----------
    fit
        Of the runs.
    kind
        "runs" or "time".
    folds
        Places of each in the residual.
    least_information
        Part of that of all, below which nothing moves.

    Returns
    -------
    ndarray
        (N,), over σ.

    Examples
    --------
    Rows that taught nothing are missed by little more than the noise:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.gain import choose_left_out_folds, predict_folds
    >>> left = predict_folds(draw_fit(), *choose_left_out_folds(draw_fit()))
    >>> round(float((left**2).mean()), 1)
    1.0
    """
    shared, own, prior = _columns(fit, kind, folds)
    return left_out_folds.predict_folds(fit.residual, shared, own, folds, prior, least_information)


def _columns(
    fit: ExtendedFit, kind: str, folds: list[Array]
) -> tuple[Array, dict[int, Array], Array]:
    """(Columns that folds share, those of each fold alone, the prior's rows on the shared ones)."""
    prior = build_coordinate_rows(fit.freedom, fit.layout)
    if kind == "runs":
        own = {number: _select_own_columns(fit, rows) for number, rows in enumerate(folds)}
        return fit.design.shared, own, prior[:, fit.design.places]
    own = {number: np.zeros((len(rows), 0)) for number, rows in enumerate(folds)}
    return fit.design.to_matrix(), own, prior


def _select_own_columns(fit: ExtendedFit, rows: Array) -> Array:
    """Columns of a fold's own runs on its rows, (N_f, q); the rows of a fold are those of whole
    runs, in order."""
    blocks = [
        values
        for block, _, values in fit.design.own
        if rows[0] <= block.start and block.stop <= rows[-1] + 1
    ]
    out = np.zeros((len(rows), sum(b.shape[1] for b in blocks)))
    row = column = 0
    for b in blocks:
        out[row : row + len(b), column : column + b.shape[1]] = b
        row, column = row + len(b), column + b.shape[1]
    return out


def predict_held_out(
    before: ExtendedFit,
    after: ExtendedFit,
    origin_before: Sequence[int] | None = None,
    origin_after: Sequence[int] | None = None,
) -> Gain:
    """Held-out errors of two fits of the same runs.

    Parameters
    ----------
    before
        The fit without the causes.
    after
        With them.
    origin_before
        Recorded run of each of its pieces; None: each is one.
    origin_after
        The other's.

    Returns
    -------
    Gain
        What the causes gain.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.gain import predict_held_out
    >>> gain = predict_held_out(draw_mismatched_fit(), draw_found_case().search.final)
    >>> gain.kind, round(gain.errors.ratio, 1)
    ('time', 2.4)
    """
    there = [
        set(origin) if origin is not None else set(range(len(fit.series.names)))
        for fit, origin in ((before, origin_before), (after, origin_after))
    ]
    # a run that one of them lacks (cut into pieces too short to keep) cannot be a fold of both
    fewest = FEWEST_RUNS if there[0] == there[1] else len(there[0] | there[1]) + 1
    kind, first, old = _errors(before, origin_before, fewest)
    if after is before:
        second, new = first, old
    else:
        _, second, new = _errors(after, origin_after, fewest)
    names = [name for name in old if name in new]
    quantities = {
        name: {
            "before": old[name][0],
            "before_std": old[name][1],
            "after": new[name][0],
            "after_std": new[name][1],
        }
        for name in names
    }
    return Gain(kind, HeldOut(first, second), quantities)


def _errors(
    fit: ExtendedFit, origin: Sequence[int] | None, fewest_runs: int
) -> tuple[str, Array, dict[str, tuple[float, float]]]:
    """(How it is held out, mean squared error over σ of every fold, what that is as drift, angle
    and amplitude)."""
    kind, folds = choose_left_out_folds(fit, origin, fewest_runs)
    left = predict_folds(fit, kind, folds)
    return (
        kind,
        np.array([float(np.mean(left[fold] ** 2)) for fold in folds]),
        _quantities(fit, left, folds),
    )


def predicts_better(before: ExtendedFit, after: ExtendedFit) -> bool:
    """Whether what was left out is more likely by runs, or, where single runs alone show a cause,
    by blocks of time.

    While the misfit is gross the errors are not those of the noise and of what is not known, and
    their plain squares count.

    Parameters
    ----------
    before
        A fit.
    after
        One with more.

    Returns
    -------
    bool
        More does not only follow the noise.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.gain import predicts_better
    >>> fits = draw_mismatched_fit(), draw_found_case().search.final
    >>> predicts_better(*fits), predicts_better(*fits[::-1])
    (True, False)
    """
    score = _square if is_gross(before) else _score
    # few runs are held out by time both ways: once is enough
    ways = dict(
        choose_left_out_folds(before, fewest_runs=n)
        for n in (FEWEST_RUNS, len(before.series.names) + 1)
    )
    return any(score(after, *way) < score(before, *way) for way in ways.items())


def leaves_more_of_wave(before: ExtendedFit, after: ExtendedFit) -> bool:
    """Whether more causes leave a gross misfit, and of the wave itself more than there was.

    What the noise of the rows weighs is then no error of the noise: where it falls along a run with
    the wave's size, a cause may take what little is left of the small wave, and add to what is left
    of the large one.

    Parameters
    ----------
    before
        A fit.
    after
        One with more.

    Returns
    -------
    bool
        By the rms of all that the rows miss, in the signals' unit.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_wrong_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.search.gain import leaves_more_of_wave
    >>> fits = draw_fit(), fit_waves(draw_wrong_waves())
    >>> leaves_more_of_wave(*fits), leaves_more_of_wave(*fits[::-1])
    (True, False)
    """
    return is_gross(after) and measure_left(after) > measure_left(before)


def measure_left(fit: ExtendedFit) -> float:
    """What a fit leaves of the wave.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    float
        rms of the rows' real parts, in the signals' unit.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.gain import measure_left
    >>> round(measure_left(draw_fit()), 5)
    0.00022
    """
    left = flatten_rows(fit.series, fit.prediction.compute_residual())
    plain = to_reals(fit.series.to_units(to_complex(place_on_rows(fit, left))))[tuple(fit.rows.T)]
    return float(np.sqrt(np.mean(plain**2)))


def _square(fit: ExtendedFit, kind: str, folds: list[Array]) -> float:
    """Sum of the squared errors of every fold, predicted from the others."""
    return float(np.sum(predict_folds(fit, kind, folds) ** 2))


def _score(fit: ExtendedFit, kind: str, folds: list[Array]) -> float:
    """−2 ln of the density that the others give to every fold."""
    shared, own, prior = _columns(fit, kind, folds)
    return left_out_folds.score_folds(fit.residual, shared, own, folds, prior, LEAST_INFORMATION)


def _quantities(
    fit: ExtendedFit, left: Array, folds: list[Array]
) -> dict[str, tuple[float, float]]:
    """rms and its standard deviation over the folds of: drift error mθ̇ (°/h), error of the angle
    mθ and of the amplitude (ppm)."""
    series, u = fit.series, fit.prediction.seen
    difference = series.to_units(to_complex(place_on_rows(fit, left)))
    turn, e_A, e_B, a_A = find_frame(u, series.phase_rad)
    angle = np.real(np.sum(difference * e_B, axis=-1) * np.conj(turn)) / a_A
    amplitude = np.real(np.sum(difference * e_A, axis=-1) * np.conj(turn)) / a_A
    out: dict[str, list[float]] = {
        "drift_error_deg_h": [],
        "angle_error_ppm": [],
        "amplitude_error_ppm": [],
    }
    for fold in folds:
        run, row = fit.rows[fold[::4], :2].T  # four residuals a row
        slopes = []
        for k in np.unique(run):
            for piece in np.array_split(row[run == k], PIECES):
                if len(piece) > 2:
                    t = series.time_s[k, piece] - series.time_s[k, piece].mean()
                    slopes.append(t @ angle[k, piece] / (t @ t))
        out["drift_error_deg_h"].append(
            float(np.mean(np.square(slopes))) / DEGREE_PER_HOUR**2 if slopes else 0.0
        )
        out["angle_error_ppm"].append(float(np.mean(angle[run, row] ** 2)) * PPM**2)
        out["amplitude_error_ppm"].append(float(np.mean(amplitude[run, row] ** 2)) * PPM**2)
    return {name: _root(np.array(squares)) for name, squares in out.items()}


def _root(squares: Array) -> tuple[float, float]:
    """Root of the mean of squares over folds, and its standard deviation from their scatter."""
    rms = float(np.sqrt(squares.mean()))
    spread = float(squares.std(ddof=1) / np.sqrt(len(squares))) if len(squares) > 1 else 0.0
    return rms, spread / (2 * rms) if rms > 0 else 0.0


def list_gain_figures(gain: Gain) -> dict[str, Any]:
    """The JSON of a gain.

    Parameters
    ----------
    gain
        Of a cause.

    Returns
    -------
    dict
        By name.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.gain import list_gain_figures, predict_held_out
    >>> gain = predict_held_out(draw_mismatched_fit(), draw_found_case().search.final)
    >>> figures = list_gain_figures(gain)
    >>> round(figures["before"], 1), round(figures["after"], 1)
    (2.4, 1.0)
    """
    errors = gain.errors
    return {
        "held_out": gain.kind,
        "before": float(np.sqrt(errors.before.mean())),
        "after": float(np.sqrt(errors.after.mean())),
        "ratio": errors.ratio,
        "std": errors.std if np.isfinite(errors.std) else None,
    } | gain.quantities
