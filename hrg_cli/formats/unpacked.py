"""Bytes of a log as it was before gzip: instruments and archives keep text logs as .csv.gz."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from ..errors import HrgError

MAGIC = b"\x1f\x8b"
CHUNK = 1 << 20


def is_packed(path: Path) -> bool:
    """Whether a file begins as gzip does."""
    with open(path, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


@contextmanager
def open_unpacked(path: Path) -> Iterator[BinaryIO]:
    """A file for reading, without its compression. HrgError: it is compressed and damaged."""
    if not is_packed(path):
        with open(path, "rb") as plain:
            yield plain
        return
    try:
        with gzip.open(path) as packed:
            yield cast(BinaryIO, packed)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise HrgError(
            f"{path}: is damaged or cut short ({error}), a whole gzip file was expected; copy it"
            " again"
        ) from error


def read_ends(path: Path, head: int, tail: int) -> tuple[bytes, bytes, int]:
    """The first and last bytes of a log and how many it has, all without its compression."""
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
