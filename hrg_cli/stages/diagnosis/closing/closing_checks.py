"""Diagnosis, the closing checks: what the final model must pass before it may be called adequate or
explained.

Each check looks at the result and not at how it was reached, at the noise that the windows state;
one that fails takes the word away.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ....effects import find
from ....fitting import checks
from ....fitting.causes.extended_fit import ExtendedFit, resolve_along_wave
from ....fitting.checks import Check
from ....fitting.envelopes.base_freedom import choose_scale_factor
from ....fitting.least_squares import invert_information
from ....physics import ellipse
from ..drive.scatter import Scatter
from ..extended.written import Written
from ..fits.places import find_another_start, find_place_beside_strike
from ..fits.refits import is_nearly_settled
from ..fits.scoring import is_possible, is_small
from ..samples.offered import measure_sigma
from ..search.gain import choose_left_out_folds, predict_folds
from ..search.search_case import Case
from ..search.selection import Search
from ..thresholds import (
    BOUND_COST,
    FREQUENCIES,
    INADEQUATE,
    LEAST_INFORMATION,
    MOST_RIVALS,
    NOISE_LEVEL,
    OWN_SIGMA,
    RUN_PREDICTED,
    SAME_FREQUENCY,
    SCALE_FACTORS,
    SCATTER_TOLD,
    SIGNIFICANT,
    WRITTEN,
)
from .sized import Sized
from .stability import ChosenAgain, check_chosen_again

Array = np.ndarray
ROUNDING = 1e-9
"""Of what stands still: an order by its rounding is none."""


def choose_word(causes: bool, is_open: bool) -> str:
    """The verdict's word.

    Parameters
    ----------
    causes
        Causes are named.
    is_open
        Anything stays open.

    Returns
    -------
    str
        "adequate", "explained", "partly explained" or "unexplained".

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.closing_checks import choose_word
    >>> [choose_word(causes, False) for causes in (False, True)]
    ['adequate', 'explained']
    """
    if is_open:
        return "partly explained" if causes else "unexplained"
    return "explained" if causes else "adequate"


def make_closing_checks(
    case: Case,
    sized: Sized,
    written: Written | None,
    waveform: Sequence[Mapping[str, Any]],
    lines_hz: Sequence[float] = (),
    odd: str = "",
    again: ChosenAgain | None = None,
) -> list[Check]:
    """All checks of a diagnosis, in the order in which a reader would ask.

    Parameters
    ----------
    case
        The causes and what they leave over.
    sized
        The fit whose numbers are told.
    written
        How the extended model's file holds; None: it could not be simulated.
    waveform
        Entries of the causes that the samples show before any dynamics.
    lines_hz
        What was taken out of the waves and is no named cause's [Hz].
    odd
        A sentence on windows that hold more than noise, empty where there are none.
    again
        The causes chosen again from fewer rows; None: they were not.

    Returns
    -------
    list of Check
        One that fails takes the word away.

    Examples
    --------
    Only the file of the model was not simulated here:

    >>> from hrg_cli.fitting.checks import list_failures
    >>> from hrg_cli.stages.diagnosis.closing.closing_checks import make_closing_checks
    >>> from hrg_cli.stages.diagnosis.closing.sized import Sized
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case
    >>> found = make_closing_checks(draw_case(), Sized.from_case(draw_case()), None, [])
    >>> len(list_failures(found))
    1
    """
    search, level = case.search, case.inquiry.noise.white
    final = search.final
    return [
        checks.check_holds(
            "nothing_left_over",
            case.remainder is None,
            "the residual still follows something that the catalogue does not hold",
        ),
        checks.check_holds(
            "catalogued_form",
            not case.outdone and (case.form is None or case.form.catalogued),
            case.outdone or "a cause has another form than the catalogue's",
        ),
        checks.check_holds(
            "lines_named",
            not lines_hz,
            "a line that nothing named makes was taken out of the waves, at "
            + " and ".join(f"{hz:.6g} Hz" for hz in lines_hz),
        ),
        *_noise(final, level, odd),
        *_whiteness(final),
        *_strikes(final, case.inquiry.noise.slow),
        *_runs(final),
        *_causes(search, sized, waveform),
        *_frequencies(case.frequencies),
        *_physics(final),
        checks.check_holds(
            "converged",
            final.converged and is_nearly_settled(search.base, search.base.chi2 - final.chi2),
            "a fit stopped before it had settled",
        ),
        *([] if again is None else [check_chosen_again(again)]),
        *_written(written),
    ]


def _noise(fit: ExtendedFit, level: float, odd: str) -> Iterator[Check]:
    """Whether what is left is the noise that the windows state, and every window's alike; `level`:
    σ between neighbouring windows over the stated one, which the fit is weighed by."""
    yield checks.check_goodness(
        fit.chi2 * level**2,
        fit.dof,
        "the final model leaves more than the noise that the windows state",
        "chi2_per_dof",
    )
    yield checks.check_at_most(
        "noise_level",
        level,
        NOISE_LEVEL,
        f"the noise between the windows is {level:.3g} times what they state",
    )
    yield checks.check_holds(
        "windows_alike", not odd, odd or "every window's noise is like its neighbours'"
    )


def _whiteness(fit: ExtendedFit) -> Iterator[Check]:
    """The residual in the wave's own frame, run by run, in the order of time and of what else
    moves."""
    series = fit.series
    own = resolve_along_wave(fit, fit.residual)
    good = series.weight > 0
    _, _, angle, _ = ellipse.find_wave(fit.prediction.seen, series.mode_number)
    amplitude = np.sqrt(np.sum(np.abs(fit.prediction.seen) ** 2, axis=-1))
    orders = {
        "time": series.time_s,
        "wave_angle": angle,
        "amplitude": amplitude,
        "temperature": series.temperature_degc,
        "rate": series.rate_rad_s,
    }
    for name, along in orders.items():
        reach = np.ptp(np.where(good, along, along[:, :1]), axis=1)
        if name != "time" and not np.any(reach > ROUNDING * np.abs(along).max()):
            continue
        runs = [
            own[k][good[k]][np.argsort(along[k][good[k]], kind="stable")] for k in range(len(own))
        ]
        yield checks.check_whiteness(
            runs,
            f"what is left is not white in the order of {name.replace('_', ' ')}",
            f"white_in_{name}",
            stated=1.0,
        )


def _strikes(fit: ExtendedFit, slow: float) -> Iterator[Check]:
    """No run moves on, from one of its rows, as from another start, and what strikes in the model
    is all that struck there."""
    moved = "from {:.4g} s on run {} moves as from another start: "
    # a misfit of any other kind is less, too, from another start somewhere
    moved += (
        "what struck it there is not {}"
        if fit.is_adequate
        else "something struck it there that is not {}, or what else is missed bends it"
    )
    found = [("nothing_strikes", find_another_start(fit, slow), INADEQUATE, "in the model")]
    found += [
        (
            f"{effect.name}_is_what_struck",
            find_place_beside_strike(values, fit, slow),
            SIGNIFICANT,
            f"{effect.name} alone",
        )
        for effect, values in fit.point.active
        if effect.strikes
    ]
    for name, place, allowed, cause in found:
        if place is not None:
            yield checks.check_at_most(
                name,
                -float(np.log10(max(place.chance, 1e-300))),
                -float(np.log10(allowed)),
                moved.format(place.time_s, fit.series.names[place.run], cause),
            )


def _runs(fit: ExtendedFit) -> Iterator[Check]:
    """Every run predicted by the others, its own start and frequency fitted on it: errors over what
    they may be."""
    if len(fit.series.names) < 2:
        return
    kind, folds = choose_left_out_folds(fit, fewest_runs=2)
    left = predict_folds(fit, kind, folds, LEAST_INFORMATION)
    level = max(fit.chi2 / fit.dof, 1.0)
    ratios = [
        float(np.sqrt(np.mean(left[fold] ** 2) / level)) / _expected(fit, fold) for fold in folds
    ]
    worst = int(np.argmax(ratios))
    run = fit.series.names[int(fit.rows[folds[worst][0], 0])]
    yield checks.check_at_most(
        "runs_predicted", ratios[worst], RUN_PREDICTED, f"run {run} is not predicted by the others"
    )


def _expected(fit: ExtendedFit, fold: Array) -> float:
    """rms over σ of a run predicted by the others: its noise, and what they leave unknown of the
    shared numbers, (1 + tr(J C Jᵀ)/n)^½."""
    shared = fit.design.shared[fold]
    if not shared.shape[1]:
        return 1.0
    places = fit.design.places
    information = invert_information(fit.covariance[np.ix_(places, places)])
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    # scaled to ones on the diagonal: what the others hold is then a part of all, whatever the units
    power, vectors = np.linalg.eigh((information - shared.T @ shared) / np.outer(size, size))
    unknown = np.sum((shared / size @ vectors) ** 2, axis=0) / np.maximum(power, LEAST_INFORMATION)
    return float(np.sqrt(1 + unknown.sum() / len(fold)))


def estimate_unknown_walk(fit: ExtendedFit) -> float:
    """Walk of the wave that the scatter of the drive's log may have left out of a run and that the
    fit's own σ do not hold.

    Parameters
    ----------
    fit
        The final one.

    Returns
    -------
    float
        Over σ; 0 where the fit stands beside it.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.closing_checks import estimate_unknown_walk
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> estimate_unknown_walk(draw_fit())
    0.0
    """
    if fit.series.scatter is not None:
        return 0.0
    return float(np.max(Scatter.from_commands(fit.series).walk))


def check_beside_drive_log(name: str, sigma: float, walk: float) -> Iterator[Check]:
    """The check of a cause beside a walk of the wave that the scatter of the drive's log may have
    left out.

    Parameters
    ----------
    name
        Of the cause.
    sigma
        σ that it stands off zero.
    walk
        Over σ.

    Returns
    -------
    iterator of Check
        None where the walk is less than the noise.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.closing_checks import check_beside_drive_log
    >>> [[c.passed for c in check_beside_drive_log("ageing", 9.0, walk)] for walk in (0.0, 99.0)]
    [[], [False]]
    """
    if walk < SCATTER_TOLD:
        return
    beside = sigma / float(np.hypot(1.0, walk))
    yield checks.check_at_least(
        f"{name}_stands_beside_drive_log",
        beside,
        OWN_SIGMA,
        f"{name} is no more than {beside:.2g} σ off zero beside the walk of {walk:.2g} σ that the"
        " scatter of the drive's log may have left out",
    )


def _causes(search: Search, sized: Sized, waveform: Sequence[Mapping[str, Any]]) -> Iterator[Check]:
    """Every named cause on its own: off zero and of a thinkable size."""
    fit = search.final
    walk = estimate_unknown_walk(fit)
    for one in search.found:
        name = one.variant.effect.name
        # a strike's sizes are held in the fit; their generalised least squares gave Δχ² as its gain
        sigma = (
            sized.measure_sigma_off(one.variant.effect)
            if one.sizes is None
            else float(np.sqrt(max(one.delta_bic, 0.0)))
        )
        yield checks.check_at_least(
            f"{name}_stands_off_zero",
            sigma,
            OWN_SIGMA,
            f"{name} is no more than {sigma:.2g} of its σ off zero",
        )
        yield from check_beside_drive_log(name, sigma, walk)
        yield checks.check_holds(
            f"{name}_is_possible",
            is_possible(one.variant.effect, fit),
            f"{name} came out larger than such a cause can be, or of a sign that it cannot have",
        )
        yield checks.check_at_most(
            f"{name}_is_told_apart",
            float(len(one.rivals)),
            float(MOST_RIVALS),
            f"{name} or any of {len(one.rivals)} other causes explains the runs as well",
        )
    for entry in waveform:
        yield from _check_in_samples(entry, fit)


def _check_in_samples(entry: Mapping[str, Any], fit: ExtendedFit) -> Iterator[Check]:
    """A cause that the samples show, asked as the others are."""
    name, effect = entry["name"], find(entry["name"])
    sigma = measure_sigma(entry)
    yield checks.check_at_least(
        f"{name}_stands_off_zero",
        sigma,
        OWN_SIGMA,
        f"{name} is no more than {sigma:.2g} of its σ off zero",
    )
    told = {key: float(p["value"]) for key, p in entry["parameters"].items()}
    yield checks.check_holds(
        f"{name}_is_possible",
        # time that is lost is small beside nothing that is seen
        effect.whole_samples or is_small(effect, effect.values() | told, fit),
        f"{name} came out larger than such a cause can be",
    )


def _frequencies(said: Mapping[str, Any]) -> Iterator[Check]:
    """Every run keeps a frequency of its own, which takes up whatever changes from run to run: they
    must agree, or follow a cause."""
    if said.get("sigma") is None:
        return
    exact = float(said["scatter_hz"]) < SAME_FREQUENCY * float(np.mean(said["hz"]))
    yield checks.check_at_most(
        "run_frequencies",
        0.0 if exact else float(said["sigma"]),
        FREQUENCIES,
        str(said["sentence"]),
    )


def _physics(fit: ExtendedFit) -> Iterator[Check]:
    """Base parameters that a resonator can have."""
    level = max(fit.chi2 / fit.dof, 1.0)
    yield checks.check_at_most(
        "passive",
        fit.bound_cost / level,
        BOUND_COST,
        "the damping stands at the bound of a passive resonator and would be beyond it",
    )
    if fit.layout.coordinate("scale_factor") is not None:
        nominal = choose_scale_factor(fit.series.mode_number)
        value, std = fit.coordinate("scale_factor"), fit.coordinate_std("scale_factor")
        low, high = (part * nominal for part in SCALE_FACTORS)
        # beyond three σ: a scale factor that is merely not known is no finding
        sure = value + 3 * std, value - 3 * std
        text = (
            f"the scale factor came out as {value:.4g}: the rate log has another unit or sign, or"
            " the channels are swapped"
        )
        yield checks.check_at_least("scale_factor_above", sure[0], low, text)
        yield checks.check_at_most("scale_factor_below", sure[1], high, text)
    finite = bool(
        np.all(np.isfinite(fit.point.p))
        and np.all(np.isfinite(fit.residual))
        and np.all(np.isfinite(fit.covariance))
    )
    yield checks.check_holds("finite", finite, "a number of the model is not finite")
    yield checks.check_covariance(fit.covariance, "the covariance of the fit is none")


def _written(written: Written | None) -> Iterator[Check]:
    """The file that was written against the fit."""
    if written is None:
        yield checks.check_holds(
            "written_model", False, "the extended model could not be simulated from its own file"
        )
        return
    text = (
        "the extended model simulated from its file misses the measurement by"
        f" {written.rms_over_noise:.3g} σ rms, the fit by {written.fitted_rms_over_noise:.3g}"
    )
    yield checks.check_at_most("written_model", written.ratio, WRITTEN, text)
