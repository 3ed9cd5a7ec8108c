"""Memory that was freed stays with the process, so that a stream's next block finds it.

glibc gives large freed blocks back to the system, which clears every page anew when it is asked for
the next one: of a long demodulation a sixteenth of the processor's time.
"""

from __future__ import annotations

import contextlib
import ctypes

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Names of glibc's parameters (malloc.h)."""
KEPT_BYTES = 128 << 20
"""Freed memory at the heap's end that stays, above any command's blocks together."""
MAPPED_BYTES = 32 << 20
"""The size from which a block is a map of its own, the largest that glibc takes."""


def keep_freed() -> None:
    """Keep freed memory for what is allocated next; where the system's library is not glibc nothing
    changes.

    Examples
    --------
    >>> from hrg_cli.allocation import keep_freed
    >>> keep_freed()
    """
    # not on every system can the program itself be loaded, or its library be told
    with contextlib.suppress(OSError, AttributeError, TypeError):
        tell = ctypes.CDLL(None).mallopt
        tell(MMAP_THRESHOLD, MAPPED_BYTES)
        tell(TRIM_THRESHOLD, KEPT_BYTES)
