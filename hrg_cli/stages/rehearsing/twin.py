"""The simulated twin of a measured programme: a device with a result's own values, and each
measured run's start, length and logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import HrgError
from ...physics.resonator import Mechanics
from ...records import Calibration, Record, Resonator
from ..earth_rate import earth_rate_of
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

    @property
    def samples(self) -> int:
        """Samples of all runs together."""
        own = sum(self.samples_of(run) for run in self.config["run"])
        return own + sum(beside.samples for beside in self.resonators)

    @property
    def longest(self) -> int:
        """Samples of the longest run."""
        own = max(self.samples_of(run) for run in self.config["run"])
        return max([own, *(beside.longest for beside in self.resonators)])

    @staticmethod
    def samples_of(run: Mapping[str, Any]) -> int:
        """Samples of one run of the simulation file."""
        return int(run["recording"]["duration_s"] * run["recording"]["sample_rate_hz"])


def make_twin(
    truth: Record,
    inputs: Sequence[Measured],
    settings: Mapping[str, Any],
    samples_a_period: float | None = None,
    identified: Sequence[Identified] = (),
) -> Twin:
    """The twin of a result and its inputs; `settings` are the stage's own, as the result's file
    keeps them.

    samples_a_period: of the simulated recordings, instead of the measured ones' own sampling;
    identified: the resonator files that tables of `--model physical` were made of.
    HrgError: the result holds no device (two modes without axes, a foreign table, tables whose
    resonator files are not at hand), no wave.
    """
    settings = dict(settings)
    colours: Sequence[Colour]
    if isinstance(truth, Resonator):
        stage, device, hidden = (
            "identify",
            build_resonator(truth, settings, inputs),
            find_hidden_rate(truth, settings),
        )
        waves = [measured.wave for measured in inputs]
        colours = [twin_colour.of_free_runs(waves, settings, hidden)] * len(inputs)
        # what a method adds to the answer without changing it is not repeated
        settings |= {"profile": False} | (
            {"method": "likelihood"} if settings.get("method") == "all" else {}
        )
    elif isinstance(truth, Calibration):
        stage, device, hidden = (
            "calibrate",
            build_carrier_of_tables(truth, inputs, identified),
            earth_rate_of(settings),
        )
        settings |= {"ladder": False, "bootstrap": 0}
        found = twin_colour.of_calibration(truth)
        colours = [found.get(measured.wave.run_id, ()) for measured in inputs]
    else:
        raise HrgError(
            f"is a {truth.kind} file; a resonator, a calibration or a diagnosis is rehearsed"
        )
    by_frequency = isinstance(truth, Calibration) and truth.axis == "frequency"
    runs, tables = [], []
    for number, (measured, colour) in enumerate(zip(inputs, colours, strict=True), 1):
        name = f"run{number}"
        own = device
        if by_frequency:
            own = replace(device, frequency_hz=float(np.nanmedian(measured.wave.frequency_hz)))
        run, table = imitate_run(name, measured, own, hidden, settings, samples_a_period)
        if by_frequency:
            table["device"] = {"frequency_hz": own.frequency_hz}
            run = replace(run, frequency=average_frequency(measured.wave))
        runs.append(replace(run, colour=colour))
        tables.append(table)
    first = tables[0]["recording"]
    config = {
        "device": {key: getattr(device, key) for key in Mechanics.__dataclass_fields__},
        "recording": {"sample_rate_hz": first["sample_rate_hz"], "duration_s": first["duration_s"]},
        "run": tables,
    }
    beside = [make_twin(i.resonator, i.inputs, i.settings, samples_a_period) for i in identified]
    return Twin(config, runs, stage, settings, truth, beside)
