"""The tables of the bench: [environment] with its programmes of temperature and rate,
[recording]."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ...records.time_origin import parse_time
from .strict_table import NotNegative, Positive, Table, need_at_most_one, need_rising


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
        need_rising(self.time_s, self.temperature_degc, "temperature_degc")
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
        need_rising(self.time_s, self.rate_rad_s, "rate_rad_s")
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
    """[environment]: a constant, or a programme that takes its place (temperature) or is added to
    it (rate)."""

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
        need_at_most_one(self, ("earth_latitude_rad", "earth_rate_rad_s"))
        return self


class RecordingTable(Table):
    """[recording]: length, rates, names and the numbers' type."""

    sample_rate_hz: Positive
    """Samples per second."""
    duration_s: Positive
    """Length of the run."""
    log_rate_hz: Positive = 100.0
    """Rows per second of the auxiliary log."""
    samples: Literal["float64", "float32"] = "float64"
    """Type of the numbers in the file."""
    gyro_id: str = "SIM"
    """The gyro."""
    lot_id: str = ""
    """The lot."""
    start_time: str = ""
    """ISO 8601 time at which the run begins; what ages does so from the first run's on."""

    @model_validator(mode="after")
    def _readable_start(self) -> Self:
        try:
            if self.start_time:
                parse_time(self.start_time)
        except ValueError as error:
            raise ValueError(
                f'start_time = "{self.start_time}" is no ISO 8601 time; write it as'
                ' "2026-05-04T14:03:22Z"'
            ) from error
        return self
