"""rehearse: the programme behind a result, measured again on its simulated twin: are its errors the
errors it makes?

The twin has the result's own values for truth and the measured runs' starts, lengths, sampling,
windows, logs and noise; it goes through raw samples and the same stages with the same settings.
What comes out is held against what was put in: t = (estimate − truth)/σ.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from .. import settings as checking
from ..effects.effect import no_term
from ..errors import HrgError
from ..fitting.envelopes.coordinates import SPLITS
from ..fourier import coefficients_at
from ..records import REHEARSAL as PREFIX
from ..records import Calibration, Diagnosis, Record, Resonator, Wave, collect
from . import twin_colour
from .demodulate import demodulate
from .estimate import estimate
from .simulate import simulate
from .twin import Measured, Twin, effects_of, twin_of
from .twin_diagnosis import base_values, causes, causes_held, same_sign, twin_of_diagnosis
from .twin_physical import Identified

Array = np.ndarray
LARGEST_RATIO = 1.3
"""Factor by which a σ may miss the error it stands for."""
LARGEST_BIAS = 1.0
"""Bias in standard deviations that a result may have."""
CHANCE = 0.01
"""Probability with which one of all the figures of a right result is blamed."""
WITHIN_68, WITHIN_95 = 1.0, 1.959964
"""Standard deviations within which a Gaussian error lies in 68.3 and 95 % of the cases."""
FEWEST = 2
"""Rehearsals that must succeed for anything to be said."""
FAILING = 0.1
"""Part of the rehearsals that may fail."""
LEAST_NAMED, MOST_STRANGE = 0.5, 0.1
"""Part of the rehearsals in which a cause of a diagnosis must be named again, and in which another
cause may be."""
MATCHED = (0.2, 5.0)
"""Factors by which the noise of the twin's samples is changed at most to match the measured
windows'."""
TRIAL_SAMPLES, MOST_TRIALS = 16_000, 8
"""Samples of a run's trials, whose windows' stated noise is matched, and trials at most: the median
over some hundred windows of few samples scatters by 2 % from draw to draw."""
CLEAR = 4.0
"""Standard deviations from which a split's size is Gaussian, and its axis; below, its components are
judged instead, for a size lost in noise is Rice's and never comes out as small as it is."""
STREAMS = 1_000_003
"""Rehearsal k of a seed draws from the stream seed·STREAMS + k."""

Work = tuple[Twin, int]


@dataclass(frozen=True)
class RehearsedFigure:
    """What one rehearsal found of one figure, and what was put in."""

    value: float
    std: float
    truth: float
    period: float = 0.0

    def t(self) -> float:
        """(estimate − truth)/σ, an angle modulo its period."""
        error = self.value - self.truth
        if self.period:
            error = float(np.mod(error + self.period / 2, self.period) - self.period / 2)
        return error / self.std


@dataclass(frozen=True)
class Rehearsed:
    """One rehearsal: its figures, its status, or the sentence why it failed; of a diagnosis, the
    causes that were named."""

    figures: Mapping[str, RehearsedFigure] = field(default_factory=dict)
    status: str = "failed"
    reason: str = ""
    named: tuple[str, ...] = ()


@dataclass(frozen=True)
class FigureStatistics:
    """How one figure's errors compare with its σ over all rehearsals, and the limits that both were
    held against."""

    name: str
    bias_over_std: float
    error_over_std_rms: float
    coverage_68: float
    coverage_95: float
    count: int
    bias_limit: float
    rms_limit: float
    rms_least: float

    def sentence(self) -> str:
        """What is wrong with the figure's error, or nothing."""
        if not abs(self.bias_over_std) <= self.bias_limit:
            return (
                f"{PREFIX}{self.name} comes out {self.bias_over_std:+.2g} of its own standard"
                f" deviations from the truth of a simulated twin on average ({self.count} times),"
                f" at most {LARGEST_BIAS:g} was expected"
            )
        if not self.error_over_std_rms <= self.rms_limit:
            return (
                f"{PREFIX}the errors of {self.name} on a simulated twin are"
                f" {self.error_over_std_rms:.3g} times its standard deviation ({self.count} times),"
                f" at most {LARGEST_RATIO:g} was expected"
            )
        if not self.error_over_std_rms >= self.rms_least:
            return (
                f"{PREFIX}the errors of {self.name} on a simulated twin are only"
                f" {self.error_over_std_rms:.3g} of its standard deviation ({self.count} times), at"
                f" least {1 / LARGEST_RATIO:.2f} was expected"
            )
        return ""


@dataclass(frozen=True)
class Named:
    """How often a cause was named in `times` diagnoses of a twin, which holds it or does not."""

    name: str
    held: bool
    named: int
    times: int

    def sentence(self, causes: int) -> str:
        """What is wrong with that, or nothing; `causes`: how many are looked at."""
        from scipy.special import bdtr, bdtrc

        tail = CHANCE / causes
        if self.held and bdtr(self.named, self.times, LEAST_NAMED) < tail:
            return (
                f"{PREFIX}{self.name} is named in {self.named} of {self.times} diagnoses of a"
                " simulated twin that holds it as large as the file says"
            )
        if not self.held and bdtrc(self.named - 1, self.times, MOST_STRANGE) < tail:
            return (
                f"{PREFIX}{self.name} is named in {self.named} of {self.times} diagnoses of a"
                " simulated twin that does not hold it"
            )
        return ""


@dataclass(frozen=True)
class Rehearsal:
    """All rehearsals of a result: the figures, the sentences that make it suspect, and how many
    failed."""

    times: int
    figures: Sequence[FigureStatistics]
    reasons: tuple[str, ...]
    failed: int
    statuses: Mapping[str, int]
    truth: str
    causes: Sequence[Named] = ()
    colour: Sequence[Mapping[str, Any]] = ()

    @property
    def status(self) -> str:
        """Whether the result's errors hold."""
        return "suspect" if self.reasons else "valid"

    def table(self) -> dict[str, Any]:
        """The rehearsal as the JSON has it."""
        return {
            "times": self.times,
            "figures": [asdict(figure) for figure in self.figures],
            "failed": self.failed,
            "statuses": dict(self.statuses),
            "truth": self.truth,
            "causes": [asdict(cause) for cause in self.causes],
            "colour": [dict(component) for component in self.colour],
        }


def rehearse(
    truth: Record,
    inputs: Sequence[Measured],
    own_settings: Mapping[str, Any],
    share: Callable[[Sequence[Work]], Sequence[Rehearsed | None]] | None = None,
    identified: Sequence[Identified] = (),
    *,
    times: Annotated[int, Field(ge=2, le=100_000, description="rehearsals")] = 30,
    samples_a_period: Annotated[
        float | None,
        Field(
            gt=2.2,
            description=(
                "samples a period of the simulated recordings; none: as the measured ones, or 8"
            ),
        ),
    ] = None,
    most_samples: Annotated[
        float, Field(gt=0, description="pairs of samples that all rehearsals together may simulate")
    ] = 2e9,
    most_samples_a_run: Annotated[
        float, Field(gt=0, description="pairs of samples that one run may hold in memory")
    ] = 1e8,
    seed: Annotated[int, Field(ge=0, description="seed of the noise")] = 0,
) -> Rehearsal:
    """Rehearse a result `times` times; `share` does the work (in other processes, for instance),
    one after the other by default.

    own_settings: those of the stage that gave the result; identified: the resonator files that
    tables of `--model physical` were made of, identified again too. HrgError: no twin can be made, too much
    work, too few rehearsals succeeded.
    """
    if not inputs:
        raise HrgError(
            "there is no wave to rehearse with; name the wave files the result was made of"
        )
    twin = (
        twin_of_diagnosis(truth, inputs, own_settings, samples_a_period)
        if isinstance(truth, Diagnosis)
        else twin_of(truth, inputs, own_settings, samples_a_period, identified)
    )
    _affordable(twin, times, most_samples, most_samples_a_run)
    twin = match_noise(twin, inputs, seed)
    twin = replace(
        twin,
        resonators=[
            match_noise(beside, one.inputs, seed)
            for beside, one in zip(twin.resonators, identified, strict=True)
        ],
    )
    works = [(twin, seed * STREAMS + k) for k in range(times)]
    done = share(works) if share is not None else [rehearse_once(work) for work in works]
    return summarise(
        twin, [Rehearsed(reason="its process was killed") if one is None else one for one in done]
    )


def _affordable(twin: Twin, times: int, most: float, most_a_run: float) -> None:
    """HrgError: more samples than the limits, and what would fit."""
    if twin.longest > most_a_run:
        raise HrgError(
            f"its longest run has {twin.longest:.3g} pairs of samples, {most_a_run:.3g} fit into"
            " memory; sample the twin more coarsely with --set samples_a_period=4, or raise"
            " most_samples_a_run"
        )
    if times * twin.samples > most:
        fit = int(most // twin.samples)
        advice = (
            f"give --times {fit}"
            if fit >= FEWEST
            else "sample the twin more coarsely with --set samples_a_period=4"
        )
        raise HrgError(
            f"{times} rehearsals of {twin.samples:.3g} pairs of samples are more than {most:.3g};"
            f" {advice}, or raise --set most_samples"
        )


def match_noise(twin: Twin, inputs: Sequence[Measured], seed: int) -> Twin:
    """The twin, its samples' noise scaled so that its windows state the noise that the measured
    ones do.

    How a window's noise follows from a sample's depends on what else its fit holds; trials of each
    run tell, several of a short one.
    """
    runs = []
    for number, (run, measured) in enumerate(zip(twin.config["run"], inputs, strict=True)):
        noise = run["readout"]["noise"]
        trials = int(np.clip(np.ceil(TRIAL_SAMPLES / twin.samples_of(run)), 1, MOST_TRIALS))
        found = float(
            np.mean(
                [
                    np.nanmedian(twin_wave(twin, number, seed * STREAMS + k).signal_std)
                    for k in range(trials)
                ]
            )
        )
        wanted = float(np.nanmedian(measured.wave.signal_std))
        ratio = wanted / found if noise > 0 and found > 0 and wanted > 0 else 1.0
        runs.append(
            {**run, "readout": {**run["readout"], "noise": noise * float(np.clip(ratio, *MATCHED))}}
        )
    return replace(twin, config={**twin.config, "run": runs})


def rehearse_once(work: Work) -> Rehearsed:
    """One rehearsal: the twin's runs through raw samples, demodulate, estimate and the result's own
    stage."""
    twin, seed = work
    try:
        record = made_again(twin, seed)
    except HrgError as error:
        return Rehearsed(reason=str(error))
    return Rehearsed(
        _figures(record, twin),
        record.status,
        record.status_reasons[0] if record.status_reasons else "",
        tuple(causes(record)) if isinstance(record, Diagnosis) else (),
    )


def made_again(twin: Twin, seed: int) -> Record:
    """The result of a twin's own stage on its runs, and on the resonator files that were made
    again."""
    waves = [twin_wave(twin, number, seed) for number in range(len(twin.runs))]
    stage = getattr(import_module(f"hrg_cli.stages.{twin.stage}"), twin.stage)
    beside = [
        made_again(one, seed + number * STREAMS**2)
        for number, one in enumerate(twin.resonators, start=1)
    ]
    given = {"resonator": beside} if beside else {}
    record: Record = stage(waves, **given, **checking.checked(stage, twin.settings))
    return record


def twin_wave(twin: Twin, number: int, seed: int) -> Wave:
    """A run of the twin as the chain sees it."""
    run, config = twin.runs[number], dict(twin.config)
    extra = effects_of(twin, number, seed)
    model: Literal["fast", "slow"] = "slow" if any(e.slow is not no_term for e in extra) else "fast"
    config["effects"] = {**config.get("effects", {}), **{effect.name: {} for effect in extra}}
    recording = collect(simulate(config, extra, model=model, run=run.name, seed=seed))
    periods = collect(demodulate(recording, **checking.checked(demodulate, run.demodulate)))
    wave = collect(estimate(periods, **checking.checked(estimate, run.estimate)))
    return wave.replace(**run.carried, **dict.fromkeys(run.missing))


def _figures(record: Record, twin: Twin) -> dict[str, RehearsedFigure]:
    """Every figure of a rehearsal's result that has an error, beside the truth."""
    truth = twin.truth
    if isinstance(record, Diagnosis) and isinstance(truth, Diagnosis):
        return _sizes(record, truth, twin)
    if isinstance(record, Resonator) and isinstance(truth, Resonator):
        return _parameters(record, truth)
    assert isinstance(record, Calibration) and isinstance(truth, Calibration)
    return _coefficients(record, truth)


def _parameters(record: Resonator, truth: Resonator) -> dict[str, RehearsedFigure]:
    true, period = truth.parameters(), np.pi / truth.mode_number
    found = {
        name: RehearsedFigure(
            value, std, true[name][0], period if name.endswith("axis_rad") else 0.0
        )
        for name, (value, std, _) in record.parameters().items()
        if name in true and np.isfinite(std) and std > 0
    }
    for size, axis, components in SPLITS:
        if size in true and axis in true and not true[size][0] >= CLEAR * true[size][1]:
            found.pop(size, None)
            found.pop(axis, None)
            vector = true[size][0] * np.exp(2j * truth.mode_number * true[axis][0])
            seen = json.loads(record.details).get("split_components", {})
            found |= {
                name: RehearsedFigure(seen[name]["value"], seen[name]["std"], put_in)
                for name, put_in in zip(components, (vector.real, vector.imag), strict=True)
                if name in seen and seen[name]["std"] > 0
            }
    rate, true_rate = (json.loads(r.details).get("rate_rad_s") for r in (record, truth))
    if rate and true_rate and rate["std"] > 0:
        found["rate_rad_s"] = RehearsedFigure(rate["value"], rate["std"], true_rate["value"])
    return found


def _sizes(record: Diagnosis, truth: Diagnosis, twin: Twin) -> dict[str, RehearsedFigure]:
    """The named causes' parameters, and the resonator beside them."""
    found: dict[str, RehearsedFigure] = {}
    named = causes(record)
    for name, (true, _) in causes_held(twin).items():
        seen = named[name][0] if name in named else {}
        sign = same_sign(name, seen, true)
        for key, (value, std) in seen.items():
            if key in true:
                found[f"{name} {key}"] = RehearsedFigure(sign * value, std, true[key][0])
    period = np.pi / int(json.loads(truth.report).get("mode_number", 2))
    beside = base_values(truth)
    lost = {
        name
        for size, axis, _ in SPLITS
        if size in beside and not beside[size][0] >= CLEAR * beside[size][1]
        for name in (size, axis)
    }
    for name, (value, std) in base_values(record).items():
        if name in beside and name not in lost and np.isfinite(std) and std > 0:
            axis = period if name.endswith("axis_rad") else 0.0
            found[name] = RehearsedFigure(value, std, beside[name][0], axis)
    return found


def _named(twin: Twin, good: Sequence[Rehearsed]) -> list[Named]:
    """How often each cause was named: those of the truth (or one that cannot be told from it), then
    any other."""
    if not isinstance(twin.truth, Diagnosis):
        return []
    true = causes_held(twin)
    alike = {name: {name} | rivals for name, (_, rivals) in true.items()}
    known = set().union(*alike.values()) if alike else set()
    # what the file names and the twin cannot hold is neither expected of it nor strange to it
    known |= set(causes(twin.truth))
    out = [
        Named(name, True, sum(bool(own & set(one.named)) for one in good), len(good))
        for name, own in alike.items()
    ]
    others = sorted({name for one in good for name in one.named} - known)
    return out + [
        Named(name, False, sum(name in one.named for one in good), len(good)) for name in others
    ]


def _coefficients(record: Calibration, truth: Calibration) -> dict[str, RehearsedFigure]:
    """Fourier coefficients of both tables at the rehearsal's nodes; the truth's tables are read
    there."""
    found = {}
    for kind in ("drift_harmonics", "scale_factor_harmonics"):
        values, std = np.asarray(getattr(record, kind)), np.asarray(getattr(record, f"{kind}_std"))
        true = coefficients_at(
            np.asarray(record.node, float),
            np.asarray(truth.node, float),
            np.asarray(getattr(truth, kind)),
            truth.interpolation,
        )
        for node, x in enumerate(record.node):
            for k in range(min(values.shape[1], true.shape[1])):
                if np.isfinite(std[node, k]) and std[node, k] > 0:
                    name = f"{kind.removesuffix('_harmonics')} {_harmonic(k)} at {x:.4g} °C"
                    found[name] = RehearsedFigure(
                        float(values[node, k]), float(std[node, k]), float(true[node, k])
                    )
    return found


def _harmonic(k: int) -> str:
    return "constant" if k == 0 else f"{'cos' if k % 2 else 'sin'} {(k + 1) // 2}·2mθ"


def summarise(twin: Twin, done: Sequence[Rehearsed]) -> Rehearsal:
    """The rehearsals' statistics and verdict. HrgError: fewer than `FEWEST` of them gave a
    result."""
    good = [one for one in done if one.status != "failed"]
    failed = [one for one in done if one.status == "failed"]
    if len(good) < FEWEST:
        raise HrgError(
            f"{len(failed)} of {len(done)} rehearsals failed; the first: {failed[0].reason}"
        )
    names = [
        name
        for name in dict.fromkeys(name for one in good for name in one.figures)
        if _moves([one.figures[name].value for one in good if name in one.figures])
    ]
    t = {
        name: np.array([one.figures[name].t() for one in good if name in one.figures])
        for name in names
    }
    figures = [figure(name, values, len(names)) for name, values in t.items()]
    named = _named(twin, good)
    reasons = [sentence for sentence in (f.sentence() for f in figures) if sentence]
    reasons += [s for s in (cause.sentence(len(named)) for cause in named) if s]
    if len(failed) > FAILING * len(done):
        reasons.append(
            f"{PREFIX}{len(failed)} of {len(done)} simulated twins gave no result; the first:"
            f" {failed[0].reason}"
        )
    refused = sum(one.status == "refused" for one in good)
    if refused > FAILING * len(done):
        first = next(one.reason for one in good if one.status == "refused")
        reasons.append(
            f"{PREFIX}{refused} of {len(done)} results of simulated twins were refused; the first:"
            f" {first}"
        )
    statuses = {
        status: sum(one.status == status for one in good)
        for status in ("valid", "suspect", "refused")
    }
    what = {
        Resonator: "the file's parameters",
        Calibration: "the file's tables",
        Diagnosis: "the file's extended model",
    }[type(twin.truth)]
    colour = twin_colour.describe_colour([run.colour for run in twin.runs])
    return Rehearsal(len(done), figures, tuple(reasons), len(failed), statuses, what, named, colour)


def _moves(values: Sequence[float]) -> bool:
    """Whether a figure was estimated at all: what a model holds comes out the same every time."""
    return len(values) >= FEWEST and float(np.ptp(values)) > 0


def figure(name: str, t: Array, figures: int = 1) -> FigureStatistics:
    """Statistics of the errors t (n,) in σ, and limits that chance exceeds in one of `figures`
    right figures with `CHANCE` only.

    Σt² of n Gaussian errors is χ² of n, their mean has the standard deviation 1/√n.
    """
    from scipy.special import chdtri, ndtri

    n, tail = len(t), CHANCE / 3 / figures  # too far to one side, too wide, too narrow
    return FigureStatistics(
        name,
        float(np.mean(t)),
        float(np.sqrt(np.mean(t**2))),
        float(np.mean(np.abs(t) < WITHIN_68)),
        float(np.mean(np.abs(t) < WITHIN_95)),
        n,
        max(LARGEST_BIAS, float(-ndtri(tail / 2) / np.sqrt(n))),
        max(LARGEST_RATIO, float(np.sqrt(chdtri(n, tail) / n))),
        min(1 / LARGEST_RATIO, float(np.sqrt(chdtri(n, 1 - tail) / n))),
    )


def with_verdict(record: Record, rehearsal: Rehearsal) -> Record:
    """The record with the rehearsal's verdict in its status and its figures in its details; an
    earlier rehearsal's are replaced."""
    others = tuple(reason for reason in record.status_reasons if not reason.startswith(PREFIX))
    status = (
        "valid"
        if record.status == "suspect" and record.status_reasons and not others
        else record.status
    )
    place = "report" if isinstance(record, Diagnosis) else "details"
    told = json.loads(getattr(record, place)) | {"rehearsal": rehearsal.table()}
    return record.replace(
        status=status,
        status_reasons=others,
        **{place: json.dumps(told, ensure_ascii=False)},
    ).judged(rehearsal.reasons)
