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

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )


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
    """Temperature at which [device] holds."""
    frequency_per_degc: Course = 0.0
    """Relative change of the frequency a °C, or a °C, °C² …."""
    damping_rate_per_degc: Course = 0.0
    """The same of the damping rate."""
    damping_split_per_degc: Course = 0.0
    """The same of the damping split."""
    frequency_split_per_degc: Course = 0.0
    """The same of the frequency split."""
    scale_factor_per_degc: Course = 0.0
    """The same of K."""


class Device(Table):
    """[device]: the resonator. One of quality_factor, time_constant_s, damping_rate_1_s; a split's size in either of its units."""

    frequency_hz: Positive
    """Oscillation frequency."""
    quality_factor: Positive | None = None
    """Q = πfτ."""
    time_constant_s: Positive | None = None
    """Amplitude's time constant τ."""
    damping_rate_1_s: NotNegative | None = None
    """ν = 1/τ."""
    damping_split: Annotated[float, Field(ge=-1, le=1)] | None = None
    """δμ, relative to ν."""
    damping_split_1_s: float | None = None
    """ν·δμ."""
    damping_axis_rad: float = 0.0
    """θ_μ, axis of the largest damping."""
    frequency_split_rad_s: float | None = None
    """δω = (ω_p − ω_q)/2."""
    frequency_split_hz: float | None = None
    """Δf = δω/π."""
    stiffness_axis_rad: float = 0.0
    """θ_ω, axis of the highest frequency."""
    scale_factor: float = 0.55
    """K of m·dθ/dt = −K·Ω."""
    mode_number: Annotated[int, Field(ge=1, le=64)] = 2
    """m: 2 for a shell, 1 for a pendulum."""
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
    """Main amplitude a_A."""
    quadrature: float = 0.0
    """Quadrature amplitude a_B, signed."""
    wave_angle_rad: float = 0.0
    """Wave angle θ."""
    phase_rad: float = 0.0
    """Phase φ."""

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
    """Pick-off by the displacement itself, or on a carrier."""
    carrier_hz: Positive | None = None
    """Carrier frequency; needed with a carrier alone."""
    carrier_phase_rad: float = 0.0
    """Carrier phase ψ."""
    model: Literal["linear", "full"] = "linear"
    """Displacement as it is, or the electrodes' whole law."""
    gap: Positive | None = None
    """The electrodes' gap in the amplitude's unit; needed with the full model alone."""
    law: Literal["alternating", "constant-voltage", "printed"] = "alternating"
    """The electrodes' law."""
    electrode_gaps: Annotated[list[Positive], Field(min_length=8, max_length=8)] = [1.0] * 8
    """Gap of each electrode, relative."""
    electrode_gains: Annotated[list[Positive], Field(min_length=8, max_length=8)] = [1.0] * 8
    """Gain of each electrode, relative."""
    noise: NotNegative = 0.0
    """Standard deviation of a sample."""
    adc_bits: Annotated[int, Field(ge=0, le=31)] = 0
    """Bits of the converter; 0: none."""
    full_scale: Positive | None = None
    """Value at which the converter saturates; 1.5 times the largest amplitude where not given, 3 times with a carrier."""
    clock_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    """Relative error of the sampling clock."""
    units: str = "1"
    """Unit of the samples."""

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
    """Times of the log, s."""
    drive_main: list[float]
    """Drive of the main amplitude, amplitude/s."""
    drive_quadrature: list[float] | None = None
    """Drive of the quadrature, amplitude/s."""

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
    """Run-down, or a driven whole-angle run."""
    log: DriveLog | None = None
    """A logged drive, replayed in place of loops."""
    amplitude: Positive | None = None
    """Set amplitude; the start's where not given."""
    amplitude_gain_1_s: NotNegative = 5.0
    """Proportional gain of the amplitude loop."""
    amplitude_integral_1_s2: NotNegative | None = None
    """Its integral gain; a quarter of the gain's square where not given."""
    quadrature_loop: Literal["off", "finite", "spring"] = "off"
    """How the quadrature is held: not, by force, or by an electric spring."""
    quadrature_gain_1_s: NotNegative | None = None
    """Proportional gain of the quadrature loop; 5 where not given."""
    quadrature_integral_1_s2: NotNegative = 0.0
    """Its integral gain."""
    drive: Literal["force", "parametric"] = "force"
    """Force on electrodes, or one ring electrode (parametric)."""
    main_phase_error_rad: float = 0.0
    """Phase error of the main force."""
    quadrature_phase_error_rad: float = 0.0
    """Phase error of the quadrature force."""
    off_s: list[list[NotNegative]] = []
    """Intervals [start, stop] in which the drive is off."""

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
    """Oscillation periods a demodulation window."""
    delay_periods: NotNegative = 0.0
    """Delay from a window's end to the drive, in periods."""
    filter_hz: Positive | None = None
    """Corner of the low-pass on the demodulated envelopes; none where not given."""
    phase_loop_hz: Positive = 1.0
    """Natural frequency of the phase-locked loop, damping 1/√2."""
    drive_bits: Annotated[int, Field(ge=0, le=31)] = 0
    """Bits of the drive's converter; 0: none."""
    drive_full_scale: Positive | None = None
    """Force, amplitude a second, at which the drive's converter saturates."""
    drive_periods: Annotated[int, Field(ge=0, le=100_000)] = 0
    """Periods of driving after each window of reading; 0: both at once."""
    spring_signal: Literal["quadrature", "phase_product"] = "quadrature"
    """What the electric spring's loop acts on: a_B/a_A, or a_A a_B over the set amplitude's square."""

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
    """Temperature of the Brownian force."""
    effective_mass_kg: Positive | None = None
    """Modal mass."""
    metres_per_unit: Positive = 1.0
    """Metres a unit of amplitude."""
    readout_corner_hz: NotNegative = 0.0
    """Corner of the 1/f read-out noise about the resonance."""
    drive_density: NotNegative = 0.0
    """Drive noise, amplitude/s/√Hz, one-sided."""
    drive_corner_hz: NotNegative = 0.0
    """Corner of its 1/f part."""

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
    """Size of the spring."""
    axis_rad: float
    """Axis that it softens."""


class Ramp(Table):
    """Temperature from one value to another."""

    kind: Literal["ramp"]
    start_degc: float
    """First temperature."""
    stop_degc: float
    """Last temperature."""
    begin_s: NotNegative = 0.0
    """Time at which it begins."""
    end_s: Positive | None = None
    """Time at which it ends; the run's end where not given."""


class Soak(Table):
    """Temperature levels held in turn."""

    kind: Literal["soak"]
    levels_degc: Annotated[list[float], Field(min_length=1)]
    """The levels."""
    dwell_s: Positive
    """Time at each."""
    transition_s: Positive
    """Time between two."""


class Cycle(Table):
    """Temperature up and down."""

    kind: Literal["cycle"]
    low_degc: float
    """Lowest temperature."""
    high_degc: float
    """Highest temperature."""
    period_s: Positive
    """Time of a cycle."""
    shape: Literal["sine", "triangle"] = "triangle"
    """Form of a cycle."""


class TemperaturePoints(Table):
    """Temperature along straight lines through points, as a log gives them; constant before the
    first and after the last."""

    kind: Literal["points"]
    time_s: Annotated[list[float], Field(min_length=1)]
    """Times of the points, rising."""
    temperature_degc: list[float]
    """Their temperatures."""

    @model_validator(mode="after")
    def _matched(self) -> Self:
        _same_and_rising(self.time_s, self.temperature_degc, "temperature_degc")
        return self


class RatePoints(Table):
    """Rate along straight lines through points, as a log gives them; constant before the first and
    after the last."""

    kind: Literal["points"]
    time_s: Annotated[list[float], Field(min_length=1)]
    """Times of the points, rising."""
    rate_rad_s: list[float]
    """Their rates."""

    @model_validator(mode="after")
    def _matched(self) -> Self:
        _same_and_rising(self.time_s, self.rate_rad_s, "rate_rad_s")
        return self


class Steps(Table):
    """Rates held in turn; `transition_s` is the table's time between two."""

    kind: Literal["steps"]
    levels_rad_s: Annotated[list[float], Field(min_length=1)]
    """The levels."""
    dwell_s: Positive
    """Time at each."""
    transition_s: Positive = 0.02
    """Time between two."""


class Sine(Table):
    """Sinusoidal rate."""

    kind: Literal["sine"]
    amplitude_rad_s: float
    """Amplitude of the rate."""
    frequency_hz: Positive
    """Its frequency."""
    phase_rad: float = 0.0
    """Its phase."""


class Sweep(Table):
    """Rate from 0 to +maximum, to −maximum and back to 0, along straight lines, in each period."""

    kind: Literal["sweep"]
    maximum_rad_s: float
    """Largest rate."""
    period_s: Positive | None = None
    """Time of a sweep; the run's length where not given."""


class EnvironmentTable(Table):
    """[environment]: a constant, or a programme that takes its place (temperature) or is added to it (rate)."""

    temperature_degc: float = 20.0
    """Constant temperature."""
    temperature: (
        Annotated[Ramp | Soak | Cycle | TemperaturePoints, Field(discriminator="kind")] | None
    ) = None
    """Programme in place of the constant temperature."""
    rate_rad_s: float = 0.0
    """Constant rate about the sensitive axis."""
    rate: Annotated[Steps | Sine | Sweep | RatePoints, Field(discriminator="kind")] | None = None
    """Programme added to the constant rate."""
    earth_latitude_rad: Annotated[float, Field(ge=-math.pi / 2, le=math.pi / 2)] | None = None
    """Latitude: the vertical axis sees the Earth's rate times its sine."""
    earth_rate_rad_s: float | None = None
    """The Earth's rate about the sensitive axis, given outright."""
    earth_logged: bool = True
    """Whether the logged rate holds the Earth's."""

    @model_validator(mode="after")
    def _one_earth(self) -> Self:
        _at_most_one(self, ("earth_latitude_rad", "earth_rate_rad_s"))
        return self


class RecordingTable(Table):
    """[recording]: length, rates, names and the numbers' type."""

    sample_rate_hz: Positive
    """Samples a second."""
    duration_s: Positive
    """Length of the run."""
    log_rate_hz: Positive = 100.0
    """Rows a second of the auxiliary log."""
    samples: Literal["float64", "float32"] = "float64"
    """Type of the numbers in the file."""
    gyro_id: str = "SIM"
    """The gyro."""
    lot_id: str = ""
    """The lot."""


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
    """Effects by name with their parameters (the table of effects)."""
    run_id: Annotated[str, Field(pattern=r"^[^/\\\s]+$")] = "run"
    """Name of the run."""

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
