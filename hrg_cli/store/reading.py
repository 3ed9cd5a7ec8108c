"""Reading: every dataset and attribute checked against its declaration, every way HDF5 fails turned
into a sentence."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import HrgError
from ..records import Column, Record
from .dataset_checks import (
    decode_text,
    find_item,
    need_declared,
    need_lengths,
    need_room,
    need_short_texts,
    need_stored,
)
from .handles import Handle, explain_reading
from .headings import (
    find_kind,
    need_kind,
    open_for_reading,
    read_attribute,
    read_json_list,
    read_provenance,
)
from .layout import AnyRecord, find_place
from .lazy import CheckedColumn
from .validity import find_values_problem, list_bound_together


@contextlib.contextmanager
def open_record(path: Path | str, kind: type[AnyRecord]) -> Iterator[AnyRecord]:
    """The record of a file, its row columns left on disk; closed on leaving.

    Rows are read and checked when they are sliced. Any number of records may be open: files beyond
    a few dozen are closed and opened again as their rows are asked for.

    Parameters
    ----------
    path
        An hrg file (HDF5).
    kind
        The record it must hold, e.g. `Recording`.

    Returns
    -------
    context manager of Record
        Columns of rows (n, …) are read by `record.c[start:stop]`.

    Raises
    ------
    HrgError
        Not that kind, damaged, a missing or ill-shaped dataset, a wrong unit; of rows that break
        their declaration, when they are read.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> run = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> _ = store.write(path, run)
    >>> with store.open_record(path, Recording) as record:
    ...     record.s[1:].tolist()
    [1.0, 1.0]
    """
    handle = Handle(Path(path))
    try:
        with explain_reading(handle.path):
            record = _record(handle.open_file(), handle.path, kind, handle)
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
    >>> _ = store.write(
    ...     path, Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    ... )
    >>> store.read(path, Recording).s.tolist()
    [1.0, 1.0, 1.0]
    """
    with open_for_reading(Path(path)) as file:
        return _record(file, Path(path), kind)


def read_any(path: Path | str) -> Record:
    """The record of a file whatever its kind.

    Parameters
    ----------
    path
        An hrg file (HDF5).

    Returns
    -------
    Record
        Of the kind that the file tells, whole, in memory.

    Raises
    ------
    HrgError
        Not an hrg file, damaged, a missing or ill-shaped dataset, a wrong unit.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> run = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> _ = store.write(path, run)
    >>> type(store.read_any(path)).__name__
    'Recording'
    """
    return read(path, find_kind(path))


def _record(
    file: h5py.File, path: Path, kind: type[AnyRecord], lazy: Handle | None = None
) -> AnyRecord:
    need_kind(file, path, kind)
    values: dict[str, Any] = {}
    sizes: dict[str, tuple[int, str]] = {}
    for field_name, spec in kind.columns().items():
        place = find_place(kind, field_name, spec)
        if spec.dims is None:
            values[field_name] = read_attribute(file, path, place, field_name, spec)
            continue
        dataset = find_item(file, place)
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
    status = decode_text(file.attrs.get("status", "valid"))
    if status not in ("valid", "suspect", "refused"):
        raise HrgError(
            f'{path}: its status is {status!r}, expected "valid", "suspect" or "refused"'
        )
    values["status"] = status
    record = kind(
        **values,
        status_reasons=tuple(read_json_list(file, "status_reasons", path)),
        provenance=read_provenance(file, path),
    )
    problem = list_bound_together(record)
    if problem is not None:
        raise HrgError(f"{path}: {problem}")
    return record


def _excused(opened: Handle | h5py.File, kind: type[Record], key: Any) -> np.ndarray:
    """The rows of a key in which NaN may stand: flagged, or the solver did not converge."""
    file = opened.open_file() if isinstance(opened, Handle) else opened
    flags, iterations = (
        find_item(file, f"/{kind.kind}/{name}") for name in ("flags", "iterations")
    )
    excused = np.asarray(flags[key]) != 0
    return excused if iterations is None else excused | (np.asarray(iterations[key]) < 0)


def _read_dataset(
    dataset: Any,
    path: Path,
    place: str,
    spec: Column,
    sizes: dict[str, tuple[int, str]],
    lazy: Handle | None,
    excused: Callable[[Any], np.ndarray] | None,
) -> Any:
    need_declared(dataset, path, place, spec)
    need_lengths(dataset, path, place, spec, sizes)
    need_stored(dataset, path, place)
    if lazy is not None:
        return CheckedColumn(lazy, dataset, place, spec, excused)
    need_room(dataset, path, place)
    if spec.dtype == "str":
        need_short_texts(dataset, path, place)
        return np.array([decode_text(v) for v in dataset[()].ravel()], dtype=object).reshape(
            dataset.shape
        )
    found = dataset[()]
    problem = find_values_problem(
        found, spec, 0, None if excused is None else lambda: excused(slice(None))
    )
    if problem is not None:
        raise HrgError(f"{path}: dataset {place} {problem}; make the file again or record it again")
    return found if spec.dtype == "raw" else np.asarray(found, dtype=spec.dtype)
