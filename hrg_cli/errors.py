"""Errors a person can act on: one sentence naming the file, what was found, what was expected and
what to do."""

import errno
from collections.abc import Iterable

NO_MEMORY = "not enough memory; use fewer or shorter inputs"
EACH_RUN_ONCE = "name each run once, or its errors come out too small"
"""What to do about a run that is there twice, be it told by its file or by its rows."""
ROOM = 60
"""Characters that a list of names has in a message of two lines."""
UNMAPPED = "failed to map segment"
"""What the system says of a library that memory has no room for; Python keeps no number of it."""


def is_no_memory(error: BaseException) -> bool:
    """Whether an error says that memory ran out.

    Parameters
    ----------
    error
        Python's own, the system's, that of a compiler that could not even say so, or that of a
        library that could not be loaded.

    Returns
    -------
    bool
        Fewer or shorter inputs would help.

    Examples
    --------
    >>> from hrg_cli.errors import is_no_memory
    >>> is_no_memory(MemoryError()), is_no_memory(OSError(2, "no such file"))
    (True, False)
    """
    if isinstance(error, (OSError, ImportError)):
        said = (str(error), str(error.__cause__ or error.__context__))
        return getattr(error, "errno", None) == errno.ENOMEM or any(UNMAPPED in s for s in said)
    silent = isinstance(error, SystemError) and "exception" in str(error)
    return silent or isinstance(error, MemoryError)


def name_some(names: Iterable[object], room: int = ROOM) -> str:
    """Names in a sentence: as many as have room, at least one, and how many there are.

    Parameters
    ----------
    names
        Of files, runs or keys.
    room
        Characters that they may take.

    Returns
    -------
    str
        Joined by commas.

    Examples
    --------
    >>> from hrg_cli.errors import name_some
    >>> name_some(["run-1", "run-2", "run-3"], room=12)
    'run-1, run-2 … (3 in all)'
    """
    every = [str(name) for name in names]
    shown, length = every[:1], len("".join(every[:1]))
    for name in every[1:]:
        length += len(name) + 2
        if length > room:
            return f"{', '.join(shown)} … ({len(every)} in all)"
        shown.append(name)
    return ", ".join(shown)


class HrgError(Exception):
    """The input or the run failed; the message is the one line a user sees (exit status 1)."""


class NotHrgError(HrgError):
    """A file is whole as far as was looked, but another program's: a laboratory's log, HDF5 or not
    (exit status 1)."""


class UsageError(HrgError):
    """The command line asks for something that does not exist (exit status 2)."""


class InterruptedRunError(HrgError):
    """The work was interrupted; the message says how far it came and how to go on (exit status
    130)."""


class DiskFullError(HrgError):
    """The output's disk is full; HDF5 cannot close its file cleanly afterwards (exit status 1)."""
