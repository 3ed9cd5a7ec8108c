"""Look through an HDF5 file's global heaps before the library does: a zeroed one makes it loop
without end.

Texts of variable length (nearly every attribute) live in collections that begin with "GCOL" (HDF5
file format 3.0, III.E). The library steps from object to object by their sizes; free space of size
zero, as after a lost disk sector, never lets it advance.
"""

from __future__ import annotations

import mmap
from pathlib import Path

from ..errors import HrgError

SIGNATURE = b"GCOL\x01\x00\x00\x00"
SCANNED_BYTES = 8 << 20
"""Of a longer file so much of its head and of its tail is looked through; texts are written
there."""


def check_heaps(path: Path) -> None:
    """HrgError when a global heap in the head or the tail of `path` would stop the HDF5 library for
    ever."""
    size = path.stat().st_size
    with open(path, "rb") as file:
        if not size:
            return
        with mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ) as data:
            tail = max(0, size - SCANNED_BYTES)
            tail -= tail % mmap.ALLOCATIONGRANULARITY
            for start, stop in ((0, min(size, SCANNED_BYTES)), (tail, size)):
                at = data.find(SIGNATURE, start, stop)
                while at >= 0:
                    if not _ends(data, at, size):
                        raise HrgError(
                            f"{path}: is damaged (the texts at byte {at} are overwritten); copy or"
                            " record it again"
                        )
                    at = data.find(SIGNATURE, at + len(SIGNATURE), stop)
                if stop == size:
                    break


def _ends(data: mmap.mmap, at: int, size: int) -> bool:
    """Whether stepping through the collection at byte `at` comes to its end."""
    end = min(at + int.from_bytes(data[at + 8 : at + 16], "little"), size)
    place = at + 16
    while place + 16 <= end:
        index = int.from_bytes(data[place : place + 2], "little")
        length = int.from_bytes(data[place + 8 : place + 16], "little")
        # Objects stand on multiples of 8 behind their 16 bytes of heading; index 0 is the free
        # space, whose length counts its own heading (HDF5 file format, III.E).
        step = 16 + (length + 7) // 8 * 8 if index else length
        if step <= 0:
            return False
        place += step
    return True
