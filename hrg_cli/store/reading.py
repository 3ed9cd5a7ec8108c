"""Reading: every dataset and attribute checked against its declaration, every way HDF5 fails turned into a sentence."""

from __future__ import annotations

import contextlib
import errno
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from .. import __version__
from ..errors import HrgError
from ..records import Column, Provenance, Record, Recording, Source
from ..units import canonical
from .heaps import check_heaps
from .layout import BY_NAME, FORMAT, FORMAT_VERSION, AnyRecord, default_of, first_line, place_of

LARGEST_COLUMN_BYTES = 8 << 30
"""No column read into memory at once may claim more."""
LARGEST_GAP_BYTES = 64 << 20
"""So much of a dataset may be left unwritten (it reads as zeros) before its size is not believed."""


@contextlib.contextmanager
def open_record(path: Path | str, kind: type[AnyRecord]) -> Iterator[AnyRecord]:
    """The record of `path`, its row columns left on disk (they are read when sliced); closed on leaving."""
    with _opened(Path(path)) as file:
        yield _record(file, Path(path), kind, lazy=True)


def read(path: Path | str, kind: type[AnyRecord]) -> AnyRecord:
    """The record of `path`, whole, in memory. HrgError: not that kind, damaged, a missing or ill-shaped dataset, a wrong unit."""
    with _opened(Path(path)) as file:
        return _record(file, Path(path), kind, lazy=False)


def read_any(path: Path | str) -> Record:
    """The record of `path` whatever its kind."""
    return read(path, kind_of(path))


def provenance_of(path: Path | str) -> Provenance:
    """Where the file of `path` comes from, without reading its datasets."""
    with _opened(Path(path)) as file:
        return _provenance(file, Path(path))


def is_hdf5(path: Path | str) -> bool:
    """Whether the file's first bytes are those of HDF5."""
    return bool(h5py.is_hdf5(path))


def kind_of(path: Path | str) -> type[Record]:
    """The kind of record in `path`."""
    with _opened(Path(path)) as file:
        return _kind(file, Path(path))


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """An HDF5 file for reading; every way h5py fails becomes a sentence."""
    if not path.exists():
        raise HrgError(f"{path}: no such file; name a file that `hrg` or your laboratory wrote")
    if path.is_dir():
        raise HrgError(f"{path}: is a folder; name a file in it")
    if not os.access(path, os.R_OK):
        raise HrgError(f"{path}: no right to read it; ask for read access")
    if path.stat().st_size == 0:
        raise HrgError(f"{path}: is empty; an hrg file (HDF5) was expected")
    check_heaps(path)
    try:
        file = h5py.File(path, "r", rdcc_nbytes=1 << 20)  # one chunk; HDF5 2 would keep 8 MB a dataset
    except BlockingIOError as error:
        raise HrgError(f"{path}: is being written by another program; wait until it is closed") from error
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        if "truncated" in str(error):
            raise HrgError(f"{path}: is truncated ({path.stat().st_size} bytes are there); copy or record it again") from error
        if not h5py.is_hdf5(path):
            raise HrgError(f"{path}: is not an HDF5 file; for a log in another format run `hrg import {path.name}` first") from error
        raise HrgError(f"{path}: cannot be opened as HDF5 ({first_line(error)}); copy or record it again") from error
    try:
        yield file
    except HrgError:
        raise
    except (OSError, RuntimeError, KeyError, UnicodeDecodeError) as error:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EACCES, errno.EROFS):
            raise
        raise HrgError(f"{path}: is damaged ({first_line(error)}); copy or record it again") from error
    finally:
        with contextlib.suppress(Exception):
            file.close()


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.shape == (1,):
        value = value[0]
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _kind(file: h5py.File, path: Path) -> type[Record]:
    if _text(file.attrs.get("format", "")) != FORMAT:
        raise HrgError(f'{path}: is HDF5 but not an hrg file (root attribute format = "hrg" is missing); run `hrg import` on a foreign log')
    version = _text(file.attrs.get("format_version", ""))
    if version.split(".")[0] != FORMAT_VERSION.split(".")[0]:
        raise HrgError(f"{path}: has format_version {version or 'none'}, this hrg reads {FORMAT_VERSION}; use a matching version of hrg")
    kind = _text(file.attrs.get("kind", ""))
    if kind not in BY_NAME:
        raise HrgError(f"{path}: its kind is {kind!r}, expected one of {', '.join(BY_NAME)}; write the file again with hrg {__version__}")
    return BY_NAME[kind]


def _record(file: h5py.File, path: Path, kind: type[AnyRecord], lazy: bool) -> AnyRecord:
    found = _kind(file, path)
    if found is not kind:
        raise HrgError(f"{path}: is a {found.kind} file, a {kind.kind} file was expected; make one with `{kind.made_by}`")
    values: dict[str, Any] = {}
    sizes: dict[str, tuple[int, str]] = {}
    for field_name, spec in kind.columns().items():
        place = place_of(kind, field_name, spec)
        if spec.dims is None:
            values[field_name] = _read_attribute(file, path, place, field_name, spec, values)
            continue
        dataset = file.get(place)
        if dataset is None:
            if spec.optional:
                continue
            raise HrgError(f"{path}: dataset {place} is missing; make the file again with `{kind.made_by}`")
        values[field_name] = _read_dataset(dataset, path, place, spec, sizes, lazy and spec.dims[0] == "row")
    status = _text(file.attrs.get("status", "valid"))
    if status not in ("valid", "suspect", "refused"):
        raise HrgError(f'{path}: its status is {status!r}, expected "valid", "suspect" or "refused"')
    values["status"] = status
    record = kind(**values, status_reasons=tuple(_json_list(file, "status_reasons", path)), provenance=_provenance(file, path))
    return _checked(record, path)


def _read_attribute(file: h5py.File, path: Path, place: str, field_name: str, spec: Column, values: dict[str, Any]) -> Any:
    group, _, name = place.rpartition("/")
    holder = file.get(group)
    if holder is None or name not in holder.attrs:
        if spec.optional:
            return default_of(field_name, spec)
        raise HrgError(f"{path}: attribute {name} of {group} is missing; make the file again or add it")
    value = holder.attrs[name]
    try:
        if spec.dtype == "str":
            return _text(value)
        number = float(np.asarray(value).reshape(()))
        if spec.dtype == "i8":
            if number != int(number):
                raise ValueError
            return int(number)
        return number
    except (TypeError, ValueError, OverflowError) as error:
        raise HrgError(f"{path}: attribute {name} of {group} is {_text(value)[:60]!r}, a number was expected") from error


def _read_dataset(dataset: Any, path: Path, place: str, spec: Column, sizes: dict[str, tuple[int, str]], lazy: bool) -> Any:
    assert spec.dims is not None
    if not isinstance(dataset, h5py.Dataset):
        raise HrgError(f"{path}: {place} is a group, a dataset was expected")
    if dataset.shape is None or dataset.ndim != len(spec.dims):
        raise HrgError(f"{path}: dataset {place} has shape {dataset.shape}, {len(spec.dims)} dimension(s) were expected")
    is_text = dataset.dtype.kind in "OSU"
    if is_text != (spec.dtype == "str") or (not is_text and dataset.dtype.kind not in "iufb"):
        raise HrgError(f"{path}: dataset {place} holds {dataset.dtype}, {'text' if spec.dtype == 'str' else 'real numbers'} were expected")
    units = dataset.attrs.get("units")
    if units is not None and spec.units not in (None, "any", "1") and canonical(_text(units)) != spec.units:
        raise HrgError(
            f"{path}: dataset {place} has units {_text(units)!r}, {spec.units!r} was expected; convert it and write the file again"
        )
    for dim, size in zip(spec.dims, dataset.shape):
        known, where = sizes.setdefault(dim, (size, place))
        if known != size:
            raise HrgError(f"{path}: {place} has {size} values where {where} has {known}; lengths must be equal")
    _need_stored(dataset, path, place)
    if lazy:
        return dataset
    if dataset.size * max(dataset.dtype.itemsize, 1) > LARGEST_COLUMN_BYTES:
        raise HrgError(f"{path}: dataset {place} claims {dataset.size} values, more than can be held in memory; shorten the file")
    if is_text:
        _need_short_texts(dataset, path, place)
        return np.array([_text(v) for v in dataset[()].ravel()], dtype=object).reshape(dataset.shape)
    return dataset[()] if spec.dtype == "raw" else np.asarray(dataset[()], dtype=spec.dtype)


def _need_stored(dataset: h5py.Dataset, path: Path, place: str) -> None:
    """Refuse a dataset whose values are not in this very file: a header may claim any size, and may point anywhere on the disk."""
    layout = dataset.id.get_create_plist()
    if dataset.is_virtual or layout.get_external_count() or Path(dataset.file.filename) != path:
        raise HrgError(f"{path}: dataset {place} keeps its values in another file; copy them into this one")
    claimed = dataset.size * dataset.dtype.itemsize
    if dataset.chunks is not None:
        stored = dataset.id.get_num_chunks() * int(np.prod(dataset.chunks)) * dataset.dtype.itemsize
    else:
        stored = claimed if layout.get_layout() == h5py.h5d.COMPACT else dataset.id.get_storage_size()
    if claimed and (stored == 0 or claimed - stored > LARGEST_GAP_BYTES):
        has = "none" if stored == 0 else f"{stored // dataset.dtype.itemsize} at most"
        raise HrgError(f"{path}: dataset {place} claims {dataset.size} values but stores {has}; copy or record it again")


def _need_short_texts(dataset: h5py.Dataset, path: Path, place: str) -> None:
    """Refuse texts whose claimed lengths the file cannot hold, before the library takes memory for them.

    A text of variable length is kept as its length (4 bytes), heap address and index (HDF5 file format 3.0, IV.A.2.d).
    """
    offset = dataset.id.get_offset()
    kind = h5py.check_string_dtype(dataset.dtype)
    if offset is None or kind is None or kind.length is not None:
        return
    lengths = np.fromfile(path, "<u4", dataset.size * 4, offset=offset)[::4]
    if len(lengths) < dataset.size or lengths.sum(dtype=np.uint64) > path.stat().st_size:
        raise HrgError(f"{path}: dataset {place} claims texts longer than the file; copy or record it again")


def _json_list(file: h5py.File, name: str, path: Path) -> list[Any]:
    text = _text(file.attrs.get(name, "[]"))
    try:
        value = json.loads(text)
    except ValueError as error:
        raise HrgError(f"{path}: root attribute {name} is not JSON") from error
    return value if isinstance(value, list) else []


def _provenance(file: h5py.File, path: Path) -> Provenance:
    history = _text(file.attrs.get("history", ""))
    sources = []
    for entry in _json_list(file, "sources", path):
        if isinstance(entry, dict):
            samples = entry.get("samples")
            known = tuple(map(str, samples)) if isinstance(samples, list) else ()
            name, kind, digest = (str(entry.get(key, "")) for key in ("name", "kind", "sha256"))
            sources.append(Source(name, kind, digest, known))
    return Provenance(
        history=tuple(history.splitlines()),
        settings=_text(file.attrs.get("settings", "")),
        sources=tuple(sources),
        created=_text(file.attrs.get("created", "")),
        generated_by=_text(file.attrs.get("generated_by", "")),
    )


def _checked(record: AnyRecord, path: Path) -> AnyRecord:
    """Rules that bind several fields."""
    if not isinstance(record, Recording):
        return record
    if len(record) == 0:
        raise HrgError(f"{path}: holds no samples; record again")
    found = "neither" if record.time_s is None else "both"
    if (record.sample_rate_hz is None) == (record.time_s is None):
        raise HrgError(f"{path}: needs either the attribute sample_rate_hz or the dataset time_s in /recording, found {found}")
    if record.sample_rate_hz is not None and not (np.isfinite(record.sample_rate_hz) and record.sample_rate_hz > 0):
        raise HrgError(f"{path}: sample_rate_hz is {record.sample_rate_hz}, a positive number was expected")
    if record.mode not in ("free", "forced"):
        raise HrgError(f'{path}: mode is {record.mode!r}, "free" or "forced" was expected')
    if record.readout not in ("direct", "carrier"):
        raise HrgError(f'{path}: readout is {record.readout!r}, "direct" or "carrier" was expected')
    if record.readout == "carrier" and record.carrier_hz is None:
        raise HrgError(f'{path}: readout is "carrier" but the attribute carrier_hz is missing; add it')
    if record.mode_number < 1:
        raise HrgError(f"{path}: mode_number is {record.mode_number}, 1 or more was expected")
    for name in ("c_scale_factor", "s_scale_factor"):
        if not np.isfinite(getattr(record, name)) or getattr(record, name) == 0:
            raise HrgError(f"{path}: {name[2:]} of channel {name[0]} is {getattr(record, name)}, a finite number other than 0 was expected")
    if canonical(record.c_units) != canonical(record.s_units):
        raise HrgError(f"{path}: channel c is in {record.c_units!r} and channel s in {record.s_units!r}; both must have one unit")
    if record.auxiliary_time_s is None and (record.temperature_degc is not None or record.rate_rad_s is not None):
        raise HrgError(f"{path}: /auxiliary has data but no time_s; add it")
    if record.auxiliary_time_s is not None and len(record.auxiliary_time_s) > 1 and not np.all(np.diff(record.auxiliary_time_s) > 0):
        raise HrgError(f"{path}: /auxiliary/time_s must increase from row to row; sort the log")
    return record
