"""Whether a dataset is what it claims: dimensions, type and unit as declared, lengths that agree,
and no more values than its file has bytes for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import HrgError
from ..records import Column
from ..units import to_file_unit
from .validity import find_dtype_problem, find_size_problem

LARGEST_COLUMN_BYTES = 8 << 30
"""No column read into memory at once may claim more."""
LARGEST_GAP_BYTES = 64 << 20
"""So much of a dataset may be left unwritten (it reads as zeros) before its size is not
believed."""
MOST_SOFT_LINKS = 16
"""One after another, as many as HDF5 itself follows."""
LARGEST_CHUNK_BYTES = 256 << 20
"""A chunk is unpacked whole; hrg writes chunks of 1 MB."""
UNPACKED_BYTES, UNPACKED_RATIO = 256 << 20, 50
"""A column of more than so many bytes is read whole only where the file stores more than one in so
many of them."""


def decode_text(value: Any) -> str:
    """The text of a value that every program can write again.

    Parameters
    ----------
    value
        Bytes, a text, or an array of one of them.

    Returns
    -------
    str
        Bytes that are no UTF-8 become U+FFFD.

    Examples
    --------
    >>> from hrg_cli.store.dataset_checks import decode_text
    >>> decode_text(b"gyro"), decode_text(bytes([0xFF])) == chr(0xFFFD)
    ('gyro', True)
    """
    if isinstance(value, np.ndarray) and value.shape == (1,):
        value = value[0]
    raw = value if isinstance(value, bytes) else str(value).encode("utf-8", "surrogatepass")
    return raw.decode("utf-8", "replace")


def find_item(holder: h5py.Group, place: str) -> Any:
    """The group or dataset of a name.

    h5py's `get` would take one that is damaged for a missing one.

    Parameters
    ----------
    holder
        Where it is looked for.
    place
        Its name.

    Returns
    -------
    object or None
        None where there is none; KeyError where it is damaged.

    Examples
    --------
    >>> from hrg_cli.store.dataset_checks import find_item
    >>> find_item({"c": 1}, "c"), find_item({"c": 1}, "s")
    (1, None)
    """
    return holder[place] if place in holder else None  # noqa: SIM401 - that is what `get` is


def need_inside(
    holder: h5py.Group, path: Path, place: str, links_left: int = MOST_SOFT_LINKS
) -> None:
    """Refuse a place that is reached by a link into another file, before it is followed.

    HDF5 would wait for ever at a pipe that nobody writes.

    Parameters
    ----------
    holder
        Where the place is looked for.
    path
        The file, for messages.
    place
        Names, one after another.
    links_left
        Soft links that are still followed.

    Raises
    ------
    HrgError
        It lies in another file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import h5py
    >>> from hrg_cli.store.dataset_checks import need_inside
    >>> with tempfile.TemporaryDirectory() as folder, h5py.File(Path(folder) / "a.h5", "w") as file:
    ...     file["c"] = h5py.ExternalLink("other.h5", "/c")
    ...     need_inside(file, Path("a.h5"), "c")
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: a.h5: c lies in another file; copy it into this one
    """
    found: Any = holder.file if place.startswith("/") else holder
    for part in filter(None, place.split("/")):
        link = found.get(part, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            raise HrgError(f"{path}: {place} lies in another file; copy it into this one")
        if isinstance(link, h5py.SoftLink) and links_left:
            need_inside(found, path, link.path, links_left - 1)
        found = find_item(found, part)
        if not isinstance(found, h5py.Group):
            return


def need_declared(dataset: Any, path: Path, place: str, spec: Column) -> None:
    """Refuse a dataset without the dimensions, type or unit of its declaration.

    Parameters
    ----------
    dataset
        As it was found.
    path
        The file, for messages.
    place
        Its name.
    spec
        Its declaration.

    Raises
    ------
    HrgError
        What was found, and what was expected.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import h5py
    >>> from hrg_cli import Wave
    >>> from hrg_cli.store.dataset_checks import need_declared
    >>> with tempfile.TemporaryDirectory() as folder, h5py.File(Path(folder) / "a.h5", "w") as file:
    ...     file["time_s"] = [[0.0, 1.0]]
    ...     need_declared(file["time_s"], Path("a.h5"), "time_s", Wave.columns()["time_s"])
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: a.h5: dataset time_s has shape (1, 2), 1 dimension(s) were expected
    """
    assert spec.dims is not None
    if not isinstance(dataset, h5py.Dataset):
        raise HrgError(f"{path}: {place} is a group, a dataset was expected")
    if dataset.shape is None or dataset.ndim != len(spec.dims):
        raise HrgError(
            f"{path}: dataset {place} has shape {dataset.shape}, {len(spec.dims)} dimension(s) were"
            " expected"
        )
    problem = find_dtype_problem(dataset.dtype, spec)
    if problem is not None:
        raise HrgError(f"{path}: dataset {place} {problem}; convert it and write the file again")
    units = dataset.attrs.get("units")
    if (
        units is not None
        and spec.units not in (None, "any", "1")
        and to_file_unit(decode_text(units)) != spec.units
    ):
        raise HrgError(
            f"{path}: dataset {place} has units {decode_text(units)!r}, {spec.units!r} was"
            " expected; convert it and write the file again"
        )


def need_lengths(
    dataset: h5py.Dataset, path: Path, place: str, spec: Column, sizes: dict[str, tuple[int, str]]
) -> None:
    """Refuse a dataset that is not as long as the others of its dimension.

    Parameters
    ----------
    dataset
        As it was found.
    path
        The file, for messages.
    place
        Its name.
    spec
        Its declaration.
    sizes
        Dimension -> length and where it was seen; it learns those that are new.

    Raises
    ------
    HrgError
        Another length, or an impossible one.

    Examples
    --------
    >>> from pathlib import Path
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.store.dataset_checks import need_lengths
    >>> need_lengths(Told(shape=(9,)), Path("a.h5"), "s", Told(dims=("row",)), {"row": (8, "c")})
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: a.h5: s has 9 values where c has 8; lengths must be equal
    """
    for dim, size in zip(spec.dims or (), dataset.shape):
        known, where = sizes.setdefault(dim.removesuffix("_2"), (size, place))
        if known != size:
            raise HrgError(
                f"{path}: {place} has {size} values where {where} has {known}; lengths must be"
                " equal"
            )
        problem = find_size_problem(dim, size)
        if problem is not None:
            raise HrgError(f"{path}: dataset {place} {problem}; make the file again")


def need_room(dataset: h5py.Dataset, path: Path, place: str) -> None:
    """Refuse a column that would take far more memory than its file has bytes for.

    Parameters
    ----------
    dataset
        As it was found.
    path
        The file, for messages.
    place
        Its name.

    Raises
    ------
    HrgError
        More values than can be held, or packed beyond belief.

    Examples
    --------
    >>> from pathlib import Path
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.store.dataset_checks import need_room
    >>> stored = Told(get_storage_size=lambda: 1000)
    >>> need_room(Told(size=1000, dtype=np.dtype("f8"), id=stored), Path("a.h5"), "c")
    >>> need_room(Told(size=10**8, dtype=np.dtype("f8"), id=stored), Path("a.h5"), "c")
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: a.h5: dataset c would unpack 1000 bytes to 762 MB; ...
    """
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


def need_stored(dataset: h5py.Dataset, path: Path, place: str) -> None:
    """Refuse a dataset whose values are not in this very file.

    A header may claim any size, and may point anywhere on the disk.

    Parameters
    ----------
    dataset
        As it was found.
    path
        The file.
    place
        Its name.

    Raises
    ------
    HrgError
        Its values lie in another file, or are not stored.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import h5py
    >>> from hrg_cli.store.dataset_checks import need_stored
    >>> with tempfile.TemporaryDirectory() as folder, h5py.File(Path(folder) / "a.h5", "w") as file:
    ...     need_stored(
    ...         file.create_dataset("c", (99,), "f8", chunks=(9,)), Path(folder) / "a.h5", "c"
    ...     )
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: ...: dataset c claims 99 values but stores none; ...
    """
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


def need_short_texts(dataset: h5py.Dataset, path: Path, place: str) -> None:
    """Refuse texts whose claimed lengths a file cannot hold, before the library takes memory for
    them.

    A text of variable length is kept as its length (4 bytes), heap address and index (HDF5 file
    format 3.0, IV.A.2.d).

    Parameters
    ----------
    dataset
        As it was found.
    path
        The file.
    place
        Its name.

    Raises
    ------
    HrgError
        They are longer than the file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import h5py
    >>> from hrg_cli.store.dataset_checks import need_short_texts
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "a.h5"
    ...     with h5py.File(path, "w") as file:
    ...         file["name"] = ["gyro", "run"]
    ...         file.flush()
    ...         need_short_texts(file["name"], path, "name")
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
