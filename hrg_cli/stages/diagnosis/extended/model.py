"""Diagnosis, the extended model: the fitted resonator, the runs and the effects as a simulation
file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....effects import EFFECTS, dropped_samples, find, mains_tone
from ....effects.effect import OF_EVERY_RUN, RUN, Effect
from ....fitting.causes.design_columns import FREQUENCY, OWN
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import to_parameters
from ....physics.resonator import OF_GENERATOR
from ....records import Wave
from ....settings import to_toml
from ..samples.tone import Tone, split_channels
from .written_run import Way, run_table

Array = np.ndarray
TONE, LOSS = mains_tone.EFFECT.name, dropped_samples.EFFECT.name
"""The pages by which the file makes a tone, and loses samples."""
SAMPLES_A_PERIOD = 11 - 5**0.5
"""Whole multiples of it stay as far from even numbers as can be (a golden section), so that no odd
harmonic below the 113th, which a read-out's defect makes, is folded onto the oscillation: with 8.5
the 33rd and the 35th of a converter's were."""
FOR_HARMONICS = 19 - 5**0.5
"""The same where such a defect is in the file: what few samples a window catch of a converter's
step scatters with the root of the sampling."""


def compose_simulation_file(
    fit: ExtendedFit,
    waves: Sequence[Wave],
    pieces: Sequence[Wave],
    origin: Sequence[int],
    effects_named: Sequence[dict[str, Any]],
    change: Array | None,
    way: Way,
    tone: Tone | None = None,
) -> str:
    """The simulation file of an extended model: [device], [effects.NAME], and a [[run]] a run with
    its start, rate, temperature and length.

    Parameters
    ----------
    fit
        Of the extended model.
    waves
        Of the runs.
    pieces
        Of the waves, which the fit's runs are; samples lost between two of them become the run's
        own effect.
    origin
        The wave of each piece.
    effects_named
        Entries of the report.
    change
        (R, 5): of the runs' start states and frequency offsets, by what a simulation of the file
        missed the fit; None: nothing.
    way
        How the file is written where there is more than one.
    tone
        One near the resonance, at its true size; each run its own where its phase is not the same
        in all.

    Returns
    -------
    str
        TOML that `hrg simulate` runs.

    Examples
    --------
    >>> from hrg_cli.settings import parse_toml
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.extended.model import compose_simulation_file
    >>> from hrg_cli.stages.diagnosis.extended.written_run import Way
    >>> waves = draw_waves()
    >>> text = compose_simulation_file(draw_fit(), waves, waves, [0, 1, 2], [], None, Way())
    >>> model = parse_toml(text)
    >>> len(model["run"]), round(model["device"]["scale_factor"], 2)
    (3, 0.55)
    """
    change = np.zeros((len(fit.series.names), OWN)) if change is None else change
    frequency = fit.frequency_hz + change[:, FREQUENCY] / (2 * np.pi)
    known = (*(effect for effect, _ in fit.point.active), *EFFECTS)
    sampling_hz = _sampling_of(frequency, fit, [find(e["name"], known) for e in effects_named])
    lost = _losses(effects_named, known)
    common, of_one_run = _fitted_effects(fit)
    common |= _tone_of_all(tone, effects_named, known) | _curves(effects_named, known)

    table: dict[str, Any] = {
        "device": _device(fit, frequency, way),
        "recording": {"sample_rate_hz": sampling_hz, "duration_s": 1.0},
    }
    if waves[0].gyro_id:
        table["recording"]["gyro_id"] = waves[0].gyro_id
    if common:
        table["effects"] = common
    names: set[str] = set()
    table["run"] = []
    for number, wave in enumerate(waves):
        own = [k for k, o in enumerate(origin) if o == number]
        if not own:
            continue
        first = own[0]
        loss = lost.get(wave.run_id, {"lost_s": 0.0, "time_s": np.inf})
        loss_s = loss["lost_s"]
        before_s = loss_s if fit.series.time_s[first, 0] > loss["time_s"] else 0.0
        sampling = _sampling(sampling_hz, loss_s)
        run: dict[str, Any] = {
            "run_id": _unused(fit.series.names[first], names),
            "device": {"frequency_hz": float(frequency[first])},
        }
        run |= run_table(fit, own, wave, pieces[first], sampling, change[first], way, before_s)
        effects = _turned_effects(fit, first, run, common)
        effects |= {name: given for name, (one, given) in of_one_run.items() if one in own}
        if loss_s > 0:  # repeated samples have no effect in the engine
            effects[LOSS] = loss
            # the run lasted longer than its samples tell
            length_s = float(wave.time_s[-1] + wave.window_s / 2) + loss_s
            run["recording"] |= {"duration_s": length_s, "sample_rate_hz": sampling}
        if tone is not None and not tone.common:
            effects[TONE] = _of_file(tone, tone.vector[first])
        if effects:
            run["effects"] = effects
        table["run"].append(run)
    return to_toml(table)


def _device(fit: ExtendedFit, frequency_hz: Array, way: Way) -> dict[str, Any]:
    """[device]: the generator's parameters, at the runs' median frequency."""
    values, _ = to_parameters(fit.point.p, fit.series.mode_number)
    device: dict[str, Any] = {
        "frequency_hz": float(np.median(frequency_hz)),
        **{name: float(v) for name, v in zip(OF_GENERATOR, values, strict=True)},
        "mode_number": fit.series.mode_number,
    }
    if way.averaged:
        device["equation"] = "averaged"
    if any(effect.follows_temperature for effect, _ in fit.point.active):
        warm = fit.series.temperature_degc[fit.series.weight > 0]
        device["temperature"] = {"reference_degc": float(np.round(np.mean(warm), 3))}
    return device


def _sampling_of(frequency_hz: Array, fit: ExtendedFit, seen: Sequence[Effect]) -> float:
    """The sampling that the highest frequency asks for, closer where a read-out bends the waves."""
    named = [*(effect for effect, _ in fit.point.active), *seen]
    bent = any(effect.makes_harmonics for effect in named)
    return float(np.ceil((FOR_HARMONICS if bent else SAMPLES_A_PERIOD) * frequency_hz.max()))


def _fitted_effects(
    fit: ExtendedFit,
) -> tuple[dict[str, dict[str, float]], dict[str, tuple[int, dict[str, float]]]]:
    """The fitted effects of all runs by name, and those of one run with that run."""
    common: dict[str, dict[str, float]] = {}
    of_one: dict[str, tuple[int, dict[str, float]]] = {}
    for effect, values in fit.point.active:
        given = {name: float(v) for name, v in values.items()}
        if given.get(RUN, OF_EVERY_RUN) == OF_EVERY_RUN:
            common[effect.name] = given
        else:
            of_one[effect.name] = int(given.pop(RUN)), given
    return common, of_one


def _values(entry: dict[str, Any]) -> dict[str, float]:
    return {name: one["value"] for name, one in entry["parameters"].items()}


def _losses(
    named: Sequence[dict[str, Any]], known: tuple[Effect, ...]
) -> dict[str, dict[str, float]]:
    """By run the samples that it lost; of several the first."""
    return {
        run: _values(entry)
        for entry in reversed(named)
        if find(entry["name"], known).whole_samples
        for run in entry["runs"]
    }


def _tone_of_all(
    tone: Tone | None, named: Sequence[dict[str, Any]], known: tuple[Effect, ...]
) -> dict[str, dict[str, float]]:
    """The tone that all runs have: the near one where its phase is the same in all, the first far
    one where none is near."""
    if tone is not None:
        return {TONE: _of_file(tone, tone.mean)} if tone.common else {}
    far = [_values(entry) for entry in named if find(entry["name"], known).makes_tone]
    return {TONE: far[0]} if far else {}


def _curves(
    named: Sequence[dict[str, Any]], known: tuple[Effect, ...]
) -> dict[str, dict[str, float]]:
    """Read-out's curves that the waveform shows. A cubic whose sign the spectrum does not tell is a
    size, and no model."""
    return {
        entry["name"]: _values(entry)
        for entry in named
        if entry.get("view") == "waveform"
        and find(entry["name"], known).makes_harmonics
        and "sign" not in entry
    }


def _turned_effects(
    fit: ExtendedFit, k: int, run: dict[str, Any], common: dict[str, dict[str, float]]
) -> dict[str, dict[str, float]]:
    """The coherent effects as a run has them whose phase was turned by π."""
    if not _turned(fit, k, run):
        return {}
    return {
        effect.name: common[effect.name] | {p.name: -values[p.name] for p in effect.fitted()}
        for effect, values in fit.point.active
        if effect.coherent and effect.name in common
    }


def _of_file(tone: Tone, vector: Array) -> dict[str, float]:
    return {**split_channels(vector), "frequency_hz": tone.frequency_hz}


def _sampling(least_hz: float, loss_s: float) -> float:
    """The sampling of a run: the least rate wanted, or the next at which what was lost is a whole
    number of samples, since a simulation loses no others."""
    return float(np.ceil(least_hz * loss_s - 1e-6) / loss_s) if loss_s > 0 else least_hz


def _turned(fit: ExtendedFit, k: int, run: dict[str, Any]) -> bool:
    """Whether the run's phase was turned by π against that of its start in the file, so that
    coherent vectors change sign."""
    return bool(np.cos(fit.series.phase_rad[k, 0] - run["start"]["phase_rad"]) < 0)


def _unused(name: str, names: set[str]) -> str:
    """A run's name fit for a file, and for no other run's."""
    name = "".join(c if c not in "/\\ \t\n" else "_" for c in name)
    while name in names:
        name += "_"
    names.add(name)
    return name
