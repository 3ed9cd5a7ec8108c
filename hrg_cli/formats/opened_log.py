"""A foreign log opened for import: its file or one file a channel, which column is what, units and
scales of the channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HrgError, name_some
from ..records.recording import ONE_CHANNEL
from .log import Log
from .log_columns import Roles, TimingTold, find_roles
from .pairing import find_second_file, pair_logs
from .readers import open_log
from .timing import Timing
from .unit_spellings import is_level, spell_channel_unit
from .unix_time import recognise_unix_time

States = tuple[tuple[int, int], ...] | None


@dataclass(frozen=True)
class OpenedLog:
    """A log with its columns' roles, and its files as they were before it was read."""

    files: Sequence[Path]
    log: Log
    roles: Roles
    before: States


def open_channels(
    path: Path,
    s_file: str | None,
    asked: Mapping[str, str | int | None],
    format: str,
    separator: str | None,
    decimal: str | None,
    timing: TimingTold,
) -> OpenedLog:
    """The log of one file, or of one file per channel, and which of its columns is what.

    Parameters
    ----------
    path
        The log.
    s_file
        The file of channel S, as `find_second_file` takes it; None: both are in one.
    asked
        Role -> title or number (from 1) of its column.
    format
        Its name; empty: told by its content.
    separator, decimal
        Of a text log; None: found.
    timing
        What was said of the times beside the columns.

    Returns
    -------
    OpenedLog
        With the files' sizes and times before they are read.

    Raises
    ------
    HrgError
        Not readable, of no known format, columns not told or of different length.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.formats.log_columns import TimingTold
    >>> from hrg_cli.formats.opened_log import open_channels
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "bench.csv"
    ...     with path.open("w") as log:
    ...         print("ch1,ch2", "1,2", "3,4", "5,6", sep=chr(10), file=log)
    ...     opened = open_channels(path, None, {}, "", None, None, TimingTold(rate=True))
    >>> opened.roles.list_columns()
    {'c': 0, 's': 1}
    """
    files = [path, *([] if s_file is None else [find_second_file(path, s_file)])]
    before = read_states(files)
    log = open_log(path, format, separator, decimal)
    asked = dict(asked)
    if s_file is not None:
        other = open_log(files[1], format, separator, decimal)
        log, asked = pair_logs(path, log, files[1], other, asked)
    roles = find_roles(log, str(path), asked, timing)
    _need_same_length(log, roles, str(path))
    log = recognise_unix_time(log, roles, path, timing)
    return OpenedLog(files, log, roles, before)


def find_scales(log: Log, roles: Roles, c_factor: float, s_factor: float) -> dict[str, Any]:
    """Scale and offset of both channels: what is asked for, on top of the log's own.

    Parameters
    ----------
    log
        As it was opened.
    roles
        Which of its columns is what; a log of one channel gives S the scale of C.
    c_factor, s_factor
        Unit of the channel per value of the log.

    Returns
    -------
    dict
        The recording's fields: physical value = scale factor · raw + offset.

    Raises
    ------
    HrgError
        A factor that is 0 or not finite.

    Examples
    --------
    An offset is scaled along:

    >>> from hrg_cli.formats.log import Channel, Log
    >>> from hrg_cli.formats.log_columns import find_roles
    >>> from hrg_cli.formats.opened_log import find_scales
    >>> log = Log("bench", tuple(Channel(n, scale_factor=0.5, add_offset=1.0) for n in "cs"), iter)
    >>> found = find_scales(log, find_roles(log, "bench", {}), 10.0, 1.0)
    >>> found["c_scale_factor"], found["c_add_offset"], found["s_add_offset"]
    (5.0, 10.0, 1.0)
    """
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


def list_first_reasons(opened: OpenedLog, timing: Timing) -> list[str]:
    """Why a recording may be doubted, as far as it is told before its rows are read.

    Parameters
    ----------
    opened
        The log.
    timing
        Of its rows.

    Returns
    -------
    list of str
        The log's own reasons, those of the times, a rate or a temperature that several columns may
        be, and that there is one channel only.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.log import make_log
    >>> from hrg_cli.formats.log_columns import find_roles
    >>> from hrg_cli.formats.opened_log import OpenedLog, list_first_reasons
    >>> from hrg_cli.formats.timing import Timing
    >>> log = make_log("bench", {"c": np.ones(4)}, sample_rate_hz=1e4)
    >>> opened = OpenedLog([], log, find_roles(log, "bench", {"s": "none"}), None)
    >>> list_first_reasons(opened, Timing(1e4, 1.0))
    ['...: wave angle, quadrature and splits cannot be seen in this run']
    """
    reasons = [*opened.log.reasons, *timing.reasons, *opened.roles.doubts]
    if opened.roles.s is None:
        reasons.append(
            f"{ONE_CHANNEL}: wave angle, quadrature and splits cannot be seen in this run"
        )
    return reasons


def read_states(files: Sequence[Path]) -> States:
    """Size and time of files, by which it is seen that one was changed.

    Parameters
    ----------
    files
        In any order, that is kept.

    Returns
    -------
    tuple or None
        Size [B] and time of the last change [ns] of each; None where they are not told.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.formats.opened_log import read_states
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log = Path(folder) / "bench.csv"
    ...     _ = log.write_text("1,2")
    ...     before = read_states([log])
    ...     _ = log.write_text("1,2,3")
    ...     before[0][0], read_states([log]) == before
    (3, False)
    """
    try:
        return tuple((stat.st_size, stat.st_mtime_ns) for stat in (path.stat() for path in files))
    except OSError:
        return None


def _need_same_length(log: Log, roles: Roles, where: str) -> None:
    """Channels and times agree in length; slow columns among themselves, and where they are shorter
    they need times of their own."""
    length = {
        role: log.channels[i].length
        for role, i in (("c", roles.c), ("s", roles.s), ("time", roles.time))
        if i is not None
    }
    slow = {role: log.channels[i].length for role, i in roles.list_auxiliary().items()}
    timed = all(log.channels[i].sample_rate_hz for i in roles.list_auxiliary().values())
    if roles.auxiliary_time is not None:
        slow["auxiliary_time"] = log.channels[roles.auxiliary_time].length
        timed = True
    fast_lengths, slow_lengths = set(length.values()), set(slow.values())
    beside = timed or slow_lengths <= fast_lengths
    if len(fast_lengths) == 1 and len(slow_lengths) <= 1 and beside:
        return
    shown = name_some(f"{role} {rows}" for role, rows in (length | slow).items())
    raise HrgError(
        f"{where}: its columns differ in length ({shown}), equal ones were expected; name the"
        " times of"
        ' slow columns with auxiliary_time, leave a column out with "none", or record again'
    )


def find_channel_unit(log: Log, roles: Roles, units: str | None, where: str) -> str:
    """The unit of both channels, as told or as the log has it.

    Parameters
    ----------
    log
        As it was opened.
    roles
        Which of its columns is what.
    units
        As told; None: the log's own.
    where
        The log, for messages.

    Returns
    -------
    str
        As recordings spell it; "1" where none is known.

    Raises
    ------
    HrgError
        A level in decibels, which is no sample of an oscillation, or two units.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.log import make_log
    >>> from hrg_cli.formats.log_columns import find_roles
    >>> from hrg_cli.formats.opened_log import find_channel_unit
    >>> log = make_log("bench", {"c": np.ones(4), "s": np.ones(4)}, {"c": "V", "s": "mV"})
    >>> find_channel_unit(log, find_roles(log, "bench", {}), None, "bench")
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: bench: channel C is in 'V' and channel S in 'mV'; give units, ...
    """
    for role, index in (("C", roles.c), ("S", roles.s)):
        level = (
            None
            if index is None
            else next((u for u in (units, log.channels[index].units) if u and is_level(u)), None)
        )
        if level is not None and index is not None:
            raise HrgError(
                f"{where}: channel {role} (column {index + 1}) is in {level}, samples of an"
                " oscillation were expected; import the amplitude with --envelope --amplitude"
                " COLUMN --decibel"
            )
    if units is not None:
        return units
    found = [spell_channel_unit(log.channels[i].units) for i in (roles.c, roles.s) if i is not None]
    if len(set(found)) > 1:
        raise HrgError(
            f"{where}: channel C is in {found[0]!r} and channel S in {found[1]!r}; "
            "give units, and c_scale_factor or s_scale_factor to bring them to one unit"
        )
    return found[0]
