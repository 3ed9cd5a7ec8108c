"""Open HDF5 files, a bounded number at a time: a file that was closed to make room is opened again
when its rows are asked for."""

from __future__ import annotations

import contextlib
import errno
import os
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path

import h5py

from ..errors import NO_MEMORY, HrgError, NotHrgError, is_no_memory
from .heaps import check_heaps
from .layout import take_first_line

MOST_OPEN = 64
"""Files held open at once, far below any system's limit, so that a thousand runs can be read side
by side."""
CACHE_BYTES = 1 << 20
"""One chunk; HDF5 2 would keep 8 MB a dataset."""
UNALLOCATED = "memory allocation failed"
"""HDF5's words where it got no memory, for which h5py raises an OSError without a number."""
SIGNATURE = b"\x89HDF\r\n\x1a\n"
USER_BLOCK = 512
"""Bytes of the smallest user block; larger ones are twice the one before."""
_in_use: OrderedDict[Handle, None] = OrderedDict()
_looked_through: set[tuple[int, ...]] = set()
"""Files whose heaps are sound: a command opens its input several times, and looking is most of
each."""


class Handle:
    """A file that is open when it is used."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: h5py.File | None = None
        self._stamp: tuple[int, int] | None = None

    def open_file(self) -> h5py.File:
        """The open file. HrgError: it cannot be opened, or was changed since it was opened
        first."""
        if self._file is None:
            self._file = _open(self.path)
            stat = self.path.stat()
            if self._stamp not in (None, (stat.st_size, stat.st_mtime_ns)):
                self.close()
                raise HrgError(
                    f"{self.path}: changed while it was read; run the command again when it is"
                    " whole"
                )
            self._stamp = stat.st_size, stat.st_mtime_ns
            while len(_in_use) >= MOST_OPEN:
                next(iter(_in_use)).close()
        _in_use[self] = None
        _in_use.move_to_end(self)
        return self._file

    def close(self) -> None:
        """Let the file go."""
        _in_use.pop(self, None)
        if self._file is not None:
            with contextlib.suppress(Exception):
                self._file.close()
            self._file = None


def has_signature(path: Path) -> bool:
    """Whether HDF5's signature stands at the file's start or behind a user block (HDF5 file format
    3.0, II.A).

    Parameters
    ----------
    path
        Any file.

    Returns
    -------
    bool
        True where it does.

    Raises
    ------
    OSError
        The file cannot be read, of which HDF5 itself says that it is none.

    Examples
    --------
    >>> import tempfile
    >>> from hrg_cli.store.handles import SIGNATURE, has_signature
    >>> with tempfile.NamedTemporaryFile() as file:
    ...     _ = file.write(bytes(512) + SIGNATURE)
    ...     file.flush()
    ...     has_signature(file.name)
    True
    """
    with open(path, "rb", buffering=0) as file:
        size = os.fstat(file.fileno()).st_size
        at = 0
        while at < size:
            if os.pread(file.fileno(), len(SIGNATURE), at) == SIGNATURE:
                return True
            at = max(USER_BLOCK, 2 * at)
    return False


def _open(path: Path) -> h5py.File:
    """The file for reading; every way that opening fails is a sentence."""
    try:
        need_readable(path)
        if path.stat().st_size == 0:
            raise HrgError(f"{path}: is empty; an hrg file (HDF5) was expected")
        _check_heaps_once(path)
    except (OSError, ValueError) as error:
        raise explain_read_error(error, path) from error
    try:
        return h5py.File(path, "r", rdcc_nbytes=CACHE_BYTES)
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise _open_error(error, path) from error


def _check_heaps_once(path: Path) -> None:
    """`check_heaps`, of a file that has not changed since it passed left out."""
    stat = path.stat()
    stamp = (stat.st_dev, stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns)
    if stamp not in _looked_through:
        check_heaps(path)
        _looked_through.add(stamp)


def need_readable(path: Path) -> None:
    """See to it that a file can be read again and again.

    Parameters
    ----------
    path
        Its name.

    Raises
    ------
    HrgError
        There is no file of this name, or a pipe or device.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli import HrgError
    >>> from hrg_cli.store import need_readable
    >>> try:
    ...     need_readable(Path("nowhere.h5"))
    ... except HrgError as error:
    ...     print(error)
    nowhere.h5: no such file; name a file that `hrg` or your laboratory wrote
    """
    need_possible(path)
    if not path.exists():
        raise HrgError(f"{path}: no such file; name a file that `hrg` or your laboratory wrote")
    if path.is_dir():
        raise HrgError(f"{path}: is a folder; name a file in it")
    if not path.is_file():
        raise HrgError(f"{path}: is a device, pipe or socket; name a file")
    if not os.access(path, os.R_OK):
        raise HrgError(f"{path}: no right to read it; ask for read access")


def need_possible(path: Path) -> None:
    """See to it that a file can have this name.

    Parameters
    ----------
    path
        The name.

    Raises
    ------
    HrgError
        None can.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.store import need_possible
    >>> need_possible(Path("not yet there.h5"))
    """
    try:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError, PermissionError):
            path.lstat()
    except (OSError, ValueError) as error:
        raise explain_read_error(error, path) from error


def _open_error(error: Exception, path: Path) -> HrgError:
    """The sentence for a file that HDF5 does not open."""
    if isinstance(error, BlockingIOError):
        return HrgError(f"{path}: is being written by another program; wait until it is closed")
    if "truncated" in str(error):
        return HrgError(
            f"{path}: is truncated ({path.stat().st_size} bytes are there); copy or record it again"
        )
    if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
        return explain_read_error(error, path)
    try:
        other = not has_signature(path)
    except OSError as unread:
        return explain_read_error(unread, path)
    if other:
        return NotHrgError(
            f"{path}: is not an HDF5 file; for a log in another format run `hrg import"
            f" {path.name}` first"
        )
    return HrgError(
        f"{path}: cannot be opened as HDF5 ({take_first_line(error)}); copy or record it again"
    )


def explain_read_error(error: Exception, path: Path, what: str = "") -> HrgError:
    """The sentence for a failure while an input was read: the input is to blame, or this machine;
    never the output.

    Parameters
    ----------
    error
        What the system or the HDF5 library said.
    path
        The input.
    what
        Its part that was read, such as a dataset's path.

    Returns
    -------
    HrgError
        To be raised.

    Examples
    --------
    >>> import errno
    >>> from pathlib import Path
    >>> from hrg_cli.store.handles import explain_read_error
    >>> print(explain_read_error(OSError(errno.EACCES, "Permission denied"), Path("in.h5")))
    in.h5: no right to read it; ask for read access
    """
    number = getattr(error, "errno", None)
    if number in (errno.EMFILE, errno.ENFILE) or "Too many open files" in str(error):
        return HrgError(
            f"{path}: cannot be opened, too many files are open here; raise the limit (ulimit -n)"
            " or give fewer --jobs"
        )
    if number == errno.ENOENT:
        return HrgError(f"{path}: no such file; name a file that is there")
    if is_no_memory(error):
        return HrgError(f"{path}: {NO_MEMORY}")
    if UNALLOCATED in str(error):  # too little is free, or a damaged chunk claims too much
        return HrgError(
            f"{path}: {f'dataset {what} ' if what else ''}needs more memory than is free"
            f" ({take_first_line(error)}); free some, or copy it again if the file is small"
        )
    if number == errno.ENAMETOOLONG:
        return HrgError(
            f"{str(path)[:80]}…: the name is too long for a file; name a file that is there"
        )
    if number in (errno.EACCES, errno.EPERM):
        return HrgError(f"{path}: no right to read it; ask for read access")
    return HrgError(
        f"{path}: {f'dataset {what} ' if what else ''}is damaged ({take_first_line(error)});"
        " copy or record it again"
    )


@contextlib.contextmanager
def explain_reading(path: Path, what: str = "") -> Iterator[None]:
    """While an input is read: every way h5py fails becomes a sentence that names the input.

    Parameters
    ----------
    path
        The input.
    what
        Its part that is read.

    Returns
    -------
    context manager
        Around the reading.

    Raises
    ------
    HrgError
        The reading failed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli import HrgError
    >>> from hrg_cli.store.handles import explain_reading
    >>> try:
    ...     with explain_reading(Path("in.h5"), "/wave/time_s"):
    ...         raise OSError("filter returned failure during read")
    ... except HrgError as error:
    ...     str(error).split(";")[0]
    'in.h5: dataset /wave/time_s is damaged (filter returned failure during read)'
    """
    try:
        yield
    except HrgError:
        raise
    except (OSError, RuntimeError, KeyError, UnicodeDecodeError) as error:
        raise explain_read_error(error, path, what) from error
