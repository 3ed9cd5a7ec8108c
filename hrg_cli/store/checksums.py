"""What a file held when it was written: SHA-256 of every dataset and of every group's attributes,
kept in the root attribute `checksums`.

Of a dataset its type, its shape and the digest of its values in C order are kept; what does not
match was changed, by whom it cannot tell.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Iterator
from typing import Any

import h5py
import numpy as np

NAME = "checksums"
ROWS_BYTES = 8 << 20
"""So much of a dataset is read at a time."""
CLAIMED_BYTES, CLAIMED_RATIO = 64 << 20, 2000
"""A dataset larger than the first is read only where it claims less than so many times the bytes it
stores."""
OF_NETCDF = (
    "CLASS",
    "NAME",
    "DIMENSION_LIST",
    "REFERENCE_LIST",
    "_Netcdf4Dimid",
    "_Netcdf4Coordinates",
    "_NCProperties",
)
"""Attributes that netCDF keeps for itself: places in the file, not content."""


class Running:
    """The digest of a dataset that is written block by block."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, values: Any) -> None:
        """Take the next rows."""
        self._hash.update(_bytes(np.asarray(values)))

    def describe(self, dataset: h5py.Dataset) -> str:
        """Type, shape and digest, now that the dataset has its whole shape."""
        return f"{_form(dataset)} {self._hash.hexdigest()}"


def _form(dataset: h5py.Dataset) -> str:
    """Type and shape of a dataset, as one word."""
    kind = "text" if dataset.dtype.kind in "OSU" else dataset.dtype.str
    return f"{kind}{'x'.join(str(int(n)) for n in dataset.shape)}"


def _bytes(values: np.ndarray) -> Any:
    if values.dtype.kind not in "OSU":
        return np.ascontiguousarray(values).data.cast("B") if values.size else b""
    # A zero between texts: "ab", "c" and "a", "bc" are not alike.
    return b"".join(_text(v).encode("utf-8", "replace") + b"\0" for v in values.ravel())


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def digest_dataset(dataset: h5py.Dataset) -> str:
    """Type, shape and digest of a dataset on disk, read a few megabytes at a time.

    Parameters
    ----------
    dataset
        Of an open file.

    Returns
    -------
    str
        One word for type and shape, and the SHA-256.

    Examples
    --------
    >>> import h5py
    >>> from hrg_cli.store.checksums import digest_dataset
    >>> with h5py.File("x", "w", driver="core", backing_store=False) as file:
    ...     digest_dataset(file.create_dataset("a", data=[1.0, 2.0])).split()[0]
    '<f82'
    """
    running = Running()
    if dataset.ndim == 0 or not dataset.size:
        running.add(dataset[()])
        return running.describe(dataset)
    rows = max(1, ROWS_BYTES // max(1, dataset.dtype.itemsize * int(np.prod(dataset.shape[1:]))))
    for start in range(0, dataset.shape[0], rows):
        running.add(dataset[start : start + rows])
    return running.describe(dataset)


def digest_attributes(holder: h5py.Group | h5py.Dataset) -> str:
    """The digest of all attributes of a group or dataset but netCDF's own and the checksums
    themselves.

    Parameters
    ----------
    holder
        A group or dataset of an open file.

    Returns
    -------
    str
        SHA-256, whatever the attributes' order.

    Examples
    --------
    >>> import h5py
    >>> from hrg_cli.store.checksums import digest_attributes
    >>> with h5py.File("x", "w", driver="core", backing_store=False) as file:
    ...     before = digest_attributes(file)
    ...     file.attrs["gyro_id"] = "SN-1"
    ...     before == digest_attributes(file)
    False
    """
    hashed = hashlib.sha256()
    for name in sorted(holder.attrs):
        if name in OF_NETCDF or (name == NAME and holder.name == "/"):
            continue
        value = np.asarray(holder.attrs[name])
        hashed.update(
            name.encode()
            + b"\0"
            # Of text h5py gives back another type than was put in.
            + value.dtype.kind.encode().replace(b"U", b"O").replace(b"S", b"O")
        )
        hashed.update(bytes(_bytes(value)) + b"\0")
    return hashed.hexdigest()


def list_contents(file: h5py.File) -> Iterator[tuple[str, h5py.Group | h5py.Dataset]]:
    """Every group and dataset of a file by its path.

    Dimensions without values (netCDF's) are left out, links to other files are not followed.

    Parameters
    ----------
    file
        Open for reading.

    Returns
    -------
    iterator of tuple
        Path and object, groups before what is in them.

    Examples
    --------
    >>> import h5py
    >>> from hrg_cli.store.checksums import list_contents
    >>> with h5py.File("x", "w", driver="core", backing_store=False) as file:
    ...     _ = file.create_dataset("wave/time_s", data=[1.0])
    ...     [path for path, _ in list_contents(file)]
    ['/', '/wave', '/wave/time_s']
    """

    def below(group: h5py.Group) -> Iterator[tuple[str, h5py.Group | h5py.Dataset]]:
        yield group.name, group
        for name in sorted(group):
            # A soft or external link may lead in a circle, or out of the file.
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                continue
            item = group[name]
            if isinstance(item, h5py.Group):
                yield from below(item)
            elif isinstance(item, h5py.Dataset) and not _only_dimension(item):
                yield item.name, item

    yield from below(file)


def _links(group: h5py.Group) -> Iterator[str]:
    """The places of all links to elsewhere; hrg writes none."""
    for name in sorted(group):
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            yield f"{group.name.rstrip('/')}/{name}"
        elif isinstance(group[name], h5py.Group):
            yield from _links(group[name])


def _only_dimension(dataset: h5py.Dataset) -> bool:
    """Whether a dataset is a length and nothing else: one that stores values is content, whatever
    its attributes say."""
    return (
        "NAME" in dataset.attrs
        and _text(dataset.attrs["NAME"]).startswith(
            "This is a netCDF dimension but not a netCDF variable"
        )
        and not dataset.id.get_storage_size()
    )


def seal(file: h5py.File, running: dict[str, Running]) -> None:
    """Keep the digests of everything in a file, in its root attribute `checksums`.

    Parameters
    ----------
    file
        Open for writing, all else written.
    running
        Digests by path of datasets that were hashed as they were written.

    Examples
    --------
    >>> import h5py
    >>> from hrg_cli.store.checksums import list_changes, seal
    >>> with h5py.File("x", "w", driver="core", backing_store=False) as file:
    ...     file["a"] = [1.0, 2.0]
    ...     seal(file, {})
    ...     file["a"][0] = 3.0
    ...     list_changes(file)
    ['the values of /a were changed']
    """
    kept = {}
    for path, item in list_contents(file):
        if isinstance(item, h5py.Dataset):
            kept[path] = running[path].describe(item) if path in running else digest_dataset(item)
        kept[f"{path}@"] = digest_attributes(item)
    file.attrs[NAME] = json.dumps(kept, sort_keys=True)


def read_kept(file: h5py.File) -> dict[str, str] | None:
    """The digests a file keeps.

    Parameters
    ----------
    file
        Open for reading.

    Returns
    -------
    dict or None
        Place -> digest; None where what it keeps are none.

    Examples
    --------
    >>> import h5py
    >>> from hrg_cli.store.checksums import read_kept, seal
    >>> with h5py.File("x", "w", driver="core", backing_store=False) as file:
    ...     seal(file, {})
    ...     list(read_kept(file))
    ['/@']
    """
    with contextlib.suppress(ValueError, KeyError, RecursionError):
        found = json.loads(_text(file.attrs[NAME]))
        if isinstance(found, dict):
            return {str(place): str(digest) for place, digest in found.items()}
    return None


def list_changes(file: h5py.File) -> list[str] | None:
    """What differs from what was written.

    Parameters
    ----------
    file
        Open for reading.

    Returns
    -------
    list of str or None
        In words, empty where nothing does; None where the file keeps no checksums.

    Examples
    --------
    >>> import h5py
    >>> from hrg_cli.store.checksums import list_changes, seal
    >>> with h5py.File("x", "w", driver="core", backing_store=False) as file:
    ...     before = list_changes(file)
    ...     seal(file, {})
    ...     before, list_changes(file)
    (None, [])
    """
    if NAME not in file.attrs:
        return None
    kept = read_kept(file)
    if kept is None:
        return ["the checksums were changed"]
    left = dict(kept)
    said = []
    for path, item in list_contents(file):
        if isinstance(item, h5py.Dataset):
            said += _compared_values(left.pop(path, None), item, f"the values of {path}")
        said += _compared(
            left.pop(f"{path}@", None),
            lambda item=item: digest_attributes(item),
            f"the attributes of {path}",
        )
    gone = sorted({place.removesuffix("@") for place in left})
    said += [f"{place} was removed" for place in gone]
    return said + [f"{place} was added, a link" for place in _links(file)]


def list_unreadable(file: h5py.File) -> list[str]:
    """What cannot be read back: all that a file without checksums can be asked.

    Parameters
    ----------
    file
        Open for reading.

    Returns
    -------
    list of str
        In words, one a dataset.

    Examples
    --------
    >>> import h5py
    >>> from hrg_cli.store.checksums import list_unreadable
    >>> with h5py.File("x", "w", driver="core", backing_store=False) as file:
    ...     file["a"] = [1.0, 2.0]
    ...     list_unreadable(file)
    []
    """
    said = []
    for path, item in list_contents(file):
        if isinstance(item, h5py.Dataset):
            what = f"the values of {path}"
            if _is_hollow(item):
                said.append(f"{what} are not stored")
                continue
            try:
                digest_dataset(item)
            except (OSError, RuntimeError):
                said.append(f"{what} cannot be read (damaged)")
    return said


def _is_hollow(dataset: h5py.Dataset) -> bool:
    """Whether a dataset claims far more values than the file has room for."""
    claimed = dataset.size * dataset.dtype.itemsize
    stored: int = dataset.id.get_storage_size()
    return bool(claimed > CLAIMED_BYTES and claimed > CLAIMED_RATIO * stored)


def _compared_values(kept: str | None, dataset: h5py.Dataset, what: str) -> list[str]:
    """The same of a dataset, which is read only where its type and shape are those that were
    kept."""
    if kept is not None and kept.split(" ")[0] != _form(dataset):
        return [f"{what} were changed"]
    if _is_hollow(dataset):
        return [f"{what} are not stored"]
    return _compared(kept, lambda: digest_dataset(dataset), what)


def _compared(kept: str | None, digest: Any, what: str) -> list[str]:
    if kept is None:
        return [f"{what} were added"]
    try:
        return [] if digest() == kept else [f"{what} were changed"]
    except (OSError, RuntimeError):
        return [f"{what} cannot be read (damaged)"]
