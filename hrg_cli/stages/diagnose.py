"""diagnose: where do measured runs depart from the simulation, which cause explains it, what
remains, and what is gained.

Steps: wrong values, adequacy of the base model, scores of every effect, forward selection with
refit, adequacy of the extended model, open search for the rest, gain on data held out, upper limits
of what was not found.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..effects import EFFECTS
from ..effects.effect import Effect
from ..errors import HrgError
from ..fitting import checks
from ..fitting.causes import extended_fit
from ..fitting.causes.extended import Point, jump_times
from ..fitting.causes.extended_fit import Fit
from ..fitting.causes.wave_frame import real
from ..fitting.envelopes import envelope_runs
from ..physics import ellipse
from ..records import Diagnosis, Resonator, Wave
from .diagnosis.beside_misfit import standing
from .diagnosis.between import between_runs
from .diagnosis.closing import closing_checks, word
from .diagnosis.contradiction import strangers
from .diagnosis.data import averaged_well, freedom_of, prepare
from .diagnosis.drive_log import blind, scatter_beyond, timed
from .diagnosis.forecast import folds_of, forecast, predicts_worse
from .diagnosis.form import Form, better
from .diagnosis.gain import held_out
from .diagnosis.heard import unheard
from .diagnosis.lost_samples import PhaseStep
from .diagnosis.model import simulation_file
from .diagnosis.odd_windows import told as odd_ones
from .diagnosis.orientation import oriented
from .diagnosis.rate_steps import settled
from .diagnosis.remainder import Remainder
from .diagnosis.report import Sized, undescribed
from .diagnosis.report import report as report_of
from .diagnosis.scores import scores
from .diagnosis.search import (
    Search,
    Variant,
    gross,
    leaving_out,
    loosened,
    scored,
    select,
    variants,
)
from .diagnosis.shares import Shares, switched_off
from .diagnosis.suspects import Suspicion, stuck_columns, suspect_runs
from .diagnosis.thresholds import WORTH
from .diagnosis.tones import taken_out
from .diagnosis.verdict import concluded, explain, noise_level, rest, reweighted
from .diagnosis.wander import wander
from .diagnosis.waveform import causes, near_tones, phase_steps, split_at, unnamed
from .diagnosis.written import faithful
from .identification.modes import has_dead_channel, thinned
from .one_gyro import of_one_gyro

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
        Runs of one gyro, free and forced together, each (n,) rows with angles in rad and logged rate
        [rad/s] and temperature [°C] where they were logged.
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
    >>> samples = [collect(simulate(config, model="slow", run=run["run_id"])) for run in config["run"]]
    >>> waves = [collect(estimate(collect(demodulate(r, periods_per_window=20)))) for r in samples]
    >>> found = diagnose(waves, most_effects=1)
    >>> found.verdict, [cause["name"] for cause in json.loads(found.report)["effects"]]
    ('explained', ['gain_mismatch'])
    """
    of_one_gyro(waves, "diagnose")
    _need_both_channels(waves)
    waves = [_with_clipped(w) for w in waves]
    searched = [e for e in (*EFFECTS, *extra_effects) if e.seen_in == "dynamics"]
    fitted = partial(_fitted, scale_factor=scale_factor, blocks=blocks, free_phase=free_phase)

    if stuck := stuck_columns(waves):
        try:
            return _refused(waves, _together(waves, fitted), searched, stuck, resonator)
        except HrgError as error:
            raise HrgError("; ".join(one.sentence for one in stuck)) from error
    try:
        with extended_fit.limited(MOTIONS_EACH * len(searched)):
            return _diagnosed(waves, fitted, searched, resonator, extra_effects, most_effects)
    except extended_fit.WorkSpentError as spent:
        return _stopped(waves, fitted(waves), searched, resonator, str(spent))


def _diagnosed(
    waves: Sequence[Wave],
    fitted: Callable[..., Fit],
    searched: Sequence[Effect],
    resonator: Resonator | None,
    extra_effects: Sequence[Effect],
    most_effects: int,
) -> Diagnosis:
    """The diagnosis with all the fits that it takes."""
    cut = _cut_at_losses(waves, fitted)
    if suspicions := suspect_runs(waves, fitted, cut.untouched, variants(searched, cut.untouched)):
        return _refused(waves, cut.untouched, searched, suspicions, resonator)
    if contradiction := strangers(cut.base):
        raise HrgError(contradiction)
    base, pieces, tones = taken_out(cut.base, cut.pieces, fitted)
    candidates = variants(searched, base)
    start = oriented(base, candidates)
    sought = _sought(start, cut.untouched, candidates, most_effects)
    while silent := unheard(sought.search.final, waves):
        candidates = [one for one in candidates if one.effect.name not in silent]
        sought = _sought(start, cut.untouched, candidates, most_effects)
    search, remainder, noise_factor = sought.search, sought.remainder, sought.noise_factor

    frequency_hz = float(np.mean(search.final.frequency_hz))
    named = [f.variant.effect.name for f in search.found]
    shown, lines = causes(waves, cut.steps, tones, frequency_hz, named)
    tone = next(iter(near_tones(tones, waves, frequency_hz)), None)
    untouched = sought.untouched if cut.steps or tones else search.base
    model, written = faithful(
        lambda change, way: simulation_file(
            search.final, waves, pieces, cut.origin, shown, change, way, tone
        ),
        search.final,
        cut.origin,
        extra_effects,
        tone,
    )
    closing = closing_checks(
        search,
        remainder,
        sought.form,
        sought.level,
        written,
        shown,
        sought.frequencies,
        [t.frequency_hz for t in unnamed(tones, shown, named)],
        odd_ones(waves, _instants(search.final, cut), [*named, *(str(e["name"]) for e in shown)]),
    )
    ahead = (
        forecast(search, candidates, noise_factor, most_effects, waves[0].units)
        if search.found
        else None
    )
    stability = _stability(
        search, candidates, noise_factor, most_effects, ahead, lambda: fitted(pieces, coarser=2)
    )
    verdict = word(bool(search.found or shown), not all(check.passed for check in closing))
    gain = held_out(untouched, search.final, cut.own, cut.origin)
    sized = Sized.of(search.final, remainder, noise_factor)
    report = report_of(
        verdict, search, sized, remainder, gain, noise_factor, resonator, candidates, untouched
    )
    report |= {
        "effects": shown + [_in_form(e, sought.form) for e in report["effects"]],
        "lines": lines,
        "frequencies": sought.frequencies,
        "wander": wander(search.final),
        "forecast": ahead,
        "checks": [check.table() for check in closing],
        "written_model": None if written is None else {
            "rms_over_noise": written.rms_over_noise,
            "fitted_rms_over_noise": written.fitted_rms_over_noise,
            "share": written.share,
        },
        "suspect_runs": [],
        "stability": stability,
        "scores": scores(search, sized, candidates),
        "remainder": _left_over(report["remainder"], sought.form, checks.failures(closing)),
    }  # fmt: skip
    report, shares = switched_off(report, search.base, search.final)
    return _with_shares(_record(search, waves, verdict, report, model), shares).judged(
        _doubts(verdict, checks.failures(closing), scatter_beyond(search.final))
    )


def _fitted(
    pieces: Sequence[Wave],
    coarser: int = 1,
    *,
    scale_factor: float | None,
    blocks: int,
    free_phase: bool,
) -> Fit:
    """The base model fitted to runs, averaged along the motion that it has itself."""

    def along(motion: Point | None) -> tuple[Fit, Point]:
        series, point, _ = prepare(pieces, scale_factor, blocks, coarser, motion)
        series = replace(series, free_phase=free_phase)
        freedom = freedom_of(series, point, scale_factor)
        return started(extended_fit.fit(series, point, freedom)), point

    first, guessed = along(None)
    if not gross(first) and not averaged_well(first.series, guessed, first.point):
        first, _ = along(first.point)
    # a gross misfit would be laid on the log's time
    return settled(first) if gross(first) else blind(settled(timed(first)))


@dataclass(frozen=True)
class _Cut:
    """Runs cut where samples seem lost: the steps, the pieces, which run each is of, the base fit;
    beside them the fit of whole runs, and which run each of its own is."""

    steps: list[PhaseStep]
    pieces: list[Wave]
    origin: list[int]
    base: Fit
    untouched: Fit
    own: list[int]


def _cut_at_losses(waves: Sequence[Wave], fitted: Callable[..., Fit]) -> _Cut:
    """The runs as they are to be diagnosed: whole where cuts are not worth it.

    HrgError: the base model finds no fit to them together.
    """
    steps = phase_steps(waves)
    pieces, origin = split_at(waves, steps)
    base = _together(pieces, fitted)
    if steps:
        with contextlib.suppress(extended_fit.DivergedError):
            whole, runs = fitted(waves), list(range(len(waves)))
            if not _needs_cuts(base, whole):
                return _Cut([], list(waves), runs, whole, whole, runs)
            return _Cut(steps, pieces, origin, base, whole, runs)
    return _Cut(steps, pieces, origin, base, base, origin)


def _together(pieces: Sequence[Wave], fitted: Callable[..., Fit]) -> Fit:
    """The base model's fit to runs. HrgError: there is none."""
    try:
        return fitted(pieces)
    except extended_fit.DivergedError as error:
        raise HrgError(
            f"{', '.join(dict.fromkeys(w.run_id for w in pieces))}: the base model finds no fit to these runs"
            " together; diagnose free and forced runs apart, or leave out the run that differs"
            " most"
        ) from error


@dataclass(frozen=True)
class _Sought:
    """What the search comes to, what it leaves over, the noise that both were judged by, and what
    is said of the runs' frequencies and of the form of a damping."""

    search: Search
    remainder: Remainder | None
    noise_factor: float
    level: float
    untouched: Fit
    frequencies: dict[str, Any]
    form: Form | None


def _need_both_channels(waves: Sequence[Wave]) -> None:
    """HrgError: in every run one channel holds noise alone, so that there is no wave to model."""
    if waves and all(has_dead_channel(thinned(envelope_runs.from_wave(wave))) for wave in waves):
        raise HrgError(
            f"{', '.join(wave.run_id or 'a run' for wave in waves)}: one channel alone was recorded,"
            " diagnose needs both; hrg identify gives the modes that it shows"
        )


def _sought(base: Fit, untouched: Fit, candidates: Sequence[Variant], most: int) -> _Sought:
    """The causes beside the base fit: searched, held against open terms, against other forms,
    against data held out, and against what is left over."""
    search, remainder, noise_factor = explain(base, candidates, most)
    level = noise_level(search.final, remainder)
    if level is not None:
        base, untouched = reweighted(base, level), reweighted(untouched, level)
        search, remainder, noise_factor = explain(base, candidates, most)
    search, frequencies = between_runs(search, candidates, noise_factor)
    search, remainder = concluded(search, remainder, noise_factor, candidates)
    search, form = better(search, candidates, noise_factor, most)
    if form is not None:
        remainder = rest(search.final, noise_factor)
    search, remainder = proven(search, remainder, noise_factor, candidates)
    search, remainder = standing(search, remainder, noise_factor, candidates)
    return _Sought(search, remainder, noise_factor, level or 1.0, untouched, frequencies, form)


def _instants(fit: Fit, cut: _Cut) -> list[tuple[int, float]]:
    """(wave, time) of every instant at which samples were lost or a cause of the fit strikes."""
    struck = jump_times(fit.series, fit.point)
    return [
        *((step.run, step.time_s) for step in cut.steps),
        *((run, time_s) for run in cut.origin for time_s in struck),
    ]


def _in_form(effect: dict[str, Any], form: Form | None) -> dict[str, Any]:
    """The report's entry of a cause, in the better form where there is one."""
    return form.amended(effect) if form is not None else effect


def _left_over(
    remainder: dict[str, Any] | None, form: Form | None, failed: Sequence[str]
) -> dict[str, Any] | None:
    """The report's remainder: open terms, what the catalogue's form leaves, else the sentences of
    the checks that failed."""
    if form is not None:
        return form.completed(remainder)
    return undescribed("; ".join(failed)) if failed and remainder is None else remainder


def _with_shares(record: Diagnosis, shares: Shares) -> Diagnosis:
    """The record with the rows of the models without some of the causes, where there are causes."""
    if not shares.left_out:
        return record
    return record.replace(simulated_without=shares.rows, left_out=json.dumps(shares.left_out))


def _refused(
    waves: Sequence[Wave],
    base: Fit,
    searched: Sequence[Effect],
    suspicions: Sequence[Suspicion],
    resonator: Resonator | None,
) -> Diagnosis:
    """The diagnosis of runs of which some are not what they say: these are named, and no physics is
    blamed."""
    sentences = [one.sentence for one in suspicions]
    closing = checks.holds("runs_are_what_they_say", False, "; ".join(sentences))
    record = _unexplained(waves, base, searched, resonator, closing, suspicions)
    return record.judged(sentences, "refused")


def _stopped(
    waves: Sequence[Wave],
    base: Fit,
    searched: Sequence[Effect],
    resonator: Resonator | None,
    spent: str,
) -> Diagnosis:
    """The diagnosis of runs whose search was stopped: no cause that it had come to is named."""
    sentence = (
        f"{spent}; the base model leaves χ² {base.chi2 / base.dof:.3g} a degree of freedom and no"
        " cause settles beside it: look for jumps and damaged rows in the waves, and diagnose the"
        " runs one by one"
    )
    closing = checks.holds("search_finished", False, sentence)
    record = _unexplained(waves, base, searched, resonator, closing, ())
    return record.judged([f'the verdict is "unexplained": {sentence}'])


def _unexplained(
    waves: Sequence[Wave],
    base: Fit,
    searched: Sequence[Effect],
    resonator: Resonator | None,
    closing: checks.Check,
    suspicions: Sequence[Suspicion],
) -> Diagnosis:
    """The record of a diagnosis that names no cause, with the check that took the word away."""
    candidates = variants(searched, base)
    scores = tuple(s for s, _ in scored(base, candidates))
    search = Search(base, base, (), scores, scores)
    origin = list(range(len(waves)))
    report = report_of(
        "unexplained",
        search,
        Sized.of(base, None, 1.0),
        None,
        held_out(base, base, origin, origin),
        1.0,
        resonator,
        candidates,
        base,
    )
    report |= {
        "lines": [],
        "frequencies": {},
        "wander": [],
        "forecast": None,
        "checks": [closing.table()],
        "written_model": None,
        "suspect_runs": [one.table() for one in suspicions],
        "stability": [],
        "scores": None,
        "remainder": undescribed(closing.sentence),
    }
    return _record(search, waves, "unexplained", report, "")


def _needs_cuts(cut: Fit, whole: Fit) -> bool:
    """Whether runs cut where samples seem lost are fitted better than whole ones, by more than the
    pieces' own starts and frequencies cost."""
    rows = len(cut.residual)
    more = cut.basis.shape[1] - whole.basis.shape[1]
    return whole.chi2 * rows / len(whole.residual) - cut.chi2 > WORTH + more * np.log(rows)


def started(fit: Fit) -> Fit:
    """The base fit with what is weakly known free where that is no way to hide a gross misfit."""
    if not gross(fit) or fit.freedom.loose is None:
        return loosened(fit)
    with contextlib.suppress(extended_fit.DivergedError):
        loose = fit.freedom.loose
        free = extended_fit.fit(fit.series, fit.point, replace(loose, loose=loose))
        return fit if gross(free) else loosened(free)
    return fit


def proven(
    search: Search, remainder: Remainder | None, noise_factor: float, candidates: Sequence[Variant]
) -> tuple[Search, Remainder | None]:
    """The search without the causes after which what was held out is predicted worse."""
    folds = folds_of(search.base.series)
    for one in reversed(search.found):
        name = one.variant.effect.name
        if not predicts_worse(search.final, name, search.base, folds):
            continue
        reduced = leaving_out(search.final, name)
        if reduced is None:
            continue
        search = search.without(one, reduced, candidates)
        remainder = rest(reduced, noise_factor)
    return search, remainder


def _stability(
    search: Search,
    candidates: Sequence[Variant],
    noise_factor: float,
    most: int,
    ahead: dict[str, Any] | None,
    coarser: Callable[[], Fit],
) -> list[dict[str, Any]]:
    """The causes' names where the same runs are looked at otherwise: averaged to half as many rows,
    and on a part of the data."""
    if not search.found:
        return []
    out: list[dict[str, Any]] = []
    with contextlib.suppress(extended_fit.DivergedError):
        again = select(coarser(), candidates, noise_factor, most)
        out.append(
            {
                "change": "averaged to half as many rows",
                "effects": [f.variant.effect.name for f in again.found],
            }
        )
    if ahead is not None:
        part = (
            "half of the runs"
            if ahead["held_out"] == "runs"
            else f"the first {100 * ahead['train_fraction']:.0f} % of every run"
        )
        out += [{"change": part, "effects": names} for names in ahead["chosen"]]
    return out


def _doubts(verdict: str, failed: Sequence[str], scatter: str) -> list[str]:
    """What makes the diagnosis suspect: a word that could not be given, and a drive's log that may
    be why."""
    if verdict in ("adequate", "explained"):
        return []
    open_ = [f'the verdict is "{verdict}": {"; ".join(failed[:3])}'] if failed else []
    return open_ + ([scatter] if scatter else [])


def summary(diagnosis: Diagnosis) -> dict[str, Any]:
    """The contract's JSON keys of diagnose; `extended_model` is the TOML's path, which whoever
    writes the file fills in."""
    return json.loads(diagnosis.report)


def _with_clipped(wave: Wave) -> Wave:
    """Windows flagged as clipped alone count: clipping is one of the causes."""
    return wave.replace(flags=np.where(wave.flags == 1, 0, wave.flags).astype(wave.flags.dtype))


def _record(
    search: Search, waves: Sequence[Wave], verdict: str, report: dict[str, Any], model: str
) -> Diagnosis:
    series = search.base.series
    good = series.weight > 0
    run = np.broadcast_to(np.arange(len(series.names))[:, None], good.shape)[good]
    measured = series.envelope[good]
    before, after = (f.prediction.residual()[good] for f in (search.base, search.final))
    a_A, _, angle, phase = ellipse.wave(measured, series.mode_number)
    for k in range(len(series.names)):
        angle[run == k], _ = ellipse.unwrap(angle[run == k], phase[run == k], series.mode_number)
    return Diagnosis(
        run=run.astype("i4"),
        time_s=series.time_s[good],
        wave_angle_rad=angle,
        main_amplitude=a_A,
        temperature_degc=series.temperature_degc[good] if series.has_temperature else None,
        rate_rad_s=series.rate_rad_s[good],
        measured=real(measured),
        simulated_before=real(search.base.prediction.seen[good]),
        simulated_after=real(search.final.prediction.seen[good]),
        residual_before=before,
        residual_after=after,
        series=json.dumps(["C0 real", "S0 real", "C0 imaginary", "S0 imaginary"]),
        run_ids=json.dumps(list(series.names), ensure_ascii=False),
        gyro_id=waves[0].gyro_id,
        verdict=verdict,
        report=json.dumps(report, ensure_ascii=False),
        extended_model=model,
    )
