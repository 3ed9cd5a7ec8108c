"""Outputs whole or not at all: a temporary name beside the output, given its name when whole, removed otherwise."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from ..errors import DiskFullError, HrgError
from .layout import first_line


def check_output(path: Path | str, force: bool = False) -> Path:
    """`path` as a place to write to, or the sentence why it is none."""
    path = Path(path)
    folder = path.parent
    if not folder.is_dir():
        raise HrgError(f"{path}: the folder {folder} does not exist; make it first")
    if path.is_dir():
        raise HrgError(f"{path}: is a folder; name a file in it")
    if path.exists() and not force:
        raise HrgError(f"{path}: exists already; give --force to replace it or another --output")
    if not os.access(folder, os.W_OK) or (os.geteuid() == 0 and _read_only(folder)):
        raise HrgError(f"{path}: no right to write in {folder}; choose another --output")
    return path


def _read_only(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        return bool(os.statvfs(folder).f_flag & os.ST_RDONLY)
    return False


@contextlib.contextmanager
def atomic_path(path: Path | str, force: bool = False) -> Iterator[Path]:
    """A temporary name beside `path`, renamed to it when the block ends well and removed otherwise."""
    path = check_output(path, force)
    _remove_stale(path)
    temporary = path.parent / f".{path.name[:80]}.hrg-{os.getpid()}-{time.monotonic_ns()}.tmp"
    try:
        yield temporary
        if force:
            os.replace(temporary, path)
        else:
            _rename_to_new(temporary, path)
    except OSError as error:
        raise write_error(error, path) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """While a failed file is let go: h5py prints a traceback for each object it cannot flush, which says nothing new."""
    hooks = sys.unraisablehook, sys.excepthook
    sys.unraisablehook, sys.excepthook = (lambda _: None), (lambda *_: None)
    try:
        yield
    finally:
        sys.unraisablehook, sys.excepthook = hooks


def _rename_to_new(temporary: Path, path: Path) -> None:
    """Rename unless another writer has made `path` meanwhile."""
    try:
        os.link(temporary, path)
    except FileExistsError as error:
        raise HrgError(f"{path}: was written by another program meanwhile; this result was dropped") from error
    except OSError:
        os.replace(temporary, path)


def _remove_stale(path: Path) -> None:
    """Remove temporary files of this output whose writer was killed."""
    for left in path.parent.glob(f".{_glob_escape(path.name[:80])}.hrg-*.tmp"):
        match = re.search(r"\.hrg-(\d+)-\d+\.tmp$", left.name)
        if match and not Path(f"/proc/{match[1]}").exists() and Path("/proc/self").exists():
            with contextlib.suppress(OSError):
                left.unlink()


def _glob_escape(name: str) -> str:
    return re.sub(r"([*?\[])", r"[\1]", name)


def write_error(error: OSError, path: Path) -> HrgError:
    if error.errno == errno.ENOSPC or "No space left" in str(error):
        return DiskFullError(f"{path}: the disk is full; free space or choose another --output")
    if error.errno in (errno.EFBIG, errno.EDQUOT) or "File too large" in str(error):
        return DiskFullError(f"{path}: may not grow so large (a quota or a limit of this process); choose another --output")
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return HrgError(f"{path}: no right to write it; choose another --output")
    if error.errno == errno.ENAMETOOLONG:
        return HrgError(f"{str(path)[:80]}…: the name is too long; choose a shorter --output")
    return HrgError(f"{path}: cannot be written ({first_line(error)}); choose another --output")
