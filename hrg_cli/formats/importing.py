"""import_log: any foreign log becomes a recording, whole or as a stream of blocks.

Times: an even time column (to within its own rounding, or `sampling_tolerance` of a step) becomes `sample_rate_hz`; any other
is kept as `time_s`, never resampled. t = 0 is the first sample. Slow columns (temperature, rate, drive) become the auxiliary
log, averaged over groups of rows where the log is long, so that it stays near `auxiliary_rows`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..records import Recording
from .columns import Roles, find, listing
from .even import TimeJudge
from .log import Array, Log
from .quantities import channel_unit, rate_factor, temperature_scale, time_factor
from .readers import guarded, open_log

Column = str | int | None
MANY_NOT_FINITE = 1e-3
"""Fraction of samples that are not finite from which the recording is suspect."""
Names = Annotated[Column, Field(description="column by name or by 1-based number; found by its title where not given")]


def import_log(
    path: Path | str,
    *,
    c: Names = None,
    s: Annotated[Column, Field(description='column of channel S; "none" for a log of one channel (S = 0)')] = None,
    time: Annotated[Column, Field(description='time column; "none" to ignore times')] = None,
    temperature: Names = None,
    rate: Names = None,
    drive_main: Names = None,
    drive_quadrature: Names = None,
    sample_rate_hz: Annotated[
        float | None, Field(gt=0, description="sampling rate, where the log has none or its times are too coarse")
    ] = None,
    sampling_tolerance: Annotated[
        float, Field(ge=0, le=0.5, description="departure from an even grid, in steps, still called even")
    ] = 1e-3,
    time_units: Annotated[str | None, Field(description="s, ms, us, ns, min, h; from the title or s where not given")] = None,
    clock_hz: Annotated[float | None, Field(gt=0, description="ticks a second of a time column that counts ticks")] = None,
    units: Annotated[str | None, Field(description="unit of both channels")] = None,
    c_scale_factor: Annotated[float, Field(description="unit of channel C a raw count, on top of the log's own")] = 1.0,
    s_scale_factor: Annotated[float, Field(description="unit of channel S a raw count, on top of the log's own")] = 1.0,
    rate_units: Annotated[
        str | None, Field(description="rad/s, deg/s, deg/h, rpm; from the title or rad/s where not given")
    ] = None,
    temperature_units: Annotated[str | None, Field(description="degC, K, degF; from the title or degC where not given")] = None,
    rate_scale_factor: Annotated[float, Field(description="factor on the rate column")] = 1.0,
    constant_rate_rad_s: Annotated[float | None, Field(description="rate of the whole run, where the log has none")] = None,
    constant_temperature_degc: Annotated[
        float | None, Field(description="temperature of the whole run, where the log has none")
    ] = None,
    mode: Annotated[Literal["free", "forced"], Field(description="run-down or driven")] = "free",
    mode_number: Annotated[int, Field(ge=1, description="angular mode number m: 2 for a shell, 1 for a pendulum")] = 2,
    readout: Annotated[Literal["direct", "carrier"], Field(description="what the channels hold")] = "direct",
    carrier_hz: Annotated[float | None, Field(gt=0, description="carrier frequency of a carrier read-out")] = None,
    nominal_frequency_hz: Annotated[float | None, Field(gt=0, description="expected oscillation frequency")] = None,
    gyro_id: Annotated[str, Field(description="the gyro")] = "",
    run_id: Annotated[str, Field(description="the run; the file's name where not given")] = "",
    lot_id: Annotated[str, Field(description="the lot")] = "",
    start_time: Annotated[str, Field(description="ISO 8601 time of the first sample; from the log where it has one")] = "",
    format: Annotated[str, Field(description="name of a format, where its content is not to decide")] = "",
    separator: Annotated[
        str | None, Field(min_length=1, max_length=1, description="of a text log; a blank for any run of blanks")
    ] = None,
    decimal: Annotated[Literal[".", ","] | None, Field(description="decimal sign of a text log")] = None,
    auxiliary_rows: Annotated[
        int, Field(ge=1, description="length of the auxiliary log beyond which rows are averaged in groups")
    ] = 100_000,
) -> Recording | Iterator[Recording]:
    """A foreign log as a recording: one Recording when it fits one block, else a stream of them (memory flat in its length).

    HrgError: not readable, no such column, times that do not rise, a broken line, fewer samples than claimed; each names the row.
    """
    path = Path(path)
    before = _state(path)
    log = open_log(path, format, separator, decimal)
    where = str(path)
    single = isinstance(s, str) and s.strip().lower() == "none"
    no_time = isinstance(time, str) and time.strip().lower() == "none"
    asked: dict[str, str | int | None] = {
        "time": None if no_time else time,
        "c": c,
        "s": s,
        "temperature": temperature,
        "rate": rate,
        "drive_main": drive_main,
        "drive_quadrature": drive_quadrature,
    }
    roles = find(log, where, asked, single)
    if no_time:
        roles = replace(roles, time=None)
    _same_length(log, roles, where)
    unit = _channel_unit(log, roles, units, where)
    for name, value in (("c_scale_factor", c_scale_factor), ("s_scale_factor", s_scale_factor)):
        if not np.isfinite(value) or value == 0:
            raise HrgError(f"{name} is {value}, a finite number other than 0 was expected")
    timing = _timing(log, roles, path, time_units, clock_hz, sample_rate_hz, sampling_tolerance)
    if readout == "carrier" and carrier_hz is None:
        raise HrgError('readout is "carrier": give carrier_hz too')
    first, second = log.channels[roles.c], log.channels[roles.c if roles.s is None else roles.s]
    blank = Recording(
        c=np.empty(0),
        s=np.empty(0),
        sample_rate_hz=timing.sample_rate_hz,
        mode=mode,
        readout=readout,
        carrier_hz=carrier_hz,
        mode_number=mode_number,
        gyro_id=gyro_id,
        run_id=run_id or path.stem,
        lot_id=lot_id,
        start_time=start_time or log.start_time,
        nominal_frequency_hz=nominal_frequency_hz,
        c_units=unit,
        s_units=unit,
        c_scale_factor=first.scale_factor * c_scale_factor,
        s_scale_factor=second.scale_factor * s_scale_factor,
        c_add_offset=first.add_offset * c_scale_factor,
        s_add_offset=second.add_offset * s_scale_factor,
    ).judged(log.reasons + timing.reasons)
    if single:
        blank = blank.judged(
            ["only one channel was recorded and S is set to 0: wave angle, quadrature and splits cannot be seen in this run"]
        )
    slow = _Slow(
        log,
        roles,
        rate_units,
        temperature_units,
        rate_scale_factor,
        constant_rate_rad_s,
        constant_temperature_degc,
        auxiliary_rows,
    )
    stream = _stream(path, log, roles, blank, timing, slow, before)
    head = list(itertools.islice(stream, 2))
    return head[0] if len(head) == 1 else itertools.chain(head, stream)


def _state(path: Path) -> tuple[int, int] | None:
    try:
        stat = path.stat()
        return stat.st_size, stat.st_mtime_ns
    except OSError:
        return None


def _same_length(log: Log, roles: Roles, where: str) -> None:
    used = [("c", roles.c), ("s", roles.s), ("time", roles.time), *roles.auxiliary().items()]
    lengths = {role: log.channels[i].length for role, i in used if i is not None and log.channels[i].length is not None}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{role} {length}" for role, length in lengths.items())
        raise HrgError(
            f"{where}: its columns differ in length ({shown}); the log is cut short or its columns were sampled apart: "
            "record again or leave out the odd one"
        )


def _channel_unit(log: Log, roles: Roles, units: str | None, where: str) -> str:
    if units is not None:
        return units
    found = [channel_unit(log.channels[i].units) for i in (roles.c, roles.s) if i is not None]
    if len(set(found)) > 1:
        raise HrgError(
            f"{where}: channel C is in {found[0]!r} and channel S in {found[1]!r}; "
            "give units, and c_scale_factor or s_scale_factor to bring them to one unit"
        )
    return found[0]


@dataclass(frozen=True)
class _Timing:
    """How rows become times: an even rate, or the column's own times × factor."""

    sample_rate_hz: float | None
    factor: float
    reasons: tuple[str, ...] = ()


def _timing(
    log: Log, roles: Roles, path: Path, time_units: str | None, clock_hz: float | None, given: float | None, tolerance: float
) -> _Timing:
    if roles.time is None:
        rate = given or log.sample_rate_hz
        if rate is None:
            raise HrgError(
                f"{path}: neither a time column nor a sampling rate was found (columns: {listing(log)}); give time or sample_rate_hz"
            )
        return _Timing(float(rate), 1.0)
    channel = log.channels[roles.time]
    if channel.kind == "clock":
        factor = 1.0
    elif clock_hz or (log.clock_hz and time_units is None):
        factor = 1.0 / (clock_hz or log.clock_hz or 1.0)
    elif channel.units.lower() in ("ticks", "tick"):
        raise HrgError(f"{path}: its time column counts ticks of the instrument's clock; give clock_hz (ticks a second)")
    else:
        factor = time_factor(time_units or channel.units or "s")
    if given is not None:
        return _Timing(float(given), factor, _departs(log, roles, path, factor, given))
    judge = TimeJudge(str(path), log.where)
    with guarded(path, log.format):
        for (times,) in log.read((roles.time,)):
            judge.add(times * factor * channel.scale_factor)
    if judge.rows == 0:
        raise HrgError(f"{path}: holds no rows of numbers; record again")
    if judge.rows == 1:
        raise HrgError(f"{path}: holds one sample only; a sampling rate cannot be found: give sample_rate_hz")
    step, departure = judge.even_step()
    rounding = log.quantum(roles.time) * (1.0 if channel.kind == "clock" else factor)
    allowed = max(tolerance * step, min(rounding, 0.5 * step) * 0.51, 4 * np.spacing(abs(judge.last)))
    if departure <= allowed:
        return _Timing(float(_nice(1 / step, step, judge.rows, rounding)), factor)
    return _Timing(None, factor)


def _nice(rate: float, step: float, rows: int, rounding: float) -> float:
    """The rate with the fewest digits within what the printed times can tell (10000, not 9999.9999)."""
    error = rate * max(rounding / (step * max(rows - 1, 1)), 4e-16 * rows**0.5)
    for digits in range(1, 16):
        short = float(f"{rate:.{digits}g}")
        if abs(short - rate) <= error:
            return short
    return rate


def _departs(log: Log, roles: Roles, path: Path, factor: float, given: float) -> tuple[str, ...]:
    """A given rate beats the log's times; where they disagree by more than their rounding and two steps, the recording is suspect."""
    assert roles.time is not None
    first = last = None
    rows = 0
    with guarded(path, log.format):
        for (times,) in log.read((roles.time,)):
            finite = times[np.isfinite(times)]
            if len(finite):
                first = finite[0] if first is None else first
                last = finite[-1]
            rows += len(times)
    if first is None or last is None or rows < 2:
        return ()
    span, expected = (last - first) * factor, (rows - 1) / given
    if abs(span - expected) <= 2 / given + 2 * log.quantum(roles.time) * factor + 1e-4 * expected:
        return ()
    return (
        f"the log's times span {span:.6g} s, {rows} samples at the given {given:g} Hz span {expected:.6g} s: "
        "samples are missing or the rate is wrong",
    )


class _Slow:
    """The auxiliary log: columns averaged over groups of rows, converted to SI; constants at the first and last time."""

    def __init__(
        self,
        log: Log,
        roles: Roles,
        rate_units: str | None,
        temperature_units: str | None,
        rate_scale: float,
        rate: float | None,
        temperature: float | None,
        most: int,
    ) -> None:
        self.indexes = roles.auxiliary()
        if "rate" in self.indexes and rate is not None:
            raise HrgError("a rate column and constant_rate_rad_s were both given; leave one out")
        if "temperature" in self.indexes and temperature is not None:
            raise HrgError("a temperature column and constant_temperature_degc were both given; leave one out")
        self.every = max(1, -(-(log.rows or 0) // most))
        self.scales: dict[str, tuple[float, float]] = {}
        for role, index in self.indexes.items():
            channel = log.channels[index]
            factor, offset = 1.0, 0.0
            if role == "rate":
                factor = rate_scale * rate_factor(rate_units or channel.units or "rad/s")
            if role == "temperature":
                factor, offset = temperature_scale(temperature_units or channel.units or "degC")
            self.scales[role] = (factor * channel.scale_factor, factor * channel.add_offset + offset)
        self.constants = {k: v for k, v in (("rate", rate), ("temperature", temperature)) if v is not None}
        self.left: list[Array] | None = None

    def block(self, times: Array, columns: list[Array], last: bool, first: bool) -> dict[str, Array]:
        """Auxiliary rows of a block: field name -> values."""
        if not self.indexes:
            if not self.constants:
                return {}
            rows = ([times[0]] if first else []) + ([times[-1]] if last and not (first and len(times) == 1) else [])
            return {"auxiliary_time_s": np.array(rows), **{_FIELD[k]: np.full(len(rows), v) for k, v in self.constants.items()}}
        stacked = [times, *(np.asarray(col, float) * a + b for col, (a, b) in zip(columns, self.scales.values()))]
        if self.left is not None:
            stacked = [np.concatenate(pair) for pair in zip(self.left, stacked)]
        whole = len(stacked[0]) if last else len(stacked[0]) // self.every * self.every
        self.left = [values[whole:] for values in stacked]
        grouped = [_means(values[:whole], self.every) for values in stacked]
        found = {"auxiliary_time_s": grouped[0], **{_FIELD[role]: values for role, values in zip(self.indexes, grouped[1:])}}
        return found | {_FIELD[k]: np.full(len(grouped[0]), v) for k, v in self.constants.items()}


_FIELD = {
    "rate": "rate_rad_s",
    "temperature": "temperature_degc",
    "drive_main": "drive_main",
    "drive_quadrature": "drive_quadrature",
}


def _means(values: Array, every: int) -> Array:
    """Means of groups of rows, the last group perhaps shorter."""
    if every == 1 or len(values) == 0:
        return values
    starts = np.arange(0, len(values), every)
    return np.asarray(np.add.reduceat(values, starts) / np.diff(starts, append=len(values)))


def _stream(
    path: Path, log: Log, roles: Roles, blank: Recording, timing: _Timing, slow: _Slow, before: tuple[int, int] | None
) -> Iterator[Recording]:
    """Blocks of the recording; the last one bears what only the whole log tells (samples that are not finite)."""
    wanted = [
        roles.c,
        *([] if roles.s is None else [roles.s]),
        *slow.indexes.values(),
        *([] if roles.time is None else [roles.time]),
    ]
    rows, not_finite, origin, held = 0, 0, None, None
    with guarded(path, log.format):
        for columns in itertools.chain(log.read(wanted), [None]):
            if columns is not None and len(columns[0]) == 0:
                continue
            if held is not None:
                first = rows == 0
                c = held[0]
                s = np.zeros_like(c) if roles.s is None else held[1]
                fast = 1 if roles.s is None else 2
                if timing.sample_rate_hz is None:
                    scale = timing.factor * log.channels[roles.time].scale_factor if roles.time is not None else 1.0
                    times = held[-1] * scale
                    origin = float(times[0]) if origin is None else origin
                    times = times - origin
                else:
                    times = np.arange(rows, rows + len(c)) / timing.sample_rate_hz
                rows += len(c)
                if c.dtype.kind == "f":
                    not_finite += int(np.sum(~(np.isfinite(c) & np.isfinite(s))))
                block = blank.replace(
                    c=c, s=s, **slow.block(times, held[fast : fast + len(slow.indexes)], columns is None, first)
                )
                if timing.sample_rate_hz is None:
                    block = block.replace(time_s=times)
                if columns is None:
                    if _state(path) != before:
                        raise HrgError(f"{path}: changed while it was read; wait until it is written and import it again")
                    if not_finite > MANY_NOT_FINITE * rows:
                        block = block.judged(
                            [f"{not_finite} of {rows} samples are not finite; they are kept and will be flagged"]
                        )
                yield block
            held = columns
    if rows == 0:
        raise HrgError(f"{path}: holds no rows of numbers; record again")
