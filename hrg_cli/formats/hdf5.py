"""HDF5 of laboratories: MATLAB v7.3, Zurich Instruments LabOne, and any other file of plain
datasets.

A column is a one-dimensional dataset, or one row or column of a two-dimensional one; its name is
the dataset's path (and a number). MATLAB v7.3 keeps arrays transposed and text as uint16. LabOne
counts time stamps in ticks of its clock base.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import HrgError
from ..store.heaps import check_heaps
from .log import BLOCK_ROWS, ONE_DEMODULATOR, Array, Blocks, Channel, Log, Reader, is_rising
from .scalars import find_rate

SIGNATURE = b"\x89HDF\r\n\x1a\n"
MOST_COLUMNS = 512
MOST_NODES = 20_000
LARGEST_RATIO = 2000
"""Bytes a file may claim to hold, over its size: more than any compression reaches."""


@dataclass(frozen=True)
class _Place:
    """Where a column lies: dataset, and for a two-dimensional one the axis of time and the index
    across it."""

    dataset: str
    axis: int = 0
    across: int | None = None


def _recognises(path: Path, head: bytes) -> bool:
    """The HDF5 signature at the start or after MATLAB's user block of 512 bytes."""
    return head.startswith(SIGNATURE) or head[512:520] == SIGNATURE


def _open_hdf5(path: Path) -> Log:
    """The columns of an HDF5 file. HrgError: an hrg file, damaged, no column of numbers, more
    claimed than stored."""
    with _file(path) as file:
        if _text(file.attrs.get("format", "")) == "hrg":
            raise HrgError(
                f"{path}: is an hrg file already (kind {_text(file.attrs.get('kind', '?'))}); use"
                " it as it is"
            )
        nodes = _datasets(file)
        chunks = sorted({name.split("/")[0] for name, _ in nodes if name.split("/")[0].isdigit()})
        if chunks:
            nodes = [(name, d) for name, d in nodes if name.split("/")[0] == chunks[0]]
        found, scalars = _numbers(path, nodes)
        clock, rate, start = (
            _clock_base(nodes, scalars),
            find_rate(scalars),
            _text(file.attrs.get("start_time", "")),
        )
    if not found:
        raise HrgError(
            f"{path}: holds no dataset of numbers with more than one value; a log with a column a"
            " channel was expected"
        )
    channels = [channel for channel, _ in found[:MOST_COLUMNS]]
    reasons: tuple[str, ...] = (
        (f"{path.name} holds {len(chunks)} chunks; only the first is imported",)
        if len(chunks) > 1
        else ()
    )
    lock_in = [c for c in channels if c.name.lower().endswith("/x")]
    if len(lock_in) == 1 and not any("scopes" in c.name for c in channels):
        reasons += (ONE_DEMODULATOR,)
    return Log(
        format="hdf5",
        channels=tuple(_titled(channels)),
        read=lambda indexes: _read(path, [found[i][1] for i in indexes]),
        rows=max(c.length or 0 for c in channels),
        sample_rate_hz=rate,
        clock_hz=clock,
        start_time=start,
        reasons=reasons,
    )


def _numbers(
    path: Path, nodes: Sequence[tuple[str, Any]]
) -> tuple[list[tuple[Channel, _Place]], dict[str, float]]:
    """The columns of numbers with where they lie, and the datasets of one number, which are a log's
    settings."""
    columns: list[tuple[Channel, _Place]] = []
    scalars: dict[str, float] = {}
    for name, dataset in nodes:
        if dataset.dtype.kind not in "iufb" or dataset.shape is None or _is_text(dataset):
            continue
        if dataset.size == 1:
            scalars[name] = float(np.asarray(dataset[()]).ravel()[0])
            continue
        _believable(path, dataset, name)
        columns.extend(_columns(name, dataset))
    return columns, scalars


@contextlib.contextmanager
def _file(path: Path) -> Iterator[Any]:
    check_heaps(path)
    try:
        file = h5py.File(path, "r")
    except (OSError, RuntimeError, ValueError) as error:
        said = str(error).splitlines()[0][:120]
        raise HrgError(
            f"{path}: cannot be opened as HDF5 ({said}); it is truncated or damaged: copy or record"
            " it again"
        ) from error
    try:
        yield file
    finally:
        with contextlib.suppress(Exception):
            file.close()


def _datasets(file: Any) -> list[tuple[str, Any]]:
    """Every dataset by path, links outside the file and MATLAB's own bookkeeping left alone."""
    found: list[tuple[str, Any]] = []
    waiting = [("", file)]
    seen: set[Any] = set()
    while waiting and len(found) < MOST_NODES and len(seen) < MOST_NODES:
        prefix, group = waiting.pop(0)
        for key in group:
            if key.startswith("#") or not isinstance(group.get(key, getlink=True), h5py.HardLink):
                continue
            node = group[key]
            address = h5py.h5o.get_info(node.id).addr
            if address in seen:
                continue
            seen.add(address)
            name = f"{prefix}{key}"
            if isinstance(node, h5py.Dataset):
                found.append((name, node))
            elif isinstance(node, h5py.Group):
                waiting.append((f"{name}/", node))
    return found


def _is_text(dataset: Any) -> bool:
    return _text(dataset.attrs.get("MATLAB_class", "")) == "char"


def _believable(path: Path, dataset: Any, name: str) -> None:
    size = dataset.size * dataset.dtype.itemsize
    if dataset.chunks is not None and dataset.id.get_storage_size() == 0:
        raise HrgError(
            f"{path}: dataset {name} claims {dataset.size} values but stores none; copy or record"
            " it again"
        )
    if size > LARGEST_RATIO * path.stat().st_size:
        raise HrgError(
            f"{path}: dataset {name} claims {dataset.size} values, more than a file of its size can"
            " hold; it is damaged"
        )


def _columns(name: str, dataset: Any) -> Iterator[tuple[Channel, _Place]]:
    units = _text(dataset.attrs.get("units", dataset.attrs.get("unit", "")))
    if dataset.ndim == 1:
        yield (
            Channel(name, units, rising=is_rising(dataset[:200]), length=len(dataset)),
            _Place(name),
        )
    elif dataset.ndim == 2:
        axis = int(np.argmax(dataset.shape))
        others = dataset.shape[1 - axis]
        for across in range(min(others, 64)):
            place = _Place(name, axis, across)
            head = _slice(dataset, place, 0, 200)
            yield (
                Channel(
                    name if others == 1 else f"{name}/{across + 1}",
                    units,
                    rising=is_rising(head),
                    length=dataset.shape[axis],
                ),
                place,
            )


def _slice(dataset: Any, place: _Place, start: int, stop: int) -> Array:
    if place.across is None:
        return np.asarray(dataset[start:stop])
    return np.asarray(
        dataset[start:stop, place.across] if place.axis == 0 else dataset[place.across, start:stop]
    )


def _read(path: Path, places: Sequence[_Place]) -> Blocks:
    with _file(path) as file:
        datasets = [file[place.dataset] for place in places]
        rows = datasets[0].shape[places[0].axis]
        for start in range(0, rows, BLOCK_ROWS):
            yield [
                _slice(d, place, start, start + BLOCK_ROWS) for d, place in zip(datasets, places)
            ]


def _clock_base(nodes: list[tuple[str, Any]], scalars: dict[str, float]) -> float | None:
    """Ticks per second of LabOne's time stamps, from the attributes or the clockbase node; None
    where not written."""
    for name, value in scalars.items():
        if "clockbase" in name.lower().split("/") and value > 0:
            return value
    for name, node in nodes:
        if not name.lower().endswith("timestamp"):
            continue
        holders = [node, node.parent]
        while holders[-1].name != "/":
            holders.append(holders[-1].parent)
        for holder in holders:
            for key in ("clockbase", "clock_base", "timebase"):
                if key in holder.attrs:
                    value = float(np.asarray(holder.attrs[key]).ravel()[0])
                    if value > 0 and np.isfinite(value):
                        return 1 / value if key == "timebase" else value
    return None


def _titled(channels: list[Channel]) -> list[Channel]:
    """Short titles where the last part of a path is unique; LabOne's columns get their roles.

    A LabOne time stamp counts ticks. Of two demodulators the first one's x is C and the second
    one's is S; of one, x and y.
    """
    last = [c.name.split("/")[-1] for c in channels]
    demods = [
        c.name.rpartition("/")[0] for c in channels if "demods" in c.name and c.name.endswith("/x")
    ]
    roles: dict[str, str] = {}
    if demods:
        roles = {f"{demods[0]}/timestamp": "time", f"{demods[0]}/x": "c"}
        roles[f"{demods[1]}/x" if len(demods) > 1 else f"{demods[0]}/y"] = "s"
    titled = []
    for channel, tail in zip(channels, last):
        units = "ticks" if tail == "timestamp" and not channel.units else channel.units
        name = tail if last.count(tail) == 1 else channel.name
        titled.append(replace(channel, name=name, units=units, role=roles.get(channel.name, "")))
    return titled


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray):
        value = value.ravel()[0] if value.size == 1 else ""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


READER = Reader("hdf5", _recognises, _open_hdf5)
