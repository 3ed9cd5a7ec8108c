"""The tables of what reads and drives the resonator: [readout], [control], [electronics],
[noise]."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from .strict_table import NotNegative, Positive, Table, need_rising


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
    """Value at which the converter saturates; 1.5 times the largest amplitude where not given, 3
    times with a carrier."""
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


class DriveLog(Table):
    """[control.log]: a drive that was logged, a_ΦA and a_ΦB in amplitude per second, replayed along
    straight lines through the rows; constant before the first and after the last."""

    time_s: Annotated[list[float], Field(min_length=1)]
    """Times of the log, s."""
    drive_main: list[float]
    """Drive of the main amplitude, amplitude/s."""
    drive_quadrature: list[float] | None = None
    """Drive of the quadrature, amplitude/s."""

    @model_validator(mode="after")
    def _matched(self) -> Self:
        need_rising(self.time_s, self.drive_main, "drive_main")
        if self.drive_quadrature is not None:
            need_rising(self.time_s, self.drive_quadrature, "drive_quadrature")
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
    off_s: list[list[NotNegative]] = []  # noqa: RUF012 - the model copies it
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
    """[electronics]: the loops act on what a board demodulates (windows of whole periods),
    filtered, delayed and through converters.

    Its converter is that of [readout] (adc_bits, full_scale). drive_full_scale is the force,
    amplitude per second, at which it saturates.
    """

    periods_per_update: Annotated[int, Field(ge=1, le=100_000)] = 16
    """Oscillation periods a demodulation window."""
    delay_periods: Annotated[float, Field(ge=0, le=100_000)] = 0.0
    """Delay from a window's end to the drive, in periods."""
    filter_hz: Positive | None = None
    """Corner of the low-pass on the demodulated envelopes; none where not given."""
    phase_loop_hz: Positive = 1.0
    """Natural frequency of the phase-locked loop, damping 1/√2."""
    drive_bits: Annotated[int, Field(ge=0, le=31)] = 0
    """Bits of the drive's converter; 0: none."""
    drive_full_scale: Positive | None = None
    """Force, amplitude per second, at which the drive's converter saturates."""
    drive_periods: Annotated[int, Field(ge=0, le=100_000)] = 0
    """Periods of driving after each window of reading; 0: both at once."""
    spring_signal: Literal["quadrature", "phase_product"] = "quadrature"
    """What the electric spring's loop acts on: a_B/a_A, or a_A a_B over the set amplitude's
    square."""

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.drive_bits and self.drive_full_scale is None:
            raise ValueError(
                "drive_bits need the force at which the converter saturates; give drive_full_scale"
            )
        return self


class NoiseTable(Table):
    """[noise]: Brownian force of the resonator, and electronic noise with a 1/f corner about the
    resonance.

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
