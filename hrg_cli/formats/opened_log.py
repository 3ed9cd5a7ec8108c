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
from .log_columns import Roles, TimingTold, find
from .pairing import find_second_file, pair_logs
from .quantities import is_level, spell_channel_unit
from .readers import open_log
from .timing import Timing

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
    """The log of one file, or of one file per channel, and which of its columns is what."""
    files = [path, *([] if s_file is None else [find_second_file(path, s_file)])]
    before = judge_state(files)
    log = open_log(path, format, separator, decimal)
    asked = dict(asked)
    if s_file is not None:
        other = open_log(files[1], format, separator, decimal)
        log, asked = pair_logs(path, log, files[1], other, asked)
    roles = find(log, str(path), asked, timing)
    need_same_length(log, roles, str(path))
    return OpenedLog(files, log, roles, before)


def find_scales(log: Log, roles: Roles, c_factor: float, s_factor: float) -> dict[str, Any]:
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


def list_first_reasons(opened: OpenedLog, timing: Timing) -> list[str]:
    """What is wrong with the recording, as far as it can be told before its rows are read."""
    reasons = [*opened.log.reasons, *timing.reasons]
    if opened.roles.s is None:
        reasons.append(
            f"{ONE_CHANNEL}: wave angle, quadrature and splits cannot be seen in this run"
        )
    return reasons


def judge_state(files: Sequence[Path]) -> States:
    """Size and time of each file, by which a change is seen; None where they cannot be told."""
    try:
        return tuple((stat.st_size, stat.st_mtime_ns) for stat in (path.stat() for path in files))
    except OSError:
        return None


def need_same_length(log: Log, roles: Roles, where: str) -> None:
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
        f"{where}: its columns differ in length ({shown}), equal ones were expected; name the times of"
        ' slow columns with auxiliary_time, leave a column out with "none", or record again'
    )


def find_channel_unit(log: Log, roles: Roles, units: str | None, where: str) -> str:
    """The unit of both channels, as told or as the log has it. HrgError: a level in decibels, two
    units."""
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
