"""Writing: records and streams of records as HDF5, block by block, with dimension scales and
provenance.

Identical content gives identical bytes: no time stamps inside but `created`, which honours
`order_time` and SOURCE_DATE_EPOCH.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import re
import shutil
import threading
import time
import traceback
import zlib
from collections.abc import Iterable, Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import DiskFullError, HrgError
from ..records import GROWING, Column, Record, collect
from ..version import __version__
from .atomic import collect_lost_writes, write_whole
from .checksums import Running, seal
from .handles import CACHE_BYTES, explain_reading, need_readable
from .layout import FORMAT, FORMAT_VERSION, AnyRecord, find_place, make_default
from .validity import WrittenBlocks

HASHED_BYTES = 1 << 20
ROW_CHUNK, ROW_CHUNK_OF_OTHERS = {"recording": 1 << 18}, 1 << 14
"""Rows of a chunk, of some kinds of record and of the others."""
_SCALE_ONLY = "This is a netCDF dimension but not a netCDF variable. %9d"


_ORDERED: ContextVar[int | None] = ContextVar("_ORDERED", default=None)
"""The time that `order_time` holds, for its own thread alone."""


@contextlib.contextmanager
def order_time(epoch: int | None) -> Iterator[None]:
    """While it lasts, what this thread writes bears one time.

    Parameters
    ----------
    epoch
        Seconds since 1970; None: the true time, or SOURCE_DATE_EPOCH.

    Returns
    -------
    context manager
        Of the writing.

    Examples
    --------
    >>> from hrg_cli import store
    >>> with store.order_time(0):
    ...     store.stamp_now()
    '1970-01-01T00:00:00Z'
    """
    before = _ORDERED.set(epoch)
    try:
        yield
    finally:
        _ORDERED.reset(before)


def stamp_now() -> str:
    """The time for `created` and `history`; `order_time` or SOURCE_DATE_EPOCH fixes it.

    Returns
    -------
    str
        ISO 8601, UTC.

    Examples
    --------
    >>> from hrg_cli import store
    >>> store.stamp_now()[4], store.stamp_now()[7]
    ('-', '-')
    """
    ordered = _ORDERED.get()
    epoch = os.environ.get("SOURCE_DATE_EPOCH") if ordered is None else ordered
    known = None if epoch in (None, "") else float(epoch)
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(known))


def compute_sha256(path: Path | str, unwanted: threading.Event | None = None) -> str:
    """SHA-256 of a file's bytes.

    Parameters
    ----------
    path
        The file.
    unwanted
        When set meanwhile, reading ends: the digest is of some of the bytes, and none's.

    Returns
    -------
    str
        Hexadecimal digits.

    Raises
    ------
    HrgError
        The file cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> from hrg_cli import store
    >>> with tempfile.NamedTemporaryFile() as empty:
    ...     store.compute_sha256(empty.name)[:8]
    'e3b0c442'
    """
    need_readable(Path(path))
    digest = hashlib.sha256()
    with explain_reading(Path(path)), open(path, "rb") as file:
        while (unwanted is None or not unwanted.is_set()) and (part := file.read(HASHED_BYTES)):
            digest.update(part)
    return digest.hexdigest()


def write(
    path: Path | str,
    stream: AnyRecord | Iterable[AnyRecord],
    force: bool = False,
    finish: Any = None,
) -> AnyRecord:
    """Write a record, or a stream of records block by block, whole or not at all.

    Parameters
    ----------
    path
        The file to make.
    stream
        A record, or blocks of one kind.
    force
        Replace an existing file.
    finish
        Called with the last record before closing; returns it with provenance and status complete.

    Returns
    -------
    Record
        The last record (a stream's: its last block).

    Raises
    ------
    HrgError
        The folder is missing or not writable, the output exists (unless `force`), the disk is full;
        then no output exists.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> record = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> store.write(path, record).status
    'valid'
    >>> store.write(path, record)
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: ...
    """
    with write_whole(path, force) as temporary, collect_lost_writes() as lost:
        blocks: Iterable[AnyRecord] = (stream,) if isinstance(stream, Record) else stream
        last: AnyRecord | None = None
        file: h5py.File | None = None
        promised = WrittenBlocks(path)
        running: dict[str, Running] = {}
        try:
            for block in _join_small(blocks):
                promised.check(block)
                _need_space(block, Path(path))
                if file is None:
                    # Readable by HDF5 1.10 and what is built on it: MATLAB and older netCDF.
                    # Whole chunks go to the disk while the processor's cache still holds them.
                    file = h5py.File(
                        temporary, "w", libver=("earliest", "v110"), rdcc_nbytes=CACHE_BYTES
                    )
                    _create(file, block, running)
                else:
                    _append(file, block, running)
                last = block
            if file is None or last is None:
                raise HrgError(f"{path}: nothing to write; the stage before it produced no record")
            if finish is not None:
                last = finish(last)
            _finish(file, last)
            seal(file, running)
            file.close()
            if lost:
                raise lost[0]
        except BaseException as error:
            traceback.clear_frames(error.__traceback__)
            if file is not None:
                with contextlib.suppress(Exception):
                    file.close()
            file = None
            if isinstance(error, RuntimeError) and (
                number := re.search(r"errno = (\d+)", str(error))
            ):
                raise OSError(int(number[1]), os.strerror(int(number[1]))) from error
            raise
    assert last is not None
    return last


def _join_small(blocks: Iterable[AnyRecord]) -> Iterator[AnyRecord]:
    """Blocks of half a chunk's rows at least, but for the last: to append a few rows to every
    dataset takes as long as to append thousands, and larger ones are not held beside others."""
    held: list[AnyRecord] = []
    for block in blocks:
        held.append(block)
        if 2 * sum(map(len, held)) >= _count_chunk_rows(block):
            yield held[0] if len(held) == 1 else collect(held)
            held = []
    if held:
        yield held[0] if len(held) == 1 else collect(held)


def _count_chunk_rows(record: Record) -> int:
    """Rows of a chunk of its datasets, at most."""
    return ROW_CHUNK.get(record.kind, ROW_CHUNK_OF_OTHERS)


def _need_space(block: Record, path: Path) -> None:
    """h5py cannot recover from a full disk, so ask before each block."""
    need = (4 << 20) if os.environ.get("HRG_NO_SPACE_MARGIN") is None else 0
    for name, spec in block.columns().items():
        value = getattr(block, name)
        if spec.dims and isinstance(value, np.ndarray):
            need += value.nbytes
    if shutil.disk_usage(path.parent).free < need:
        raise DiskFullError(
            f"{path}: the disk is full ({need >> 20} MB more are needed); free space or choose"
            " another --output"
        )


def _present(record: Record) -> Iterator[tuple[str, str, Column, Any]]:
    for field_name, spec in record.columns().items():
        value = getattr(record, field_name)
        if value is not None:
            yield field_name, find_place(type(record), field_name, spec), spec, value


def _create(file: h5py.File, record: Record, running: dict[str, Running]) -> None:
    file.create_group(record.kind)
    for _, place, spec, value in _present(record):
        if spec.dims is None:
            continue
        array = _encoded(value, spec)
        growing = spec.dims[0] in GROWING
        options: dict[str, Any] = {}
        if growing:
            row_bytes = max(1, array[:1].nbytes) if len(array) else 8
            rows = _count_chunk_rows(record) if spec.dims[0] == "row" else 4096
            rows = max(16, min(rows, max(len(array), 16), (1 << 20) // row_bytes))
            options = {"maxshape": (None, *array.shape[1:]), "chunks": (rows, *array.shape[1:])}
            if spec.dtype == "raw":
                options["fletcher32"] = True
            elif spec.dims[0] == "row" or array.nbytes > 4096:
                options["fletcher32"] = True
                if spec.packed and _worth_compressing(array):
                    options |= {"compression": "gzip", "compression_opts": 1, "shuffle": True}
        dataset = file.create_dataset(place, data=array, track_times=False, **options)
        if growing:
            running[place] = Running()
            running[place].add(array)
        dataset.attrs["units"] = _units(record, spec)
        dataset.attrs["long_name"] = spec.meaning
        dataset.flush()  # a failure while a dataset is closed would be lost


def _worth_compressing(array: Any) -> bool:
    """Whether gzip after shuffle saves a third of the first rows; noise does not shrink and costs
    most of a command's time."""
    sample = np.ascontiguousarray(array).reshape(-1)[: 1 << 14]
    shuffled = sample.view("u1").reshape(-1, sample.itemsize).T.tobytes()
    return len(zlib.compress(shuffled, 1)) < 0.67 * max(1, len(shuffled))


def _units(record: Record, spec: Column) -> str:
    if spec.units == "any":
        return (
            str(getattr(record, "units", "1"))
            if isinstance(getattr(record, "units", "1"), str)
            else "1"
        )
    return spec.units or "1"


def _encoded(value: Any, spec: Column) -> Any:
    if spec.dtype == "str":
        return np.array(
            [str(v) for v in np.asarray(value).ravel()], dtype=h5py.string_dtype()
        ).reshape(np.shape(value))
    array = np.asarray(value)
    return array if spec.dtype == "raw" else array.astype(spec.dtype, copy=False)


def _append(file: h5py.File, block: Record, running: dict[str, Running]) -> None:
    for _, place, spec, value in _present(block):
        if spec.dims is None or spec.dims[0] not in GROWING:
            continue
        array = _encoded(value, spec)
        dataset = file[place]
        start = dataset.shape[0]
        dataset.resize(start + len(array), axis=0)
        dataset[start:] = array
        running[place].add(array)
        dataset.flush()


def _finish(file: h5py.File, record: Record) -> None:
    for field_name, place, spec, value in _present(record):
        if spec.dims is None:
            group, _, name = place.rpartition("/")
            if group not in file and value == make_default(field_name, spec):
                continue
            holder = file[group] if group in file else file.create_group(group)
            # a text of variable length lives in the file's heap: it may be of any length
            holder.attrs[name] = value
        elif spec.dims[0] not in GROWING and place in file:
            if file[place].shape == np.shape(value) and spec.dtype != "str":
                file[place][...] = value
            elif file[place].shape != np.shape(value):
                del file[place]
                _create_late(file, record, place, spec, value)
        elif place not in file:
            _create_late(file, record, place, spec, value)
    _attach_scales(file, record)
    provenance = record.provenance
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = FORMAT_VERSION
    file.attrs["kind"] = record.kind
    file.attrs["generated_by"] = provenance.generated_by or f"hrg {__version__}"
    file.attrs["created"] = provenance.created or stamp_now()
    file.attrs["history"] = "\n".join(_as_line(command) for command in provenance.history)
    file.attrs["settings"] = provenance.settings
    file.attrs["sources"] = json.dumps([dataclasses.asdict(s) for s in provenance.sources])
    file.attrs["status"] = record.status
    file.attrs["status_reasons"] = json.dumps(list(record.status_reasons), ensure_ascii=False)


def _create_late(file: h5py.File, record: Record, place: str, spec: Column, value: Any) -> None:
    dataset = file.create_dataset(place, data=_encoded(value, spec), track_times=False)
    dataset.attrs["units"] = _units(record, spec)
    dataset.attrs["long_name"] = spec.meaning
    dataset.flush()


def _as_line(command: str) -> str:
    """A command as one line of the history: a file's name may hold a line break."""
    return "".join(
        sign.encode("unicode_escape").decode() if sign.splitlines() == [""] else sign
        for sign in command
    )


def _attach_scales(file: h5py.File, record: Record) -> None:
    """Give every dimension of every dataset a scale of its own group, so that netCDF readers open
    the group."""
    for _, place, spec, _ in _present(record):
        if spec.dims is None:
            continue
        dataset = file[place]
        group = dataset.parent
        for axis, dim in enumerate(spec.dims):
            scale = group.get(dim)
            if scale is None:
                length = dataset.shape[axis]
                scale = group.create_dataset(
                    dim,
                    shape=(length,),
                    dtype="i1",
                    track_times=False,
                    compression="gzip" if length > 4096 else None,
                )
                scale.make_scale(_SCALE_ONLY % length)
            if scale.id != dataset.id:
                dataset.dims[axis].attach_scale(scale)
