"""The simulated twin of a measured programme: a device with a result's own values, and each
measured run's start, length and logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...errors import HrgError
from ...physics.resonator import Mechanics
from ...physics.slow_engine import EnvelopePath
from ...records import Calibration, Record, Resonator
from ..earth_rate import read_earth_rate
from . import twin_colour
from .twin_colour import Colour
from .twin_device import build_carrier_of_tables, build_resonator, find_hidden_rate
from .twin_physical import Identified
from .twin_run import Measured, TwinRun, average_frequency, imitate_run

Array = np.ndarray


@dataclass(frozen=True)
class Twin:
    """A programme to rehearse: tables of a simulation file, its runs, the stage that gave the
    result, its settings, the truth, and the twins of the resonator files it was made of."""

    config: Mapping[str, Any]
    runs: Sequence[TwinRun]
    stage: str
    settings: Mapping[str, Any]
    truth: Record
    resonators: Sequence[Twin] = ()
    motions: dict[int, list[EnvelopePath]] = field(default_factory=dict, compare=False)
    """By run the paths of its motion once they are followed, the same in every rehearsal."""

    @property
    def samples(self) -> int:
        """Samples of all runs together."""
        own = sum(self.count_samples(run) for run in self.config["run"])
        return own + sum(beside.samples for beside in self.resonators)

    @property
    def longest(self) -> int:
        """Samples of the longest run."""
        own = max(self.count_samples(run) for run in self.config["run"])
        return max([own, *(beside.longest for beside in self.resonators)])

    @staticmethod
    def count_samples(run: Mapping[str, Any]) -> int:
        """Samples of one run of the simulation file."""
        return int(run["recording"]["duration_s"] * run["recording"]["sample_rate_hz"])


def make_twin(
    truth: Record,
    inputs: Sequence[Measured],
    settings: Mapping[str, Any],
    samples_a_period: float | None = None,
    identified: Sequence[Identified] = (),
) -> Twin:
    """The twin of a result and its inputs.

    Parameters
    ----------
    truth
        A resonator or a calibration.
    inputs
        The runs that it was made of.
    settings
        The stage's own, as the result's file keeps them.
    samples_a_period
        Of the simulated recordings; None: the measured ones' own sampling.
    identified
        The resonator files that tables of `--model physical` were made of.

    Returns
    -------
    Twin
        One simulated run for each measured one.

    Raises
    ------
    HrgError
        The result holds no device: two modes without axes, a foreign table, tables whose resonator
        files are not at hand, no wave.

    Examples
    --------
    >>> from hrg_cli import identify
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin import make_twin
    >>> run = draw_input()
    >>> twin = make_twin(identify([run.wave]), [run], {})
    >>> twin.stage, twin.samples, round(twin.config["device"]["damping_rate_1_s"], 2)
    ('identify', 2000, 0.5)
    """
    if isinstance(truth, Resonator):
        plan = _plan_of_resonator(truth, inputs, settings)
    elif isinstance(truth, Calibration):
        plan = _plan_of_tables(truth, inputs, settings, identified)
    else:
        raise HrgError(
            f"is a {truth.kind} file; a resonator, a calibration or a diagnosis is rehearsed"
        )
    # tables over frequency: the runs' own frequencies are their abscissa, one for all would be none
    by_frequency = isinstance(truth, Calibration) and truth.axis == "frequency"
    runs, tables = [], []
    for number, (measured, colour) in enumerate(zip(inputs, plan.colours, strict=True), 1):
        name, device = f"run{number}", plan.device
        if by_frequency:
            device = replace(device, frequency_hz=float(np.nanmedian(measured.wave.frequency_hz)))
        run, table = imitate_run(
            name, measured, device, plan.hidden_rad_s, plan.settings, samples_a_period
        )
        if by_frequency:
            table["device"] = {"frequency_hz": device.frequency_hz}
            run = replace(run, frequency=average_frequency(measured.wave))
        runs.append(replace(run, colour=colour))
        tables.append(table)
    beside = [make_twin(i.resonator, i.inputs, i.settings, samples_a_period) for i in identified]
    config = _write_config(plan.device, tables)
    return Twin(config, runs, plan.stage, plan.settings, truth, beside)


@dataclass(frozen=True)
class TwinPlan:
    """What a twin takes from the result: the stage that gave it and its settings, the device, the
    rate that no log holds, and the colour of every run's noise."""

    stage: str
    settings: Mapping[str, Any]
    device: Mechanics
    hidden_rad_s: float
    colours: Sequence[Colour]


def _plan_of_resonator(
    truth: Resonator, inputs: Sequence[Measured], settings: Mapping[str, Any]
) -> TwinPlan:
    hidden = find_hidden_rate(truth, settings)
    colour = twin_colour.estimate_of_free_runs([one.wave for one in inputs], settings, hidden)
    # what a method adds to the answer without changing it is not repeated
    quicker: dict[str, Any] = {"profile": False}
    if settings.get("method") == "all":
        quicker["method"] = "likelihood"
    return TwinPlan(
        "identify",
        {**settings, **quicker},
        build_resonator(truth, settings, inputs),
        hidden,
        [colour] * len(inputs),
    )


def _plan_of_tables(
    truth: Calibration,
    inputs: Sequence[Measured],
    settings: Mapping[str, Any],
    identified: Sequence[Identified],
) -> TwinPlan:
    colours = twin_colour.read_calibration_noise(truth)
    return TwinPlan(
        "calibrate",
        {**settings, "ladder": False, "bootstrap": 0},
        build_carrier_of_tables(truth, inputs, identified),
        read_earth_rate(settings),
        [colours.get(one.wave.run_id, ()) for one in inputs],
    )


def _write_config(device: Mechanics, tables: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The simulation file; what every run has of its own stands first in it as well, since a file
    without it is not whole."""
    first = tables[0]["recording"]
    return {
        "device": {key: getattr(device, key) for key in Mechanics.__dataclass_fields__},
        "recording": {"sample_rate_hz": first["sample_rate_hz"], "duration_s": first["duration_s"]},
        "run": list(tables),
    }
