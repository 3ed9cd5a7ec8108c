"""The tables of the resonator: [device], [start], [spring]."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from .strict_table import NotNegative, Positive, Table, need_at_most_one, need_exactly_one

Course = float | list[float]
"""Relative change a °C, then a °C², …: value(T) = value·(1 + c₁ΔT + c₂ΔT² + …)."""


class DeviceTemperature(Table):
    """[device.temperature]: coefficients about the reference temperature."""

    reference_degc: float = 20.0
    """Temperature at which [device] holds."""
    frequency_per_degc: Course = 0.0
    """Relative change of the frequency a °C, or a °C, °C² …."""
    damping_rate_per_degc: Course = 0.0
    """The same of the damping rate."""
    damping_split_per_degc: Course = 0.0
    """The same of ν·δμ, whatever ν does."""
    frequency_split_per_degc: Course = 0.0
    """The same of the frequency split."""
    scale_factor_per_degc: Course = 0.0
    """The same of K."""


class Device(Table):
    """[device]: the resonator. One of quality_factor, time_constant_s, damping_rate_1_s; a split's
    size in either of its units."""

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
    equation: Literal["resonator", "averaged"] = "resonator"
    """averaged: over a period, of first order in the slow rates over ω, as other simulators have
    it."""
    temperature: DeviceTemperature = DeviceTemperature()

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        need_exactly_one(self, ("quality_factor", "time_constant_s", "damping_rate_1_s"))
        need_at_most_one(self, ("damping_split", "damping_split_1_s"))
        need_at_most_one(self, ("frequency_split_rad_s", "frequency_split_hz"))
        if abs(self.split_1_s) > self.rate_1_s:
            raise ValueError(
                f"the damping split {self.split_1_s:g} 1/s exceeds the damping rate"
                f" {self.rate_1_s:g} 1/s; one axis would gain energy"
            )
        return self

    @property
    def averaged(self) -> bool:
        """Whether the equation is averaged over a period."""
        return self.equation == "averaged"

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


class SpringTable(Table):
    """[spring]: a constant electric spring that softens along an axis: δω·e^{2jmθ_ω} less
    size·e^{2jm·axis}, f less size/2π."""

    size_rad_s: float
    """Size of the spring."""
    axis_rad: float
    """Axis that it softens."""
