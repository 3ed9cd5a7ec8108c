"""import_log: any foreign log becomes a recording, whole or as a stream of blocks.

Times: an even time column (to within its own rounding, or `sampling_tolerance` of a step) becomes
`sample_rate_hz`; any other is kept as `time_s`, never resampled. t = 0 is the first sample taken
(with `from_s`, `start_time` moves along). Slow columns (temperature, rate, drive) become the
auxiliary log, averaged over groups of rows where the log is long, so that it stays near
`auxiliary_rows`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..records import Recording, open_single
from .doubled_rows import time_rows
from .log_columns import TimingTold
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
from .opened_log import find_channel_unit, find_scales, list_first_reasons, open_channels
from .run_heading import RunHeading, UnitsTold
from .sample_blocks import stream_blocks
from .slow import SlowLog
from .taken import Taken, check_range
from .timing import doubt_rate


def import_log(
    path: Path | str,
    *,
    c: Annotated[
        Column,
        Field(
            description="column of channel C, by its title or 1-based number; found by its title"
            " where not given"
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
        Column,
        Field(
            description="column of the temperature; found by its title, or as the only one in"
            " such a unit, where not given"
        ),
    ] = None,
    rate: Annotated[
        Column,
        Field(
            description="column of the rate; found by its title, or as the only one in such a"
            " unit, where not given"
        ),
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
            description="column of the slow columns' own times, where they have fewer rows than"
            " the channels"
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
            description="what the channels hold: the motion itself (direct), or a carrier it"
            " modulates"
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
    """A foreign log as a recording: one record when it fits one block, else a stream of them
    (memory flat in its length).

    Columns that are not named are found by their titles; units come from the titles, the log's own
    attributes, or the options.

    Parameters
    ----------
    path
        The log, in any of the formats of `READERS`.

    Returns
    -------
    Recording or Iterator[Recording]
        Samples (n,) of both channels as they were written, with their scale factors and unit; times
        in s from the first sample taken, temperature in °C, rate in rad/s. `collect` joins a
        stream.

    Raises
    ------
    HrgError
        Not readable, no such column, times that do not rise, a broken line, fewer samples than
        claimed; each names the row.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli import collect
    >>> from hrg_cli.formats.importing import import_log
    >>> lines = ("time [ms],C [V],S [V]", "0.0,1.00,0.50", "0.1,0.80,0.40", "0.2,0.31,0.15")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "bench.csv"
    ...     with path.open("w") as log:
    ...         print(*lines, sep=chr(10), file=log)
    ...     recording = collect(import_log(path, gyro_id="SN-1"))
    >>> round(recording.sample_rate_hz), recording.c_units, recording.physical(0, 3)[0].tolist()
    (10000, 'V', [1.0, 0.8, 0.31])
    """
    check_range(from_s, to_s)
    _check_carrier(readout, carrier_hz)
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
    timed = TimingTold(sample_rate_hz is not None, clock_hz is not None, time_units)
    opened = open_channels(Path(path), s_file, asked, format, separator, decimal, timed)
    roles, where = opened.roles, opened.files[0]
    grid = (clock_hz, sample_rate_hz, sampling_tolerance)
    log, timing = time_rows(opened.log, roles, where, time_units, *grid)
    unit = find_channel_unit(log, roles, units, str(where))
    told = UnitsTold(time_units, rate_units, temperature_units)
    heading = RunHeading(mode, mode_number, gyro_id, run_id, lot_id, start_time)
    blank = Recording(
        c=np.empty(0),
        s=np.empty(0),
        sample_rate_hz=timing.sample_rate_hz,
        readout=readout,
        carrier_hz=carrier_hz,
        nominal_frequency_hz=nominal_frequency_hz,
        c_units=unit,
        s_units=unit,
        **heading.make_fields(log, where),
        **find_scales(log, roles, c_scale_factor, s_scale_factor),
    ).judged(list_first_reasons(opened, timing) + doubt_rate(timing, nominal_frequency_hz, readout))
    slow = SlowLog(
        log,
        roles,
        where=str(where),
        told=told,
        rate_scale_factor=rate_scale_factor,
        constants={"rate": constant_rate_rad_s, "temperature": constant_temperature_degc},
        most=auxiliary_rows,
    )
    by_role = told.list_by_role(("c", "s"), unit)
    taken = Taken(log, roles.list_columns(), by_role, timing.sample_rate_hz, from_s, to_s)
    kept = dataclasses.replace(opened, log=log)
    return open_single(stream_blocks(kept, blank, timing, slow, taken))


def _check_carrier(readout: str, carrier_hz: float | None) -> None:
    """HrgError: a carrier read-out without its frequency."""
    if readout == "carrier" and carrier_hz is None:
        raise HrgError('readout is "carrier": give carrier_hz too')
