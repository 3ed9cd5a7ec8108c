"""NI TDMS (npTDMS): channels of all groups, streamed; a file cut short is refused, npTDMS itself
would only warn."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HrgError, name_some
from .log import BLOCK_ROWS, Blocks, Channel, Log, Reader, is_rising, need_library


def _recognises(path: Path, head: bytes) -> bool:
    """The tag of a TDMS segment."""
    return head[:4] == b"TDSm"


def _open_tdms(path: Path) -> Log:
    """The channels of a TDMS file. HrgError: npTDMS missing, damaged, cut short."""
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise need_library("npTDMS", path) from error
    logging.getLogger("nptdms").setLevel(logging.ERROR)
    with TdmsFile.open(str(path)) as file:
        status = file.file_status
        _complete(path, status)
        found = [
            channel
            for group in file.groups()
            for channel in group.channels()
            if channel.data_type is not None
        ]
        found = [channel for channel in found if len(channel) > 0]
        channels = [_describe_channel(channel) for channel in found]
        starts = [channel.properties.get("wf_start_time") for channel in found]
        names = [(channel.group_name, channel.name) for channel in found]
    if not channels:
        raise HrgError(f"{path}: holds no channel with samples; record again")
    known = [channel.sample_rate_hz for channel in channels if channel.sample_rate_hz is not None]
    start = next(
        (np.datetime_as_string(np.datetime64(s), unit="ms") + "Z" for s in starts if s is not None),
        "",
    )
    return Log(
        format="tdms",
        channels=tuple(channels),
        read=lambda indexes: _read(path, [names[i] for i in indexes]),
        rows=max(c.length or 0 for c in channels),
        sample_rate_hz=max(known) if known else None,
        start_time=start,
    )


def _describe_channel(channel: Any) -> Channel:
    """A channel of the file by its properties, which are NI's own names."""
    kind = np.dtype(channel.dtype).kind
    given = channel.properties
    step = given.get("wf_increment")
    return Channel(
        channel.name,
        str(given.get("unit_string", given.get("NI_UnitDescription", ""))),
        kind="clock" if kind == "M" else "number" if kind in "iufb" else "text",
        length=len(channel),
        sample_rate_hz=1 / float(step) if isinstance(step, int | float) and step > 0 else None,
        rising=kind in "iuf" and is_rising(channel[: min(200, len(channel))]),
    )


def _complete(path: Path, status: Any) -> None:
    if status is None or not status.incomplete_final_segment:
        return
    short = [
        f"{name} {state.read_length} of {state.expected_length}"
        for name, state in (status.channel_statuses or {}).items()
        if state.read_length != state.expected_length
    ]
    raise HrgError(
        f"{path}: its last segment is cut short ({name_some(short) or 'samples are missing'}); copy"
        " or record it again"
    )


def _read(path: Path, names: Sequence[tuple[str, str]]) -> Blocks:
    from nptdms import TdmsFile

    with TdmsFile.open(str(path)) as file:
        channels = [file[group][name] for group, name in names]
        firsts = [channel.read_data(offset=0, length=1)[0] for channel in channels]
        for start in range(0, len(channels[0]), BLOCK_ROWS):
            length = min(BLOCK_ROWS, len(channels[0]) - start)
            yield [
                _numbers(channel.read_data(offset=start, length=length), first)
                for channel, first in zip(channels, firsts)
            ]


def _numbers(values: Any, first: Any) -> np.ndarray:
    """Values as numbers; time stamps as seconds since the first one."""
    array = np.asarray(values)
    return (array - first) / np.timedelta64(1, "ns") / 1e9 if array.dtype.kind == "M" else array


READER = Reader("tdms", _recognises, _open_tdms)
