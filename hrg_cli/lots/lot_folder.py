"""The folder of a lot: new or a lot's own, and one program's at a time."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from .. import store
from ..errors import HrgError

MARK = "lot.json"


def claim(folder: Path, force: bool) -> None:
    r"""Make the folder of a lot, or take one that is empty or a lot's.

    Parameters
    ----------
    folder
        Of the lot.
    force
        It may hold something else.

    Raises
    ------
    HrgError
        It is a file, holds something else, or cannot be made.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.lots.lot_folder import claim
    >>> with TemporaryDirectory() as name:
    ...     claim(Path(name) / "lot", force=False)
    ...     (Path(name) / "lot" / "lot.json").read_text()
    '{"kind": "lot", "status": "unfinished"}\n'
    """
    if folder.exists() and not folder.is_dir():
        raise HrgError(f"{folder}: is a file; name a folder for the lot")
    if not folder.exists():
        if not folder.absolute().parent.is_dir():
            raise HrgError(f"{folder}: the folder {folder.parent} does not exist; make it first")
        try:
            folder.mkdir()
        except OSError as error:
            raise HrgError(
                f"{folder}: cannot be made ({error.strerror}); choose another --output"
            ) from error
    elif not force and any(folder.iterdir()) and not (folder / MARK).exists():
        raise HrgError(
            f"{folder}: holds files that are not of a lot; name an empty folder or give --force"
        )
    store.check_output(folder / MARK, force=True)
    if not (folder / MARK).exists():
        write_text(folder / MARK, '{"kind": "lot", "status": "unfinished"}\n')


@contextlib.contextmanager
def hold_as_only_writer(folder: Path) -> Iterator[None]:
    """Let no two programs work on one lot at a time.

    Parameters
    ----------
    folder
        Of the lot.

    Returns
    -------
    context manager
        Of the work.

    Raises
    ------
    HrgError
        Another program works on it.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.errors import HrgError
    >>> from hrg_cli.lots.lot_folder import hold_as_only_writer
    >>> with TemporaryDirectory() as name, hold_as_only_writer(Path(name)):
    ...     try:
    ...         with hold_as_only_writer(Path(name)):
    ...             pass
    ...     except HrgError as error:
    ...         print(str(error).partition(": ")[2])
    another program works on this lot; wait until it has ended
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise HrgError(
                f"{folder}: another program works on this lot; wait until it has ended"
            ) from error
        yield
    finally:
        os.close(handle)


def write_text(path: Path, text: str) -> None:
    """Write a text, whole or not at all, in place of one that was there.

    Parameters
    ----------
    path
        Of the file.
    text
        What it is to hold, as UTF-8.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.lots.lot_folder import write_text
    >>> with TemporaryDirectory() as name:
    ...     write_text(Path(name) / "note.txt", "0.55 °/h")
    ...     (Path(name) / "note.txt").read_text(encoding="utf-8")
    '0.55 °/h'
    """
    with store.write_whole(path, force=True) as temporary:
        temporary.write_text(text, encoding="utf-8")
