"""The simulation file: what may stand in its TOML, checked strictly, and how its runs override it.

Tables [device], [start], [readout], [control], [electronics], [noise], [spring], [environment],
[recording], [effects.NAME]; each
[[run]] repeats any part of them under the same dotted names, e.g. `start.wave_angle_rad = 0.3`, on top of the file's own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..errors import HrgError
from ..settings import validate

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Course = float | list[float]
"""Relative change a °C, then a °C², …: value(T) = value·(1 + c₁ΔT + c₂ΔT² + …)."""


class Table(BaseModel):
    """A table of the file: strict types, no unknown key, no NaN."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


def _given(table: BaseModel, names: tuple[str, ...]) -> list[str]:
    return [name for name in names if getattr(table, name) is not None]


def _exactly_one(table: BaseModel, names: tuple[str, ...]) -> None:
    given = _given(table, names)
    if len(given) != 1:
        raise ValueError(
            f"one of {', '.join(names)} was expected, not {' and '.join(given) or 'none'}"
        )


def _at_most_one(table: BaseModel, names: tuple[str, ...]) -> None:
    given = _given(table, names)
    if len(given) > 1:
        raise ValueError(f"{' and '.join(given)} say the same; give one")


class DeviceTemperature(Table):
    """[device.temperature]: coefficients about the reference temperature."""

    reference_degc: float = 20.0
    frequency_per_degc: Course = 0.0
    damping_rate_per_degc: Course = 0.0
    damping_split_per_degc: Course = 0.0
    frequency_split_per_degc: Course = 0.0
    scale_factor_per_degc: Course = 0.0


class Device(Table):
    """[device]: the resonator. One of quality_factor, time_constant_s, damping_rate_1_s; a split's size in either of its units."""

    frequency_hz: Positive
    quality_factor: Positive | None = None
    time_constant_s: Positive | None = None
    damping_rate_1_s: NotNegative | None = None
    damping_split: Annotated[float, Field(ge=-1, le=1)] | None = None
    damping_split_1_s: float | None = None
    damping_axis_rad: float = 0.0
    frequency_split_rad_s: float | None = None
    frequency_split_hz: float | None = None
    stiffness_axis_rad: float = 0.0
    scale_factor: float = 0.55
    mode_number: Annotated[int, Field(ge=1, le=64)] = 2
    temperature: DeviceTemperature = DeviceTemperature()

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        _exactly_one(self, ("quality_factor", "time_constant_s", "damping_rate_1_s"))
        _at_most_one(self, ("damping_split", "damping_split_1_s"))
        _at_most_one(self, ("frequency_split_rad_s", "frequency_split_hz"))
        if abs(self.split_1_s) > self.rate_1_s:
            raise ValueError(
                f"the damping split {self.split_1_s:g} 1/s exceeds the damping rate"
                f" {self.rate_1_s:g} 1/s; one axis would gain energy"
            )
        return self

    @property
    def rate_1_s(self) -> float:
        """ν = 1/τ = πf/Q."""
        if self.damping_rate_1_s is not None:
            return self.damping_rate_1_s
        return (
            1 / self.time_constant_s
            if self.time_constant_s
            else math.pi * self.frequency_hz / (self.quality_factor or math.inf)
        )

    @property
    def split_1_s(self) -> float:
        """νδμ."""
        return (
            self.damping_split_1_s
            if self.damping_split_1_s is not None
            else self.rate_1_s * (self.damping_split or 0.0)
        )

    @property
    def frequency_split(self) -> float:
        """δω = πΔf, rad/s."""
        return (
            self.frequency_split_rad_s
            if self.frequency_split_rad_s is not None
            else math.pi * (self.frequency_split_hz or 0.0)
        )


class Start(Table):
    """[start]: the wave at t = 0."""

    amplitude: Positive = 1.0
    quadrature: float = 0.0
    wave_angle_rad: float = 0.0
    phase_rad: float = 0.0

    @model_validator(mode="after")
    def _order(self) -> Self:
        if abs(self.quadrature) > self.amplitude:
            raise ValueError(
                f"the quadrature {self.quadrature:g} exceeds the amplitude {self.amplitude:g}; the"
                " larger one is the main amplitude"
            )
        return self


class ReadoutTable(Table):
    """[readout]: electrodes, carrier, noise and converter."""

    kind: Literal["direct", "carrier"] = "direct"
    carrier_hz: Positive | None = None
    carrier_phase_rad: float = 0.0
    model: Literal["linear", "full"] = "linear"
    gap: Positive | None = None
    law: Literal["alternating", "constant-voltage", "printed"] = "alternating"
    electrode_gaps: Annotated[list[Positive], Field(min_length=8, max_length=8)] = [1.0] * 8
    electrode_gains: Annotated[list[Positive], Field(min_length=8, max_length=8)] = [1.0] * 8
    noise: NotNegative = 0.0
    adc_bits: Annotated[int, Field(ge=0, le=31)] = 0
    full_scale: Positive | None = None
    clock_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    units: str = "1"

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if (self.kind == "carrier") != (self.carrier_hz is not None):
            raise ValueError(
                'carrier_hz belongs to kind = "carrier" and is needed there; give both or neither'
            )
        if (self.model == "full") != (self.gap is not None):
            raise ValueError(
                'gap belongs to model = "full" and is needed there; give both or neither'
            )
        if self.model == "linear" and self.model_fields_set & {
            "law",
            "electrode_gaps",
            "electrode_gains",
        }:
            raise ValueError(
                'law, electrode_gaps and electrode_gains belong to model = "full"; set it and give'
                " the gap"
            )
        if self.kind == "carrier" and self.law == "constant-voltage":
            raise ValueError(
                'law = "constant-voltage" is a pick-off without a carrier; set kind = "direct" or'
                ' law = "alternating"'
            )
        if self.full_scale is not None and self.adc_bits == 0:
            raise ValueError("full_scale belongs to a converter; give adc_bits too")
        return self


def _same_and_rising(time_s: list[float], values: list[float], name: str) -> None:
    if len(time_s) != len(values):
        raise ValueError(
            f"time_s has {len(time_s)} values and {name} {len(values)}; as many were expected"
        )
    if any(later <= earlier for earlier, later in pairwise(time_s)):
        raise ValueError("time_s must rise from value to value")


class DriveLog(Table):
    """[control.log]: a drive that was logged, a_ΦA and a_ΦB in amplitude a second, replayed along
    straight lines through the rows; constant before the first and after the last."""

    time_s: Annotated[list[float], Field(min_length=1)]
    drive_main: list[float]
    drive_quadrature: list[float] | None = None

    @model_validator(mode="after")
    def _matched(self) -> Self:
        _same_and_rising(self.time_s, self.drive_main, "drive_main")
        if self.drive_quadrature is not None:
            _same_and_rising(self.time_s, self.drive_quadrature, "drive_quadrature")
        return self


LOOPS = (
    "amplitude",
    "amplitude_gain_1_s",
    "amplitude_integral_1_s2",
    "quadrature_gain_1_s",
    "quadrature_integral_1_s2",
)
"""What a replayed log leaves no use for."""


class ControlTable(Table):
    """[control]: a free run-down, the loops of a forced whole-angle run, or their log in place of
    them."""

    mode: Literal["free", "forced"] = "free"
    log: DriveLog | None = None
    amplitude: Positive | None = None
    amplitude_gain_1_s: NotNegative = 5.0
    amplitude_integral_1_s2: NotNegative | None = None
    quadrature_loop: Literal["off", "finite", "spring"] = "off"
    quadrature_gain_1_s: NotNegative | None = None
    quadrature_integral_1_s2: NotNegative = 0.0
    drive: Literal["force", "parametric"] = "force"
    main_phase_error_rad: float = 0.0
    quadrature_phase_error_rad: float = 0.0
    off_s: list[list[NotNegative]] = []

    @model_validator(mode="after")
    def _complete(self) -> Self:
        given = sorted(self.model_fields_set - {"mode"})
        if self.mode == "free" and given:
            raise ValueError(
                f'a free run has no control, but {", ".join(given)} is set; set mode = "forced" or'
                " leave it out"
            )
        if (self.quadrature_loop == "off") and self.quadrature_gain_1_s:
            raise ValueError(
                'quadrature_gain_1_s belongs to quadrature_loop = "finite" or "spring"'
            )
        if self.log is not None and (set_ := sorted(self.model_fields_set.intersection(LOOPS))):
            raise ValueError(
                f"log is replayed and no loop acts, but {', '.join(set_)} is set; give the log or"
                " the loops"
            )
        if (
            self.log is not None
            and self.log.drive_quadrature is not None
            and self.quadrature_loop == "off"
        ):
            raise ValueError(
                'log has drive_quadrature; say how it acts by quadrature_loop = "finite" or'
                ' "spring"'
            )
        for interval in self.off_s:
            if len(interval) != 2 or interval[0] >= interval[1]:
                raise ValueError(
                    f"off_s holds intervals [start, stop] with start < stop, not {interval}"
                )
        return self


class ElectronicsTable(Table):
    """[electronics]: the loops act on what a board demodulates (windows of whole periods), filtered, delayed and through converters.

    Its converter is that of [readout] (adc_bits, full_scale). drive_full_scale is the force,
    amplitude a second, at which it saturates.
    """

    periods_per_update: Annotated[int, Field(ge=1, le=100_000)] = 16
    delay_periods: NotNegative = 0.0
    filter_hz: Positive | None = None
    phase_loop_hz: Positive = 1.0
    drive_bits: Annotated[int, Field(ge=0, le=31)] = 0
    drive_full_scale: Positive | None = None
    drive_periods: Annotated[int, Field(ge=0, le=100_000)] = 0
    spring_signal: Literal["quadrature", "phase_product"] = "quadrature"

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.drive_bits and self.drive_full_scale is None:
            raise ValueError(
                "drive_bits need the force at which the converter saturates; give drive_full_scale"
            )
        return self


class NoiseTable(Table):
    """[noise]: Brownian force of the resonator, and electronic noise with a 1/f corner about the resonance.

    readout_corner_hz belongs to the noise of [readout]; drive_density is the drive's envelope
    force, amplitude/s/√Hz, one-sided.
    """

    temperature_k: Positive | None = None
    effective_mass_kg: Positive | None = None
    metres_per_unit: Positive = 1.0
    readout_corner_hz: NotNegative = 0.0
    drive_density: NotNegative = 0.0
    drive_corner_hz: NotNegative = 0.0

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if (self.temperature_k is None) != (self.effective_mass_kg is None):
            raise ValueError(
                "Brownian force needs temperature_k and effective_mass_kg; give both or neither"
            )
        if self.drive_corner_hz and not self.drive_density:
            raise ValueError("drive_corner_hz is the corner of drive_density; give it too")
        return self


class SpringTable(Table):
    """[spring]: a constant electric spring that softens along an axis: δω·e^{2jmθ_ω} less size·e^{2jm·axis}, f less size/2π."""

    size_rad_s: float
    axis_rad: float


class Ramp(Table):
    """Temperature from one value to another."""

    kind: Literal["ramp"]
    start_degc: float
    stop_degc: float
    begin_s: NotNegative = 0.0
    end_s: Positive | None = None


class Soak(Table):
    """Temperature levels held in turn."""

    kind: Literal["soak"]
    levels_degc: Annotated[list[float], Field(min_length=1)]
    dwell_s: Positive
    transition_s: Positive


class Cycle(Table):
    """Temperature up and down."""

    kind: Literal["cycle"]
    low_degc: float
    high_degc: float
    period_s: Positive
    shape: Literal["sine", "triangle"] = "triangle"


class TemperaturePoints(Table):
    """Temperature along straight lines through points, as a log gives them; constant before the
    first and after the last."""

    kind: Literal["points"]
    time_s: Annotated[list[float], Field(min_length=1)]
    temperature_degc: list[float]

    @model_validator(mode="after")
    def _matched(self) -> Self:
        _same_and_rising(self.time_s, self.temperature_degc, "temperature_degc")
        return self


class RatePoints(Table):
    """Rate along straight lines through points, as a log gives them; constant before the first and
    after the last."""

    kind: Literal["points"]
    time_s: Annotated[list[float], Field(min_length=1)]
    rate_rad_s: list[float]

    @model_validator(mode="after")
    def _matched(self) -> Self:
        _same_and_rising(self.time_s, self.rate_rad_s, "rate_rad_s")
        return self


class Steps(Table):
    """Rates held in turn; `transition_s` is the table's time between two."""

    kind: Literal["steps"]
    levels_rad_s: Annotated[list[float], Field(min_length=1)]
    dwell_s: Positive
    transition_s: Positive = 0.02


class Sine(Table):
    """Sinusoidal rate."""

    kind: Literal["sine"]
    amplitude_rad_s: float
    frequency_hz: Positive
    phase_rad: float = 0.0


class Sweep(Table):
    """Rate from 0 to +maximum, to −maximum and back to 0, along straight lines, in each period."""

    kind: Literal["sweep"]
    maximum_rad_s: float
    period_s: Positive | None = None


class EnvironmentTable(Table):
    """[environment]: a constant, or a programme that takes its place (temperature) or is added to it (rate)."""

    temperature_degc: float = 20.0
    temperature: (
        Annotated[Ramp | Soak | Cycle | TemperaturePoints, Field(discriminator="kind")] | None
    ) = None
    rate_rad_s: float = 0.0
    rate: Annotated[Steps | Sine | Sweep | RatePoints, Field(discriminator="kind")] | None = None
    earth_latitude_rad: Annotated[float, Field(ge=-math.pi / 2, le=math.pi / 2)] | None = None
    earth_rate_rad_s: float | None = None
    earth_logged: bool = True

    @model_validator(mode="after")
    def _one_earth(self) -> Self:
        _at_most_one(self, ("earth_latitude_rad", "earth_rate_rad_s"))
        return self


class RecordingTable(Table):
    """[recording]: length, rates, names and the numbers' type."""

    sample_rate_hz: Positive
    duration_s: Positive
    log_rate_hz: Positive = 100.0
    samples: Literal["float64", "float32"] = "float64"
    gyro_id: str = "SIM"
    lot_id: str = ""


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
    effects: dict[str, dict[str, float | str | bool]] = {}
    run_id: Annotated[str, Field(pattern=r"^[^/\\\s]+$")] = "run"

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


def runs_of(config: Mapping[str, Any], where: str = "simulation") -> list[SimulationFile]:
    """The runs of a simulation file, each whole and checked. HrgError: what is wrong, where, and
    what was meant."""
    base = {key: value for key, value in config.items() if key != "run"}
    overrides = config.get("run", [])
    if not isinstance(overrides, list) or not all(isinstance(r, Mapping) for r in overrides):
        raise HrgError(f"{where}: run is not an array of tables; write each run under [[run]]")
    if not overrides:
        return [validate(SimulationFile, base, where)]
    digits = len(str(len(overrides)))
    runs = []
    for number, override in enumerate(overrides, 1):
        named = {"run_id": f"run{number:0{digits}d}"} | dict(override)
        runs.append(
            validate(
                SimulationFile, _merged(base, named), f"{where}: run {number} ({named['run_id']})"
            )
        )
    names = [run.run_id for run in runs]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise HrgError(f"{where}: run_id {twice[0]} stands twice; give each run its own name")
    return runs


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
