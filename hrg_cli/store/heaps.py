"""Look through an HDF5 file's global heaps before the library does: a zeroed one makes it loop
without end.

Texts of variable length (nearly every attribute) live in collections that begin with "GCOL" (HDF5
file format 3.0, III.E). The library steps from object to object by their sizes; free space of size
zero, as after a lost disk sector, never lets it advance.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ..errors import HrgError

SIGNATURE = b"GCOL\x01\x00\x00\x00"
SCANNED_BYTES = 8 << 20
"""Of a longer file so much of its head and of its tail is looked through; texts are written
there."""
PIECE_BYTES = 1 << 18
"""So much is read at a time, into memory that the processor's cache holds."""
STEP = 16
"""Bytes of the heading of a collection, and of each object in it."""


def check_heaps(path: Path) -> None:
    """Refuse a file of which a global heap, in its head or tail, would stop the HDF5 library for
    ever.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    HrgError
        It would.
    OSError
        The file cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> from hrg_cli import HrgError
    >>> from hrg_cli.store.heaps import SIGNATURE, check_heaps
    >>> with tempfile.NamedTemporaryFile() as file:
    ...     _ = file.write(SIGNATURE + (64).to_bytes(8, "little") + bytes(64))
    ...     file.flush()
    ...     try:
    ...         check_heaps(file.name)
    ...     except HrgError as error:
    ...         "the texts at byte 0 are overwritten" in str(error)
    True
    """
    # Read, not mapped: of a bad sector, or where the file is cut meanwhile, reading raises an error
    # where a map ends the process (SIGBUS).
    with open(path, "rb", buffering=0) as file:
        size = os.fstat(file.fileno()).st_size
        for part in _read_pieces(file.fileno(), size):
            at = part.content.find(SIGNATURE)
            while at >= 0:
                if not _ends(part, part.start + at, size):
                    raise HrgError(
                        f"{path}: is damaged (the texts at byte {part.start + at} are overwritten);"
                        " copy or record it again"
                    )
                at = part.content.find(SIGNATURE, at + len(SIGNATURE))


@dataclass(frozen=True)
class _Part:
    """A stretch of a file that was read; what lies beyond it is read when it is asked for."""

    handle: int
    start: int
    content: bytes

    def read(self, place: int, length: int) -> bytes:
        """Bytes of the file from `place`."""
        first = place - self.start
        if first + length <= len(self.content):
            return self.content[first : first + length]
        return os.pread(self.handle, length, place)


def _read_pieces(handle: int, size: int) -> Iterator[_Part]:
    """The file's head and tail, piece by piece; a signature across two of them is in the first."""
    for start in [0] if size <= SCANNED_BYTES else [0, size - SCANNED_BYTES]:
        stop = min(start + SCANNED_BYTES, size)
        for first in range(start, stop, PIECE_BYTES):
            length = min(PIECE_BYTES + len(SIGNATURE) - 1, stop - first)
            yield _Part(handle, first, os.pread(handle, length, first))


def _ends(part: _Part, at: int, size: int) -> bool:
    """Whether stepping through the collection at byte `at` comes to its end."""
    end = min(at + int.from_bytes(part.read(at + 8, 8), "little"), size)
    place = at + STEP
    while place + STEP <= end:
        heading = part.read(place, STEP)
        index = int.from_bytes(heading[:2], "little")
        length = int.from_bytes(heading[8:], "little")
        # Objects stand on multiples of 8 behind their heading; index 0 is the free space, whose
        # length counts its own heading (HDF5 file format, III.E).
        step = STEP + (length + 7) // 8 * 8 if index else length
        if step <= 0:
            return False
        place += step
    return True
