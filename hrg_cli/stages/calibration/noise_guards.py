"""How much more the angles of a calibration scatter than their windows state."""

from __future__ import annotations

import numpy as np

from ...fitting.checks import Check, check_at_most
from ...fitting.tables.allan_terms import fit_allan_terms
from ...fitting.tables.joint import Fitted
from ...fitting.tables.table_design import predict_turn

Array = np.ndarray

LARGEST_NOISE = 2.0
"""Variance of the angles against that which the windows state, above which the result is suspect;
below, the excess is said."""
EVEN = 0.01
"""Part of the usual interval by which an increment may differ to stand in an Allan deviation."""
FEWEST_RATES = 100
"""Increments from which a run's Allan deviation is looked at."""


def compare_known_noise(fitted: Fitted) -> Check:
    """The check of the angles' white noise against what their windows state.

    Parameters
    ----------
    fitted
        The runs.

    Returns
    -------
    Check
        The ratio of variances, at most 2; 0 where the windows state none.

    Examples
    --------
    Noise three times as large as its windows state fails:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.noise_guards import compare_known_noise
    >>> path = draw_path(0.1, np.random.default_rng(0), angle_variance=1e-12 / 9)
    >>> check = compare_known_noise(fit([path], TableLayout(np.ones(1), "temperature", 2, 0, 0)))
    >>> bool(8 < check.value < 10), check.passed
    (True, False)
    """
    ratio = _average_noise_ratio(fitted)
    sentence = (
        f"the angles scatter {np.sqrt(ratio or 0):.3g} times as much as their windows state; the"
        " errors hold that, but what makes it is not known: look at the residual of demodulate,"
        " and run diagnose on free runs"
    )
    return check_at_most(
        "noise_over_stated", 0.0 if ratio is None else ratio, LARGEST_NOISE, sentence
    )


def _average_noise_ratio(fitted: Fitted) -> float | None:
    """Mean over the runs of white noise found / expected (variances): what the windows state, and
    the third of a walk's step that a block's mean holds, by which no walk is quite white; None
    where no run states one."""
    found = [
        (
            noise.white
            / (
                path.mode_number**2 * float(np.mean(path.angle_variance))
                + noise.walk * float(np.median(path.width_s)) / 3
            ),
            len(path),
        )
        for path, noise in zip(fitted.paths, fitted.noises)
        if np.mean(path.angle_variance) > 0
    ]
    return (
        float(np.average([r for r, _ in found], weights=[n for _, n in found])) if found else None
    )


def say_noise(fitted: Fitted) -> dict[str, float | None]:
    """The noise at which variants are judged.

    Parameters
    ----------
    fitted
        The runs.

    Returns
    -------
    dict
        White noise over what the windows state, and the angle random walk of the rate [rad/√s];
        None where it is not told.

    Examples
    --------
    Noise of 1 µrad in angles whose windows state 1 µrad:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.noise_guards import say_noise
    >>> path = draw_path(0.1, np.random.default_rng(0))
    >>> fitted = fit([path], TableLayout(np.ones(1), "temperature", 2, 0, 0))
    >>> bool(abs(say_noise(fitted)["white_over_stated"] - 1) < 0.1)
    True
    """
    ratio = _average_noise_ratio(fitted)
    scale_factor = fitted.layout.compute_mean_scale_factor(fitted.solution.coefficients)
    return {
        "white_over_stated": None if ratio is None else float(np.sqrt(ratio)),
        "angle_random_walk_rad_sqrt_s": _estimate_angle_random_walk(fitted) / abs(scale_factor)
        if scale_factor
        else None,
    }


def _estimate_angle_random_walk(fitted: Fitted) -> float:
    """Angle random walk of mθ, rad/√s: where every run shows it in the Allan deviation of what the
    fit leaves, that one's, mean square of the runs by their lengths; else the likelihood's.

    The walk that weighs the rows is the larger of a run's own and all runs' common one, with quick
    noise that is no walk in its white part: right for weights and for what is too faint for one
    run, no measure of what can be seen.
    """
    faint = float(np.sqrt(np.median([noise.walk for noise in fitted.noises])))
    squares, seconds = [], []
    for path, turn in zip(fitted.paths, fitted.turns, strict=True):
        interval = float(np.median(path.interval_s))
        rows = _longest_even_stretch(path.interval_s, interval)
        count = rows.stop - rows.start
        left = turn - predict_turn(path, fitted.layout, *[fitted.solution.coefficients] * 2)
        width = float(np.median(path.width_s))
        # a block of many windows that stand for their middle is nearly a plain mean
        bend_off = path.bend_off_s if path.row_s > 0.99 * width else 0.0
        if count < FEWEST_RATES:
            return faint
        terms = fit_allan_terms(left[rows] / interval, interval, width, bend_off).coefficients
        if not terms["angle_random_walk"].seen:
            return faint
        squares.append(terms["angle_random_walk"].value ** 2)
        seconds.append(interval * count)
    return float(np.sqrt(np.average(squares, weights=seconds)))


def _longest_even_stretch(intervals: Array, usual: float) -> slice:
    """The longest stretch of (n,) intervals that are the usual one."""
    odd = np.flatnonzero(np.abs(intervals / usual - 1) > EVEN)
    ends = np.concatenate([[-1], odd, [len(intervals)]])
    longest = int(np.argmax(np.diff(ends)))
    return slice(int(ends[longest]) + 1, int(ends[longest + 1]))
