"""Reading: every dataset and attribute checked against its declaration, every way HDF5 fails turned
into a sentence."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import HrgError, NotHrgError
from ..records import Column, Provenance, Record, Source
from ..units import canonical
from ..version import __version__
from . import checksums
from .handles import Handle, reading
from .layout import BY_NAME, FORMAT, FORMAT_VERSION, AnyRecord, default_of, place_of
from .lazy import CheckedColumn
from .validity import attribute_problem, bound_together, dtype_problem, size_problem, values_problem

LARGEST_COLUMN_BYTES = 8 << 30
"""No column read into memory at once may claim more."""
LARGEST_GAP_BYTES = 64 << 20
"""So much of a dataset may be left unwritten (it reads as zeros) before its size is not
believed."""
LARGEST_CHUNK_BYTES = 256 << 20
"""A chunk is unpacked whole; hrg writes chunks of 1 MB."""
UNPACKED_BYTES, UNPACKED_RATIO = 256 << 20, 50
"""A column of more than so many bytes is read whole only where the file stores more than one in so
many of them."""


@contextlib.contextmanager
def open_record(path: Path | str, kind: type[AnyRecord]) -> Iterator[AnyRecord]:
    """The record of `path`, its row columns left on disk (they are read and checked when sliced);
    closed on leaving.

    Any number of records may be open: files beyond a few dozen are closed and opened again as their
    rows are asked for.
    """
    handle = Handle(Path(path))
    try:
        with reading(handle.path):
            record = _record(handle.file(), handle.path, kind, handle)
        yield record
    finally:
        handle.close()


def read(path: Path | str, kind: type[AnyRecord]) -> AnyRecord:
    """The record of a file, whole, in memory.

    Parameters
    ----------
    path
        An hrg file (HDF5).
    kind
        The record it must hold, e.g. `Wave`.

    Returns
    -------
    Record
        Of that kind, every column checked against its declaration.

    Raises
    ------
    HrgError
        Not that kind, damaged, a missing or ill-shaped dataset, a wrong unit.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> _ = store.write(path, Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free"))
    >>> store.read(path, Recording).s.tolist()
    [1.0, 1.0, 1.0]
    """
    with _opened(Path(path)) as file:
        return _record(file, Path(path), kind)


def read_any(path: Path | str) -> Record:
    """The record of `path` whatever its kind."""
    return read(path, kind_of(path))


def provenance_of(path: Path | str) -> Provenance:
    """Where the file of `path` comes from, without reading its datasets."""
    with _opened(Path(path)) as file:
        return _provenance(file, Path(path))


def is_hdf5(path: Path | str) -> bool:
    """Whether the file's first bytes are those of HDF5. HrgError: they cannot be read."""
    with reading(Path(path)):
        return bool(h5py.is_hdf5(path))


def kind_of(path: Path | str) -> type[Record]:
    """The kind of record in `path`."""
    with _opened(Path(path)) as file:
        return _kind(file, Path(path))


def texts_of(path: Path | str, group: str, names: Sequence[str]) -> dict[str, str]:
    """Those of the named attributes of a group that are there, as texts; also ones that no record
    declares. HrgError: the file cannot be opened."""
    with _opened(Path(path)) as file:
        return _texts(file, group, names)


def heading_of(path: Path | str, kind: type[Record], names: Sequence[str]) -> dict[str, str]:
    """Those of the named attributes of a record of that kind that are there, as texts; its datasets
    are not looked at. HrgError: the file cannot be opened, holds another kind, or an attribute is
    not as declared; NotHrgError: another program's HDF5."""
    declared = kind.columns()
    with _opened(Path(path)) as file:
        _need_kind(file, Path(path), kind)
        texts = _texts(file, kind.kind, names)
        for name in texts.keys() & declared.keys():
            spec = declared[name]
            place = place_of(kind, name, spec)
            texts[name] = str(_read_attribute(file, Path(path), place, name, spec))
        return texts


def changes(path: Path | str) -> list[str] | None:
    """What in a file differs from what was written there, in words; None where it keeps no
    checksums (a laboratory's file)."""
    with _opened(Path(path)) as file:
        return checksums.changes(file)


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """An HDF5 file for reading; every way h5py fails becomes a sentence."""
    handle = Handle(path)
    try:
        with reading(path):
            yield handle.file()
    finally:
        handle.close()


def _texts(file: h5py.File, group: str, names: Sequence[str]) -> dict[str, str]:
    held = file[group].attrs if group in file else {}
    return {name: _text(held[name]) for name in names if name in held}


def _text(value: Any) -> str:
    """The text that every program can write again: bytes that are no UTF-8 become U+FFFD."""
    if isinstance(value, np.ndarray) and value.shape == (1,):
        value = value[0]
    raw = value if isinstance(value, bytes) else str(value).encode("utf-8", "surrogatepass")
    return raw.decode("utf-8", "replace")


def _kind(file: h5py.File, path: Path) -> type[Record]:
    if _text(file.attrs.get("format", "")) != FORMAT:
        raise NotHrgError(
            f'{path}: is HDF5 but not an hrg file (root attribute format = "hrg" is missing); run'
            " `hrg import` on a foreign log"
        )
    version = _text(file.attrs.get("format_version", ""))
    if version.split(".")[0] != FORMAT_VERSION.split(".")[0]:
        raise HrgError(
            f"{path}: has format_version {version or 'none'}, this hrg reads {FORMAT_VERSION}; use"
            " a matching version of hrg"
        )
    kind = _text(file.attrs.get("kind", ""))
    if kind not in BY_NAME:
        raise HrgError(
            f"{path}: its kind is {kind!r}, expected one of {', '.join(BY_NAME)}; write the file"
            f" again with hrg {__version__}"
        )
    return BY_NAME[kind]


def _need_kind(file: h5py.File, path: Path, kind: type[Record]) -> None:
    found = _kind(file, path)
    if found is not kind:
        raise HrgError(
            f"{path}: is a {found.kind} file, a {kind.kind} file was expected; make one with"
            f" `{kind.made_by}`"
        )


def _record(
    file: h5py.File, path: Path, kind: type[AnyRecord], lazy: Handle | None = None
) -> AnyRecord:
    _need_kind(file, path, kind)
    values: dict[str, Any] = {}
    sizes: dict[str, tuple[int, str]] = {}
    for field_name, spec in kind.columns().items():
        place = place_of(kind, field_name, spec)
        if spec.dims is None:
            values[field_name] = _read_attribute(file, path, place, field_name, spec)
            continue
        dataset = file.get(place)
        if dataset is None:
            if spec.optional:
                continue
            raise HrgError(
                f"{path}: dataset {place} is missing; make the file again with `{kind.made_by}`"
            )
        excused = partial(_excused, lazy or file, kind) if spec.valid.missing == "flagged" else None
        values[field_name] = _read_dataset(
            dataset, path, place, spec, sizes, lazy if spec.dims[0] == "row" else None, excused
        )
    status = _text(file.attrs.get("status", "valid"))
    if status not in ("valid", "suspect", "refused"):
        raise HrgError(
            f'{path}: its status is {status!r}, expected "valid", "suspect" or "refused"'
        )
    values["status"] = status
    record = kind(
        **values,
        status_reasons=tuple(_json_list(file, "status_reasons", path)),
        provenance=_provenance(file, path),
    )
    problem = bound_together(record)
    if problem is not None:
        raise HrgError(f"{path}: {problem}")
    return record


def _excused(opened: Handle | h5py.File, kind: type[Record], key: Any) -> np.ndarray:
    """The rows of a key in which NaN may stand: flagged, or the solver did not converge."""
    file = opened.file() if isinstance(opened, Handle) else opened
    flags, iterations = file.get(f"/{kind.kind}/flags"), file.get(f"/{kind.kind}/iterations")
    excused = np.asarray(flags[key]) != 0
    return excused if iterations is None else excused | (np.asarray(iterations[key]) < 0)


def _read_attribute(file: h5py.File, path: Path, place: str, field_name: str, spec: Column) -> Any:
    group, _, name = place.rpartition("/")
    holder = file.get(group)
    if holder is None or name not in holder.attrs:
        if spec.optional:
            return default_of(field_name, spec)
        raise HrgError(
            f"{path}: attribute {name} of {group} is missing; make the file again or add it"
        )
    value = _parsed(holder.attrs[name], spec, f"{path}: attribute {name} of {group}")
    problem = attribute_problem(value, spec)
    if problem is not None:
        raise HrgError(
            f"{path}: attribute {name} of {group} {problem}; correct it or make the file again"
        )
    return value


def _parsed(value: Any, spec: Column, where: str) -> Any:
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
        raise HrgError(f"{where} is {_text(value)[:60]!r}, a number was expected") from error


def _read_dataset(
    dataset: Any,
    path: Path,
    place: str,
    spec: Column,
    sizes: dict[str, tuple[int, str]],
    lazy: Handle | None,
    excused: Callable[[Any], np.ndarray] | None,
) -> Any:
    _need_declared(dataset, path, place, spec)
    _need_lengths(dataset, path, place, spec, sizes)
    _need_stored(dataset, path, place)
    if lazy is not None:
        return CheckedColumn(lazy, dataset, place, spec, excused)
    _need_room(dataset, path, place)
    if spec.dtype == "str":
        _need_short_texts(dataset, path, place)
        return np.array([_text(v) for v in dataset[()].ravel()], dtype=object).reshape(
            dataset.shape
        )
    found = dataset[()]
    problem = values_problem(
        found, spec, 0, None if excused is None else lambda: excused(slice(None))
    )
    if problem is not None:
        raise HrgError(f"{path}: dataset {place} {problem}; make the file again or record it again")
    return found if spec.dtype == "raw" else np.asarray(found, dtype=spec.dtype)


def _need_declared(dataset: Any, path: Path, place: str, spec: Column) -> None:
    """HrgError: the dataset has not the dimensions, type or unit of its declaration."""
    assert spec.dims is not None
    if not isinstance(dataset, h5py.Dataset):
        raise HrgError(f"{path}: {place} is a group, a dataset was expected")
    if dataset.shape is None or dataset.ndim != len(spec.dims):
        raise HrgError(
            f"{path}: dataset {place} has shape {dataset.shape}, {len(spec.dims)} dimension(s) were"
            " expected"
        )
    problem = dtype_problem(dataset.dtype, spec)
    if problem is not None:
        raise HrgError(f"{path}: dataset {place} {problem}; convert it and write the file again")
    units = dataset.attrs.get("units")
    if (
        units is not None
        and spec.units not in (None, "any", "1")
        and canonical(_text(units)) != spec.units
    ):
        raise HrgError(
            f"{path}: dataset {place} has units {_text(units)!r}, {spec.units!r} was expected;"
            " convert it and write the file again"
        )


def _need_lengths(
    dataset: h5py.Dataset, path: Path, place: str, spec: Column, sizes: dict[str, tuple[int, str]]
) -> None:
    """HrgError: a dimension is as long in no other dataset, or of an impossible length; `sizes`
    learns the others."""
    for dim, size in zip(spec.dims or (), dataset.shape):
        known, where = sizes.setdefault(dim.removesuffix("_2"), (size, place))
        if known != size:
            raise HrgError(
                f"{path}: {place} has {size} values where {where} has {known}; lengths must be"
                " equal"
            )
        problem = size_problem(dim, size)
        if problem is not None:
            raise HrgError(f"{path}: dataset {place} {problem}; make the file again")


def _need_room(dataset: h5py.Dataset, path: Path, place: str) -> None:
    """Refuse a column that would take far more memory than its file has bytes for."""
    claimed = dataset.size * max(dataset.dtype.itemsize, 1)
    if claimed > LARGEST_COLUMN_BYTES:
        raise HrgError(
            f"{path}: dataset {place} claims {dataset.size} values, more than can be held in"
            " memory; shorten the file"
        )
    stored = dataset.id.get_storage_size()
    if claimed > UNPACKED_BYTES and claimed > UNPACKED_RATIO * stored:
        raise HrgError(
            f"{path}: dataset {place} would unpack {stored} bytes to {claimed >> 20} MB; write it"
            " again without such compression"
        )


def _need_stored(dataset: h5py.Dataset, path: Path, place: str) -> None:
    """Refuse a dataset whose values are not in this very file: a header may claim any size, and may
    point anywhere on the disk."""
    layout = dataset.id.get_create_plist()
    if dataset.is_virtual or layout.get_external_count() or Path(dataset.file.filename) != path:
        raise HrgError(
            f"{path}: dataset {place} keeps its values in another file; copy them into this one"
        )
    claimed = dataset.size * dataset.dtype.itemsize
    if dataset.chunks is not None:
        chunk = int(np.prod(dataset.chunks)) * dataset.dtype.itemsize
        if chunk > LARGEST_CHUNK_BYTES and chunk > UNPACKED_RATIO * dataset.id.get_storage_size():
            raise HrgError(
                f"{path}: dataset {place} would unpack one chunk to {chunk >> 20} MB; write it"
                " again in smaller chunks"
            )
        stored = dataset.id.get_num_chunks() * int(np.prod(dataset.chunks)) * dataset.dtype.itemsize
    else:
        stored = (
            claimed if layout.get_layout() == h5py.h5d.COMPACT else dataset.id.get_storage_size()
        )
    if claimed and (stored == 0 or claimed - stored > LARGEST_GAP_BYTES):
        has = "none" if stored == 0 else f"{stored // dataset.dtype.itemsize} at most"
        raise HrgError(
            f"{path}: dataset {place} claims {dataset.size} values but stores {has}; copy or record"
            " it again"
        )


def _need_short_texts(dataset: h5py.Dataset, path: Path, place: str) -> None:
    """Refuse texts whose claimed lengths the file cannot hold, before the library takes memory for
    them.

    A text of variable length is kept as its length (4 bytes), heap address and index (HDF5 file
    format 3.0, IV.A.2.d).
    """
    offset = dataset.id.get_offset()
    kind = h5py.check_string_dtype(dataset.dtype)
    if offset is None or kind is None or kind.length is not None:
        return
    lengths = np.fromfile(path, "<u4", dataset.size * 4, offset=offset)[::4]
    if len(lengths) < dataset.size or lengths.sum(dtype=np.uint64) > path.stat().st_size:
        raise HrgError(
            f"{path}: dataset {place} claims texts longer than the file; copy or record it again"
        )


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
