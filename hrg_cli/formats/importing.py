"""import_log: any foreign log becomes a recording, whole or as a stream of blocks.

Times: an even time column (to within its own rounding, or `sampling_tolerance` of a step) becomes
`sample_rate_hz`; any other is kept as `time_s`, never resampled. t = 0 is the first sample taken
(with `from_s`, `start_time` moves along). Slow columns (temperature, rate, drive) become the
auxiliary log, averaged over groups of rows where the log is long, so that it stays near
`auxiliary_rows`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..records import Recording
from ..records.clock import moved
from ..records.recording import ONE_CHANNEL
from .columns import ALIASES, Roles, find
from .log import Array, Log
from .log_options import (
    ClockHz,
    Column,
    ConstantRate,
    ConstantTemperature,
    Decimal,
    FormatName,
    FromS,
    GyroId,
    LotId,
    Mode,
    ModeNumber,
    RateUnits,
    RunId,
    SamplingTolerance,
    Separator,
    TemperatureUnits,
    Time,
    TimeUnits,
    ToS,
)
from .pairing import pair_logs, second_file
from .quantities import channel_unit, is_level
from .readers import guard_reading, open_log
from .slow import SlowLog
from .taken import Taken, checked_range
from .timing import Timing, timing_of

States = tuple[tuple[int, int], ...] | None


def import_log(
    path: Path | str,
    *,
    c: Annotated[
        Column,
        Field(
            description="column of channel C, by its title or 1-based number; found by its title where not given"
        ),
    ] = None,
    s: Annotated[
        Column, Field(description='column of channel S; "none" for a log of one channel (S = 0)')
    ] = None,
    s_file: Annotated[
        str | None,
        Field(
            min_length=1,
            description=(
                "file of channel S, where it has one of its own: a name, or OLD=NEW put into the"
                " log's name"
            ),
        ),
    ] = None,
    time: Time = None,
    temperature: Annotated[
        Column, Field(description="column of the temperature; found by its title where not given")
    ] = None,
    rate: Annotated[
        Column, Field(description="column of the rate; found by its title where not given")
    ] = None,
    drive_main: Annotated[
        Column, Field(description="column of the main drive; found by its title where not given")
    ] = None,
    drive_quadrature: Annotated[
        Column,
        Field(description="column of the quadrature drive; found by its title where not given"),
    ] = None,
    auxiliary_time: Annotated[
        Column,
        Field(
            description="column of the slow columns' own times, where they have fewer rows than the channels"
        ),
    ] = None,
    sample_rate_hz: Annotated[
        float | None,
        Field(
            gt=0, description="sampling rate, where the log has none or its times are too coarse"
        ),
    ] = None,
    sampling_tolerance: SamplingTolerance = 1e-3,
    time_units: TimeUnits = None,
    clock_hz: ClockHz = None,
    units: Annotated[str | None, Field(description="unit of both channels")] = None,
    c_scale_factor: Annotated[
        float, Field(description="unit of channel C per raw count, on top of the log's own")
    ] = 1.0,
    s_scale_factor: Annotated[
        float, Field(description="unit of channel S per raw count, on top of the log's own")
    ] = 1.0,
    rate_units: RateUnits = None,
    temperature_units: TemperatureUnits = None,
    rate_scale_factor: Annotated[float, Field(description="factor on the rate column")] = 1.0,
    constant_rate_rad_s: ConstantRate = None,
    constant_temperature_degc: ConstantTemperature = None,
    mode: Mode = "free",
    mode_number: ModeNumber = 2,
    readout: Annotated[
        Literal["direct", "carrier"],
        Field(
            description="what the channels hold: the motion itself (direct), or a carrier it modulates"
        ),
    ] = "direct",
    carrier_hz: Annotated[
        float | None, Field(gt=0, description="carrier frequency of a carrier read-out")
    ] = None,
    nominal_frequency_hz: Annotated[
        float | None, Field(gt=0, description="expected oscillation frequency")
    ] = None,
    gyro_id: GyroId = "",
    run_id: RunId = "",
    lot_id: LotId = "",
    start_time: Annotated[
        str, Field(description="ISO 8601 time of the first sample; from the log where it has one")
    ] = "",
    format: FormatName = "",
    separator: Separator = None,
    decimal: Decimal = None,
    from_s: FromS = None,
    to_s: ToS = None,
    auxiliary_rows: Annotated[
        int,
        Field(
            ge=1, description="length of the auxiliary log beyond which rows are averaged in groups"
        ),
    ] = 100_000,
) -> Recording | Iterator[Recording]:
    """A foreign log as a recording: one Recording when it fits one block, else a stream of them
    (memory flat in its length).

    HrgError: not readable, no such column, times that do not rise, a broken line, fewer samples
    than claimed; each names the row.
    """
    checked_range(from_s, to_s)
    if readout == "carrier" and carrier_hz is None:
        raise HrgError('readout is "carrier": give carrier_hz too')
    asked: dict[str, str | int | None] = {
        "time": time,
        "c": c,
        "s": s,
        "temperature": temperature,
        "rate": rate,
        "drive_main": drive_main,
        "drive_quadrature": drive_quadrature,
        "auxiliary_time": auxiliary_time,
    }
    opened = _open(Path(path), s_file, asked, format, separator, decimal)
    log, roles, where = opened.log, opened.roles, opened.files[0]
    unit = _channel_unit(log, roles, units, str(where))
    timing = timing_of(log, roles, where, time_units, clock_hz, sample_rate_hz, sampling_tolerance)
    blank = Recording(
        c=np.empty(0),
        s=np.empty(0),
        sample_rate_hz=timing.sample_rate_hz,
        mode=mode,
        readout=readout,
        carrier_hz=carrier_hz,
        mode_number=mode_number,
        gyro_id=gyro_id,
        run_id=run_id or where.stem,
        lot_id=lot_id,
        start_time=start_time or log.start_time,
        nominal_frequency_hz=nominal_frequency_hz,
        c_units=unit,
        s_units=unit,
        **_scales(log, roles, c_scale_factor, s_scale_factor),
    ).judged(_first_reasons(opened, timing))
    slow = SlowLog(
        log,
        roles,
        rate_units=rate_units,
        temperature_units=temperature_units,
        rate_scale_factor=rate_scale_factor,
        constants={"rate": constant_rate_rad_s, "temperature": constant_temperature_degc},
        most=auxiliary_rows,
    )
    columns = {role: index for role in ALIASES if (index := getattr(roles, role)) is not None}
    told = {"c": unit, "s": unit} | ({"time": time_units} if time_units else {})
    taken = Taken(log, columns, told, timing.sample_rate_hz, from_s, to_s)
    stream = _stream(opened, blank, timing, slow, taken)
    head = list(itertools.islice(stream, 2))
    return head[0] if len(head) == 1 else itertools.chain(head, stream)


@dataclass(frozen=True)
class _Opened:
    """A log with its columns' roles, and its files as they were before it was read."""

    files: Sequence[Path]
    log: Log
    roles: Roles
    before: States


def _open(
    path: Path,
    s_file: str | None,
    asked: Mapping[str, str | int | None],
    format: str,
    separator: str | None,
    decimal: str | None,
) -> _Opened:
    """The log of one file, or of one file per channel, and which of its columns is what."""
    files = [path, *([] if s_file is None else [second_file(path, s_file)])]
    before = _state(files)
    log = open_log(path, format, separator, decimal)
    asked = dict(asked)
    if s_file is not None:
        other = open_log(files[1], format, separator, decimal)
        log, asked = pair_logs(path, log, files[1], other, asked)
    roles = find(log, str(path), asked)
    _same_length(log, roles, str(path))
    return _Opened(files, log, roles, before)


def _scales(log: Log, roles: Roles, c_factor: float, s_factor: float) -> dict[str, Any]:
    """Scale and offset of both channels: what is asked for on top of the log's own. HrgError: a
    factor that is 0 or not finite."""
    found: dict[str, Any] = {}
    for name, index, factor in (
        ("c", roles.c, c_factor),
        ("s", roles.c if roles.s is None else roles.s, s_factor),
    ):
        if not np.isfinite(factor) or factor == 0:
            raise HrgError(
                f"{name}_scale_factor is {factor}, a finite number other than 0 was expected"
            )
        found[f"{name}_scale_factor"] = log.channels[index].scale_factor * factor
        found[f"{name}_add_offset"] = log.channels[index].add_offset * factor
    return found


def _first_reasons(opened: _Opened, timing: Timing) -> list[str]:
    """What is wrong with the recording, as far as it can be told before its rows are read."""
    reasons = [*opened.log.reasons, *timing.reasons]
    if opened.roles.s is None:
        reasons.append(
            f"{ONE_CHANNEL}: wave angle, quadrature and splits cannot be seen in this run"
        )
    return reasons


def _state(files: Sequence[Path]) -> States:
    try:
        return tuple((stat.st_size, stat.st_mtime_ns) for stat in (path.stat() for path in files))
    except OSError:
        return None


def _same_length(log: Log, roles: Roles, where: str) -> None:
    """Channels and times agree in length; slow columns among themselves, and where they are shorter
    they need times of their own."""
    length = {
        role: log.channels[i].length
        for role, i in (("c", roles.c), ("s", roles.s), ("time", roles.time))
        if i is not None
    }
    slow = {role: log.channels[i].length for role, i in roles.auxiliary().items()}
    if roles.auxiliary_time is not None:
        slow["auxiliary_time"] = log.channels[roles.auxiliary_time].length
    timed = "auxiliary_time" in slow or all(
        log.channels[i].sample_rate_hz for i in roles.auxiliary().values()
    )
    if (
        len(set(length.values())) == 1
        and len(set(slow.values())) <= 1
        and (timed or set(slow.values()) <= set(length.values()))
    ):
        return
    shown = ", ".join(f"{role} {rows}" for role, rows in (length | slow).items())
    raise HrgError(
        f"{where}: its columns differ in length ({shown}); the log is cut short or its columns were"
        " sampled apart: name the times of the slow columns with auxiliary_time, leave one out"
        ' with "none", or record again'
    )


def _channel_unit(log: Log, roles: Roles, units: str | None, where: str) -> str:
    for role, index in (("C", roles.c), ("S", roles.s)):
        level = (
            None
            if index is None
            else next((u for u in (units, log.channels[index].units) if u and is_level(u)), None)
        )
        if level is not None and index is not None:
            raise HrgError(
                f"{where}: channel {role}, column {index + 1} ({log.channels[index].name}), is in"
                f" {level}: the logarithm of an amplitude, where samples of an oscillation were"
                " expected; import it with --envelope --amplitude COLUMN --decibel"
            )
    if units is not None:
        return units
    found = [channel_unit(log.channels[i].units) for i in (roles.c, roles.s) if i is not None]
    if len(set(found)) > 1:
        raise HrgError(
            f"{where}: channel C is in {found[0]!r} and channel S in {found[1]!r}; "
            "give units, and c_scale_factor or s_scale_factor to bring them to one unit"
        )
    return found[0]


def _stream(
    opened: _Opened, blank: Recording, timing: Timing, slow: SlowLog, taken: Taken
) -> Iterator[Recording]:
    """Blocks of the recording; the last one bears what only the whole log tells: what was taken,
    what was left out or is not finite."""
    path, log, roles = opened.files[0], opened.log, opened.roles
    rows = 0
    fast = 1 if roles.s is None else 2
    with guard_reading(path, log.format):
        pieces = _pieces(log, roles, timing, slow, taken)
        held = next(pieces, None)
        while held is not None:
            row, times, columns = held
            following = next(pieces, None)
            shift = taken.first_s or 0.0
            times = times - shift
            c = columns[0]
            s = np.zeros_like(c) if roles.s is None else columns[1]
            if c.dtype.kind == "f":
                bad = ~(np.isfinite(c) & np.isfinite(s))
                if bad.any():
                    taken.count_not_finite(bad, row)
            auxiliary = slow.block(
                path,
                timing,
                times,
                columns[fast : fast + len(slow.indexes)],
                rows == 0,
                following is None,
                shift,
            )
            block = blank.replace(c=c, s=s, start_time=moved(blank.start_time, shift), **auxiliary)
            if timing.sample_rate_hz is None:
                block = block.replace(time_s=times)
            rows += len(c)
            if following is None:
                if _state(opened.files) != opened.before:
                    raise HrgError(
                        f"{path}: changed while it was read; wait until it is written and import it"
                        " again"
                    )
                for status, reason in taken.verdicts():
                    block = block.judged([reason], status)
                block = block.replace(details=taken.details())
            yield block
            held = following
    taken.check_range(str(path))
    if rows == 0:
        raise HrgError(f"{path}: holds no rows of numbers; record again")


def _pieces(
    log: Log, roles: Roles, timing: Timing, slow: SlowLog, taken: Taken
) -> Iterator[tuple[int, Array, list[Array]]]:
    """The rows in the range asked for, block by block: the log's row of the first, times from the
    log's first row on, columns."""
    wanted = [
        roles.c,
        *([] if roles.s is None else [roles.s]),
        *slow.indexes,
        *([] if roles.time is None else [roles.time]),
    ]
    scale = 1.0 if roles.time is None else log.channels[roles.time].scale_factor
    row = 0
    for columns in log.read(wanted):
        if len(columns[0]) == 0:
            continue
        if timing.sample_rate_hz is None:
            times = np.asarray(columns[-1], float) * timing.factor * scale - timing.first
        else:
            times = np.arange(row, row + len(columns[0])) / timing.sample_rate_hz
        part = taken.block(times)
        if part.stop > part.start:
            yield row + part.start, times[part], [column[part] for column in columns]
        row += len(times)
        if taken.to_s is not None and times[-1] >= taken.to_s:
            return
