"""Diagnosis, the extended model: the fitted resonator, the runs and the effects as a simulation
file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....effects import EFFECTS, dropped_samples, find, mains_tone
from ....effects.effect import OF_EVERY_RUN, RUN
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.layout import FREQUENCY, OWN
from ....fitting.envelopes.coordinates import to_parameters
from ....physics.resonator import OF_GENERATOR
from ....records import Wave
from ....settings import to_toml
from ..samples.tones import Tone, channel_parts
from .run import Way, run_table

Array = np.ndarray
TONE, LOSS = mains_tone.EFFECT.name, dropped_samples.EFFECT.name
"""The pages by which the file makes a tone, and loses samples."""
SAMPLES_A_PERIOD = 11 - 5**0.5
"""Whole multiples of it stay as far from even numbers as can be (a golden section), so that no odd
harmonic below the 113th, which a read-out's defect makes, is folded onto the oscillation: with 8.5
the 33rd and the 35th of a converter's were."""
FOR_HARMONICS = 19 - 5**0.5
"""The same where such a defect is in the file: what few samples a window catch of a converter's step
scatters with the root of the sampling."""


def simulation_file(
    fit: ExtendedFit,
    waves: Sequence[Wave],
    pieces: Sequence[Wave],
    origin: Sequence[int],
    effects_named: Sequence[dict[str, Any]],
    change: Array | None,
    way: Way,
    tone: Tone | None = None,
) -> str:
    """TOML that `hrg simulate` runs: [device], [effects.NAME], and a [[run]] a run with its start,
    rate, temperature and length.

    The fit's runs are `pieces` of the waves (`origin`: of which); samples lost between two pieces
    become the run's own effect. change (R, 5): of the runs' start states and frequency offsets, by
    what a simulation of the file missed the fit. tone: one near the resonance, at its true size;
    each run its own where its phase is not the same in all.
    """
    values, _ = to_parameters(fit.point.p, fit.series.mode_number)
    change = np.zeros((len(fit.series.names), OWN)) if change is None else change
    frequency = fit.frequency_hz + change[:, FREQUENCY] / (2 * np.pi)
    device: dict[str, Any] = {
        "frequency_hz": float(np.median(frequency)),
        **{name: float(v) for name, v in zip(OF_GENERATOR, values, strict=True)},
        "mode_number": fit.series.mode_number,
    }
    if any(effect.follows_temperature for effect, _ in fit.point.active):
        device["temperature"] = {
            "reference_degc": float(
                np.round(np.mean(fit.series.temperature_degc[fit.series.weight > 0]), 3)
            )
        }
    known = (*(effect for effect, _ in fit.point.active), *EFFECTS)
    named = [
        *(effect for effect, _ in fit.point.active),
        *(find(e["name"], known) for e in effects_named),
    ]
    bent = any(effect.makes_harmonics for effect in named)
    samples_a_period = FOR_HARMONICS if bent else SAMPLES_A_PERIOD
    table: dict[str, Any] = {
        "device": device,
        "recording": {
            "sample_rate_hz": float(np.ceil(samples_a_period * frequency.max())),
            "duration_s": 1.0,
        },
    }
    if waves[0].gyro_id:
        table["recording"]["gyro_id"] = waves[0].gyro_id
    lost = {
        run: {k: v["value"] for k, v in e["parameters"].items()}
        for e in reversed(effects_named)
        if find(e["name"], known).whole_samples
        for run in e["runs"]
    }
    far_tone = [
        {k: v["value"] for k, v in e["parameters"].items()}
        for e in effects_named
        if find(e["name"], known).makes_tone
    ][:1]
    effects = {
        effect.name: {k: float(v) for k, v in given.items()} for effect, given in fit.point.active
    }
    of_one = {
        name: int(given.pop(RUN))
        for name, given in effects.items()
        if given.get(RUN, OF_EVERY_RUN) != OF_EVERY_RUN
    }
    struck = {name: effects.pop(name) for name in of_one}
    if tone is not None and tone.common:
        effects[TONE] = _of_file(tone, tone.mean)
    elif tone is None and far_tone:
        effects[TONE] = far_tone[0]
    for e in effects_named:
        # a cubic whose sign the spectrum does not tell is a size, and no model
        if (
            e.get("view") == "waveform"
            and find(e["name"], known).makes_harmonics
            and "sign" not in e
        ):
            effects[e["name"]] = {k: v["value"] for k, v in e["parameters"].items()}
    if effects:
        table["effects"] = effects
    names: set[str] = set()
    table["run"] = []
    for number, wave in enumerate(waves):
        own = [k for k, o in enumerate(origin) if o == number]
        if not own:
            continue
        run: dict[str, Any] = {
            "run_id": _unused(fit.series.names[own[0]], names),
            "device": {"frequency_hz": float(frequency[own[0]])},
        }
        loss = lost.get(wave.run_id, {"lost_s": 0.0, "time_s": np.inf})
        loss_s = loss["lost_s"]
        before_s = loss_s if fit.series.time_s[own[0], 0] > loss["time_s"] else 0.0
        sampling = _sampling(table["recording"]["sample_rate_hz"], loss_s)
        run |= run_table(fit, own, wave, pieces[own[0]], sampling, change[own[0]], way, before_s)
        own_effects = {
            effect.name: effects[effect.name] | {p.name: -values[p.name] for p in effect.fitted()}
            for effect, values in fit.point.active
            if effect.coherent and effect.name in effects and _turned(fit, own[0], run)
        }
        own_effects |= {name: given for name, given in struck.items() if of_one[name] in own}
        if loss_s > 0:  # repeated samples have no effect in the engine
            own_effects[LOSS] = lost[wave.run_id]
            # the run lasted longer than its samples tell
            length_s = float(wave.time_s[-1] + wave.window_s / 2) + loss_s
            run["recording"] = {"duration_s": length_s, "sample_rate_hz": sampling}
        if tone is not None and not tone.common:
            own_effects[TONE] = _of_file(tone, tone.vector[own[0]])
        if own_effects:
            run["effects"] = own_effects
        table["run"].append(run)
    return to_toml(table)


def _of_file(tone: Tone, vector: Array) -> dict[str, float]:
    return {**channel_parts(vector), "frequency_hz": tone.frequency_hz}


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
