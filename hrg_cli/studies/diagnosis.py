"""How well diagnosis names causes: the chance of naming each effect against its size, and what it is taken for when it errs.

For every effect a programme that can see it; sizes in σ of an ideal detector that knows the effect and everything else about the runs
(Neyman–Pearson: z = size / σ of the parameter beside the base model). Data come from the fast engine through the raw samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from ..effects import EFFECTS, find
from ..effects.effect import Effect
from ..errors import UsageError
from ..records import Wave, collect
from ..stages.demodulate import demodulate
from ..stages.diagnose import diagnose, summary
from ..stages.estimate import estimate
from ..stages.simulate import run_ids, simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray
NEEDS_DRIVE = {
    "drive_feedthrough",
    "drive_gain_mismatch",
    "drive_nonorthogonality",
    "drive_rotation",
    "parasitic_force",
    "quadrature_drive_phase_error",
}
NEEDS_CYCLE = {"thermal_gradient", "thermal_hysteresis"}
NEEDS_STEPS = {"centrifugal_stiffness"}
"""Seen within a run only where its rate changes."""
LEFT_OUT = {"clock_error", "table_rate_error", "finite_quadrature_gain", "thermal_lag", "dropped_samples", "mains_tone", "saturation"}
"""Not separable from base values, seen only beside another effect, or named by the waveform."""
RATES = (0.0, 0.0, 2.0, -2.0, 0.0, 0.0)
FALSE_ALARM = 1e-3
"""Chance of a false alarm at which the ideal detector is quoted."""


def diagnosis_study(
    *,
    effects: Annotated[list[str], Field(description="effects to try; none: all that a programme can separate")] = [],  # noqa: B006
    sizes: Annotated[list[float], Field(description="sizes, in σ of an ideal detector")] = [4.0, 8.0, 16.0, 40.0],  # noqa: B006
    draws: Annotated[int, Field(ge=1, description="random devices a size")] = 2,
    controls: Annotated[int, Field(ge=0, description="clean programmes for the false alarms")] = 4,
    seed: Annotated[int, Field(ge=0, description="seed of devices and noise")] = 0,
) -> dict[str, Any]:
    """{power: {effect: {size: share named}}, ideal: {size: share}, confusion: {effect: {named: count}}, false_alarms}."""
    names = effects or [e.name for e in EFFECTS if e.name not in LEFT_OUT]
    if set(names) & LEFT_OUT:
        raise UsageError(f"{', '.join(sorted(set(names) & LEFT_OUT))}: no programme of this study separates it")
    alarms = sum(_report(_programme(seed + 1000 + k, None, ""), seed + k)["verdict"] != "adequate" for k in range(controls))
    power: dict[str, dict[str, float]] = {}
    confusion: dict[str, dict[str, int]] = {}
    for name in names:
        effect = find(name)
        unit = _unit(effect, seed)
        power[name], confusion[name] = {}, {}
        for size in sizes:
            named = 0
            for draw in range(draws):
                values = {p.name: size * unit[p.name] for p in effect.fitted()}
                values |= {p.name: 22.5 for p in effect.parameters if p.name == "reference_temperature_degc"}
                table = _programme(seed + draw, {name: values}, name)
                found = _report(table, seed + draw)["effects"]
                first = found[0]["name"] if found else "none"
                group = [first, *(found[0]["indistinguishable_from"] if found else [])]
                named += name in group[:3]
                taken = name if name in group[:3] else first
                confusion[name][taken] = confusion[name].get(taken, 0) + 1
            power[name][f"{size:g}"] = named / draws
    return {
        "power": power,
        "ideal": {f"{size:g}": _ideal(size) for size in sizes},
        "confusion": confusion,
        "false_alarms": {"alarms": alarms, "programmes": controls},
    }


def _ideal(size: float) -> float:
    """Chance that a detector of one known cause at `FALSE_ALARM` sees it."""
    from scipy.special import ndtr, ndtri

    return float(ndtr(size + ndtri(FALSE_ALARM / 2)))


def _unit(effect: Effect, seed: int) -> dict[str, float]:
    """One σ of the effect's parameters in its clean programme; with several, the typical shape scaled to joint one σ by the largest σ."""
    report = _report(_programme(seed, None, effect.name), seed)
    row = next(t for t in report["tested"] if t["name"] == effect.name)
    std = [s for s in row["std"] if s is not None]
    if not std:
        raise UsageError(f"{effect.name}: the study's programme cannot show it")
    return {p.name: s / np.sqrt(len(row["std"])) if s is not None else 0.0 for p, s in zip(effect.fitted(), row["std"], strict=True)}


def _programme(seed: int, effects: Mapping[str, Any] | None, shown: str) -> dict[str, Any]:
    """Six runs of two seconds of a random device: several angles, two amplitudes, both signs of rotation, temperature ramps.

    Drives, cycles of temperature or steps of the rate where the effect `shown` needs them to be seen.
    """
    random = np.random.default_rng([seed, 77])
    device = {
        "frequency_hz": random.uniform(4500, 5500),
        "damping_rate_1_s": random.uniform(0.25, 0.4),
        "damping_split_1_s": random.uniform(0.005, 0.02),
        "damping_axis_rad": random.uniform(0, 1.5),
        "frequency_split_rad_s": random.uniform(0.05, 0.15),
        "stiffness_axis_rad": random.uniform(0, 1.5),
        "scale_factor": random.uniform(0.5, 0.6),
    }
    runs = []
    for k, rate in enumerate(RATES):
        warm = {"kind": "ramp", "start_degc": 22.0 + k % 3, "stop_degc": 22.0 + k % 3 + (1.0, -0.8, 0.5)[k % 3]}
        if shown in NEEDS_CYCLE:
            warm = {"kind": "cycle", "low_degc": 22.0, "high_degc": 23.0, "period_s": (1.0, 1.5, 2.0)[k % 3], "shape": "sine"}
        driven = shown in NEEDS_DRIVE and k % 2 == 0
        run: dict[str, Any] = {
            "run_id": f"run{k}",
            "start": {
                "wave_angle_rad": 0.25 * k + random.uniform(0, 0.1),
                "phase_rad": random.uniform(0, 6),
                "quadrature": 0.0 if driven else random.uniform(-0.1, 0.1),
                "amplitude": (1.0, 0.5)[k % 2],
            },
            "environment": {"rate_rad_s": rate, "temperature": warm},
        }
        if shown in NEEDS_STEPS:
            run["environment"] |= {"rate": {"kind": "steps", "levels_rad_s": [1.0, -1.0, 2.0, 0.0], "dwell_s": 0.45}, "rate_rad_s": 0.0}
        if driven:
            run["control"] = {"mode": "forced", "quadrature_loop": "finite"}
        runs.append(run)
    return {
        "device": device,
        "recording": {"sample_rate_hz": 20011.0, "duration_s": 2.0},
        "readout": {"noise": 3e-4},
        "effects": dict(effects or {}),
        "run": runs,
    }


def _report(table: dict[str, Any], seed: int) -> dict[str, Any]:
    waves: list[Wave] = []
    for run in run_ids(table):
        periods = collect(demodulate(collect(simulate(table, run=run, seed=seed)), periods_per_window=40.0))
        waves.append(collect(estimate(periods)))
    return summary(diagnose(waves))


def table(study: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """The power table: a row an effect, the ideal detector last."""
    sizes = list(study["ideal"])
    rows = [(name, *(f"{row[s]:.2f}" for s in sizes)) for name, row in study["power"].items()]
    return ("named at size/σ", *sizes), [*rows, ("ideal detector", *(f"{study['ideal'][s]:.2f}" for s in sizes))]


def figure(study: dict[str, Any]) -> Figure:
    """Power against size on the left, the confusion matrix on the right."""
    from matplotlib.figure import Figure

    names = list(study["confusion"])
    named = list(dict.fromkeys([*names, *(k for row in study["confusion"].values() for k in row)]))
    drawing = Figure(figsize=(14, 7), layout="constrained")
    left, right = drawing.subplots(1, 2, width_ratios=(1, 1.4))
    sizes = [float(s) for s in study["ideal"]]
    for row in study["power"].values():
        left.plot(sizes, list(row.values()), color="0.6", marker=".")
    left.plot(sizes, list(study["ideal"].values()), color="C1", label="ideal detector")
    left.set(xscale="log", xlabel="size over σ of an ideal detector", ylabel="chance of being named", ylim=(-0.02, 1.02))
    left.set_xticks(sizes, [f"{size:g}" for size in sizes])
    left.minorticks_off()
    left.legend()
    counts = np.array([[study["confusion"][a].get(b, 0) for b in named] for a in names], float)
    image = right.imshow(counts / np.maximum(counts.sum(1, keepdims=True), 1), cmap="Greys", vmin=0, vmax=1, aspect="auto")
    right.set_xticks(range(len(named)), named, rotation=90)
    right.set_yticks(range(len(names)), names)
    right.set(xlabel="named", ylabel="hidden")
    drawing.colorbar(image, ax=right, label="share")
    return drawing
