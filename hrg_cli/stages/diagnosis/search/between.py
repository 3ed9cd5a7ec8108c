"""Diagnosis between the runs: their frequencies, which every run's own fit leaves free, against
what each cause predicts of them.

ô = H f + G θ + w, w ~ N(0, Σ + s²): ô (R,) the fitted offsets with covariance Σ, H the mean of the
free and of the forced runs, G what a cause's parameters θ do to them, s an unexplained wander from
run to run, estimated beside each cause by restricted likelihood. A cause is named where it takes
away so much of the scatter that, with s unknown, chance would not (F test), whatever the wander's
size; what the rows of the runs say of it counts as well (`run_patterns`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ....fitting.causes import evidence, extended_fit, fit_point
from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.refits import compute_bic, hold_effect
from ..fits.scoring import is_gross, score_effects
from ..thresholds import BESIDE_NOISE, SIGNIFICANT, WORTH
from .inquiry import Inquiry, NoiseLevel
from .offsets import Offsets, find_lone_run, judge_scatter, point_at, read_offsets
from .other_ways import choose_ways
from .run_patterns import QUIET, SPARE, Pattern, find_patterns, share_among
from .search_case import Case
from .selection import Begun, Found, find_best_step, prune_causes

Array = np.ndarray
SCATTER = 1e-6
"""Chance of the offsets' scatter being noise from which it is looked into."""
LEAST = 0.3
"""Smallest wander assumed, in σ of the offsets: fewer runs do not know it better."""
MOST = 2


def take_from_frequencies(case: Case) -> Case:
    """The case with the causes that the runs' frequencies show, and what is to be said of these
    frequencies.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    Case
        With the causes, and the frequencies as they are told.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.between import take_from_frequencies
    >>> take_from_frequencies(draw_found_case()).frequencies["sentence"]
    "the runs' frequencies agree within their errors"
    """
    search, noise = case.search, case.inquiry.noise
    final, found = choose_ways(search.final, search.found, case.inquiry.candidates, noise)
    search = replace(search, final=final, found=found)
    begun = [one.name for one in search.start.found]
    taken = _follow(search.final, case.inquiry, MOST - len(begun))
    new = {one.name: one for one in taken.causes}
    # what the search began with stays at the head of its list
    head = [new.pop(one.name, one) for one in search.found if one.name in begun]
    fit, others = taken.fit, [one for one in search.found if one.name not in (*begun, *new)]
    if taken.causes:
        # without those that stood in, within the runs, for what their frequencies follow
        fit, others = prune_causes(fit, others, noise, {})
    fitting = [one for one in taken.left if one.allowed and one.left_p > QUIET]
    follows = [*begun, *new]
    frequencies = _describe_frequencies(fit, noise, follows, fitting, len(taken.left))
    search = replace(search, final=fit, found=(*head, *others, *new.values()))
    return replace(case, search=search, frequencies=frequencies)


def begin_with_frequencies(base: ExtendedFit, inquiry: Inquiry) -> Begun:
    """What the runs' frequencies show without any doubt, before the rows of the runs are asked:
    whose parts in the rows are small would else be taken for other causes there.

    Parameters
    ----------
    base
        The fit without causes.
    inquiry
        The causes asked.

    Returns
    -------
    Begun
        The fit with these causes, each of which leaves no more than noise of the frequencies.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.between import begin_with_frequencies
    >>> begin_with_frequencies(draw_fit(), draw_found_case().inquiry).found
    ()
    """
    if is_gross(base):
        return Begun(base)
    taken = _follow(base, inquiry, min(MOST, inquiry.most), surely=True)
    if taken.causes and _do_rows_settle(base, taken.fit, inquiry):
        return Begun(base)
    return Begun(taken.fit, taken.causes)


def _do_rows_settle(base: ExtendedFit, taken: ExtendedFit, inquiry: Inquiry) -> bool:
    """Whether a cause that the rows show by themselves leaves the runs' frequencies at one, and is
    the better account of the rows: what it bends in them moves the fitted frequencies too."""
    step = find_best_step(base, score_effects(base, inquiry.candidates), inquiry.noise)
    if step is None or compute_bic(step[0]) > compute_bic(taken):
        return False
    return judge_scatter(read_offsets(step[0], inquiry.noise)[0])[1] > QUIET


@dataclass(frozen=True)
class Followed:
    """The fit with the causes that the runs' frequencies show, these, and the patterns of what the
    frequencies do besides, none of which is sure enough."""

    fit: ExtendedFit
    causes: tuple[Found, ...]
    left: Sequence[Pattern]


def _follow(fit: ExtendedFit, inquiry: Inquiry, most: int, *, surely: bool = False) -> Followed:
    """Cause by cause, the least likely by chance first; `surely`: those alone that leave no more
    than noise."""
    causes: dict[str, Found] = {}
    for _ in range(most):
        offsets, index = read_offsets(fit, inquiry.noise)
        if (
            len(causes) >= most
            or len(offsets.value) - offsets.means.shape[1] <= SPARE
            or judge_scatter(offsets)[1] > SCATTER
        ):
            break
        ranked = find_patterns(fit, offsets, index, inquiry)
        room = most - len(causes)
        best = next((one for one in ranked if one.allowed and len(one.variants) <= room), None)
        if best is None or not _convinces(best, len(ranked), surely):
            return Followed(fit, tuple(causes.values()), ranked)
        fit, taken = _adopt_pattern(fit, best, ranked, offsets)
        causes |= {one.name: one for one in taken}
    return Followed(fit, tuple(causes.values()), ())


def _convinces(best: Pattern, tried: int, surely: bool) -> bool:
    """Whether the best of so many is no chance; `surely`: and leaves no more than noise."""
    quiet = best.left_p > QUIET
    limit = BESIDE_NOISE if quiet and not surely else SIGNIFICANT
    return (quiet or not surely) and evidence.correct_for_tries(best.p_value, tried) <= limit


def _adopt_pattern(
    fit: ExtendedFit, best: Pattern, ranked: Sequence[Pattern], offsets: Offsets
) -> tuple[ExtendedFit, list[Found]]:
    """The fit with the causes, the runs' frequencies held together up to the wander that is
    left."""
    known = best.known
    size, _ = best.offsets.fit_response(known.response, best.wander)
    own = float(np.sqrt(np.median(np.diag(offsets.covariance))))
    freedom = replace(fit.freedom, offset_std=max(best.wander, LEAST * own))
    # what the cause does to the frequencies leaves the offsets, or a great one would start many
    # turns away
    point = replace(fit.point, offset_rad_s=best.offsets.value - known.response @ size)
    values = share_among(best.variants, known.aside + known.directions @ size)
    for variant, of_it in zip(best.variants, values, strict=True):
        point = fit_point.add_effect(point, variant.effect, of_it)
    again = extended_fit.fit(fit.series, point, freedom)
    level = best.compute_misfit(best.wander)
    rivals = tuple(
        o.name
        for o in ranked
        if len(o.variants) == 1
        and o.variants[0] not in best.variants
        and o.allowed
        and o.compute_misfit(best.wander) < level + WORTH
    )
    worth = evidence.find_bic_gain(best.gain, known.response.shape[1], len(fit.residual))
    columns = fit.find_sensitivities([one.wanted for one in best.variants])
    taken = []
    for variant, S in zip(best.variants, columns, strict=True):
        score = evidence.score(variant.effect.name, fit.residual, S, fit.basis)
        score = replace(score, p_value=best.p_value)
        taken.append(Found(variant, score, len(ranked), worth, rivals))
    return again, taken


def _free_offsets(fit: ExtendedFit, follows: Sequence[str]) -> ExtendedFit:
    """Every run's frequency free again, the causes it follows held where they are."""
    active = []
    for effect, values in fit.point.active:
        if effect.name in follows:
            effect = hold_effect(effect)
        active.append((effect, values))
    return extended_fit.fit(
        fit.series,
        replace(fit.point, active=tuple(active)),
        replace(fit.freedom, offset_std=np.inf),
    )


_SAID_OF_A_MISFIT = (
    "what the model misses within the runs may move them by that: find its cause first"
)


def _describe_frequencies(
    fit: ExtendedFit,
    noise: NoiseLevel,
    follows: Sequence[str],
    fitting: Sequence[Pattern],
    tried: int,
) -> dict[str, Any]:
    """The runs' frequencies with errors, their scatter, and one sentence. fitting: causes, of so
    many tried, that leave no more than noise, which chance does too often in so few runs."""
    free = _free_offsets(fit, follows) if follows else fit
    offsets, _ = read_offsets(free, noise)
    hz = 1 / (2 * np.pi)
    out: dict[str, Any] = {
        "hz": free.frequency_hz.tolist(),
        "std_hz": (np.sqrt(np.diag(offsets.covariance)) * hz).tolist(),
        "follow": list(follows),
        "would_follow": [],
    }
    if len(offsets.value) <= offsets.means.shape[1]:
        return out | {
            "scatter_hz": None,
            "sigma": None,
            "sentence": "one run alone: its frequency is compared with no other's",
        }
    z, p = judge_scatter(offsets)
    wander_hz = offsets.estimate_wander() * hz
    out |= {"scatter_hz": wander_hz, "sigma": z}
    if p > SCATTER:
        return out | {"sentence": _say_agreement(follows)}
    differ = _say_difference(follows, wander_hz, z)
    if fitting:
        names = dict.fromkeys(v.effect.name for one in fitting for v in one.variants)
        return out | {"would_follow": [*names], "sentence": differ + _say_chance(fitting, tried)}
    lone = find_lone_run(offsets, SCATTER)
    if lone is not None:
        return out | {"sentence": _say_lone_run(free, offsets, lone, z)}
    asked = len(offsets.value) - offsets.means.shape[1] > SPARE
    if not free.is_adequate:
        return out | {"sentence": differ + _SAID_OF_A_MISFIT}
    return out | {"sentence": differ + _say_unfollowed(fit.series.has_temperature, asked)}


def _say_agreement(follows: Sequence[str]) -> str:
    sentence = "the runs' frequencies agree within their errors"
    if follows:
        sentence += f" once {' and '.join(follows)} is taken into account"
    return sentence


def _say_difference(follows: Sequence[str], wander_hz: float, z: float) -> str:
    """By how much the frequencies differ; what is to be said of it follows."""
    beside = f"beside {' and '.join(follows)} " if follows else ""
    return (
        f"{beside}the frequencies of the runs differ by {wander_hz:.3g} Hz from run to run ({z:.3g}"
        " sigma); "
    )


def _say_chance(fitting: Sequence[Pattern], tried: int) -> str:
    """The causes that would make the frequencies so, and why they are not named all the same."""
    names = " or ".join(one.name for one in fitting)
    chance = evidence.correct_for_tries(fitting[0].p_value, tried)
    next_experiment = fitting[0].variants[-1].effect.next_experiment
    return (
        f"{names} would make them so, but so few runs line up with one of {tried} causes by chance"
        f" with p = {chance:.2g}: record more runs; {next_experiment}"
    )


def _say_lone_run(fit: ExtendedFit, offsets: Offsets, run: int, z: float) -> str:
    """The one run whose frequency stands beside the others', and what would make it so."""
    size, _ = offsets.fit_response(point_at(run, offsets), 0.0)
    beside = float(size[0])
    omega = 2 * np.pi * float(fit.frequency_hz[run]) - beside
    slope = fit.point.find_temperature_slopes().get("frequency_hz", 0.0)
    thermometer = "its temperature was another than logged"
    if slope:
        kelvin = -beside / (omega * slope)
        thermometer = (
            f"its thermometer reads {abs(kelvin):.3g} K too {'high' if kelvin > 0 else 'low'}"
        )
    return (
        f"{fit.series.names[run]} alone oscillates {beside / (2 * np.pi):+.3g} Hz"
        f" ({1e6 * beside / omega:.3g} ppm, {z:.3g} sigma) beside the others, which agree:"
        f" {thermometer}, its sampling rate is to be divided by {1 + beside / omega:.9g}, or it is"
        " another gyro's"
    )


def _say_unfollowed(has_temperature: bool, asked: bool) -> str:
    """That no cause makes them so, or that so few frequencies follow whatever moves."""
    advice = "repeat a run as it was" if has_temperature else "log the temperature of every run"
    if not asked:
        advice, nothing = "record more runs", "so few runs do not tell what they follow"
    else:
        nothing = "nothing in the catalogue follows it"
    return f"{nothing}, every run keeps a frequency of its own; {advice}"
