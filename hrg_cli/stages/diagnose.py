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
from ..fitting.causes import extended_fit
from ..fitting.causes.extended_fit import Fit
from ..fitting.causes.wave_frame import real
from ..physics import ellipse
from ..records import Diagnosis, Resonator, Wave
from .diagnosis.between import between_runs
from .diagnosis.closing import completed, opened
from .diagnosis.contradiction import contradicting_logs, strangers
from .diagnosis.data import freedom_of, prepare
from .diagnosis.forecast import Trained
from .diagnosis.form import better
from .diagnosis.gain import held_out
from .diagnosis.model import simulation_file
from .diagnosis.orientation import oriented
from .diagnosis.rate_steps import settled
from .diagnosis.report import report as report_of
from .diagnosis.search import Search, variants
from .diagnosis.tones import taken_out
from .diagnosis.verdict import concluded, explain, noise_level, rest, reweighted
from .diagnosis.wander import wandering
from .diagnosis.waveform import causes, phase_steps, split_at
from .one_gyro import of_one_gyro

Array = np.ndarray
IN_THE_WAVEFORM = ("dropped_samples", "mains_tone")
"""Effects named by the waveform view alone."""


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

    waves: runs of one gyro, free and forced together; resonator: the values the user believes. HrgError: no usable run, several gyros.
    """
    of_one_gyro(waves, "diagnose")
    waves = [_with_clipped(w) for w in waves]

    def fitted(pieces: Sequence[Wave]) -> Fit:
        series, point, _ = prepare(pieces, scale_factor, blocks)
        series = replace(series, free_phase=free_phase)
        return settled(extended_fit.fit(series, point, freedom_of(series, point, scale_factor)))

    steps = phase_steps(waves)
    pieces, origin = split_at(waves, steps)
    try:
        base = fitted(pieces)
    except extended_fit.DivergedError as error:
        raise HrgError(
            f"{', '.join(w.run_id for w in waves)}: the base model finds no fit to these runs together; "
            "diagnose free and forced runs apart, or leave out the run that differs most"
        ) from error
    if contradiction := strangers(base) or contradicting_logs(pieces, base, fitted):
        raise HrgError(contradiction)
    untouched, own = base, origin
    if steps:
        with contextlib.suppress(extended_fit.DivergedError):
            untouched, own = fitted(waves), list(range(len(waves)))
    base, pieces, tones = taken_out(base, pieces, fitted)
    candidates = variants([e for e in (*EFFECTS, *extra_effects) if e.name not in IN_THE_WAVEFORM], base)
    base = wandering(oriented(base, candidates), candidates)
    most = most_effects if base.series.colour is None else min(2, most_effects)
    search, remainder, noise_factor = explain(base, candidates, most)
    level = noise_level(search.final, remainder)
    if level is not None:
        base = reweighted(base, level)
        untouched = reweighted(untouched, level)
        search, remainder, noise_factor = explain(base, candidates, most_effects)
    search, frequencies = between_runs(search, candidates, noise_factor)
    wanders = base.series.colour is not None
    trained = Trained(search.base, candidates)
    search, form = better(search, trained, noise_factor, most_effects) if wanders else (search, None)
    if form is None:
        verdict, search, remainder = concluded(search, remainder, noise_factor, candidates)
        search, form = (search, None) if wanders else better(search, trained, noise_factor, most_effects)
    if form is not None:
        verdict, remainder = "partly explained", rest(search.final, noise_factor)
    verdict = opened(verdict, search, form)
    shown, lines = causes(waves, steps, tones, float(np.mean(search.final.frequency_hz)), [f.variant.effect.name for f in search.found])
    if shown and verdict in ("adequate", "unexplained"):
        verdict = "explained" if verdict == "adequate" else "partly explained"
    if not steps and not tones:
        untouched = search.base
    gain = held_out(untouched, search.final, own, origin)
    report = report_of(verdict, search, remainder, gain, noise_factor, resonator, candidates, untouched)
    report["effects"] = shown + report["effects"]
    report["lines"] = lines
    report["frequencies"] = frequencies
    report = completed(report, search, form, trained)
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


def _record(
    search: Search, waves: Sequence[Wave], pieces: Sequence[Wave], origin: list[int], verdict: str, report: dict[str, Any]
) -> Diagnosis:
    series = search.base.series
    good = series.weight > 0
    run = np.broadcast_to(np.arange(len(series.names))[:, None], good.shape)[good]
    measured = series.envelope[good]
    before, after = (f.prediction.uncoloured().residual()[good] for f in (search.base, search.final))
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
        extended_model=simulation_file(search.final, waves, pieces, origin, report["effects"]),
    )
