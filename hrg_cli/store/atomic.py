"""Outputs whole or not at all: a temporary name beside the output, given its name when whole,
removed otherwise.

The temporary name bears host and process, so that several hosts may work in one folder: each
removes what its own killed processes left, and what no host has touched for a day.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import hashlib
import os
import platform
import re
import stat
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from ..errors import NO_MEMORY, DiskFullError, HrgError, UsageError, is_no_memory
from .layout import take_first_line
from .own_outputs import find_own, note_own, read_stamp, remove_own

LONGEST_NAME = 255
"""Bytes of a file's name, on every usual file system."""
SHOWN_BYTES = 60
"""So much of the output's name stands in the temporary one."""
ABANDONED_S = 86_400
"""A temporary file that nobody has written to for so long is no longer somebody's."""


def check_output(path: Path | str, force: bool = False) -> Path:
    """A place to write to.

    Parameters
    ----------
    path
        The file to be written.
    force
        Whether one that is there may be replaced.

    Returns
    -------
    Path
        The same place.

    Raises
    ------
    HrgError
        It is none: a folder, in none or in one without the right to write, a file that is there, a
        name that no file can have.

    Examples
    --------
    >>> import tempfile
    >>> from hrg_cli.store import check_output
    >>> check_output(tempfile.mkdtemp() + "/out.h5").name
    'out.h5'
    """
    path = Path(path)
    _check_name(path)
    folder = path.parent
    if not folder.is_dir():
        raise HrgError(f"{path}: the folder {folder} does not exist; make it first")
    if path.is_dir():
        raise HrgError(f"{path}: is a folder; name a file in it")
    if os.path.lexists(path) and path.exists() and not path.is_file():
        raise HrgError(
            f"{path}: is a device, pipe or socket, and only a regular file may be replaced; choose"
            " another --output"
        )
    if os.path.lexists(path) and not force:
        raise HrgError(f"{path}: exists already; give --force to replace it or another --output")
    if not os.access(folder, os.W_OK) or (os.geteuid() == 0 and _read_only(folder)):
        raise HrgError(f"{path}: no right to write in {folder}; choose another --output")
    return path


def need_no_input(output: Path, inputs: Iterable[Path]) -> None:
    """See to it that an output replaces none of the inputs.

    Parameters
    ----------
    output
        The file to be written.
    inputs
        The files that are read.

    Raises
    ------
    HrgError
        It would.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.store import need_no_input
    >>> need_no_input(Path("out.h5"), [Path("in.h5")])
    """
    for path in inputs:
        if is_same_file(path, output):
            raise HrgError(f"{output}: is an input of this command too; choose another --output")


def is_same_file(one: Path, other: Path) -> bool:
    """Whether two names are of one file, there or yet to be made.

    Parameters
    ----------
    one, other
        The names; folders are no files.

    Returns
    -------
    bool
        True where they are.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.store import is_same_file
    >>> is_same_file(Path("out.h5"), Path("./folder/../out.h5"))
    True
    """
    try:
        return one.samefile(other) and not one.is_dir()
    except OSError:  # one of them is not there
        return os.path.realpath(one) == os.path.realpath(other)


def _check_name(path: Path) -> None:
    """Refuse a name that no file can have, or that is a word for standard output."""
    if str(path) == "-":
        raise UsageError(
            "-o -: results are files, none is written to standard output; name a file (--json"
            " prints the result's figures)"
        )
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise HrgError(
            f"{str(path)!r}: the name is not UTF-8, which other programs could not read; choose"
            " another"
        ) from error
    if "\0" in str(path):
        raise HrgError(f"{str(path)!r}: the name holds a zero byte; choose another --output")
    if (
        any(len(os.fsencode(part)) > LONGEST_NAME for part in path.parts)
        or len(os.fsencode(path)) > 4000
    ):
        raise HrgError(f"{str(path)[:80]}…: the name is too long; choose a shorter --output")


def _read_only(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        return bool(os.statvfs(folder).f_flag & os.ST_RDONLY)
    return False


@contextlib.contextmanager
def write_whole(path: Path | str, force: bool = False) -> Iterator[Path]:
    """A temporary name beside `path`, renamed to it when the block ends well and removed otherwise.

    Parameters
    ----------
    path
        The file to be written.
    force
        Replace one that is there.

    Returns
    -------
    context manager of Path
        The temporary name, in the same folder.

    Raises
    ------
    HrgError
        The file is there and `force` is not given, or the folder cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.store import write_whole
    >>> folder = Path(tempfile.mkdtemp())
    >>> with write_whole(folder / "table.csv") as temporary:
    ...     _ = temporary.write_text("a,b")
    >>> [path.name for path in folder.iterdir()]
    ['table.csv']
    """
    path = check_output(path, force)
    remove_stale(path.parent, shorten_name(path))
    temporary = (
        path.parent
        / f".{shorten_name(path)}.hrg-{name_host()}-{os.getpid()}-{time.monotonic_ns()}.tmp"
    )
    try:
        yield temporary
        if force:
            _keep_rights(path, temporary)
        stamp = read_stamp(temporary)
        if force:
            os.replace(temporary, path)
        else:
            _rename_to_new(temporary, path)
        note_own(path, stamp)
    except OSError as error:
        raise explain_write_error(error, path) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


@contextlib.contextmanager
def keep_whole_or_none(
    outputs: Sequence[Path], unless: tuple[type[BaseException], ...] = ()
) -> Iterator[None]:
    """Outputs that belong together: where the block fails, no file that it has written stays.

    What another program has written meanwhile is not touched.

    Parameters
    ----------
    outputs
        The files that the block writes, by `write_whole`.
    unless
        Failures after which they stay.

    Returns
    -------
    context manager
        Around the writing.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.store import keep_whole_or_none, write_whole
    >>> out = Path(tempfile.mkdtemp()) / "first.csv"
    >>> try:
    ...     with keep_whole_or_none([out]):
    ...         with write_whole(out) as temporary:
    ...             _ = temporary.write_text("a,b")
    ...         raise OSError("the second one failed")
    ... except OSError:
    ...     out.exists()
    False
    """
    before = {path: find_own(path) for path in outputs}
    try:
        yield
    except unless:
        raise
    except BaseException:
        for path, stamp in before.items():
            if find_own(path) != stamp:
                remove_own(path)
            remove_stale(path.parent, shorten_name(path))  # of processes that worked for the block
        raise


@contextlib.contextmanager
def collect_lost_writes() -> Iterator[list[BaseException]]:
    """Errors that h5py meets while it lets go of an object, which it can only print.

    While a failed file is let go they say nothing new, otherwise a write is lost.

    Returns
    -------
    context manager of list
        Those met so far.

    Examples
    --------
    >>> from hrg_cli.store.atomic import collect_lost_writes
    >>> with collect_lost_writes() as lost:
    ...     pass
    >>> lost
    []
    """
    hooks = sys.unraisablehook, sys.excepthook
    lost: list[BaseException] = []

    def keep(told: sys.UnraisableHookArgs) -> None:
        if isinstance(told.exc_value, RuntimeError):
            lost.append(told.exc_value)
        else:
            hooks[0](told)

    sys.unraisablehook, sys.excepthook = keep, (lambda *_: None)
    try:
        yield lost
    finally:
        sys.unraisablehook, sys.excepthook = hooks


def _keep_rights(path: Path, temporary: Path) -> None:
    """Let who may read and write the file that is replaced be who may do so afterwards."""
    with contextlib.suppress(OSError):
        old = path.lstat().st_mode
        if stat.S_ISREG(old):
            os.chmod(temporary, stat.S_IMODE(old) & 0o777)


def _rename_to_new(temporary: Path, path: Path) -> None:
    """Rename unless another writer has made `path` meanwhile, in one step that only one of several
    writers can take."""
    try:
        try:
            os.link(temporary, path)
        except FileExistsError:
            raise
        except OSError:  # a file system without links
            _rename_to_claimed(temporary, path)
    except FileExistsError as error:
        raise HrgError(
            f"{path}: was written by another program meanwhile; this result was dropped"
        ) from error


def _rename_to_claimed(temporary: Path, path: Path) -> None:
    """Rename to a name that an empty file of this program's own holds free of others'.
    FileExistsError: another has it."""
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
    try:
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            path.unlink()
        raise


def shorten_name(path: Path) -> str:
    """As much of an output's name as its temporary one bears.

    Parameters
    ----------
    path
        The output.

    Returns
    -------
    str
        60 bytes at most, whole characters.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.store.atomic import shorten_name
    >>> shorten_name(Path("lot/table.csv")), len(shorten_name(Path("n" * 100)))
    ('table.csv', 60)
    """
    return path.name.encode("utf-8", "ignore")[:SHOWN_BYTES].decode("utf-8", "ignore")


@functools.cache
def name_host() -> str:
    """The host, and the space of process numbers on it (of a container): within it a number names
    one process.

    Returns
    -------
    str
        Letters, digits and a dot.

    Examples
    --------
    >>> from hrg_cli.store.atomic import name_host
    >>> name_host().count(".")
    1
    """
    facts = [platform.node()]
    for read in (
        lambda: Path("/etc/machine-id").read_text(),
        lambda: os.readlink("/proc/self/ns/pid"),
    ):
        with contextlib.suppress(OSError):
            facts.append(read())
    name = re.sub(r"[^A-Za-z0-9]", "", platform.node())[:16] or "host"
    return f"{name}.{hashlib.sha256(' '.join(facts).encode()).hexdigest()[:8]}"


def remove_stale(folder: Path, name: str | None = None, below: bool = False) -> None:
    """Remove temporary files whose writer was killed: of this host, or not touched for a day.

    Parameters
    ----------
    folder
        Where they stand.
    name
        Of this output alone; None: of all.
    below
        In the folders below, too.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.store import remove_stale
    >>> remove_stale(Path(tempfile.mkdtemp()))
    """
    pattern = f".{'*' if name is None else _glob_escape(name)}.hrg-*.tmp"
    for left in folder.rglob(pattern) if below else folder.glob(pattern):
        if _is_abandoned(left):
            with contextlib.suppress(OSError):
                left.unlink()


def _is_abandoned(left: Path) -> bool:
    match = re.search(r"\.hrg-([A-Za-z0-9.]+)-(\d+)-\d+\.tmp$", left.name)
    if match is None:
        return False
    if match[1] == name_host() and Path("/proc/self").exists():
        return not _may_write(match[2])
    with contextlib.suppress(OSError):
        return time.time() - left.stat().st_mtime > ABANDONED_S
    return False


def _may_write(pid: str) -> bool:
    """Whether a process of this host is at work; one that was killed and that its parent has not
    taken note of (a zombie) is not."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except (FileNotFoundError, ProcessLookupError):
        return False
    except OSError:
        return True
    return state.rpartition(")")[2].split()[:1] not in (["Z"], ["X"])


def _glob_escape(name: str) -> str:
    return re.sub(r"([*?\[])", r"[\1]", name)


def explain_write_error(error: OSError, path: Path) -> HrgError:
    """The sentence of a write that the system refused.

    Parameters
    ----------
    error
        What the system said.
    path
        The output, by the name that was asked for.

    Returns
    -------
    HrgError
        A `DiskFullError` where there is no room.

    Examples
    --------
    >>> import errno
    >>> from pathlib import Path
    >>> from hrg_cli.store.atomic import explain_write_error
    >>> print(explain_write_error(OSError(errno.EACCES, "Permission denied"), Path("out.h5")))
    out.h5: no right to write it; choose another --output
    """
    if error.errno == errno.ENOSPC or "No space left" in str(error):
        return DiskFullError(f"{path}: the disk is full; free space or choose another --output")
    if error.errno in (errno.EFBIG, errno.EDQUOT) or "File too large" in str(error):
        return DiskFullError(
            f"{path}: may not grow so large (a quota or a limit of this process); choose another"
            " --output"
        )
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return HrgError(f"{path}: no right to write it; choose another --output")
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return HrgError(
            f"{path}: cannot be opened, too many files are open; raise the limit (ulimit -n) or"
            " give fewer --jobs"
        )
    if is_no_memory(error):
        return HrgError(f"{path}: {NO_MEMORY}")
    if error.errno == errno.ENAMETOOLONG:
        return HrgError(f"{str(path)[:80]}…: the name is too long; choose a shorter --output")
    return HrgError(
        f"{path}: cannot be written ({error.strerror or take_first_line(error)}); choose another"
        " --output"
    )
