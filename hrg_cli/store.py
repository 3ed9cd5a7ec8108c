"""Reads and writes every kind of record as HDF5: whole or not at all, checked on the way in, provenance beside the data.

Written under a temporary name in the target folder and renamed when whole; an existing output is replaced only when asked.
Datasets carry dimension scales, so each group opens with `xarray.open_dataset(path, group=..., engine="h5netcdf")`.
Identical content gives identical bytes: no time stamps inside but `created`, which honours SOURCE_DATE_EPOCH.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import hashlib
import json
import os
import re
import shutil
import sys
import time
import traceback
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from . import __version__
from .errors import DiskFullError, HrgError
from .heaps import check_heaps
from .records import GROWING, KINDS, Column, Provenance, Record, Recording, Source
from .units import canonical

FORMAT, FORMAT_VERSION = "hrg", "1.0"
LARGEST_COLUMN_BYTES = 8 << 30
"""No column read into memory at once may claim more."""
LARGEST_GAP_BYTES = 64 << 20
"""So much of a dataset may be left unwritten (it reads as zeros) before its size is not believed."""
ROW_CHUNK = {"recording": 1 << 18}

AnyRecord = TypeVar("AnyRecord", bound=Record)
_KIND = {cls.kind: cls for cls in KINDS}
_SCALE_ONLY = "This is a netCDF dimension but not a netCDF variable. %9d"


# ---------------------------------------------------------------- reading


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
        raise HrgError(f"{path}: cannot be opened as HDF5 ({_first_line(error)}); copy or record it again") from error
    try:
        yield file
    except HrgError:
        raise
    except (OSError, RuntimeError, KeyError, UnicodeDecodeError) as error:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EACCES, errno.EROFS):
            raise
        raise HrgError(f"{path}: is damaged ({_first_line(error)}); copy or record it again") from error
    finally:
        with contextlib.suppress(Exception):
            file.close()


def _first_line(error: BaseException) -> str:
    return str(error).strip("'\"").splitlines()[0][:160] if str(error) else type(error).__name__


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
    if kind not in _KIND:
        raise HrgError(f"{path}: its kind is {kind!r}, expected one of {', '.join(_KIND)}; write the file again with hrg {__version__}")
    return _KIND[kind]


def _record(file: h5py.File, path: Path, kind: type[AnyRecord], lazy: bool) -> AnyRecord:
    found = _kind(file, path)
    if found is not kind:
        raise HrgError(f"{path}: is a {found.kind} file, a {kind.kind} file was expected; make one with `{kind.made_by}`")
    values: dict[str, Any] = {}
    sizes: dict[str, tuple[int, str]] = {}
    for field_name, spec in kind.columns().items():
        place = _place(kind, field_name, spec)
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


def _place(kind: type[Record], field_name: str, spec: Column) -> str:
    return f"{spec.group or '/' + kind.kind}/{spec.name or field_name}"


def _read_attribute(file: h5py.File, path: Path, place: str, field_name: str, spec: Column, values: dict[str, Any]) -> Any:
    group, _, name = place.rpartition("/")
    holder = file.get(group)
    if holder is None or name not in holder.attrs:
        if spec.optional:
            return _default(field_name, spec)
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


def _default(field_name: str, spec: Column) -> Any:
    for cls in KINDS:
        for f in dataclasses.fields(cls):
            if f.metadata.get("column") is spec:
                return f.default
    raise AssertionError(field_name)


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
            sources.append(Source(*(str(entry.get(k, "")) for k in ("name", "kind", "sha256"))))
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


# ---------------------------------------------------------------- writing


def check_output(path: Path | str, force: bool = False) -> Path:
    """`path` as a place to write to, or the sentence why it is none."""
    path = Path(path)
    folder = path.parent
    if not folder.is_dir():
        raise HrgError(f"{path}: the folder {folder} does not exist; make it first")
    if path.is_dir():
        raise HrgError(f"{path}: is a folder; name a file in it")
    if path.exists() and not force:
        raise HrgError(f"{path}: exists already; give --force to replace it or another --output")
    if not os.access(folder, os.W_OK) or (os.geteuid() == 0 and _read_only(folder)):
        raise HrgError(f"{path}: no right to write in {folder}; choose another --output")
    return path


def _read_only(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        return bool(os.statvfs(folder).f_flag & os.ST_RDONLY)
    return False


@contextlib.contextmanager
def atomic_path(path: Path | str, force: bool = False) -> Iterator[Path]:
    """A temporary name beside `path`, renamed to it when the block ends well and removed otherwise."""
    path = check_output(path, force)
    _remove_stale(path)
    temporary = path.parent / f".{path.name[:80]}.hrg-{os.getpid()}-{time.monotonic_ns()}.tmp"
    try:
        yield temporary
        if force:
            os.replace(temporary, path)
        else:
            _rename_to_new(temporary, path)
    except OSError as error:
        raise _write_error(error, path) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """While a failed file is let go: h5py prints a traceback for each object it cannot flush, which says nothing new."""
    hooks = sys.unraisablehook, sys.excepthook
    sys.unraisablehook, sys.excepthook = (lambda _: None), (lambda *_: None)
    try:
        yield
    finally:
        sys.unraisablehook, sys.excepthook = hooks


def _rename_to_new(temporary: Path, path: Path) -> None:
    """Rename unless another writer has made `path` meanwhile."""
    try:
        os.link(temporary, path)
    except FileExistsError as error:
        raise HrgError(f"{path}: was written by another program meanwhile; this result was dropped") from error
    except OSError:
        os.replace(temporary, path)


def _remove_stale(path: Path) -> None:
    """Remove temporary files of this output whose writer was killed."""
    for left in path.parent.glob(f".{_glob_escape(path.name[:80])}.hrg-*.tmp"):
        match = re.search(r"\.hrg-(\d+)-\d+\.tmp$", left.name)
        if match and not Path(f"/proc/{match[1]}").exists() and Path("/proc/self").exists():
            with contextlib.suppress(OSError):
                left.unlink()


def _glob_escape(name: str) -> str:
    return re.sub(r"([*?\[])", r"[\1]", name)


def _write_error(error: OSError, path: Path) -> HrgError:
    if error.errno == errno.ENOSPC or "No space left" in str(error):
        return DiskFullError(f"{path}: the disk is full; free space or choose another --output")
    if error.errno in (errno.EFBIG, errno.EDQUOT) or "File too large" in str(error):
        return DiskFullError(f"{path}: may not grow so large (a quota or a limit of this process); choose another --output")
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return HrgError(f"{path}: no right to write it; choose another --output")
    if error.errno == errno.ENAMETOOLONG:
        return HrgError(f"{str(path)[:80]}…: the name is too long; choose a shorter --output")
    return HrgError(f"{path}: cannot be written ({_first_line(error)}); choose another --output")


def created_now() -> str:
    """The time for `created` and `history`, ISO 8601 UTC; SOURCE_DATE_EPOCH fixes it."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(float(epoch) if epoch else None))


def sha256(path: Path | str) -> str:
    """SHA-256 of a file's bytes, hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write(path: Path | str, stream: AnyRecord | Iterable[AnyRecord], force: bool = False, finish: Any = None) -> AnyRecord:
    """Write a record, or a stream of records block by block, to `path`; return the last record (a stream's: its last block).

    finish: called with the last record before closing; returns it with provenance and status complete.
    HrgError: the folder is missing or not writable, the output exists (unless `force`), the disk is full; then no output exists.
    """
    with atomic_path(path, force) as temporary:
        blocks: Iterable[AnyRecord] = (stream,) if isinstance(stream, Record) else stream
        last: AnyRecord | None = None
        file: h5py.File | None = None
        try:
            for block in blocks:
                _need_space(block, Path(path))
                if file is None:
                    file = h5py.File(temporary, "w", libver=("earliest", "v110"))
                    _create(file, block)
                else:
                    _append(file, block)
                last = block
            if file is None or last is None:
                raise HrgError(f"{path}: nothing to write; the stage before it produced no record")
            if finish is not None:
                last = finish(last)
            _finish(file, last)
            file.close()
        except BaseException as error:
            with _quiet():
                traceback.clear_frames(error.__traceback__)
                if file is not None:
                    with contextlib.suppress(Exception):
                        file.close()
                file = None
            if isinstance(error, RuntimeError) and (number := re.search(r"errno = (\d+)", str(error))):
                raise OSError(int(number[1]), os.strerror(int(number[1]))) from error
            raise
    assert last is not None
    return last


def _need_space(block: Record, path: Path) -> None:
    """h5py cannot recover from a full disk, so ask before each block."""
    need = (4 << 20) if os.environ.get("HRG_NO_SPACE_MARGIN") is None else 0
    for name, spec in block.columns().items():
        value = getattr(block, name)
        if spec.dims and isinstance(value, np.ndarray):
            need += value.nbytes
    if shutil.disk_usage(path.parent).free < need:
        raise DiskFullError(f"{path}: the disk is full ({need >> 20} MB more are needed); free space or choose another --output")


def _present(record: Record) -> Iterator[tuple[str, str, Column, Any]]:
    for field_name, spec in record.columns().items():
        value = getattr(record, field_name)
        if value is not None:
            yield field_name, _place(type(record), field_name, spec), spec, value


def _create(file: h5py.File, record: Record) -> None:
    file.create_group(record.kind)
    for _, place, spec, value in _present(record):
        if spec.dims is None:
            continue
        array = _encoded(value, spec)
        growing = spec.dims[0] in GROWING
        options: dict[str, Any] = {}
        if growing:
            row_bytes = max(1, array[:1].nbytes) if len(array) else 8
            rows = ROW_CHUNK.get(record.kind, 1 << 14) if spec.dims[0] == "row" else 4096
            rows = max(16, min(rows, max(len(array), 16), (1 << 20) // row_bytes))
            options = {"maxshape": (None, *array.shape[1:]), "chunks": (rows, *array.shape[1:])}
            if spec.dtype == "raw":
                options["fletcher32"] = True
            elif spec.dims[0] == "row" or array.nbytes > 4096:
                options["fletcher32"] = True
                if _worth_compressing(array):
                    options |= {"compression": "gzip", "compression_opts": 1, "shuffle": True}
        dataset = file.create_dataset(place, data=array, track_times=False, **options)
        dataset.attrs["units"] = _units(record, spec)
        dataset.attrs["long_name"] = spec.meaning
        dataset.flush()  # a failure while a dataset is closed would be lost


def _worth_compressing(array: Any) -> bool:
    """Whether gzip after shuffle saves a third of the first rows; noise does not shrink and costs most of a command's time."""
    sample = np.ascontiguousarray(array).reshape(-1)[: 1 << 14]
    shuffled = sample.view("u1").reshape(-1, sample.itemsize).T.tobytes()
    return len(zlib.compress(shuffled, 1)) < 0.67 * max(1, len(shuffled))


def _units(record: Record, spec: Column) -> str:
    if spec.units == "any":
        return str(getattr(record, "units", "1")) if isinstance(getattr(record, "units", "1"), str) else "1"
    return spec.units or "1"


def _encoded(value: Any, spec: Column) -> Any:
    if spec.dtype == "str":
        return np.array([str(v) for v in np.asarray(value).ravel()], dtype=h5py.string_dtype()).reshape(np.shape(value))
    array = np.asarray(value[()] if isinstance(value, h5py.Dataset) else value)
    return array if spec.dtype == "raw" else array.astype(spec.dtype, copy=False)


def _append(file: h5py.File, block: Record) -> None:
    for _, place, spec, value in _present(block):
        if spec.dims is None or spec.dims[0] not in GROWING:
            continue
        array = _encoded(value, spec)
        dataset = file[place]
        start = dataset.shape[0]
        dataset.resize(start + len(array), axis=0)
        dataset[start:] = array
        dataset.flush()


def _finish(file: h5py.File, record: Record) -> None:
    for field_name, place, spec, value in _present(record):
        if spec.dims is None:
            group, _, name = place.rpartition("/")
            if group not in file and value == _default(field_name, spec):
                continue
            holder = file[group] if group in file else file.create_group(group)
            holder.attrs[name] = _attribute_text(file, value) if isinstance(value, str) else value
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
    file.attrs["created"] = provenance.created or created_now()
    file.attrs["history"] = _attribute_text(file, "\n".join(provenance.history))
    file.attrs["settings"] = _attribute_text(file, provenance.settings)
    file.attrs["sources"] = json.dumps([dataclasses.asdict(s) for s in provenance.sources])
    file.attrs["status"] = record.status
    file.attrs["status_reasons"] = _attribute_text(file, json.dumps(list(record.status_reasons), ensure_ascii=False))


def _attribute_text(file: h5py.File, text: str) -> Any:
    """An attribute holds 64 kB at the most in the old format; longer texts are cut with a word that says so."""
    limit = 60_000
    raw = text.encode()
    return text if len(raw) <= limit else raw[:limit].decode("utf-8", "ignore") + "\n… (cut: longer than an HDF5 attribute holds)"


def _create_late(file: h5py.File, record: Record, place: str, spec: Column, value: Any) -> None:
    dataset = file.create_dataset(place, data=_encoded(value, spec), track_times=False)
    dataset.attrs["units"] = _units(record, spec)
    dataset.attrs["long_name"] = spec.meaning
    dataset.flush()


def _attach_scales(file: h5py.File, record: Record) -> None:
    """Give every dimension of every dataset a scale of its own group, so that netCDF readers open the group."""
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
                    dim, shape=(length,), dtype="i1", track_times=False, compression="gzip" if length > 4096 else None
                )
                scale.make_scale(_SCALE_ONLY % length)
            if scale.id != dataset.id:
                dataset.dims[axis].attach_scale(scale)
