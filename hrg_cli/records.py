"""The records that pass between stages: one frozen dataclass a kind of file, each column declared
once with unit and meaning.

Reading, writing, checking and slicing follow from the declarations (`store.py` knows no column by
name). A column's first dimension says how it grows: `row` is the record's own length; the auxiliary
log and the simulated truth have their own rows. A *stream* is an iterator of records of one kind:
its rows are appended, its other values are those of the last record.
"""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, ClassVar, Literal, Self, TypeVar

import numpy as np

from .errors import HrgError
from .notebook import Shown, needed

Array = np.ndarray
R = TypeVar("R", bound="Record")
Status = Literal["valid", "suspect", "refused"]

FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING = 1, 2, 4, 8
"""Bits of the column `flags`."""

GROWING = ("row", "auxiliary_row", "truth_row")
"""Leading dimensions along which a stream is appended."""


SIZES: dict[str, tuple[int, ...]] = {"channel": (2,), "signal": (4, 8)}
"""Sizes a named dimension may have; the others are free. A dimension `x_2` has the size of `x`."""


@dataclass(frozen=True)
class Valid:
    """What values a column or attribute may hold; every reader and the writer hold it to this
    (`store/validity.py`).

    missing: where NaN may stand for a value that is not known: "never", "flagged" (rows whose flags
    are not 0 or whose fit did not converge), "anywhere"; infinity never may. raw: any number, as a
    converter gave it. above, at_least, at_most: bounds of every value. rising: strictly, from row
    to row. one_of: the texts that are known. json: a text that is a JSON "object" or "list".
    """

    missing: Literal["never", "flagged", "anywhere"] = "never"
    raw: bool = False
    infinite: bool = False
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    rising: bool = False
    one_of: tuple[str, ...] = ()
    json: Literal["", "object", "list"] = ""


FINITE = Valid()
RAW = Valid(raw=True)
RISING = Valid(rising=True)
FLAGGED = Valid(missing="flagged")
FLAGGED_STD = Valid(missing="flagged", at_least=0)
LOGGED = Valid(missing="anywhere")
SCATTER = Valid(at_least=0)
POSITIVE = Valid(above=0)
ORDER = Valid(at_least=1, at_most=1000)
JSON_OBJECT, JSON_LIST = Valid(json="object"), Valid(json="list")
MODE, READOUT = Valid(one_of=("free", "forced")), Valid(one_of=("direct", "carrier"))
REHEARSAL = "rehearsal: "
"""Beginning of every sentence that a rehearsal leaves in a file's status."""
FASTEST_HZ = 1e12
"""No converter samples faster; a larger rate is a damaged number."""


@dataclass(frozen=True)
class Column:
    """How one field of a record is kept: a dataset (`dims` not None) or an attribute of the
    group."""

    units: str | None
    meaning: str
    dims: tuple[str, ...] | None
    group: str | None
    name: str | None
    dtype: str
    optional: bool
    packed: bool = True
    """Compressed where that saves space; not where it would cost more than all the work on the
    values."""
    valid: Valid = FINITE


def column(
    units: str,
    meaning: str,
    dims: tuple[str, ...] = ("row",),
    *,
    group: str | None = None,
    name: str | None = None,
    dtype: str = "f8",
    optional: bool = False,
    packed: bool = True,
    valid: Valid = FINITE,
) -> Any:
    """Declare a dataset; `units` is its canonical unit ("any" for the channel's own), `dims` the
    names of its dimensions."""
    spec = Column(units, meaning, dims, group, name, dtype, optional, packed, valid)
    return (
        field(default=None, metadata={"column": spec})
        if optional
        else field(metadata={"column": spec})
    )


def attribute(
    meaning: str,
    *,
    default: Any = dataclasses.MISSING,
    dtype: str = "str",
    group: str | None = None,
    name: str | None = None,
    valid: Valid = FINITE,
) -> Any:
    """Declare an attribute of the record's group; with `default` it may be missing from a file."""
    optional = default is not dataclasses.MISSING
    return field(
        default=default,
        metadata={"column": Column(None, meaning, None, group, name, dtype, optional, valid=valid)},
    )


def details_number(text: str, *keys: str, default: float) -> float:
    """A number deep in a record's JSON text, `default` where it is not there. HrgError: something
    else stands in its place."""
    tree: Any = json.loads(text or "{}")
    for key in keys:
        if not isinstance(tree, dict):
            break
        tree = tree.get(key, default if key == keys[-1] else {})
    if isinstance(tree, int | float) and not isinstance(tree, bool) and np.isfinite(tree):
        return float(tree)
    raise HrgError(f"the details are damaged ({'.'.join(keys)} is no number); make the file again")


@dataclass(frozen=True)
class Source:
    """One input of a command, as kept in the root attribute `sources`.

    samples: fingerprints of the recorded samples it goes back to (`origins`), so that a copied
    recording is known at any later stage.
    """

    name: str
    kind: str
    sha256: str
    samples: tuple[str, ...] = ()


@dataclass(frozen=True)
class Provenance:
    """Where a record comes from: the commands behind it, its whole settings as TOML, and its
    inputs."""

    history: tuple[str, ...] = ()
    settings: str = ""
    sources: tuple[Source, ...] = ()
    created: str = ""
    generated_by: str = ""


@dataclass(frozen=True, kw_only=True, repr=False)
class Record(Shown):
    """Common to all kinds: validity with its reasons, and provenance."""

    kind: ClassVar[str]
    made_by: ClassVar[str]
    status: Status = "valid"
    status_reasons: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance)

    @classmethod
    @functools.cache
    def columns(cls) -> dict[str, Column]:
        """Field name -> its declaration, in order."""
        return {
            f.name: f.metadata["column"] for f in dataclasses.fields(cls) if "column" in f.metadata
        }

    def __len__(self) -> int:
        for name, spec in self.columns().items():
            if spec.dims and spec.dims[0] == "row" and getattr(self, name) is not None:
                return len(getattr(self, name))
        return 0

    def rows(self, start: int, stop: int) -> Self:
        """The same record with only rows [start, stop), read into memory."""
        cut = {
            name: getattr(self, name)[start:stop]
            for name, spec in self.columns().items()
            if spec.dims and spec.dims[0] == "row" and getattr(self, name) is not None
        }
        return dataclasses.replace(self, **cut)

    def blocks(self, rows: int) -> Iterator[Self]:
        """The record in pieces of at most `rows` rows; a lazily opened file is read piece by
        piece."""
        for start in range(0, len(self), rows):
            yield self.rows(start, min(start + rows, len(self)))

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed."""
        return dataclasses.replace(self, **changes)

    def judged(self, reasons: Iterable[str], status: Status = "suspect") -> Self:
        """A copy whose status is at least as bad as `status` for these further reasons (none:
        unchanged)."""
        reasons = tuple(reasons)
        if not reasons:
            return self
        order: list[Status] = ["valid", "suspect", "refused"]
        worst = max(self.status, status, key=order.index)
        return dataclasses.replace(self, status=worst, status_reasons=self.status_reasons + reasons)


def collect(stream: R | Iterable[R]) -> R:
    """One record in memory from a stream of blocks.

    Parameters
    ----------
    stream
        Records of one kind whose rows follow each other, or one record.

    Returns
    -------
    Record
        The blocks' rows joined; everything else is the last block's.

    Raises
    ------
    HrgError
        The stream is empty.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect
    >>> block = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> len(collect([block, block]))
    6
    """
    if isinstance(stream, Record):
        return stream
    parts = list(stream)
    if not parts:
        raise HrgError("an empty stream holds no record; the stage before it produced nothing")
    last = parts[-1]
    joined: dict[str, Any] = {}
    for name, spec in last.columns().items():
        if spec.dims and spec.dims[0] in GROWING and getattr(last, name) is not None:
            joined[name] = np.concatenate([getattr(p, name) for p in parts])
    return dataclasses.replace(last, **joined)


class Slice:
    """Rows start:stop of an array or of a dataset on disk, read when sliced (by slices without a
    step)."""

    def __init__(self, values: Any, start: int, stop: int) -> None:
        self._values, self._start, self._stop = values, start, stop
        self.dtype = values.dtype

    def __len__(self) -> int:
        return self._stop - self._start

    @property
    def shape(self) -> tuple[int, ...]:
        """As an array's."""
        return (len(self),)

    def __getitem__(self, rows: slice) -> Array:
        first, last, _ = rows.indices(len(self))
        return np.asarray(self._values[self._start + first : self._start + max(first, last)])


@dataclass(frozen=True, kw_only=True, repr=False)
class Recording(Record):
    """Samples of the two channels; evenly sampled (`sample_rate_hz`, first sample at t = 0) or at
    `time_s`.

    `c` and `s` are raw numbers (integer or float); their physical value is raw × scale_factor +
    add_offset in `c_units`.
    """

    kind: ClassVar[str] = "recording"
    made_by: ClassVar[str] = "hrg import or hrg simulate"
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
        "unit of channel C a raw count",
        default=1.0,
        dtype="f8",
        group="/recording/c",
        name="scale_factor",
    )
    s_scale_factor: float = attribute(
        "unit of channel S a raw count",
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
        valid=LOGGED,
    )
    rate_rad_s: Array | None = column(
        "rad s-1",
        "rate about the sensitive axis",
        ("auxiliary_row",),
        group="/auxiliary",
        optional=True,
        valid=LOGGED,
    )
    drive_main: Array | None = column(
        "any",
        "commanded drive of the main wave, force/(2ω) a second",
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
        """Sample times [s] of rows start:stop, from the whole recording's first sample on."""
        stop = len(self.c) if stop is None else min(stop, len(self.c))
        if self.time_s is not None:
            return np.asarray(self.time_s[start:stop])
        assert self.sample_rate_hz is not None
        return np.arange(self.first_sample + start, self.first_sample + stop) / self.sample_rate_hz

    def part(self, start: int, stop: int) -> Recording:
        """Samples start:stop, left where they are until they are sliced; times, logs and truth stay
        those of the whole recording."""
        return dataclasses.replace(
            self,
            c=Slice(self.c, start, stop),  # type: ignore[arg-type]
            s=Slice(self.s, start, stop),  # type: ignore[arg-type]
            time_s=None if self.time_s is None else Slice(self.time_s, start, stop),  # type: ignore[arg-type]
            first_sample=self.first_sample + start,
        )

    def physical(self, start: int = 0, stop: int | None = None) -> tuple[Array, Array]:
        """Both channels of rows start:stop in their units, as floats."""
        c = np.asarray(self.c[start:stop], dtype=float) * self.c_scale_factor + self.c_add_offset
        s = np.asarray(self.s[start:stop], dtype=float) * self.s_scale_factor + self.s_add_offset
        return c, s


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
        "degC", "temperature at the window", optional=True, valid=LOGGED
    )
    rate_rad_s: Array | None = column(
        "rad s-1", "rate about the sensitive axis at the window", optional=True, valid=LOGGED
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


@dataclass(frozen=True, kw_only=True, repr=False)
class Periods(Windowed):
    """Signals a window: the least-squares coefficients of both channels at the window's centre.

    Direct read-out, 4 signals c_cos, c_sin, s_cos, s_sin: C = c_cos·cos ω_r t + c_sin·sin ω_r t, so
    C0 = c_cos − j·c_sin. Carrier read-out, 8 signals: the a (cosine) and b (sine) coefficients at
    the difference and sum frequencies in the order a_c⁻, a_c⁺, b_c⁻, b_c⁺, a_s⁻, a_s⁺, b_s⁻, b_s⁺
    (PHYSICS §3, seed B (1)).
    """

    kind: ClassVar[str] = "periods"
    made_by: ClassVar[str] = "hrg demodulate"
    signals: Array = column("any", "signal coefficients", ("row", "signal"), valid=FLAGGED)
    signals_std: Array = column(
        "any", "their standard deviations", ("row", "signal"), packed=False, valid=FLAGGED_STD
    )
    residual_rms: Array = column(
        "any", "rms of what the fit leaves, channel C and S", ("row", "channel"), valid=FLAGGED_STD
    )
    periods_per_window: float = attribute(
        "oscillation periods a window", dtype="f8", valid=POSITIVE
    )
    carrier_hz: float | None = attribute(
        "carrier frequency", default=None, dtype="f8", valid=POSITIVE
    )
    units: str = attribute("unit of the signals", default="1", name="signal_units")
    details: str = attribute(
        "JSON: what import --envelope took of the log, and the noise it found", default="{}"
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class Wave(Windowed):
    """The standing wave a window: main amplitude, quadrature, wave angle, phases, with standard
    deviations.

    C0 = e^{jφ}(a_A cos mθ + j a_B sin mθ), S0 = e^{jφ}(a_A sin mθ − j a_B cos mθ); θ and φ
    unwrapped within the run; φ against the reference frequency. `covariance` is kept for the four
    of (a_A, a_B, θ, φ) only where it is not diagonal.
    """

    kind: ClassVar[str] = "wave"
    made_by: ClassVar[str] = "hrg estimate"
    main_amplitude: Array = column("any", "main amplitude a_A", valid=FLAGGED)
    quadrature_amplitude: Array = column("any", "quadrature amplitude a_B, signed", valid=FLAGGED)
    wave_angle_rad: Array = column("rad", "wave angle θ, physical angle, unwrapped", valid=FLAGGED)
    phase_rad: Array = column(
        "rad", "phase φ against the reference frequency, unwrapped", valid=FLAGGED
    )
    carrier_phase_rad: Array = column(
        "rad", "carrier phase ψ (0 with direct read-out)", valid=FLAGGED
    )
    main_amplitude_std: Array = column("any", "its standard deviation", valid=FLAGGED_STD)
    quadrature_amplitude_std: Array = column("any", "its standard deviation", valid=FLAGGED_STD)
    wave_angle_rad_std: Array = column("rad", "its standard deviation", valid=FLAGGED_STD)
    phase_rad_std: Array = column("rad", "its standard deviation", valid=FLAGGED_STD)
    carrier_phase_rad_std: Array = column("rad", "its standard deviation", valid=FLAGGED_STD)
    residual_rms: Array = column(
        "any",
        "rms of the redundant equations' residual (0 where there is no redundancy)",
        valid=FLAGGED_STD,
    )
    signal_std: Array = column(
        "any",
        "standard deviation of one signal coefficient, pooled over the window's signals",
        valid=FLAGGED_STD,
    )
    iterations: Array = column(
        "1",
        "residual evaluations of the solver (0: closed form; negative: not converged)",
        dtype="i2",
    )
    frequency_hz: Array = column(
        "Hz",
        "oscillation frequency: reference + dφ/dt / 2π, smoothed over neighbouring windows",
        valid=LOGGED,
    )
    units: str = attribute("unit of the amplitudes", default="1", name="amplitude_units")

    def good(self) -> Array:
        """Rows that are neither flagged nor failed: (n,) bool."""
        return (self.flags == 0) & (self.iterations >= 0) & np.isfinite(self.wave_angle_rad)


@dataclass(frozen=True, kw_only=True, repr=False)
class Resonator(Record):
    """Mechanical parameters with covariance, and how well each run agrees."""

    kind: ClassVar[str] = "resonator"
    made_by: ClassVar[str] = "hrg identify"
    name: Array = column("1", "parameter", ("parameter",), dtype="str")
    value: Array = column("any", "value", ("parameter",))
    std: Array = column("any", "standard deviation", ("parameter",), valid=SCATTER)
    units: Array = column("1", "unit", ("parameter",), dtype="str")
    covariance: Array = column("any", "covariance of the values", ("parameter", "parameter_2"))
    method: str = attribute("method of identification", default="likelihood")
    mode_number: int = attribute("angular mode number m", default=2, dtype="i8", valid=ORDER)
    gyro_id: str = attribute("the gyro", default="")
    lot_id: str = attribute("the lot", default="")
    chi2_per_dof: float = attribute(
        "χ² a degree of freedom of the fit",
        default=float("nan"),
        dtype="f8",
        valid=Valid(missing="anywhere", infinite=True, at_least=0),
    )
    condition: float = attribute(
        "condition number of the scaled Fisher information",
        default=float("nan"),
        dtype="f8",
        valid=Valid(missing="anywhere", infinite=True, at_least=0),
    )
    temperature_degc: float | None = attribute(
        "mean temperature of the runs, where it was logged", default=None, dtype="f8"
    )
    temperature_span_degc: float | None = attribute(
        "range of the runs' temperatures", default=None, dtype="f8", valid=SCATTER
    )
    flat_directions: str = attribute(
        "JSON list of sentences: what these runs cannot tell", default="[]", valid=JSON_LIST
    )
    details: str = attribute(
        "JSON: method comparison, profiles, bounds", default="{}", valid=JSON_OBJECT
    )
    run: Array | None = column(
        "1", "run", ("run",), group="/fit", name="run_id", dtype="str", optional=True
    )
    run_chi2_per_dof: Array | None = column(
        "1",
        "χ² a degree of freedom of the run",
        ("run",),
        group="/fit",
        name="chi2_per_dof",
        optional=True,
        valid=Valid(missing="anywhere", at_least=0),
    )
    run_residual_rms: Array | None = column(
        "any",
        "rms of the run's envelope residual",
        ("run",),
        group="/fit",
        name="residual_rms",
        optional=True,
        valid=Valid(missing="anywhere", at_least=0),
    )
    run_rows: Array | None = column(
        "1",
        "windows used of the run",
        ("run",),
        group="/fit",
        name="rows",
        dtype="i8",
        optional=True,
        valid=SCATTER,
    )

    def parameters(self) -> dict[str, tuple[float, float, str]]:
        """name -> (value, standard deviation, unit)."""
        return {
            str(n): (float(v), float(s), str(u))
            for n, v, s, u in zip(self.name, self.value, self.std, self.units)
        }

    def get(self, name: str) -> float:
        """Value of one parameter."""
        return self.parameters()[name][0]

    def uncertain(self) -> dict[str, Any]:
        """The parameters as correlated numbers of the package `uncertainties`: what is computed
        from them has its right σ.

        HrgError: the package is not installed.
        """
        package, values = needed("uncertainties", "uncertain()"), np.asarray(self.value, float)
        numbers = package.correlated_values(values, np.asarray(self.covariance, float))
        return dict(zip(map(str, self.name), numbers, strict=True))


@dataclass(frozen=True, kw_only=True, repr=False)
class Calibration(Record):
    """Drift D(T, θ) and scale factor K(T, θ): m·dθ/dt = −K·Ω + D, as Fourier coefficients a
    temperature node and as tables.

    Harmonics are of 2mθ: value(θ) = h₀ + Σ_k h_{2k−1} cos(2mkθ) + h_{2k} sin(2mkθ). Nodes are
    temperatures (`axis` "temperature") or frequencies ("frequency").
    """

    kind: ClassVar[str] = "calibration"
    made_by: ClassVar[str] = "hrg calibrate"
    temperature_degc: Array | None = column(
        "degC", "temperature nodes", ("node",), optional=True, valid=RISING
    )
    frequency_hz: Array | None = column(
        "Hz",
        "frequency nodes, with `axis` frequency",
        ("node",),
        optional=True,
        valid=Valid(above=0, rising=True),
    )
    wave_angle_rad: Array = column(
        "rad", "wave angle nodes over one period π/m", ("angle",), valid=RISING
    )
    drift_rad_s: Array = column("rad s-1", "drift D", ("node", "angle"))
    drift_rad_s_std: Array = column(
        "rad s-1", "its standard deviation", ("node", "angle"), valid=SCATTER
    )
    scale_factor: Array = column("1", "scale factor K", ("node", "angle"))
    scale_factor_std: Array = column(
        "1", "its standard deviation", ("node", "angle"), valid=SCATTER
    )
    drift_harmonics: Array = column(
        "rad s-1", "constant, cos 2mθ, sin 2mθ, …", ("node", "harmonic")
    )
    drift_harmonics_std: Array = column(
        "rad s-1", "their standard deviations", ("node", "harmonic"), valid=SCATTER
    )
    scale_factor_harmonics: Array = column(
        "1", "constant, cos 2mθ, sin 2mθ, …", ("node", "harmonic_k")
    )
    scale_factor_harmonics_std: Array = column(
        "1", "their standard deviations", ("node", "harmonic_k"), valid=SCATTER
    )
    covariance: Array = column(
        "any",
        "covariance of all coefficients, node-major, drift then scale factor a node",
        ("coefficient", "coefficient_2"),
    )
    axis: str = attribute(
        '"temperature" or "frequency"',
        default="temperature",
        valid=Valid(one_of=("temperature", "frequency")),
    )
    model: str = attribute(
        "variant: table, parametric, quadrature, phase, combined, physical", default="table"
    )
    interpolation: str = attribute(
        "between nodes: linear, cubic, monotone",
        default="linear",
        valid=Valid(one_of=("linear", "cubic", "monotone")),
    )
    mode_number: int = attribute("angular mode number m", default=2, dtype="i8", valid=ORDER)
    gyro_id: str = attribute("the gyro", default="")
    lot_id: str = attribute("the lot", default="")
    node_min: float = attribute(
        "lowest node value the table may be used at", dtype="f8", valid=Valid(infinite=True)
    )
    node_max: float = attribute(
        "highest node value the table may be used at", dtype="f8", valid=Valid(infinite=True)
    )
    rate_min_rad_s: float = attribute("lowest rate calibrated", dtype="f8")
    rate_max_rad_s: float = attribute("highest rate calibrated", dtype="f8")

    @property
    def node(self) -> Array:
        """The nodes of the table's first axis."""
        nodes = self.temperature_degc if self.axis == "temperature" else self.frequency_hz
        assert nodes is not None
        return nodes

    def evaluate(self, node: Array | float, wave_angle_rad: Array | float) -> tuple[Array, Array]:
        """(D in rad/s, K) at temperatures (or frequencies, by `axis`) and wave angles, broadcast
        against each other.

        HrgError: a node outside the range the tables may be used in.
        """
        x, theta = np.broadcast_arrays(np.asarray(node, float), np.asarray(wave_angle_rad, float))
        low, high = (
            v if np.isfinite(v) else edge
            for v, edge in ((self.node_min, -np.inf), (self.node_max, np.inf))
        )
        if np.any((x < low) | (x > high)):
            raise HrgError(
                f"the tables are for {low:g} to {high:g}, {float(x.min()):g} to {float(x.max()):g}"
                " was asked for"
            )
        drift, scale = import_module("hrg_cli.stages.calibration.table").values(
            self, x.ravel(), theta.ravel()
        )
        return drift.reshape(x.shape), scale.reshape(x.shape)

    correction: str = attribute(
        "sign and order of the correction",
        default="rate = (D - m*dtheta/dt) / K; subtract drift first, then divide",
    )
    details: str = attribute(
        "JSON: rms figures, ladder, cross-validation, stability, model coefficients",
        default="{}",
        valid=JSON_OBJECT,
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class Compensated(Record):
    """Rate and angle of one run after the tables, with what was left before and after where the
    rate was known."""

    kind: ClassVar[str] = "compensated"
    made_by: ClassVar[str] = "hrg compensate"
    time_s: Array = column("s", "middle of the increment", valid=RISING)
    rate_estimate_rad_s: Array = column("rad s-1", "rate after the tables")
    rate_estimate_rad_s_std: Array | None = column(
        "rad s-1", "its standard deviation, where it is known", optional=True, valid=SCATTER
    )
    angle_estimate_rad: Array = column("rad", "its integral from the run's start")
    residual_before_rad_s: Array | None = column(
        "rad s-1", "rate error with a constant scale factor only", optional=True
    )
    residual_after_rad_s: Array | None = column(
        "rad s-1", "rate error after the tables", optional=True
    )
    gyro_id: str = attribute("the gyro", default="")
    run_id: str = attribute("the run", default="")
    lot_id: str = attribute("the lot", default="")
    mode_number: int = attribute("angular mode number m", default=2, dtype="i8", valid=ORDER)
    details: str = attribute("JSON: rms figures", default="{}", valid=JSON_OBJECT)


@dataclass(frozen=True, kw_only=True, repr=False)
class Diagnosis(Record):
    """What the simulation gets wrong: the verdict as JSON and the residual series before and
    after."""

    kind: ClassVar[str] = "diagnosis"
    made_by: ClassVar[str] = "hrg diagnose"
    run: Array = column("1", "index of the run of each row", dtype="i4", valid=SCATTER)
    time_s: Array = column("s", "time")
    wave_angle_rad: Array = column("rad", "wave angle")
    main_amplitude: Array = column("any", "main amplitude")
    temperature_degc: Array | None = column("degC", "temperature", optional=True, valid=LOGGED)
    rate_rad_s: Array | None = column("rad s-1", "rate", optional=True, valid=LOGGED)
    measured: Array = column("any", "measured series, columns named in `series`", ("row", "series"))
    simulated_before: Array = column("any", "the same of the base model", ("row", "series"))
    simulated_after: Array = column("any", "the same of the extended model", ("row", "series"))
    simulated_without: Array | None = column(
        "any",
        "the model fitted without some of the causes, columns named in `left_out`",
        ("row", "series", "left_out"),
        optional=True,
    )
    residual_before: Array = column("1", "whitened residual of the base model", ("row", "series"))
    residual_after: Array = column(
        "1", "whitened residual of the extended model", ("row", "series")
    )
    series: str = attribute("JSON list: the columns' names", valid=JSON_LIST)
    left_out: str = attribute(
        "JSON list of lists: the causes left out of each column of simulated_without",
        default="[]",
        valid=JSON_LIST,
    )
    run_ids: str = attribute("JSON list: the runs", default="[]", valid=JSON_LIST)
    gyro_id: str = attribute("the gyro", default="")
    verdict: str = attribute(
        "adequate, explained, partly explained, unexplained",
        valid=Valid(one_of=("adequate", "explained", "partly explained", "unexplained")),
    )
    report: str = attribute("JSON: the whole verdict", valid=JSON_OBJECT)
    extended_model: str = attribute("the extended model as TOML", default="")


KINDS: tuple[type[Record], ...] = (
    Recording,
    Periods,
    Wave,
    Resonator,
    Calibration,
    Compensated,
    Diagnosis,
)
"""Every kind of file, in the order of the work."""
