"""Diagnosis, the forecast: how much better data are predicted that nothing of the model has seen,
the choice of the causes included.

With four runs or more half of the runs are held out, then the other half; with fewer the last part
of every run. On the rest the base model is fitted, the causes are *chosen* and fitted anew, and
both models predict what was held out: a run from its own start and frequency, the last part of a
run from nothing but its first. The whole wave counts, its phase included:
    e = |C − Ĉ|² + |S − Ŝ|²,   ratio = (Σe_base / Σe_causes)^½.
The interval is that of a bootstrap over blocks of what was held out, each with its own draw of what
the training taught.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ....fitting.causes import extended_fit
from ....fitting.causes.coordinate_priors import CoordinatePriors
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.fit_point import Point
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.causes.sensitivities import linearise_flow
from ....fitting.causes.slow_prediction import predict
from ....fitting.causes.wave_frame import to_complex, to_reals
from ....fitting.causes.whitened_rows import build_layout, compute_design
from ....fitting.noise import channel_noise
from ....physics import ellipse
from ..base.joint_fit import settle_log
from ..drive.scatter import has_log
from ..fits.refits import hold_effect, leave_out
from ..thresholds import ASTRAY, UNTAUGHT, WORSE_TAUGHT, WORTH
from .gain import leaves_more_of_wave
from .search_case import Case
from .selection import select
from .stand_in import is_beyond_question

Array = np.ndarray
FEWEST_RUNS = 4
TRAIN = 0.7
"""Part of every run that teaches where there are too few runs to hold whole ones out."""
FEWEST_ROWS, BLOCKS, DRAWS = 40, 8, 400
COURSE_POINTS = 60
AT_REST = 1e-3
"""Part of the fastest run's rate below which a run stands still."""


@dataclass(frozen=True)
class Fold:
    """Data split in two: series with weight on what teaches, rows (R, n) to be predicted, whether
    those are whole runs."""

    train: MeasuredRuns
    test: Array
    whole_runs: bool

    def select_taught(self, point: Point) -> Point:
        """A point of all runs for those that teach, found by number: pieces of one run have its
        name in common."""
        kept = self.train.numbers
        return replace(point, start=point.start[kept], offset_rad_s=point.offset_rad_s[kept])


@dataclass(frozen=True)
class Errors:
    """Errors of a forecast at the rows held out: run (k,), time (k,), measured less predicted (k,
    4), relative wave errors (k, 4).

    `parts`: δmθ, δ ln a, δr and δφ (k, 4); `learned` (k, 4, m): what one σ of each of m
    combinations of the parameters moves the errors by; weight (k,): 1/σ of the rows; whitening (k,
    2, 2): of the channels' noise in each, None where both have the same.
    """

    run: Array
    time_s: Array
    difference: Array
    parts: Array
    learned: Array
    weight: Array
    whitening: Array | None = None

    @property
    def square(self) -> Array:
        """e of every row, (k,)."""
        return np.sum(self.difference**2, axis=1)

    def compute_surprise(self, misfit: float) -> float:
        """−2 ln of the density that the forecast gave what came, less a constant: of errors e with
        C = s² + MMᵀ over σ, eᵀC⁻¹e + ln det C/s², M what was `learned` and s² = `misfit`.

        A proper score (Good 1952): what a forecast does not know counts neither for it nor against.
        """
        e = self._over_noise(self.difference[..., None]).ravel()
        M = self._over_noise(self.learned).reshape(len(e), -1)
        known = np.eye(M.shape[1]) + M.T @ M / misfit
        along = M.T @ e / misfit
        return float(
            e @ e / misfit - along @ np.linalg.solve(known, along) + np.linalg.slogdet(known)[1]
        )

    def _over_noise(self, values: Array) -> Array:
        """Values (k, 4, m) of the rows over their noise."""
        white = channel_noise.whiten_reals(self.whitening, values[:, None])[:, 0]
        return white * self.weight[:, None, None]

    def forget_learned(self) -> Errors:
        """The same without what was learned, which grows with rows times runs."""
        return replace(self, learned=self.learned[..., :0].copy())

    def draw(self, random: np.random.Generator) -> Array:
        """e had the training taught something else within its own uncertainty, (k, DRAWS)."""
        taught = random.standard_normal((DRAWS, self.learned.shape[-1]))
        # one at a time: all together are as large as everything else that a diagnosis holds
        one_by_one = (np.sum((self.difference + self.learned @ one) ** 2, axis=1) for one in taught)
        return np.stack(list(one_by_one), axis=-1)


def split_for_forecast(series: MeasuredRuns) -> list[Fold]:
    """The splits; empty where the runs are too short for one.

    Parameters
    ----------
    series
        Of the runs.

    Returns
    -------
    list of Fold
        Two of four runs or more, one of fewer.

    Examples
    --------
    Rows of each run that are predicted, in two halves of four runs:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case_of_four
    >>> from hrg_cli.stages.diagnosis.search.forecast import split_for_forecast
    >>> folds = split_for_forecast(draw_case_of_four().search.base.series)
    >>> [fold.test.sum(axis=1).tolist() for fold in folds]
    [[50, 50, 0, 0], [0, 0, 50, 50]]
    """
    good = series.weight > 0
    runs = len(series.names)
    if runs >= FEWEST_RUNS:
        halves = [_pick_every_other(series) == k for k in (0, 1)]
        return [
            Fold(series.select_runs(np.flatnonzero(~half).tolist()), good & half[:, None], True)
            for half in halves
        ]
    first, last = series.time_s[:, 0], np.max(series.time_s, axis=1, where=good, initial=-np.inf)
    keep = good & (series.time_s <= (first + TRAIN * (last - first))[:, None])
    if keep.sum(axis=1).min() < FEWEST_ROWS or (good & ~keep).sum() < BLOCKS:
        return []
    return [
        Fold(
            series.keep_rows(keep),
            good & ~keep,
            False,
        )
    ]


def _pick_every_other(series: MeasuredRuns) -> Array:
    """0 or 1 of each run (R,), by turns among those that are driven, and turned, alike: a half
    without a driven run, or with runs at rest alone, teaches nothing of what these show."""
    good = series.weight > 0
    driven = np.any(good & (series.forced > 0), axis=1)
    fastest = np.max(np.abs(series.rate_rad_s), axis=1, where=good, initial=0.0)
    turned = fastest > AT_REST * fastest.max()
    order = np.lexsort((turned, driven))  # stable: of one kind as the runs stand
    half = np.empty(len(order), int)
    half[order] = np.arange(len(order)) % 2
    return half


def forecast(case: Case, unit: str, seed: int = 0) -> dict[str, Any] | None:
    """The forecast with causes chosen inside each fold, in the signals' unit; None where no fold
    can be made or fitted, or no cause was found.

    The base fit of all data is where each fold's fit starts.

    Parameters
    ----------
    case
        The causes and what they leave over.
    unit
        The signals'.
    seed
        Of the bootstrap.

    Returns
    -------
    dict or None
        How large the errors were and are, their ratio, its interval, and a sentence.

    Examples
    --------
    Noise of 10⁻³ of a sample leaves little, once the gain mismatch is known:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case_of_four
    >>> from hrg_cli.stages.diagnosis.search.forecast import forecast
    >>> found = forecast(draw_case_of_four(), "V")
    >>> found["chosen"], round(found["before"], 4), round(found["after"], 4)
    ([['gain_mismatch'], ['gain_mismatch']], 0.0006, 0.0003)
    """
    search = case.search
    if not search.found:
        return None
    base, before, after, drawn, chosen = search.base, [], [], [], []
    random = np.random.default_rng(seed)
    for fold in split_for_forecast(base.series):
        with contextlib.suppress(extended_fit.DivergedError):
            plain = train(base, fold)
            inside = select(plain, case.inquiry)
            pair = (
                find_forecast_errors(plain, base, fold),
                find_forecast_errors(inside.final, base, fold),
            )
            if all(np.all(np.isfinite(one.difference)) for one in pair):
                drawn.append((pair[0].draw(random), pair[1].draw(random)))
                before.append(pair[0].forget_learned())
                after.append(pair[1].forget_learned())
                chosen.append([one.variant.effect.name for one in inside.found])
    if not before:
        return None
    rows = sum(len(e.run) for e in before)
    ratio, low, high, std = bootstrap_gain(before, after, drawn, random)
    levels = [
        float(np.sqrt(sum(e.square.sum() for e in side) / (2 * rows))) for side in (before, after)
    ]
    held = "runs" if len(base.series.names) >= FEWEST_RUNS else "time"
    found = {
        "held_out": held,
        "before": levels[0],
        "after": levels[1],
        "ratio": ratio,
        "low": low,
        "high": high,
        "std": std,
        "unit": unit,
        "chosen": chosen,
        "train_fraction": 0.5 if held == "runs" else TRAIN,
        "parts": {
            "before": _root_mean_squares(before, base.series.mode_number),
            "after": _root_mean_squares(after, base.series.mode_number),
        },
        "course": _course(before[0], after[0], base.series),
    }
    return found | {"sentence": describe_forecast(found)}


def train(base: ExtendedFit, fold: Fold) -> ExtendedFit:
    """The base model fitted to a fold's training data alone.

    Parameters
    ----------
    base
        The fit without causes to all runs.
    fold
        What teaches.

    Returns
    -------
    ExtendedFit
        Without causes.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case_of_four
    >>> from hrg_cli.stages.diagnosis.search.forecast import split_for_forecast, train
    >>> search = draw_case_of_four().search
    >>> folds = split_for_forecast(search.base.series)
    >>> len(train(search.base, folds[0]).series.names)
    2
    """
    point = replace(fold.select_taught(base.point), active=())
    # what a drive's log leaves unknown is said of all runs together, and is judged anew in part of
    # them
    return settle_log(extended_fit.fit(fold.train, point, base.freedom))


def find_forecast_errors(fit: ExtendedFit, base: ExtendedFit, fold: Fold) -> Errors:
    """What a training fit misses of the rows held out.

    Parameters
    ----------
    fit
        Of the training data.
    base
        Without causes, to all runs.
    fold
        What is held out.

    Returns
    -------
    Errors
        Of the rows held out.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case_of_four
    >>> from hrg_cli.stages.diagnosis.search.forecast import (
    ...     find_forecast_errors,
    ...     split_for_forecast,
    ...     train,
    ... )
    >>> search = draw_case_of_four().search
    >>> folds = split_for_forecast(search.base.series)
    >>> errors = find_forecast_errors(train(search.base, folds[0]), search.base, folds[0])
    >>> errors.difference.shape, float(np.sqrt(errors.square.mean() / 2).round(4))
    ((100, 4), 0.0006)
    """
    if fold.whole_runs:
        # a run's start and frequency are its own: they are fitted on it, everything shared is held
        kept = np.flatnonzero(fold.test.any(axis=1))
        series = base.series.select_runs(kept.tolist())
        still = tuple((hold_effect(effect), values) for effect, values in fit.point.active)
        point = replace(
            fit.point,
            start=base.point.start[kept],
            offset_rad_s=base.point.offset_rad_s[kept],
            active=still,
        )
        held = CoordinatePriors(fit.point.p, np.zeros(len(fit.point.p)), passive=False)
        own = extended_fit.fit(series, point, held)
        prediction, names = own.prediction, kept
        learned = _propagate_learned(own, fit)
    else:
        series = base.series.keep_rows(fold.test)
        prediction, names = predict(series, fit.point), np.arange(len(series.names))
        with np.errstate(all="ignore"):
            design = compute_design(linearise_flow(prediction), fit.layout)
            learned = design.to_matrix() @ _root(fit.covariance)
    run, row = np.argwhere(series.weight > 0).T
    plain = to_reals(series.whiten(series.envelope - prediction.seen))
    missed = plain[run, row].reshape(4 * len(run))
    if series.unsettled is not None:
        # what nobody knows of these runs is no error of the forecast
        missed, learned = (series.unsettled.project_out(one) for one in (missed, learned))
    difference = _to_units(series, run, row, missed[:, None])[..., 0]
    measured = series.envelope[run, row]
    # a model that misses its own training by more than the noise is trusted that much less
    misfit = max(1.0, fit.chi2 / fit.dof)
    return Errors(
        names[run],
        series.time_s[run, row],
        difference,
        _parts(measured, measured - to_complex(difference)),
        np.sqrt(misfit) * _to_units(series, run, row, learned),
        series.weight[run, row],
        None if series.whitening is None else series.whitening[run],
    )


def _to_units(series: MeasuredRuns, run: Array, row: Array, over_noise: Array) -> Array:
    """Columns (4k, m) over the noise of rows in the envelopes' unit, (k, 4, m)."""
    whitening = None if series.whitening is None else series.whitening[run]
    inverse = channel_noise.invert(whitening)
    values = channel_noise.whiten_reals(inverse, over_noise.reshape(len(run), 1, 4, -1))
    return np.asarray(values[:, 0] / series.weight[run, row][:, None, None])


def _propagate_learned(own: ExtendedFit, fit: ExtendedFit) -> Array:
    """What one σ of what was learned moves, over σ, (N, m): of the runs' own starts and
    frequencies, and of all that they share with the training, beside these."""
    point = replace(own.point, active=fit.point.active)
    layout = build_layout(own.series, point, fit.freedom)
    with np.errstate(all="ignore"):
        design = compute_design(linearise_flow(replace(own.prediction, point=point)), layout)
        of_runs = own.design.to_matrix() @ _root(own.covariance)
    places = fit.layout.shared
    of_all = own.basis.project_out(design.shared) @ _root(fit.covariance[np.ix_(places, places)])
    return np.concatenate([of_runs, of_all], axis=1)


def drop_misleading(case: Case) -> Case:
    """The case without the causes after which what was held out is predicted worse, or that leave
    a gross misfit, and more of the wave than they found.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    Case
        The same where nothing is given up.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case_of_four
    >>> from hrg_cli.stages.diagnosis.search.forecast import drop_misleading
    >>> [one.score.name for one in drop_misleading(draw_case_of_four()).search.found]
    ['gain_mismatch']
    """
    folds = split_for_forecast(case.search.base.series)
    for one in reversed(case.search.found):
        name = one.variant.effect.name
        if is_beyond_question(case.search.final, name):
            continue
        reduced = leave_out(case.search.final, name, base=case.search.base)
        if reduced is not None and (
            leaves_more_of_wave(reduced, case.search.final)
            or predicts_worse(case.search.final, name, case.search.base, folds)
        ):
            case = case.give_up(one, reduced)
    return case


def predicts_worse(final: ExtendedFit, name: str, base: ExtendedFit, folds: Sequence[Fold]) -> bool:
    """Whether what is held out is predicted worse with a cause than without it, fitted each time to
    the training data alone, by odds of `WORTH`.

    Folds whose training does not know the cause (`UNTAUGHT`), or is not fitted as all data are
    (`WORSE_TAUGHT`), or that go `ASTRAY` either way, are left out; none left: it cannot be said,
    and is not.

    Parameters
    ----------
    final
        The fit with the causes.
    name
        Of the cause.
    base
        The fit without causes.
    folds
        How the data are split.

    Returns
    -------
    bool
        The cause misleads.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case_of_four
    >>> from hrg_cli.stages.diagnosis.search.forecast import predicts_worse, split_for_forecast
    >>> search = draw_case_of_four().search
    >>> folds = split_for_forecast(search.base.series)
    >>> predicts_worse(search.final, "gain_mismatch", search.base, folds)
    False
    """
    with_it = without_it = 0.0
    fitted = max(1.0, final.chi2 / final.dof)
    along = _settle_each_way(final, name, base)
    for fold in folds:
        with contextlib.suppress(extended_fit.DivergedError):
            point = fold.select_taught(final.point)
            # as `train` does: what the drive's log leaves unknown is judged anew
            taught = settle_log(extended_fit.fit(fold.train, point, final.freedom))
            if taught.chi2 / taught.dof > WORSE_TAUGHT * fitted:
                continue
            if not _knows(taught, final, name, UNTAUGHT * (np.sqrt(2) if fold.whole_runs else 1.0)):
                continue
            reduced = leave_out(taught, name)
            if reduced is None:
                continue
            misfit = max(1.0, reduced.chi2 / reduced.dof)
            errors = [
                find_forecast_errors(fit, whole, fold)
                for fit, whole in zip((taught, reduced), along, strict=True)
            ]
            one, other = (side.compute_surprise(misfit) for side in errors)
            # where both are far beyond all that the training says it does not know, it is silent on
            # something else, as runs at rest are on the scale factor, and decides nothing
            known = min(one, other) < ASTRAY * errors[0].difference.size
            if known and np.isfinite(one) and np.isfinite(other):
                with_it, without_it = with_it + one, without_it + other
    return with_it > without_it + WORTH


def _settle_each_way(
    final: ExtendedFit, name: str, base: ExtendedFit
) -> tuple[ExtendedFit, ExtendedFit]:
    """Fits of all data, with a cause and without it, along whose motions what is held out is
    judged: the walk of a drive's log that was found beside no cause holds what the cause does."""
    if not has_log(base.series):
        return base, base
    without = leave_out(final, name)
    return final, base if without is None else settle_log(without)


def _knows(taught: ExtendedFit, final: ExtendedFit, name: str, least: float) -> bool:
    """Whether a training knows all of a cause's parameters, to `least` times the σ of all data; a
    σ of 0 is that of what it does not see."""
    stds = [
        (taught.parameter_std(name, p), final.parameter_std(name, p))
        for p in final.layout.parameters(name)
    ]
    return bool(stds) and all(0 < one <= least * all_data for one, all_data in stds)


def bootstrap_gain(
    before: Sequence[Errors],
    after: Sequence[Errors],
    drawn: Sequence[tuple[Array, Array]],
    random: np.random.Generator,
) -> tuple[float, float, float, float]:
    """(ratio of the errors, 2.5 % and 97.5 % quantile, standard deviation): blocks drawn with
    replacement, each with its own teaching.

    Parameters
    ----------
    before
        Errors of each fold without the causes.
    after
        With them.
    drawn
        What each fold's two `draw`, (k, DRAWS) each.
    random
        Of the blocks.

    Returns
    -------
    tuple of float
        1 and an interval about it where nothing is gained.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case_of_four
    >>> from hrg_cli.stages.diagnosis.search import forecast
    >>> search = draw_case_of_four().search
    >>> fold, _ = forecast.split_for_forecast(search.base.series)
    >>> taught = forecast.train(search.base, fold)
    >>> errors = forecast.find_forecast_errors(taught, search.base, fold)
    >>> random = np.random.default_rng(0)
    >>> drawn = errors.draw(random), errors.draw(random)
    >>> forecast.bootstrap_gain([errors], [errors], [drawn], random)[0]
    1.0
    """
    sums: list[list[Array]] = [[], []]
    for one, pair in zip(before, drawn, strict=True):
        blocks = [b for b in np.array_split(np.arange(len(one.run)), BLOCKS) if len(b)]
        for side, squares in enumerate(pair):
            sums[side] += [squares[b].sum(axis=0) for b in blocks]
    count = len(sums[0])
    picked = random.multinomial(count, np.full(count, 1 / count), DRAWS)
    left = [np.sum(picked * np.stack(side, axis=1), axis=1) for side in sums]
    ratios = np.sqrt(left[0] / np.maximum(left[1], 1e-300))
    low, high = np.quantile(ratios, [0.025, 0.975])
    plain = [sum(float(e.square.sum()) for e in side) for side in (before, after)]
    ratio = float(np.sqrt(plain[0] / max(plain[1], 1e-300)))
    return ratio, float(min(low, ratio)), float(max(high, ratio)), float(ratios.std(ddof=1))


def _root(covariance: Array) -> Array:
    """Columns whose outer products sum to the covariance, which may be blind to some directions."""
    size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    size = np.where(size > 0, size, 1.0)
    level, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    return size[:, None] * vectors * np.sqrt(np.maximum(level, 0.0))


def _parts(measured: Array, said: Array) -> Array:
    """Measured less said: δmθ, δ ln a, δr, δφ, (k, 4)."""
    a, b, angle, phase = ellipse.find_wave(measured, 1)
    a_said, b_said, angle_said, phase_said = ellipse.find_wave(said, 1)
    turn = angle - angle_said
    half = np.round(turn / np.pi)  # (mθ + π, φ + π) is the same wave
    shift = phase - phase_said - np.pi * half
    return np.stack(
        [
            turn - np.pi * half,
            np.log(a / a_said),
            b / a - b_said / a_said,
            np.angle(np.exp(1j * shift)),
        ],
        axis=1,
    )


def _root_mean_squares(sides: Sequence[Errors], mode_number: int) -> dict[str, float]:
    """Of all folds together: degrees of the wave angle and of the phase, amplitude and quadrature
    in per cent of the amplitude."""
    angle, amplitude, quadrature, phase = np.sqrt(
        np.mean(np.concatenate([e.parts for e in sides]) ** 2, axis=0)
    )
    return {
        "angle_deg": float(np.degrees(angle) / mode_number),
        "amplitude_percent": float(100 * amplitude),
        "quadrature_percent": float(100 * quadrature),
        "phase_deg": float(np.degrees(phase)),
    }


def _course(before: Errors, after: Errors, series: MeasuredRuns) -> list[dict[str, Any]]:
    """Errors against time of every run of the first fold, for a picture."""
    out = []
    units = {
        "angle_deg": np.degrees(1) / series.mode_number,
        "amplitude_percent": 100.0,
        "quadrature_percent": 100.0,
        "phase_deg": np.degrees(1),
    }
    for k in np.unique(before.run):
        rows = np.flatnonzero(before.run == k)
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, COURSE_POINTS).astype(int))]
        one: dict[str, Any] = {
            "run": series.names[int(k)],
            "time_s": [float(f"{t:.6g}") for t in before.time_s[rows]],
        }
        for name, errors in (("before", before), ("after", after)):
            one[name] = {
                word: [float(f"{v:.6g}") for v in unit * errors.parts[rows, column]]
                for column, (word, unit) in enumerate(units.items())
            }
        out.append(one)
    return out


def describe_forecast(report: dict[str, Any]) -> str:
    """The forecast in one line.

    Parameters
    ----------
    report
        The figures of a forecast.

    Returns
    -------
    str
        In the signals' unit.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.search.forecast import describe_forecast
    >>> figures = {"before": 5.6e-4, "after": 3.2e-4, "ratio": 1.75, "low": 1.5, "high": 2.05}
    >>> how = {"held_out": "runs", "unit": "V", "chosen": [["gain_mismatch"]]}
    >>> describe_forecast(figures | how)[:60]
    'runs that taught nothing: 0.00056 → 0.00032 V rms, phase inc'
    """
    what = (
        "runs that taught nothing"
        if report["held_out"] == "runs"
        else f"the last {100 * (1 - report['train_fraction']):.0f} % from the first"
    )
    names = list(dict.fromkeys(name for fold in report["chosen"] for name in fold))
    by = f"with {', '.join(names)}" if names else "no cause was chosen there"
    unit = "" if report["unit"] == "1" else f" {report['unit']}"
    return (
        f"{what}: {report['before']:.3g} → {report['after']:.3g}{unit} rms, phase"
        f" included ({by}); {report['ratio']:.3g} times as good, 95 % between {report['low']:.3g}"
        f" and {report['high']:.3g}"
    )
