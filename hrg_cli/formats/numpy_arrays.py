"""Arrays that numpy saved: `.npy` (one array, its columns or fields as channels) and `.npz` (a
variable a channel), never a pickled object."""

from __future__ import annotations

import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np

from ..errors import HrgError
from .log import Array, Log, Reader, make_log
from .matlab_child import split_columns
from .scalars import find_rate
from .unit_spellings import split_name

MAGIC = b"\x93NUMPY"
MEMBER = ".npy"


def _recognises(path: Path, head: bytes) -> bool:
    """The magic word of `.npy`, or an archive whose first member is one."""
    if head.startswith(MAGIC):
        return True
    length = int.from_bytes(head[26:28], "little")
    return head.startswith(b"PK\x03\x04") and head[30 : 30 + length].endswith(MEMBER.encode())


def _open_numpy(path: Path) -> Log:
    """Every vector, column, field and named variable as a channel; a complex one as two, `re` and
    `im`.

    A bare array of several columns has no titles, as a table of text without them. Raises HrgError:
    no numbers, pickled objects, damaged, a member that claims more than the file holds.
    """
    with path.open("rb") as file:
        bare = file.read(len(MAGIC)) == MAGIC
    arrays = {"": _open_bare(path)} if bare else dict(_read_members(path))
    columns = dict(column for name, array in arrays.items() for column in _columns_of(name, array))
    if not columns:
        raise HrgError(
            f"{path}: holds no vector of numbers; save one variable a channel: np.savez(file,"
            " time=t, c=c, s=s)"
        )
    titles = {name: split_name(name) for name in columns}
    scalars = {name: float(a.reshape(())) for name, a in arrays.items() if _is_number(a)}
    return make_log(
        "numpy",
        {titles[name][0]: column for name, column in columns.items()},
        {title: unit for title, unit in titles.values()},
        sample_rate_hz=find_rate(scalars),
        header=not bare or arrays[""].dtype.names is not None,
    )


def _open_bare(path: Path) -> Array:
    """The array of a `.npy`, left on disk."""
    with path.open("rb") as file:
        _need_plain(path, file, path.stat().st_size, "")
    return np.load(path, mmap_mode="r", allow_pickle=False)


def _read_members(path: Path) -> Iterator[tuple[str, Array]]:
    """Name and array of every member of a `.npz`."""
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                if not member.filename.endswith(MEMBER):
                    continue
                name = member.filename.removesuffix(MEMBER)
                with archive.open(member) as file:
                    _need_plain(path, file, member.file_size, f"variable {name} ")
                with archive.open(member) as file:
                    yield name, np.lib.format.read_array(file, allow_pickle=False)
    except (zipfile.BadZipFile, zlib.error) as error:
        raise HrgError(f"{path}: is no whole .npz ({error}); save it again") from error


def _need_plain(path: Path, file: IO[bytes], held: int, what: str) -> None:
    """HrgError: objects, which only Python itself unpacks, or more numbers than there are bytes."""
    form = np.lib.format
    try:
        one = form.read_magic(file) == (1, 0)
        shape, _, dtype = (form.read_array_header_1_0 if one else form.read_array_header_2_0)(file)
    except (SyntaxError, ValueError, tokenize.TokenError) as error:
        raise HrgError(f"{path}: {what}has a damaged head; save it again") from error
    if dtype.hasobject:
        raise HrgError(
            f"{path}: {what}holds Python objects, which are not read: save arrays of numbers"
        )
    if int(np.prod([int(n) for n in shape], dtype=object)) * dtype.itemsize > held:
        raise HrgError(
            f"{path}: {what}claims {shape} numbers, more than the file holds; it is truncated: save"
            " it again"
        )


def _is_number(array: Array) -> bool:
    return array.size == 1 and array.dtype.kind in "iufb"


def _columns_of(name: str, array: Array) -> Iterator[tuple[str, Array]]:
    """Named vectors (n,) of an array: itself, its columns, its fields, its two parts."""
    if array.dtype.names:
        for field in array.dtype.names:
            yield from _columns_of(f"{name}/{field}" if name else field, array[field])
    elif array.ndim == 2:
        for k, column in enumerate(split_columns(array), start=1):
            yield from _columns_of(f"{name}/{k}" if name else f"column {k}", column)
    elif array.ndim == 1 and array.size > 1:
        if array.dtype.kind in "iufb":
            yield name or "column 1", array
        elif array.dtype.kind == "c":
            yield f"{name}/re".lstrip("/"), array.real
            yield f"{name}/im".lstrip("/"), array.imag


READER = Reader("numpy", _recognises, _open_numpy)
