"""The simulation file: what may stand in its TOML, checked strictly, and how its runs override it.

Tables [device], [start], [readout], [control], [electronics], [noise], [spring], [environment],
[recording] (each in `simulation/`), [effects.NAME]; each [[run]] repeats any part of them under the
same dotted names, e.g. `start.wave_angle_rad = 0.3`, on top of the file's own.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, PrivateAttr, model_validator

from ..effects.effect import OF_EVERY_RUN, RUN
from ..errors import HrgError
from ..records.time_origin import count_from_first
from ..settings import list_leaves, validate
from .simulation.bench_tables import EnvironmentTable, RecordingTable
from .simulation.device_tables import Device, SpringTable, Start
from .simulation.electronics_tables import ControlTable, ElectronicsTable, NoiseTable, ReadoutTable
from .simulation.strict_table import Table


class SimulationFile(Table):
    """One run's whole settings."""

    device: Device
    start: Start = Start()
    readout: ReadoutTable = ReadoutTable()
    control: ControlTable = ControlTable()
    electronics: ElectronicsTable | None = None
    noise: NoiseTable = NoiseTable()
    spring: SpringTable | None = None
    environment: EnvironmentTable = EnvironmentTable()
    recording: RecordingTable
    effects: dict[str, dict[str, float | str | bool]] = {}  # noqa: RUF012 - the model copies it
    """Effects by name with their parameters (the table of effects)."""
    run_id: Annotated[str, Field(pattern=r"^[^/\\\s]+$")] = "run"
    """Name of the run."""
    _begun_s: float = PrivateAttr(0.0)

    @property
    def begun_s(self) -> float:
        """How long after the first run of its file this one begins."""
        return self._begun_s

    @model_validator(mode="after")
    def _fast_enough(self) -> Self:
        highest = self.device.frequency_hz + (self.readout.carrier_hz or 0.0)
        if self.recording.sample_rate_hz <= 2 * highest:
            raise ValueError(
                f"recording.sample_rate_hz = {self.recording.sample_rate_hz:g} must exceed"
                f" {2 * highest:g}, twice the highest frequency; raise it"
            )
        if (
            self.readout.carrier_hz is not None
            and self.readout.carrier_hz <= self.device.frequency_hz
        ):
            raise ValueError(
                f"readout.carrier_hz = {self.readout.carrier_hz:g} must exceed the device's"
                f" {self.device.frequency_hz:g} Hz"
            )
        return self

    @model_validator(mode="after")
    def _electronics_belong(self) -> Self:
        if self.electronics is not None and self.control.mode == "free":
            raise ValueError(
                'electronics drives loops, but control.mode is "free"; set control.mode = "forced"'
                " or leave [electronics] out"
            )
        if self.electronics is not None and self.control.log is not None:
            raise ValueError(
                "electronics makes the drive from what it sees, but control.log replays one; leave"
                " out [electronics] or the log"
            )
        if self.noise.drive_density and self.control.mode == "free":
            raise ValueError(
                'noise.drive_density is of the drive, but control.mode is "free"; set control.mode'
                ' = "forced" or leave it out'
            )
        if self.readout.kind == "carrier" and (
            self.electronics is not None or self.noise.readout_corner_hz
        ):
            raise ValueError(
                "electronics and noise.readout_corner_hz act on the direct read-out; a carrier"
                ' moves the signal away from the 1/f noise, so set readout.kind = "direct" or leave'
                " them out"
            )
        if self.noise.readout_corner_hz and not self.readout.noise:
            raise ValueError("noise.readout_corner_hz is the corner of readout.noise; give it too")
        return self


SMALLEST, LARGEST = 1e-30, 1e30
"""Sizes of a number that is not 0: squares and quotients of two of them can still be had."""


def _need_sizes(config: Mapping[str, Any], where: str) -> None:
    """HrgError where a number is beyond what can be simulated; not finite ones are left to the
    tables."""
    for key, value in list_leaves(config):
        size = abs(value) if isinstance(value, int | float) else 0
        if size and math.isfinite(size) and not SMALLEST <= size <= LARGEST:
            raise HrgError(
                f"{where}: {key[:80]} = {value:g} is beyond what can be simulated; 0, or a size of"
                f" {SMALLEST:g} to {LARGEST:g}, was expected"
            )


def list_runs(config: Mapping[str, Any], where: str = "simulation") -> list[SimulationFile]:
    """The runs of a simulation file, each whole and checked.

    Parameters
    ----------
    config
        The file's tables; each [[run]] holds what differs from them.
    where
        The file, for messages.

    Returns
    -------
    list of SimulationFile
        At least one.

    Raises
    ------
    HrgError
        What is wrong, where, and what was meant.

    Examples
    --------
    >>> from hrg_cli.stages.simulation_file import list_runs
    >>> config = {
    ...     "device": {"frequency_hz": 5000.0, "quality_factor": 1e6},
    ...     "recording": {"sample_rate_hz": 20_000.0, "duration_s": 3.0},
    ...     "run": [{"run_id": "still"}, {"run_id": "turning", "environment": {"rate_rad_s": 1.0}}],
    ... }
    >>> [
    ...     (run.run_id, run.environment.rate_rad_s, run.device.frequency_hz)
    ...     for run in list_runs(config)
    ... ]
    [('still', 0.0, 5000.0), ('turning', 1.0, 5000.0)]
    >>> list_runs(config | {"recording": {"sample_rate_hz": 20_000.0, "duration": 3.0}})
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: simulation: run 1 (still): ...duration...
    """
    _need_sizes(config, where)
    base = {key: value for key, value in config.items() if key != "run"}
    overrides = config.get("run", [])
    if not isinstance(overrides, list) or not all(isinstance(r, Mapping) for r in overrides):
        raise HrgError(f"{where}: run is not an array of tables; write each run under [[run]]")
    if not overrides:
        return _each_in_its_run([validate(SimulationFile, base, where)], where)
    digits = len(str(len(overrides)))
    runs = []
    for number, override in enumerate(overrides, 1):
        named = {"run_id": f"run{number:0{digits}d}"} | dict(override)
        runs.append(
            validate(
                SimulationFile, _merged(base, named), f"{where}: run {number} ({named['run_id']})"
            )
        )
    names = Counter(run.run_id for run in runs)
    twice = sorted(name for name, count in names.items() if count > 1)
    if twice:
        raise HrgError(f"{where}: run_id {twice[0]} stands twice; give each run its own name")
    return _each_in_its_run(runs, where)


def _each_in_its_run(runs: list[SimulationFile], where: str) -> list[SimulationFile]:
    """The runs, each told when it begins after the first, without the effects that happen in
    another one: what has `run` happens in the run of that number, from 0, or with −1 in every run.
    HrgError: there is no such run."""

    def happens(number: int, name: str, given: Mapping[str, Any]) -> bool:
        wanted = given.get(RUN, OF_EVERY_RUN)
        if wanted != OF_EVERY_RUN and wanted not in range(len(runs)):
            raise HrgError(
                f"{where}: effects.{name}.{RUN} = {str(wanted).removesuffix('.0')} is no run of the"
                f" file; give one of 0 to {len(runs) - 1}, in the file's order, or"
                f" {OF_EVERY_RUN:g} for every run"
            )
        return wanted in (OF_EVERY_RUN, number)

    began = count_from_first([run.recording.start_time for run in runs])
    own = [
        run.model_copy(
            update={
                "effects": {
                    name: {key: value for key, value in given.items() if key != RUN}
                    for name, given in run.effects.items()
                    if happens(number, name, given)
                }
            }
        )
        for number, run in enumerate(runs)
    ]
    for run, begun_s in zip(own, began, strict=True):
        run._begun_s = begun_s
    return own


def _merged(base: Mapping[str, Any], override: Mapping[str, Any]) -> dict[str, Any]:
    """Nested tables of `override` over those of `base`; a programme of another `kind` replaces the
    whole table."""
    result = dict(base)
    for key, value in override.items():
        old = result.get(key)
        if isinstance(old, Mapping) and isinstance(value, Mapping):
            another = key in ("temperature", "rate") and value.get(
                "kind", old.get("kind")
            ) != old.get("kind")
            result[key] = dict(value) if another else _merged(old, value)
        else:
            result[key] = value
    return result
