"""Which files this program itself has given their names: only these may it remove again.

A file is known by its place on the disk, its size and the time of its last write, which another
program's file under the same name, or another one's writing into this one, does not share.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

Stamp = tuple[int, int, int, int]
_OWN: dict[str, Stamp] = {}
"""Absolute path -> the file as it was when it was given that name."""


def read_stamp(path: Path) -> Stamp | None:
    """What a file is known by.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    tuple or None
        Device, inode, size in bytes and time of the last write in ns; None where there is none.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.store.own_outputs import read_stamp
    >>> read_stamp(Path("there/is/none"))
    """
    with contextlib.suppress(OSError):
        found = path.stat(follow_symlinks=False)
        return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns
    return None


def note_own(path: Path, stamp: Stamp | None) -> None:
    """Note that this program, or a process that works for it, has written a file.

    Parameters
    ----------
    path
        Its name.
    stamp
        As it was written; None: it was not.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.store.own_outputs import find_own, note_own
    >>> note_own(Path("wave.h5"), (1, 2, 3, 4))
    >>> find_own(Path("./wave.h5"))
    (1, 2, 3, 4)
    >>> note_own(Path("wave.h5"), None)
    """
    key = os.path.abspath(path)
    if stamp is None:
        _OWN.pop(key, None)
    else:
        _OWN[key] = stamp


def find_own(path: Path) -> Stamp | None:
    """A file as this program has written it.

    Parameters
    ----------
    path
        Its name.

    Returns
    -------
    tuple or None
        None where it has not written one of that name.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.store.own_outputs import find_own
    >>> find_own(Path("somebody's.h5"))
    """
    return _OWN.get(os.path.abspath(path))


def remove_own(path: Path) -> None:
    """Remove a file that this program has written, and that nobody has replaced or changed since.

    Parameters
    ----------
    path
        Its name; another's file stays.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.store.own_outputs import remove_own
    >>> with TemporaryDirectory() as folder:
    ...     foreign = Path(folder) / "foreign.csv"
    ...     foreign.touch()
    ...     remove_own(foreign)
    ...     foreign.exists()
    True
    """
    own = find_own(path)
    if own is not None and read_stamp(path) == own:
        with contextlib.suppress(OSError):
            path.unlink()
