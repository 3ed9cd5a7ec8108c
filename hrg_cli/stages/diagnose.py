"""diagnose: where do measured runs depart from the simulation, which cause explains it, what remains, and what is gained.

Steps: wrong values, adequacy of the base model, scores of every effect, forward selection with refit, adequacy of the extended model,
open search for the rest, gain on data held out, upper limits of what was not found.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..effects import EFFECTS
from ..effects.effect import Effect
from ..errors import HrgError
from ..fitting.causes import evidence, extended_fit
from ..fitting.causes.extended import Point, Series
from ..fitting.causes.extended_fit import Fit, Freedom
from ..fitting.envelopes.base_fit import nominal_scale_factor
from ..records import Diagnosis, Resonator, Wave
from .diagnosis.between import between_runs
from .diagnosis.closing import completed, opened
from .diagnosis.contradiction import contradicting_logs
from .diagnosis.data import prepare
from .diagnosis.form import better
from .diagnosis.gain import held_out
from .diagnosis.model import simulation_file
from .diagnosis.orientation import oriented
from .diagnosis.rate_steps import settled
from .diagnosis.remainder import Remainder, adequacy, describe
from .diagnosis.report import report as report_of
from .diagnosis.search import GROSS, SIGNIFICANT, WORTH, Search, Variant, adopted, select, variants
from .diagnosis.tones import Tone, strongest, without
from .diagnosis.wander import wandering
from .diagnosis.waveform import causes, phase_steps, split_at

Array = np.ndarray
INADEQUATE = 1e-4
"""Chance at which a clean model would be called inadequate by the residual's smooth part, and again by the open terms."""
OPEN_TERMS = 3
MOST_TONES = 4
TONE_LEAVES = 0.8
"""Part of a gross misfit's χ² that a tone may leave."""
IN_THE_WAVEFORM = ("dropped_samples", "mains_tone")
"""Effects named by the waveform view alone."""
CLEARLY = 16.0
"""ΔBIC by which an open description must beat catalogued causes that leave nothing over."""


def diagnose(
    waves: Sequence[Wave],
    resonator: Resonator | None = None,
    extra_effects: Sequence[Effect] = (),
    *,
    scale_factor: Annotated[float | None, Field(gt=0, description="known scale factor K, held")] = None,
    most_effects: Annotated[int, Field(ge=0, le=12, description="most effects taken into the extended model")] = 5,
    blocks: Annotated[int, Field(ge=40, le=1500, description="fewest averaged rows a run")] = 120,
    free_phase: Annotated[bool, Field(description="judge shape and angle alone: the phase wanders by causes outside the model")] = False,
) -> Diagnosis:
    """Name what the base model gets wrong in these runs, or say that nothing fits and describe it.

    waves: runs of one gyro, free and forced together; resonator: the values the user believes. HrgError: no usable run.
    """
    waves = [_with_clipped(w) for w in waves]

    def fitted(pieces: Sequence[Wave]) -> Fit:
        series, point, _ = prepare(pieces, scale_factor, blocks)
        series = replace(series, free_phase=free_phase)
        return settled(extended_fit.fit(series, point, _freedom(series, point, scale_factor)))

    steps = phase_steps(waves)
    pieces, origin = split_at(waves, steps)
    try:
        base = fitted(pieces)
    except extended_fit.DivergedError as error:
        raise HrgError(
            f"{', '.join(w.run_id for w in waves)}: the base model finds no fit to these runs together; "
            "diagnose free and forced runs apart, or leave out the run that differs most"
        ) from error
    if contradiction := contradicting_logs(pieces, base, fitted):
        raise HrgError(contradiction)
    untouched, own = base, origin
    if steps:
        with contextlib.suppress(extended_fit.DivergedError):
            untouched, own = fitted(waves), list(range(len(waves)))
    tones: list[Tone] = []
    while len(tones) < MOST_TONES and (tone := strongest(base, pieces)) is not None:
        try:
            rest = fitted(without(pieces, tone))
        except extended_fit.DivergedError:  # what is left has no fit: it was no tone
            break
        if base.chi2 > GROSS * base.dof and rest.chi2 > TONE_LEAVES * base.chi2:
            break  # a line of a gross misfit of the motion
        base = rest
        tones.append(tone)
        pieces = without(pieces, tone)
    candidates = variants([e for e in (*EFFECTS, *extra_effects) if e.name not in IN_THE_WAVEFORM], base)
    base = wandering(oriented(base, candidates), candidates)
    most = most_effects if base.series.colour is None else min(2, most_effects)
    search, remainder, noise_factor = _explain(base, candidates, most)
    level = _noise_level(search.final, remainder)
    if level is not None:
        base = _reweighted(base, level)
        untouched = _reweighted(untouched, level)
        search, remainder, noise_factor = _explain(base, candidates, most_effects)
    search, frequencies = between_runs(search, candidates, noise_factor)
    wanders = base.series.colour is not None
    search, form = better(search, candidates, noise_factor, most_effects) if wanders else (search, None)
    if form is None:
        verdict, search, remainder = _verdict(search, remainder, noise_factor)
        search, form = (search, None) if wanders else better(search, candidates, noise_factor, most_effects)
    if form is not None:
        verdict, remainder = "partly explained", _rest(search.final, noise_factor)
    verdict = opened(verdict, search, form)
    frequency = base.series.reference_frequency_hz + float(np.mean(search.final.point.offset_rad_s)) / (2 * np.pi)
    shown, lines = causes(waves, steps, tones, frequency, [f.variant.effect.name for f in search.found])
    if shown and verdict in ("adequate", "unexplained"):
        verdict = "explained" if verdict == "adequate" else "partly explained"
    if not steps and not tones:
        untouched = search.base
    gain = held_out(untouched, search.final, own, origin)
    report = report_of(verdict, search, remainder, gain, noise_factor, resonator, candidates, untouched)
    report["effects"] = shown + report["effects"]
    report["lines"] = lines
    report["frequencies"] = frequencies
    report = completed(report, search, form, candidates)
    return _record(search, waves, pieces, origin, verdict, report).judged(_doubts(search.final))


def _doubts(fit: Fit) -> list[str]:
    """What makes the runs themselves suspect."""
    if "p5" in fit.names and fit.point.p[5] < -5 * fit.std("p5"):
        K = fit.point.p[5]
        return [
            f"the scale factor came out negative, {K:.4g}: the logged rate has the wrong sign or the channels are swapped; turn one of them"
        ]
    return []


def summary(diagnosis: Diagnosis) -> dict[str, Any]:
    """The contract's JSON keys of diagnose; `extended_model` is the TOML's path, which whoever writes the file fills in."""
    return json.loads(diagnosis.report)


def _with_clipped(wave: Wave) -> Wave:
    """Windows flagged as clipped alone count: clipping is one of the causes."""
    return wave.replace(flags=np.where(wave.flags == 1, 0, wave.flags).astype(wave.flags.dtype))


def _freedom(series: Series, point: Point, scale_factor: float | None) -> Freedom:
    """Weak priors: K where nothing turns, the second order's scale between plain averaging (0) and a real resonator (1)."""
    span = float(series.time_s.max())
    damping = max(abs(float(point.p[0])), 0.01 / span)
    split = max(float(np.hypot(point.p[3], point.p[4])), damping, 1 / span)
    std = np.array([np.inf, 10 * damping, 10 * damping, 30 * split, 30 * split, 3.0, 1.0])
    if scale_factor is not None:
        std[5] = 0.0
    return Freedom(np.array([0, 0, 0, 0, 0, nominal_scale_factor(series.mode_number), 0.5]), std)


def _reweighted(fit: Fit, level: float) -> Fit:
    """The fit again with every σ times `level`."""
    return extended_fit.fit(replace(fit.series, weight=fit.series.weight / level), fit.point, fit.freedom)


def _noise_level(fit: Fit, remainder: Remainder | None) -> float | None:
    """White noise over the stated one, from second differences of what is left in the end; None where they agree."""
    if fit.series.colour is not None:
        return None
    values = np.zeros((*fit.series.weight.shape, 4))
    values[tuple(fit.rows.T)] = (remainder.fit if remainder else fit).residual
    ok = fit.series.weight > 0
    rough = np.diff(values, n=2, axis=1)[ok[:, 2:]]
    if len(rough) < 20:
        return None
    level = float(np.sqrt(np.median(rough**2) / (6 * 0.45494)))  # median of χ² with one degree of freedom
    return level if abs(level - 1) > max(0.03, 8 / np.sqrt(rough.size)) and level > 1e-9 else None


def _explain(base: Fit, candidates: Sequence[Variant], most: int) -> tuple[Search, Remainder | None, float]:
    """Selection and open search; repeated with inflated noise where, after both, the residual is still not white."""
    noise_factor = 1.0
    for _ in range(2):
        search = select(base, candidates, noise_factor, most, [])
        remainder = _rest(search.final, noise_factor)
        level, p = adequacy(remainder.fit if remainder else search.final)
        if p > INADEQUATE or level < 1.2 * noise_factor:
            break
        noise_factor = level
    return search, remainder, noise_factor


def _rest(fit: Fit, noise_factor: float) -> Remainder | None:
    """The open search where the fit is not adequate; None where it is.

    Not adequate: the residual's smooth part is too large, or one open term of all those tried finds what is too quick for that part.
    """
    level, p = adequacy(fit)
    if level < 1.2 * noise_factor and noise_factor > 1:
        return None
    if p > INADEQUATE:
        found = describe(fit, noise_factor, OPEN_TERMS, INADEQUATE)
        return found if found.terms else None
    return describe(fit, noise_factor, OPEN_TERMS, SIGNIFICANT)


def _verdict(search: Search, remainder: Remainder | None, noise_factor: float) -> tuple[str, Search, Remainder | None]:
    """The word for it; catalogued causes that open terms outdo are dropped and not blamed."""
    if not search.found:
        return ("unexplained" if remainder is not None else "adequate"), search, remainder
    alone = describe(search.base, noise_factor, OPEN_TERMS, SIGNIFICANT)
    if alone.terms and not _is_catalogued(alone, search):
        price = float(np.log(len(search.base.residual)))
        spent = (search.final.basis.shape[1] - search.base.basis.shape[1] + (remainder.rank if remainder else 0)) * price
        catalogued = (search.final.chi2 if remainder is None else remainder.chi2) + spent
        described = alone.chi2 + alone.rank * price
        # a negative damping says that the catalogue's form is not the right one;
        # what the catalogue explains in full is given up only for something clearly better; what it explains in part must earn its place
        margin = CLEARLY if remainder is None else -0.5 * WORTH
        mimic = remainder is not None and _single(alone, search) < -CLEARLY * noise_factor
        forbidden = search.base.point.p[0] > 0 > search.final.point.p[0] and alone.fit.point.p[0] > 0
        if forbidden or mimic or described < catalogued - margin * noise_factor:
            return "unexplained", replace(search, final=search.base, found=(), last=search.first), alone
    return ("explained" if remainder is None else "partly explained"), search, remainder


def _single(alone: Remainder, search: Search) -> float:
    """χ² of the first open term alone less that of the first catalogued cause alone, each with its price."""
    base, first, one = search.base, search.found[0], alone.terms[0]
    price = float(np.log(len(base.residual)))
    cause = adopted(base, first.score, first.variant)
    return (base.chi2 - one.score.gain + one.score.rank * price) - (cause.chi2 + first.score.rank * price)


def _is_catalogued(remainder: Remainder, search: Search) -> bool:
    """Whether one of the open terms is only another spelling of a catalogued effect."""
    visible = [s for s in search.first if s.visible]
    return any(evidence.alike(t.score, s) > 0.995 and s.rank <= t.score.rank for t in remainder.terms for s in visible)


def _record(
    search: Search, waves: Sequence[Wave], pieces: Sequence[Wave], origin: list[int], verdict: str, report: dict[str, Any]
) -> Diagnosis:
    series = search.base.series
    good = series.weight > 0
    run = np.broadcast_to(np.arange(len(series.names))[:, None], good.shape)[good]
    measured = series.envelope[good]
    before, after = (f.prediction.uncoloured().residual()[good] for f in (search.base, search.final))
    from ..physics import ellipse

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
        measured=np.concatenate([measured.real, measured.imag], axis=1),
        residual_before=before,
        residual_after=after,
        series=json.dumps(["C0 real", "S0 real", "C0 imaginary", "S0 imaginary"]),
        run_ids=json.dumps(list(series.names), ensure_ascii=False),
        gyro_id=waves[0].gyro_id,
        verdict=verdict,
        report=json.dumps(report, ensure_ascii=False),
        extended_model=simulation_file(search.final, waves, pieces, origin, report["effects"]),
    )
