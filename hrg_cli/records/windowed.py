"""What a row of every window carries, and the bits that flag it."""

from __future__ import annotations

from dataclasses import dataclass

from .columns import (
    LOGGED,
    MODE,
    NEAR_LOGGED,
    ORDER,
    POSITIVE,
    READOUT,
    RISING,
    STANDS_FOR,
    Array,
    Valid,
    attribute,
    column,
)
from .record import Record

FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING = 1, 2, 4, 8
"""Bits of the column `flags`."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Windowed(Record):
    """What a row of every window carries, and the run it belongs to: common to `Periods` and
    `Wave`."""

    time_s: Array = column("s", "centre of the window", packed=False, valid=RISING)
    flags: Array = column(
        "1",
        "bits: 1 clipped, 2 gap, 4 not finite, 8 settling",
        dtype="u1",
        valid=Valid(at_least=0, at_most=15),
    )
    temperature_degc: Array | None = column(
        "degC", "temperature at the window", optional=True, valid=NEAR_LOGGED
    )
    rate_rad_s: Array | None = column(
        "rad s-1", "rate about the sensitive axis at the window", optional=True, valid=NEAR_LOGGED
    )
    drive_main: Array | None = column(
        "any", "commanded drive of the main wave", optional=True, valid=LOGGED
    )
    drive_quadrature: Array | None = column(
        "any", "commanded drive of the quadrature wave", optional=True, valid=LOGGED
    )
    reference_frequency_hz: float = attribute(
        "frequency of the reference phase, which is 0 at t = 0", dtype="f8", valid=POSITIVE
    )
    window_s: float = attribute("length of a window", dtype="f8", valid=POSITIVE)
    window_stands_for: str = attribute(
        '"mean": of the motion over the window; "middle": the bend of the motion within it is taken'
        " off by the windows two before and two behind",
        default="mean",
        valid=STANDS_FOR,
    )
    mode: str = attribute('"free" or "forced"', valid=MODE)
    readout: str = attribute('"direct" or "carrier"', default="direct", valid=READOUT)
    mode_number: int = attribute("angular mode number m", default=2, dtype="i8", valid=ORDER)
    gyro_id: str = attribute("the gyro", default="")
    run_id: str = attribute("the run", default="")
    lot_id: str = attribute("the lot", default="")
    start_time: str = attribute("ISO 8601 time of t = 0", default="")
    least_count: float | None = attribute(
        "smallest step of the samples' values, unit of the signals",
        default=None,
        dtype="f8",
        valid=POSITIVE,
    )
    quantisation_share: float | None = attribute(
        "part of the samples' residual variance that rounding to the least count makes: its"
        " square/12 over the residual's",
        default=None,
        dtype="f8",
    )
    noise_correlation: float | None = attribute(
        "correlation of the two channels' noise about the oscillation",
        default=None,
        dtype="f8",
        valid=Valid(at_least=-1, at_most=1),
    )
    spectrum_frequency_hz: Array | None = column(
        "Hz",
        "frequency of the residual spectrum",
        ("frequency",),
        group="/spectrum",
        name="frequency_hz",
        optional=True,
        valid=Valid(at_least=0, rising=True),
    )
    spectrum_density: Array | None = column(
        "any",
        "one-sided power density of the residual, both channels, signal unit²/Hz",
        ("frequency", "channel"),
        group="/spectrum",
        name="density",
        optional=True,
        valid=Valid(at_least=0),
    )
    spectrum_line_frequency_hz: Array | None = column(
        "Hz",
        "lines that stand out of the residual",
        ("line",),
        group="/spectrum",
        name="line_frequency_hz",
        optional=True,
        valid=Valid(at_least=0),
    )
    spectrum_line_amplitude: Array | None = column(
        "any",
        "their amplitudes, both channels",
        ("line", "channel"),
        group="/spectrum",
        name="line_amplitude",
        optional=True,
    )
    spectrum_line_ratio: Array | None = column(
        "1",
        "their power over the noise floor",
        ("line",),
        group="/spectrum",
        name="line_ratio",
        optional=True,
        valid=Valid(at_least=0),
    )
