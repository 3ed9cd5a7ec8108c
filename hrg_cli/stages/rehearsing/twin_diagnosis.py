"""The twin of a diagnosed programme: the extended model that the diagnosis wrote, and what another
diagnosis of it finds again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...effects import EFFECTS
from ...errors import HrgError
from ...records import Diagnosis
from ...settings import parse_toml
from . import twin_colour
from .channel_shares import split_noise
from .twin import Twin
from .twin_run import Measured, TwinRun, choose_sample_rate, name_run, write_carrier

COHERENT = {effect.name for effect in EFFECTS if effect.coherent}
"""Effects whose vector stands with the wave's phase, so that its sign is nobody's to know."""
Causes = dict[str, tuple[dict[str, tuple[float, float]], frozenset[str]]]
"""Causes by name: parameters' values and standard deviations, and which others cannot be told from
the cause."""


def make_twin_of_diagnosis(
    truth: Diagnosis,
    inputs: Sequence[Measured],
    settings: Mapping[str, Any],
    samples_a_period: float | None = None,
) -> Twin:
    """The twin of a diagnosis: its extended model, run by run with the measured windows and logs.

    Parameters
    ----------
    truth
        The diagnosis, with the model that it wrote.
    inputs
        Its runs, in its order.
    settings
        Its own.
    samples_a_period
        Of the simulated recordings; None: the measured ones' own sampling.

    Returns
    -------
    Twin
        One simulated run for each measured one.

    Raises
    ------
    HrgError
        It was refused and wrote no model, or the model lacks a run.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin_diagnosis import make_twin_of_diagnosis
    >>> model = '''
    ... recording = {sample_rate_hz = 2000.0, duration_s = 1.0}
    ... [[run]]
    ... run_id = "a"
    ... device = {frequency_hz = 500.0}
    ... readout = {noise = 1e-3}
    ... recording = {duration_s = 1.0}
    ... '''
    >>> truth = Told(extended_model=model, read_report=dict)
    >>> twin = make_twin_of_diagnosis(truth, [draw_input()], {})
    >>> [run.name for run in twin.runs], twin.samples
    (['a'], 2000)
    """
    if not truth.extended_model:
        raise HrgError("was refused and holds no extended model; there is nothing to simulate")
    config = parse_toml(truth.extended_model)
    if not isinstance(config.get("run"), list):
        raise HrgError("has an extended model without runs; it is damaged: diagnose again")
    if len(config["run"]) != len(inputs):
        raise HrgError(
            f"has an extended model of {len(config['run'])} runs, {len(inputs)} waves were"
            " diagnosed: runs without a row that counts are not in it; diagnose the others alone"
        )
    colour = twin_colour.read_diagnosis_wander(truth)
    runs, tables = [], []
    for run, measured in zip(config["run"], inputs, strict=True):
        wave = measured.wave
        frequency = float(run["device"]["frequency_hz"])
        carrier = measured.carrier_hz if wave.readout == "carrier" else None
        sampling = choose_sample_rate(measured, frequency, carrier or 0.0, samples_a_period)
        readout = {**run["readout"], **write_carrier(carrier)}
        readout["noise"] *= float(np.sqrt(sampling / config["recording"]["sample_rate_hz"]))
        recording = {**config["recording"], **run["recording"], "sample_rate_hz": sampling}
        tables.append({**run, "readout": readout, "recording": recording})
        carried, missing = name_run(wave)
        windows = {k: v for k, v in measured.demodulate.items() if k != "nominal_frequency_hz"}
        windows.setdefault("periods_per_window", max(1.0, wave.window_s * frequency))
        one = TwinRun(run["run_id"], windows, measured.estimate, carried, missing, colour)
        std = float(np.nanmedian(wave.signal_std))
        runs.append(replace(one, std=std, window_s=wave.window_s, channels=split_noise(wave)))
    config = {**config, "recording": tables[0]["recording"], "run": tables}
    return Twin(config, runs, "diagnose", dict(settings), truth)


def list_causes(record: Diagnosis) -> Causes:
    """The causes that a diagnosis names; a cause seen twice, as it is told first.

    Parameters
    ----------
    record
        The diagnosis.

    Returns
    -------
    dict
        Cause -> its parameters' values and standard deviations, and which others it cannot be told
        from; one seen twice, as it is told first.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rehearsing.twin_diagnosis import list_causes
    >>> cause = {"name": "gain_mismatch", "parameters": {"gain": {"value": 0.01, "std": 1e-3}}}
    >>> list_causes(Told(told=lambda table: [cause]))
    {'gain_mismatch': ({'gain': (0.01, 0.001)}, frozenset())}
    """
    out: Causes = {}
    for one in record.told("effects"):
        found = {
            name: (float(p["value"]), float(p["std"]))
            for name, p in (one.get("parameters") or {}).items()
            if p.get("value") is not None and p.get("std")
        }
        out.setdefault(one["name"], (found, frozenset(one.get("indistinguishable_from") or ())))
    return out


def list_held_causes(twin: Twin) -> Causes:
    """The causes of the twin's truth that its simulation holds.

    Parameters
    ----------
    twin
        Of a diagnosis.

    Returns
    -------
    dict
        As of `list_causes`, without causes that the extended model could not hold.

    Examples
    --------
    >>> import numpy as np
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.records import Diagnosis
    >>> from hrg_cli.stages.rehearsing.twin_diagnosis import list_held_causes
    >>> rows = dict.fromkeys(("run", "time_s", "wave_angle_rad", "main_amplitude"), np.zeros(0))
    >>> series = ("measured", "simulated_before", "simulated_after")
    >>> series += ("residual_before", "residual_after")
    >>> rows |= dict.fromkeys(series, np.zeros((0, 4))) | {"series": "[]"}
    >>> report = '{"effects": [{"name": "gain_mismatch"}, {"name": "clock_error"}]}'
    >>> truth = Diagnosis(verdict="explained", report=report, **rows)
    >>> config = {"run": [{"effects": {"clock_error": {}}}]}
    >>> list(list_held_causes(Told(truth=truth, config=config)))
    ['clock_error']
    """
    inside = set(twin.config.get("effects", {}))
    for run in twin.config["run"]:
        inside |= set(run.get("effects", {}))
    assert isinstance(twin.truth, Diagnosis)
    return {name: one for name, one in list_causes(twin.truth).items() if name in inside}


def list_base_values(record: Diagnosis) -> dict[str, tuple[float, float]]:
    """The resonator beside the causes: values and standard deviations by name.

    Parameters
    ----------
    record
        The diagnosis.

    Returns
    -------
    dict
        Parameter -> value and standard deviation, in its unit.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rehearsing.twin_diagnosis import list_base_values
    >>> row = {"name": "scale_factor", "value": 0.55, "std": 1e-3}
    >>> list_base_values(Told(told=lambda table: [row]))
    {'scale_factor': (0.55, 0.001)}
    """
    return {row["name"]: (float(row["value"]), float(row["std"])) for row in record.told("values")}


def find_sign(
    name: str, found: Mapping[str, tuple[float, float]], true: Mapping[str, Any]
) -> float:
    """−1 for a coherent effect whose vector came out the other way round, else 1.

    Parameters
    ----------
    name
        Of the effect.
    found
        Its parameters' values and standard deviations as they came out.
    true
        The same of the truth.

    Returns
    -------
    float
        −1 or 1.

    Examples
    --------
    (mθ, φ) and (mθ + π, φ + π) are one wave, so nobody knows which way a force at its frequency
    points:

    >>> from hrg_cli.stages.rehearsing.twin_diagnosis import COHERENT, find_sign
    >>> true, found = {"along": (1.0, 0.1)}, {"along": (-1.1, 0.1)}
    >>> find_sign(sorted(COHERENT)[0], found, true), find_sign("gain_mismatch", found, true)
    (-1.0, 1.0)
    """
    if name not in COHERENT:
        return 1.0
    along = sum(value * true[key][0] for key, (value, _) in found.items() if key in true)
    return -1.0 if along < 0 else 1.0
