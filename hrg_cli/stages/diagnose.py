"""diagnose: where do measured runs depart from the simulation, which cause explains it, what
remains, and what is gained.

Steps: runs that are not what they say, tones and lost samples taken out, causes searched and held
against all that could stand in their place, the model written and simulated, the closing checks
that give the word, and a forecast of data that taught nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..effects import EFFECTS, find
from ..effects.effect import Effect
from ..errors import HrgError, name_some
from ..fitting import checks
from ..fitting.causes import extended_fit, motion_budget
from ..fitting.causes.extended_fit import ExtendedFit
from ..fitting.causes.fit_point import Active
from ..fitting.causes.slow_equation import find_strikes
from ..fitting.checks import Check
from ..fitting.envelopes import envelope_runs
from ..records import Diagnosis, Resonator, Wave
from .diagnosis.base.contradiction import find_strangers
from .diagnosis.base.data import count_codes, is_coarse
from .diagnosis.base.joint_fit import Cut, cut_at_losses, fit_base, fit_together
from .diagnosis.closing.closing_checks import choose_word, make_closing_checks
from .diagnosis.closing.sized import Sized, give_up_unsized
from .diagnosis.closing.stability import ChosenAgain, choose_again, list_stability
from .diagnosis.closing.wander import describe_wander
from .diagnosis.extended.lost_time import time_losses
from .diagnosis.extended.model import compose_simulation_file
from .diagnosis.extended.written import Written, write_faithfully
from .diagnosis.fits.scoring import is_gross
from .diagnosis.fits.variants import Variant, list_variants
from .diagnosis.report.record import (
    add_shares,
    describe_left_over,
    list_diagnosis_doubts,
    make_diagnosis_record,
    take_form,
)
from .diagnosis.report.refusal import refuse, stop_search
from .diagnosis.report.report import report as report_of
from .diagnosis.report.scores import tabulate_scores
from .diagnosis.report.shares import report_shares
from .diagnosis.run_clock import count_from_begin
from .diagnosis.samples.harmonics import measure_motion_harmonics
from .diagnosis.samples.heard import find_largest_cubic, find_unheard
from .diagnosis.samples.lines import (
    describe_folded,
    describe_rounding,
    find_common_step,
    find_median_frequency,
)
from .diagnosis.samples.odd_windows import say_odd_windows as odd_ones
from .diagnosis.samples.own_clipping import count_blocks, count_common_clipping
from .diagnosis.samples.tone import Tone
from .diagnosis.samples.tone_search import widen_by_rest
from .diagnosis.samples.tones import confirm_tones, remove_tones, take_out_tones
from .diagnosis.samples.waveform import find_waveform_causes, list_near_tones, list_unnamed_tones
from .diagnosis.search.explain import explain, reweight_fit
from .diagnosis.search.forecast import forecast
from .diagnosis.search.gain import predict_held_out
from .diagnosis.search.orientation import orient_runs, settle_signs
from .diagnosis.search.search_case import Case
from .diagnosis.search.starts import tell_course
from .diagnosis.suspects import (
    QuietMistake,
    Suspicion,
    find_backward_runs,
    find_mislabelled,
    find_stuck_columns,
    find_twin_channels,
    suspect_plain_run,
    suspect_quiet_run,
    suspect_runs,
)
from .diagnosis.suspects.rivals import fit_nearest
from .diagnosis.thresholds import GROSS
from .identification.modes import has_dead_channel, thin_run
from .one_gyro import need_each_once, need_same_gyro
from .shared_noise import need_own_noise
from .usable import (
    ESTIMATE_AGAIN,
    drop_refused,
    explain_refusal,
    name_apart,
    restrict_to_known_rates,
)

Array = np.ndarray
MOTIONS_EACH = 40 * extended_fit.MOST_STEPS
"""Motions computed in fits, for each effect of the catalogue, after which the search is stopped: so
many as fit each alone forty times to its end. Sound runs need some hundred in all, since their fits
take whole steps; a recorded pendulum beside a misfit of a thousand took 7609."""


def diagnose(
    waves: Sequence[Wave],
    resonator: Resonator | None = None,
    extra_effects: Sequence[Effect] = (),
    *,
    scale_factor: Annotated[
        float | None, Field(gt=0, description="known scale factor K, held")
    ] = None,
    most_effects: Annotated[
        int, Field(ge=0, le=12, description="most effects taken into the extended model")
    ] = 5,
    blocks: Annotated[int, Field(ge=40, le=1500, description="fewest averaged rows a run")] = 120,
    free_phase: Annotated[
        bool,
        Field(
            description="judge shape and angle alone: the phase wanders by causes outside the model"
        ),
    ] = False,
) -> Diagnosis:
    """Name what the base model gets wrong in these runs, or say that nothing fits and describe it.

    The base model is the linear gyro of PHYSICS §0, u' = L u + drive; a cause is an effect of the
    catalogue whose sensitivity ∂u/∂p, beside those of the base model, takes from the residual more
    than chance and the choice among many would (Rao's score, then refits; page "verdict").

    Parameters
    ----------
    waves
        Runs of one gyro, free and forced together, each (n,) rows with angles in rad and logged
        rate [rad/s] and temperature [°C] where they were logged.
    resonator
        The values that are believed; the report says which of them the runs contradict.
    extra_effects
        `Effect` objects looked for beside the catalogue's.

    Returns
    -------
    Diagnosis
        The verdict, its report as JSON, the extended model as TOML, and the residual series
        (rows, 4) before and after.

    Raises
    ------
    HrgError
        No usable run, several gyros, runs that contradict each other.

    Examples
    --------
    >>> import json
    >>> from hrg_cli import collect, demodulate, diagnose, estimate, simulate
    >>> config = {
    ...     "device": {"frequency_hz": 1000.0, "quality_factor": 20_000.0},
    ...     "effects": {"gain_mismatch": {"gain": 0.01}},
    ...     "readout": {"noise": 1e-4},
    ...     "recording": {"sample_rate_hz": 8000.0, "duration_s": 4.0},
    ...     "run": [
    ...         {"run_id": name, "environment": {"rate_rad_s": rate}}
    ...         for name, rate in (("left", 1.0), ("right", -1.0), ("slow", 0.5))
    ...     ],
    ... }
    >>> samples = [
    ...     collect(simulate(config, model="slow", run=run["run_id"])) for run in config["run"]
    ... ]
    >>> waves = [collect(estimate(collect(demodulate(r, periods_per_window=20)))) for r in samples]
    >>> found = diagnose(waves, most_effects=1)
    >>> found.verdict, [cause["name"] for cause in found.told("effects")]
    ('explained', ['gain_mismatch'])
    """
    need_same_gyro(waves, "diagnose")
    need_each_once(waves)
    need_own_noise(waves)
    usable = restrict_to_known_rates(drop_refused(waves))
    with usable.blame_refusals():
        _need_both_channels(usable.waves)
    clocks = count_from_begin(name_apart(usable.waves))
    counted, clipped = count_common_clipping(clocks.waves)
    blocks = count_blocks(blocks, clocks.waves, counted)
    asked = Asked(
        tuple(counted),
        tuple(clocks.waves),
        resonator,
        tuple(e for e in (*EFFECTS, *extra_effects) if e.seen_in == "dynamics"),
        tuple(extra_effects),
        most_effects,
        partial(fit_base, scale_factor=scale_factor, blocks=blocks, free_phase=free_phase),
    )
    coarse = map(_say_coarse, filter(is_coarse, counted))
    notes = (*usable.notes, *clocks.list_notes(), *clipped, *coarse)
    found = clocks.restore(_diagnose_usable(asked))
    return replace(usable, refusals=(), notes=notes).judge(found)


def _say_coarse(wave: Wave) -> str:
    """What few codes do to a run."""
    return (
        f"{wave.run_id}: rounding makes most of its noise, its amplitude being"
        f" {count_codes(wave):.2g} codes of"
        f" {wave.least_count:.3g}: what it leaves may be the converter's; record it with more bits"
    )


def _diagnose_usable(asked: Asked) -> Diagnosis:
    """The diagnosis of runs that can be used, or the refusal of runs that are not what they say."""
    unfit = [
        Suspicion(w.run_id, "its wave is refused", explain_refusal(w), ESTIMATE_AGAIN)
        for w in asked.waves
        if w.status == "refused"
    ]
    # A stuck column is no motion, nor is one that runs backwards, nor is a drive what nobody drove:
    # causes fitted to it would be blamed for it.
    plain = (find_stuck_columns, find_twin_channels, find_backward_runs, find_mislabelled)
    if stuck := unfit or next(filter(None, (look_at(asked.waves) for look_at in plain)), []):
        try:
            base = fit_together(asked.waves, asked.fit)
        except HrgError as error:
            raise HrgError("; ".join(one.sentence for one in stuck)) from error
        return refuse(asked.waves, base, asked.searched, stuck, asked.resonator)
    try:
        with motion_budget.limit_motions(MOTIONS_EACH * len(asked.searched)):
            return _diagnosed(asked)
    except motion_budget.WorkSpentError as spent:
        base = asked.fit(asked.waves)
        return stop_search(asked.waves, base, asked.searched, asked.resonator, str(spent))


@dataclass(frozen=True)
class Asked:
    """What a diagnosis is asked: the waves, the same with all their flags (`waves` has none where
    clipped windows count), the values believed, the causes looked for, those of them that the user
    brought, how many at most, and how the base model is fitted to runs."""

    waves: tuple[Wave, ...]
    flagged: tuple[Wave, ...]
    resonator: Resonator | None
    searched: tuple[Effect, ...]
    extra_effects: tuple[Effect, ...]
    most: int
    fit: Callable[..., ExtendedFit]


@dataclass(frozen=True)
class InSamples:
    """What the samples show before any dynamics: the causes' entries, these and the dynamics'
    causes as effects, lines of the spectrum, the tone nearest to the oscillation, and what nothing
    explains: frequencies of lines, a sentence on odd windows."""

    shown: list[dict[str, Any]]
    named: list[Effect]
    lines: list[dict[str, Any]]
    tone: Tone | None
    unnamed_hz: list[float]
    odd: str


def _diagnosed(asked: Asked) -> Diagnosis:
    """The diagnosis with all the fits that it takes."""
    near = partial(_fit_nearest, asked)
    cut = cut_at_losses(asked.waves, asked.fit, near)
    candidates = list_variants(asked.searched, cut.untouched)
    if suspicions := suspect_runs(asked.waves, asked.fit, cut.untouched, candidates):
        return refuse(asked.waves, cut.untouched, asked.searched, suspicions, asked.resonator)
    if contradiction := find_strangers(cut.base):
        raise HrgError(contradiction)
    # a gross misfit has no motion to average rows along; the causes that leave least of it have one
    cut = cut.follow(near(cut.base))
    if plain := suspect_plain_run(asked.waves, asked.fit, cut.untouched, candidates):
        return refuse(asked.waves, cut.untouched, asked.searched, list(plain), asked.resonator)
    # Tones near the oscillation first: in the envelopes they look like a split that beats.
    case, pieces, tones = _explain_beside_tones(asked, cut, near)
    starts = [wave.start_time for wave in asked.waves]
    case = replace(case, frequencies=tell_course(case.frequencies, starts))
    result = _judge(asked, cut, case, pieces, tones)
    case = result.case
    mistake = result.mistake
    if mistake is not None and mistake.surely:
        suspected = list(mistake.suspicions)
        return refuse(asked.waves, cut.untouched, asked.searched, suspected, asked.resonator)
    causes = bool(case.search.found or result.samples.shown)
    verdict = choose_word(causes, bool(result.failed))
    report = _report_result(verdict, asked, cut, result)
    report, shares = report_shares(report, case.search.base, case.search.final)
    record = make_diagnosis_record(case.search, asked.waves, verdict, report, result.model)
    return add_shares(record, shares).judged(
        list_diagnosis_doubts(verdict, result.failed, case.search.final)
    )


@dataclass(frozen=True)
class ClosedCase:
    """The final result and what judged it: the case, as the search left it and without the causes
    that it gives up, the tones taken out before it, the fit whose numbers are told, what the
    samples show, the model as written and as simulated, the causes chosen again from fewer rows,
    the closing checks and those that failed in words, and a mistake of one run that may have made
    it all."""

    searched: Case
    case: Case
    tones: Sequence[Tone]
    sized: Sized
    samples: InSamples
    model: str
    written: Written | None
    again: ChosenAgain | None
    closing: Sequence[Check]
    failed: list[str]
    mistake: QuietMistake | None


def _judge(
    asked: Asked, cut: Cut, case: Case, pieces: Sequence[Wave], tones: Sequence[Tone]
) -> ClosedCase:
    """The case held against the samples, against its own simulation, and by the closing checks."""
    searched = case
    case, sized = give_up_unsized(searched)
    samples = _seen_in_samples(asked, case, cut, widen_by_rest(tones, case.search.final, pieces))
    model, written = _written(asked, case, cut, pieces, samples)
    again = choose_again(case, lambda: cut.fit(pieces, coarser=2))
    closing = make_closing_checks(
        case, sized, written, samples.shown, samples.unnamed_hz, samples.odd, again
    )
    failed = checks.list_failures(closing)
    if failed:
        why = (describe_folded(pieces, samples.named), describe_rounding(pieces))
        failed = [*filter(None, why), *failed]
    final, candidates = case.search.final, case.inquiry.candidates
    mistake = suspect_quiet_run(
        asked.waves, asked.fit, cut.untouched, final, candidates, failed=bool(failed)
    )
    return ClosedCase(
        searched, case, tones, sized, samples, model, written, again, closing, failed, mistake
    )


def _report_result(verdict: str, asked: Asked, cut: Cut, result: ClosedCase) -> dict[str, Any]:
    """The report of a result: what the causes are, gain and leave, and every check of it."""
    case, samples, written = result.case, result.samples, result.written
    # what is chosen inside each fold is not what is named at the end: where all of it is given up,
    # whether choosing predicts better is a question all the same
    ahead = forecast(result.searched, asked.waves[0].units)
    untouched = _untouched(case, cut) if cut.steps or result.tones else case.search.base
    gain = predict_held_out(untouched, case.search.final, cut.own, cut.origin)
    report = report_of(verdict, case, result.sized, gain, asked.resonator, untouched)
    mistakes = [] if result.mistake is None else [result.mistake.to_json()]
    return report | {
        "effects": samples.shown + [take_form(cause, case.form) for cause in report["effects"]],
        "lines": samples.lines,
        "frequencies": case.frequencies,
        "wander": describe_wander(case.search.final),
        "forecast": ahead,
        "checks": [check.to_json() for check in result.closing],
        "written_model": None if written is None else written.to_json(),
        "suspect_runs": [],
        "stability": list_stability(result.again, ahead) if case.search.found else [],
        "scores": tabulate_scores(case, result.sized),
        "not_separable": [*report["not_separable"], *mistakes],
        "remainder": describe_left_over(report["remainder"], case.form, result.failed),
    }


def _fit_nearest(asked: Asked, fit: ExtendedFit) -> ExtendedFit:
    """A fit with the few causes that leave least of a gross misfit; as it is where it is not
    gross."""
    if not is_gross(fit):
        return fit
    near: ExtendedFit = fit.recall(
        "nearest", lambda: fit_nearest(fit, list_variants(asked.searched, fit), GROSS)
    )
    return near


def _explain_beside_tones(
    asked: Asked, cut: Cut, near: Callable[[ExtendedFit], ExtendedFit]
) -> tuple[Case, list[Wave], list[Tone]]:
    """The causes, the pieces without the tones near the resonance, and these: each of them stands
    out beside the causes too."""
    base, pieces, tones = take_out_tones(cut.base, cut.pieces, cut.fit, near)
    while True:
        case = _explain_heard(asked, base)
        active = case.search.final.point.active

        def complete(waves: Sequence[Wave], active: Active = active) -> ExtendedFit:
            fit = cut.fit(waves)
            return extended_fit.fit(fit.series, replace(fit.point, active=active), fit.freedom)

        # What looked like a tone beside the bare model may have been a cause's own beat.
        standing = confirm_tones(tones, cut.pieces, complete) if active else tones
        if len(standing) == len(tones):
            return case, pieces, tones
        tones = standing
        pieces = remove_tones(cut.pieces, tones)
        base = cut.fit(pieces) if any(tone.standing for tone in tones) else cut.base


def _explain_heard(asked: Asked, base: ExtendedFit) -> Case:
    """The causes beside the base fit, without those whose waveform the samples do not hold."""
    candidates: Sequence[Variant] = list_variants(asked.searched, base)
    start, step_s = orient_runs(base, candidates), find_common_step(asked.waves)

    def explained(begin: ExtendedFit) -> Case:
        return explain(begin, candidates, asked.most, step_s)

    case, start = settle_signs(explained(start), start, explained)
    # A cause that must leave harmonics in the samples and does not is another one in disguise; the
    # search begins anew without it, since what it took up belongs to others.
    while silent := find_unheard(case.search.final, asked.waves):
        candidates = [one for one in candidates if one.effect.name not in silent]
        case = explained(start)
    return case


def _seen_in_samples(asked: Asked, case: Case, cut: Cut, tones: Sequence[Tone]) -> InSamples:
    """What the samples show beside the causes of the dynamics."""
    final, waves = case.search.final, asked.waves
    # where the motion itself is: a frequency that follows the amplitude is elsewhere at rest
    frequency_hz = float(np.mean([find_median_frequency(wave) for wave in waves]))
    found = [one.variant.effect for one in case.search.found]
    bends = [pair for pair in final.point.active if pair[0].makes_harmonics]
    shown, lines = find_waveform_causes(
        # the fits tell a clip by its windows' motion, but beside a gross misfit of that
        asked.flagged if is_gross(final) else waves,
        time_losses(cut.steps, final, waves, cut.origin),
        tones,
        frequency_hz,
        found,
        measure_motion_harmonics(final),
        None if bends else partial(find_largest_cubic, final),
    )
    named = [*found, *(find(str(entry["name"])) for entry in shown)]
    return InSamples(
        shown,
        named,
        lines,
        next(iter(list_near_tones(tones, waves, frequency_hz)), None),
        [t.frequency_hz for t in list_unnamed_tones(tones, named)],
        odd_ones(waves, _instants(final, cut), named, bends),
    )


def _written(
    asked: Asked, case: Case, cut: Cut, pieces: Sequence[Wave], samples: InSamples
) -> tuple[str, Written | None]:
    """The extended model as a simulation file, and how it does when it is simulated."""

    def file(change: Any, way: Any) -> str:
        return compose_simulation_file(
            case.search.final, asked.waves, pieces, cut.origin, samples.shown, change, way,
            samples.tone,
        )  # fmt: skip

    return write_faithfully(file, case.search.final, cut.origin, asked.extra_effects, samples.tone)


def _untouched(case: Case, cut: Cut) -> ExtendedFit:
    """The base fit of whole runs, at the noise that the case is judged by."""
    white = case.inquiry.noise.white
    return cut.untouched if white == 1.0 else reweight_fit(cut.untouched, white)


def _instants(fit: ExtendedFit, cut: Cut) -> list[tuple[int, float]]:
    """(wave, time) of every instant at which samples were lost or a cause of the fit strikes."""
    strikes = [instant for _, instant in find_strikes(fit.series, fit.point)]
    return [
        *((step.run, step.time_s) for step in cut.steps),
        *((run, time_s) for run in cut.origin for time_s in strikes),
    ]


def _need_both_channels(waves: Sequence[Wave]) -> None:
    """HrgError: in every run one channel holds noise alone, so that there is no wave to model."""
    if waves and all(has_dead_channel(thin_run(envelope_runs.from_wave(wave))) for wave in waves):
        raise HrgError(
            f"{name_some(wave.run_id or 'a run' for wave in waves)}: one channel alone was"
            " recorded, diagnose needs both; hrg identify gives the modes that it shows"
        )


def summarise(diagnosis: Diagnosis) -> dict[str, Any]:
    """What the command's JSON says of a diagnosis: its report.

    Parameters
    ----------
    diagnosis
        As it was written.

    Returns
    -------
    dict
        By the keys of the JSON page; `extended_model` is the TOML's path, which whoever writes the
        file fills in.

    Examples
    --------
    >>> from hrg_cli import diagnose
    >>> from hrg_cli.stages.diagnose import summarise
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> summarise(diagnose(draw_waves()))["verdict"]
    'adequate'
    """
    return diagnosis.read_report()
