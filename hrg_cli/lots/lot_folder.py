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
    """The folder is new, empty, or that of a lot."""
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
    """No two programs work on one lot at a time."""
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
    """A text, whole or not at all, in place of one that was there."""
    with store.atomic_path(path, force=True) as temporary:
        temporary.write_text(text, encoding="utf-8")
