"""Samples of the two channels, with the logs beside them and the simulated truth."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from .columns import (
    JSON_OBJECT,
    LOGGED,
    MODE,
    NEAR_LOGGED,
    ORDER,
    POSITIVE,
    RAW,
    READOUT,
    RISING,
    Array,
    Valid,
    attribute,
    column,
)
from .record import Record

FASTEST_HZ = 1e12
"""No converter samples faster; a larger rate is a damaged number."""


class Slice:
    """Rows start:stop of an array or of a dataset on disk, read when sliced (by slices without a
    step), `less` a number."""

    def __init__(self, values: Any, start: int, stop: int, less: float = 0.0) -> None:
        self._values, self._start, self._stop, self._less = values, start, stop, less
        self.dtype = values.dtype

    def __len__(self) -> int:
        return self._stop - self._start

    @property
    def shape(self) -> tuple[int, ...]:
        """As an array's."""
        return (len(self),)

    def __getitem__(self, rows: slice) -> Array:
        first, last, _ = rows.indices(len(self))
        part = np.asarray(self._values[self._start + first : self._start + max(first, last)])
        return part - self._less if self._less else part


ONE_CHANNEL = "only one channel was recorded and S is set to 0"
"""How the reason begins that an import without an S gives its recording."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Recording(Record):
    """Samples of the two channels; evenly sampled (`sample_rate_hz`, first sample at t = 0) or at
    `time_s`.

    `c` and `s` are raw numbers (integer or float); their physical value is raw × scale_factor +
    add_offset in `c_units`.
    """

    kind: ClassVar[str] = "recording"
    made_by: ClassVar[str] = "hrg import` or `hrg simulate"
    c: Array = column("any", "channel C, raw", dtype="raw", valid=RAW)
    s: Array = column("any", "channel S, raw", dtype="raw", valid=RAW)
    time_s: Array | None = column(
        "s", "time of each sample (uneven sampling)", optional=True, valid=RISING
    )
    sample_rate_hz: float | None = attribute(
        "sampling rate of even sampling",
        default=None,
        dtype="f8",
        valid=Valid(above=0, at_most=FASTEST_HZ),
    )
    mode: str = attribute('"free" or "forced"', valid=MODE)
    readout: str = attribute('"direct" or "carrier"', default="direct", valid=READOUT)
    carrier_hz: float | None = attribute(
        "carrier frequency", default=None, dtype="f8", valid=POSITIVE
    )
    mode_number: int = attribute(
        "angular mode number m: 2 for a shell, 1 for a pendulum", default=2, dtype="i8", valid=ORDER
    )
    gyro_id: str = attribute("the gyro", default="")
    run_id: str = attribute("the run", default="")
    lot_id: str = attribute("the lot", default="")
    start_time: str = attribute("ISO 8601 time of t = 0", default="")
    nominal_frequency_hz: float | None = attribute(
        "expected oscillation frequency", default=None, dtype="f8", valid=POSITIVE
    )
    c_units: str = attribute("unit of channel C", default="1", group="/recording/c", name="units")
    s_units: str = attribute("unit of channel S", default="1", group="/recording/s", name="units")
    c_scale_factor: float = attribute(
        "unit of channel C per raw count",
        default=1.0,
        dtype="f8",
        group="/recording/c",
        name="scale_factor",
    )
    s_scale_factor: float = attribute(
        "unit of channel S per raw count",
        default=1.0,
        dtype="f8",
        group="/recording/s",
        name="scale_factor",
    )
    c_add_offset: float = attribute(
        "value of channel C at raw 0",
        default=0.0,
        dtype="f8",
        group="/recording/c",
        name="add_offset",
    )
    s_add_offset: float = attribute(
        "value of channel S at raw 0",
        default=0.0,
        dtype="f8",
        group="/recording/s",
        name="add_offset",
    )
    least_count: float | None = attribute(
        "smallest step of the recorded values of both channels, in their unit",
        default=None,
        dtype="f8",
        valid=POSITIVE,
    )
    details: str = attribute(
        "JSON: what import took of the log: columns, units, rate, gaps, rows left out",
        default="{}",
        valid=JSON_OBJECT,
    )
    auxiliary_time_s: Array | None = column(
        "s",
        "time of the log",
        ("auxiliary_row",),
        group="/auxiliary",
        name="time_s",
        optional=True,
        valid=RISING,
    )
    temperature_degc: Array | None = column(
        "degC",
        "temperature log",
        ("auxiliary_row",),
        group="/auxiliary",
        optional=True,
        valid=NEAR_LOGGED,
    )
    rate_rad_s: Array | None = column(
        "rad s-1",
        "rate about the sensitive axis",
        ("auxiliary_row",),
        group="/auxiliary",
        optional=True,
        valid=NEAR_LOGGED,
    )
    drive_main: Array | None = column(
        "any",
        "commanded drive of the main wave, force/(2ω) per second",
        ("auxiliary_row",),
        group="/auxiliary",
        optional=True,
        valid=LOGGED,
    )
    drive_quadrature: Array | None = column(
        "any",
        "commanded drive of the quadrature wave",
        ("auxiliary_row",),
        group="/auxiliary",
        optional=True,
        valid=LOGGED,
    )
    truth_time_s: Array | None = column(
        "s", "time of the truth", ("truth_row",), group="/truth", name="time_s", optional=True
    )
    truth_main_amplitude: Array | None = column(
        "any",
        "true main amplitude",
        ("truth_row",),
        group="/truth",
        name="main_amplitude",
        optional=True,
        valid=LOGGED,
    )
    truth_quadrature_amplitude: Array | None = column(
        "any",
        "true quadrature amplitude",
        ("truth_row",),
        group="/truth",
        name="quadrature_amplitude",
        optional=True,
        valid=LOGGED,
    )
    truth_wave_angle_rad: Array | None = column(
        "rad",
        "true wave angle",
        ("truth_row",),
        group="/truth",
        name="wave_angle_rad",
        optional=True,
        valid=LOGGED,
    )
    truth_phase_rad: Array | None = column(
        "rad",
        "true phase",
        ("truth_row",),
        group="/truth",
        name="phase_rad",
        optional=True,
        valid=LOGGED,
    )
    truth_settings: str = attribute(
        "the simulation's settings as TOML", default="", group="/truth", name="settings"
    )

    first_sample: int = 0
    """Samples before the first one, where this is a part of an evenly sampled recording; no file
    holds it."""

    def times(self, start: int = 0, stop: int | None = None) -> Array:
        """Sample times of rows start:stop, from the whole recording's first sample on.

        Parameters
        ----------
        start, stop
            Rows as in a slice; stop None: to the end.

        Returns
        -------
        ndarray
            Times (n,), s.

        Examples
        --------
        >>> import numpy as np
        >>> from hrg_cli import Recording
        >>> recording = Recording(c=np.zeros(5), s=np.ones(5), sample_rate_hz=10.0, mode="free")
        >>> [float(t) for t in recording.times(1, 3)]
        [0.1, 0.2]
        """
        stop = len(self.c) if stop is None else min(stop, len(self.c))
        if self.time_s is not None:
            return np.asarray(self.time_s[start:stop])
        assert self.sample_rate_hz is not None
        return np.arange(self.first_sample + start, self.first_sample + stop) / self.sample_rate_hz

    def part(self, start: int, stop: int) -> Recording:
        """Samples start:stop, left where they are until they are sliced.

        Parameters
        ----------
        start, stop
            Rows as in a slice.

        Returns
        -------
        Recording
            Times go on from the whole recording's first sample; logs and truth are those of the
            whole.
        """
        return dataclasses.replace(
            self,
            c=Slice(self.c, start, stop),  # type: ignore[arg-type]
            s=Slice(self.s, start, stop),  # type: ignore[arg-type]
            time_s=None if self.time_s is None else Slice(self.time_s, start, stop),  # type: ignore[arg-type]
            first_sample=self.first_sample + start,
        )

    def physical(self, start: int = 0, stop: int | None = None) -> tuple[Array, Array]:
        """Both channels of rows start:stop in their units.

        Parameters
        ----------
        start, stop
            Rows as in a slice; stop None: to the end.

        Returns
        -------
        tuple of ndarray
            (C, S), floats (n,) each: the stored values times the channel's factor plus its offset.
        """
        c = np.asarray(self.c[start:stop], dtype=float) * self.c_scale_factor + self.c_add_offset
        s = np.asarray(self.s[start:stop], dtype=float) * self.s_scale_factor + self.s_add_offset
        return c, s
