"""Bytes of a log as it was before gzip: instruments and archives keep text logs as .csv.gz."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from ..errors import HrgError
from ..store.handles import explain_reading

MAGIC = b"\x1f\x8b"
CHUNK = 1 << 20
LARGEST_BYTES, LARGEST_RATIO = 256 << 20, 200
"""A log that unpacks to more than the first is read up to so many times what it stores: rows whose
time goes on shrink to a tenth, what goes on for ever to a thousandth."""


class _Packed(gzip.GzipFile):
    """A gzip file that is read up to a bound."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "rb")
        self._path = path
        self._room = max(LARGEST_BYTES, LARGEST_RATIO * path.stat().st_size)

    def read(self, size: int | None = -1) -> bytes:
        """Bytes without compression. HrgError: more than the bound."""
        content = super().read(size)
        if self.tell() > self._room:
            raise HrgError(
                f"{self._path}: unpacks to more than {self._room >> 20} MB, {LARGEST_RATIO} times"
                " its size; if it is a log, unpack it first"
            )
        return content


def is_packed(path: Path) -> bool:
    """Whether a file begins as gzip does.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    bool
        Told by its first two bytes, never by its name.

    Raises
    ------
    HrgError
        It cannot be read.

    Examples
    --------
    >>> import gzip, tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.formats.unpacked import is_packed
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "bench.csv"
    ...     _ = path.write_bytes(gzip.compress(b"1,2"))
    ...     is_packed(path)
    True
    """
    with explain_reading(path), open(path, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


@contextmanager
def open_unpacked(path: Path) -> Iterator[BinaryIO]:
    """A file for reading, without its compression.

    Parameters
    ----------
    path
        Packed by gzip or not.

    Returns
    -------
    context manager
        Of the bytes; a log that unpacks to far more than any log does is not read on.

    Raises
    ------
    HrgError
        It is packed and damaged, cut short, or unpacks without end.

    Examples
    --------
    >>> import gzip, tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.formats.unpacked import open_unpacked
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "bench.csv.gz"
    ...     _ = path.write_bytes(gzip.compress(b"1,2"))
    ...     with open_unpacked(path) as file:
    ...         file.read()
    b'1,2'
    """
    if not is_packed(path):
        with open(path, "rb") as plain:
            yield plain
        return
    try:
        with _Packed(path) as packed:
            yield cast(BinaryIO, packed)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise HrgError(
            f"{path}: is damaged or cut short ({error}), a whole gzip file was expected; copy it"
            " again"
        ) from error


def read_ends(path: Path, head: int, tail: int) -> tuple[bytes, bytes, int]:
    """The first and the last bytes of a log and how many it has, all without its compression.

    Parameters
    ----------
    path
        Packed by gzip or not.
    head, tail
        How many bytes [B] are wanted of either end.

    Returns
    -------
    tuple
        The first bytes, the last ones, and the log's size [B].

    Raises
    ------
    HrgError
        It is packed and damaged.

    Examples
    --------
    >>> import gzip, tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.formats.unpacked import read_ends
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "bench.csv.gz"
    ...     _ = path.write_bytes(gzip.compress(b"0123456789" * 100))
    ...     read_ends(path, 4, 2)
    (b'0123', b'89', 1000)
    """
    with open_unpacked(path) as file:
        first = file.read(head)
        if not is_packed(path):
            size = path.stat().st_size
            file.seek(max(0, size - tail))
            return first, file.read(tail), size
        last, size = first[-tail:], len(first)
        while chunk := file.read(CHUNK):
            last, size = (last + chunk)[-tail:], size + len(chunk)
        return first, last, size
