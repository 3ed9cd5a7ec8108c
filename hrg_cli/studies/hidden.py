"""Programmes with one hidden effect of a stated size, for the diagnosis study: random devices, what
each effect needs to be seen, sizes.

A size is in σ of an ideal detector: one that knows the effect and its direction, and the base model
as well as these runs show it, z = |s⊥ d| with s⊥ the effect's sensitivities over σ beside the base
model's Jacobian, d the parameters' values.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..effects import find
from ..effects.effect import INSTANT, OF_EVERY_RUN, RUN, Effect
from ..errors import UsageError
from ..fitting.causes import extended_fit, fit_point, scales, whitened_rows
from ..fitting.causes.extended_fit import ExtendedFit
from ..fitting.causes.fit_point import build_state
from ..fitting.causes.wave_frame import to_reals
from ..records import Wave, collect
from ..stages.demodulate import demodulate
from ..stages.diagnosis.base import joint_fit
from ..stages.diagnosis.base.data import prepare
from ..stages.estimate import estimate
from ..stages.simulate import list_run_ids, simulate

Array = np.ndarray
SAMPLE_RATE_HZ, DURATION_S = 20011.0, 2.0
RATES = (0.0, 0.0, 2.0, -2.0, 0.0, 0.0)
MIDDLE = (0.2, 0.8)
"""Part of a run in which something happens at an instant."""
REFERENCE_DEGC = 22.5
BESIDE_IT = {
    "thermal_frequency": {"relative_1_k": 3e-7, "reference_temperature_degc": REFERENCE_DEGC}
}
"""Sizes of the effects that others need beside them to do anything."""
ALL_ROWS = 1500
FAINT = 1e-6
"""Independence beside the model below which a parameter is rounding."""


@dataclass(frozen=True)
class Hiding:
    """An effect on a device: the tables of its programme without it, values of one σ, and what it
    needs to be seen.

    `values(size)` are the effect's parameters at a size in σ.
    """

    effect: Effect
    table: Mapping[str, Any]
    neutral: Mapping[str, float]
    direction: Mapping[str, float]
    fit: ExtendedFit
    scale_factor: float | None

    def choose_values(self, size: float) -> dict[str, float]:
        """The effect's parameters at a size; a clipping level has no slope, its size is sought."""
        if self.effect.sets_in:
            return {
                **self.neutral,
                **find_onset(self.effect, self.neutral, self.fit, size, _beside_base),
            }
        return {
            name: value + size * self.direction.get(name, 0.0)
            for name, value in self.neutral.items()
        }

    def measure(self, size: float | None, seed: int) -> list[Wave]:
        """Waves of the programme with the effect at a size, or without it."""
        table = copy.deepcopy(dict(self.table)) | {"effects": list_effects_beside(self.effect)}
        if size is not None:
            values = self.choose_values(size)
            run = values.pop(RUN, OF_EVERY_RUN)
            own = table if run == OF_EVERY_RUN else table["run"][int(run)]
            own.setdefault("effects", {})[self.effect.name] = values
        return make_waves(table, seed, self.effect.name)


def _size_beside_model(change: Array, fit: ExtendedFit) -> float:
    """Size in σ of a change of the envelopes that the base model cannot take up."""
    rows = whitened_rows.flatten_rows(fit.series, to_reals(fit.series.whiten(change)))
    return float(np.linalg.norm(_project_base(rows, fit)))


def hide(name: str, random: np.random.Generator, noise: float) -> Hiding:
    """A random device, start and direction for an effect that is to be found.

    Parameters
    ----------
    name
        Of the effect.
    random
        Of the draw.
    noise
        Of a sample.

    Returns
    -------
    Hiding
        With the sizes in σ of an ideal detector.

    Raises
    ------
    UsageError
        Its programme does not show it.

    Examples
    --------
    An effect of size 0 does nothing:

    >>> import numpy as np
    >>> from hrg_cli.studies.hidden import hide
    >>> hide("gain_mismatch", np.random.default_rng(1), 3e-4).choose_values(0.0)
    {'gain': 0.0}
    """
    effect = find(name)
    table = draw_programme(random, name, noise)
    others = list_effects_beside(effect)
    seed = int(random.integers(2**31))
    K = table["device"]["scale_factor"] if "known scale factor" in effect.shown_by else None
    fit = fit_base(make_waves({**table, "effects": others}, seed, name), K, others)
    neutral = effect.values()
    if "reference_temperature_degc" in neutral:
        neutral["reference_temperature_degc"] = REFERENCE_DEGC
    if effect.whole_samples:
        lost = {
            "lost_s": 1 / SAMPLE_RATE_HZ,
            INSTANT: float(random.uniform(*MIDDLE)) * DURATION_S,
        }
        # one sample at "size 1", whatever that is in σ
        return Hiding(effect, table, neutral, lost, fit, K)
    if effect.of_one_run:
        neutral[RUN] = float(random.integers(len(RATES)))
        neutral[INSTANT] = float(random.uniform(*MIDDLE)) * DURATION_S
    if effect.seen_in == "waveform":
        away = float(random.choice([-1, 1]) * random.uniform(5, 50))
        neutral["frequency_hz"] = table["device"]["frequency_hz"] + away
        parts = ("c_cos", "c_sin", "s_cos", "s_sin")
        trial = {
            part: 10 * noise * float(v)
            for part, v in zip(parts, random.standard_normal(4), strict=True)
        }
        heard = {**table, "effects": {name: {**neutral, **trial}}}
        seen = prepare(make_waves(heard, seed, name), K, ALL_ROWS)[0].envelope - fit.series.envelope
        z = _size_beside_model(seen, fit)
        return Hiding(effect, table, neutral, {k: v / z for k, v in trial.items()}, fit, K)
    if effect.sets_in:
        return Hiding(effect, table, neutral, {}, fit, K)
    return Hiding(
        effect, table, neutral, find_direction(effect, fit, neutral, random, _beside_base), fit, K
    )


def find_direction(
    effect: Effect,
    fit: ExtendedFit,
    neutral: Mapping[str, float],
    random: np.random.Generator,
    information: Callable[[ExtendedFit, Array], Array],
) -> dict[str, float]:
    """A random direction of an effect's parameters, one σ long.

    Parameters
    ----------
    effect
        The effect.
    fit
        Of the model without it.
    neutral
        Its parameters when it does nothing.
    random
        Of the draw.
    information
        Fit and columns over σ (N, K) -> their Fisher information (K, K).

    Returns
    -------
    dict
        Parameter -> how far; those that these runs do not show stay neutral.

    Raises
    ------
    UsageError
        The runs show none of them.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.studies.hidden import _beside_base, find_direction, hide
    >>> random = np.random.default_rng(1)
    >>> fit, effect = hide("gain_mismatch", random, 3e-4).fit, find("gain_mismatch")
    >>> list(find_direction(effect, fit, effect.values(), random, _beside_base))
    ['gain']
    """
    steps = scales.list_steps(effect, fit.series)
    S = whitened_rows.find_sensitivity(fit.flow, effect, neutral, steps)
    free = information(fit, S)
    whole, size = np.sum(S**2, axis=0), np.maximum(np.diag(free), 0.0)
    shown = size > FAINT**2 * whole
    if not shown.any():
        raise UsageError(f"{effect.name}: these runs cannot show it")
    d = np.where(
        shown, random.standard_normal(len(size)) / np.where(size > 0, np.sqrt(size), 1.0), 0.0
    )
    d = np.abs(d) if effect.needs_one_sign else d
    d /= np.sqrt(d @ free @ d)
    return dict(zip(steps, map(float, d), strict=True))


def find_onset(
    effect: Effect,
    neutral: Mapping[str, float],
    fit: ExtendedFit,
    size: float,
    information: Callable[[ExtendedFit, Array], Array],
) -> dict[str, float]:
    """Value of the parameter that sets in at which an effect stands so far out of the model.

    Parameters
    ----------
    effect
        A read-out that leaves small signals alone, or clips large ones.
    neutral
        Its other parameters.
    fit
        Of the model without it.
    size
        In σ.
    information
        Fit and a column over σ (N, 1) -> its Fisher information (1, 1).

    Returns
    -------
    dict
        The one parameter, found by halving.

    Examples
    --------
    The earlier it sets in, the more is seen:

    >>> import numpy as np
    >>> from hrg_cli.effects import EFFECTS
    >>> from hrg_cli.studies.hidden import _beside_base, find_onset, hide
    >>> effect = next(one for one in EFFECTS if one.sets_in)
    >>> hiding = hide(effect.name, np.random.default_rng(1), 3e-4)
    >>> small, large = (
    ...     next(iter(find_onset(effect, hiding.neutral, hiding.fit, size, _beside_base).values()))
    ...     for size in (3.0, 30.0)
    ... )
    >>> large != small
    True
    """
    u = fit.prediction.seen
    parameter = next(p for p in effect.fitted() if p.sets_in)
    starts = [abs(start[parameter.name]) for start in effect.starts(fit.series)]
    low, high = 0.5 * min(starts), 3 * max(starts)
    for _ in range(50):
        middle = (low + high) / 2
        changed = effect.slow_readout(
            {**neutral, parameter.name: middle}, u, build_state(fit.series, fit.point)
        )
        column = whitened_rows.flatten_rows(fit.series, to_reals(fit.series.whiten(changed - u)))
        low, high = (
            (middle, high) if information(fit, column[:, None])[0, 0] < size**2 else (low, middle)
        )
    return {parameter.name: low}


def _beside_base(fit: ExtendedFit, columns: Array) -> Array:
    """Fisher information (K, K) of columns over σ (N, K) beside the base model, as free as the runs
    leave it."""
    free = _project_base(columns, fit)
    return free.T @ free


def _project_base(columns: Array, fit: ExtendedFit) -> Array:
    """Columns over σ without what the base model can do, projected twice against rounding."""
    return fit.basis.project_out(fit.basis.project_out(columns))


def list_effects_beside(effect: Effect) -> dict[str, dict[str, float]]:
    """What stands beside an effect in its programme.

    Parameters
    ----------
    effect
        Of the catalogue.

    Returns
    -------
    dict
        Effect -> its parameters; empty where it needs none.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.studies.hidden import list_effects_beside
    >>> list_effects_beside(find("gain_mismatch"))
    {}
    """
    return {effect.beside: dict(BESIDE_IT[effect.beside])} if effect.beside else {}


def fit_base(
    runs: list[Wave], scale_factor: float | None, beside: Mapping[str, Mapping[str, float]]
) -> ExtendedFit:
    """The base model's fit at the windows' own rate, with the effects that stand beside the hidden
    one; what a diagnosis does not know of driven runs (where their frame stands, what their loops
    answer) is no better known to the yardstick.

    Parameters
    ----------
    runs
        Of one device.
    scale_factor
        Known K, held; None: fitted.
    beside
        Effect -> its parameters.

    Returns
    -------
    ExtendedFit
        At the optimum.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.studies.hidden import draw_programme, fit_base, make_waves
    >>> table = draw_programme(np.random.default_rng(1), "gain_mismatch", 3e-4)
    >>> fit = fit_base(make_waves(table, 1, "gain_mismatch"), None, {})
    >>> bool(0.9 < fit.chi2 / fit.dof < 1.1)
    True
    """
    fit = joint_fit.fit_base(runs, scale_factor=scale_factor, blocks=ALL_ROWS, free_phase=False)
    for name, values in beside.items():
        fit = extended_fit.fit(
            fit.series, fit_point.add_effect(fit.point, find(name), values), fit.freedom
        )
    return fit


def _temperature_of(run: int, cycles: bool) -> dict[str, Any]:
    """The temperature of a run: ramps up and down of several sizes, or cycles of several
    periods."""
    if cycles:
        return {
            "kind": "cycle",
            "low_degc": 22.0,
            "high_degc": 23.0,
            "period_s": (1.0, 1.5, 2.0)[run % 3],
            "shape": "sine",
        }
    start = 22.0 + run % 3
    return {
        "kind": "ramp",
        "start_degc": start,
        "stop_degc": start + (1.0, -0.8, 0.5)[run % 3],
    }


def draw_programme(random: np.random.Generator, shown: str, noise: float) -> dict[str, Any]:
    """Six runs of a random device: several angles, two amplitudes, both signs of rotation,
    temperature ramps.

    Parameters
    ----------
    random
        Of the draw.
    shown
        Effect, for which runs are forced, cycle in temperature or step in rate where it needs them
        to be seen.
    noise
        Of a sample.

    Returns
    -------
    dict
        Tables of a simulation file.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.studies.hidden import draw_programme
    >>> table = draw_programme(np.random.default_rng(1), "gain_mismatch", 3e-4)
    >>> len(table["run"]), table["readout"]
    (6, {'noise': 0.0003})
    """
    device = {
        "frequency_hz": random.uniform(4500, 5500),
        "damping_rate_1_s": random.uniform(0.25, 0.4),
        "damping_split_1_s": random.uniform(0.005, 0.02),
        "damping_axis_rad": random.uniform(0, 1.5),
        "frequency_split_rad_s": random.uniform(0.05, 0.15),
        "stiffness_axis_rad": random.uniform(0, 1.5),
        "scale_factor": random.uniform(0.5, 0.6),
    }
    runs, needed = [], find(shown).shown_by
    for k, rate in enumerate(RATES):
        driven = "drive" in needed and k % 2 == 0
        # a loop that is not there, or of unknown gain, shows by the quadrature it lets decay
        quadrature = 0.05 if find(shown).in_the_log else 0.0
        run: dict[str, Any] = {
            "run_id": f"run{k}",
            "start": {
                "wave_angle_rad": 0.25 * k + random.uniform(0, 0.1),
                "phase_rad": random.uniform(0, 6),
                "quadrature": quadrature if driven else random.uniform(-0.1, 0.1),
                "amplitude": (1.0, 0.5)[k % 2],
            },
            "environment": {
                "rate_rad_s": rate,
                "temperature": _temperature_of(k, "temperature cycle" in needed),
            },
        }
        if "rate steps" in needed:
            run["environment"] |= {
                "rate": {"kind": "steps", "levels_rad_s": [1.0, -1.0, 2.0, 0.0], "dwell_s": 0.45},
                "rate_rad_s": 0.0,
            }
        if driven:
            loop = "finite" if shown == "quadrature_drive_phase_error" else "off"
            run["control"] = {"mode": "forced", "quadrature_loop": loop}
        runs.append(run)
    return {
        "device": {name: float(value) for name, value in device.items()},
        "recording": {"sample_rate_hz": SAMPLE_RATE_HZ, "duration_s": DURATION_S},
        "readout": {"noise": noise},
        "effects": {},
        "run": runs,
    }


def make_waves(table: Mapping[str, Any], seed: int, shown: str) -> list[Wave]:
    """What the chain makes of the raw samples of a programme.

    Parameters
    ----------
    table
        Tables of a simulation file.
    seed
        Of the noise.
    shown
        Effect; for one that is in the log, runs of a loop of unknown gain come without one.

    Returns
    -------
    list of Wave
        In the order of the runs.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.studies.hidden import draw_programme, make_waves
    >>> table = draw_programme(np.random.default_rng(1), "gain_mismatch", 3e-4)
    >>> [wave.run_id for wave in make_waves(table, 1, "gain_mismatch")][:2]
    ['run0', 'run1']
    """
    table = copy.deepcopy(dict(table))
    out: list[Wave] = []
    for run in list_run_ids(table):
        periods = collect(
            demodulate(collect(simulate(table, run=run, seed=seed)), periods_per_window=40.0)
        )
        wave: Wave = collect(estimate(periods))
        if find(shown).in_the_log and wave.mode == "forced":
            wave = wave.replace(drive_main=None, drive_quadrature=None)
        out.append(wave)
    return out
