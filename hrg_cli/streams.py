"""The standard streams: there even where the shell closed them, and honest about what could not be
written.

What goes to standard output is the command's result: where it cannot be written the command has
failed. Standard error tells how it goes: a message that cannot be written is lost, and the command
goes on.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from typing import Any, TextIO

from .errors import HrgError

INPUT, OUTPUT, ERROR = 0, 1, 2


class _Result(io.FileIO):
    """Standard output below its buffer."""

    def write(self, data: Any) -> int:
        """Write, or say why not, once: what is still in the buffer is dropped."""
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as error:
            drop(self.fileno())
            raise HrgError(
                f"standard output: cannot be written ({error.strerror}); make room, or name a file"
                " with -o"
            ) from error


class _Messages(io.FileIO):
    """Standard error below its buffer."""

    def write(self, data: Any) -> int:
        """Write what can be written."""
        with contextlib.suppress(OSError):
            return super().write(data)
        return len(data)


def drop(handle: int) -> None:
    """Let what is written there from now on vanish."""
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, handle)
    os.close(silent)


def result_stream(handle: int, like: TextIO, close: bool) -> TextIO:
    """Text for an open file that takes a result, encoded as `like` is; characters that the encoding
    lacks are shown as escapes. close: whether the file is closed with it."""
    return io.TextIOWrapper(
        io.BufferedWriter(_Result(handle, "w", closefd=close)),
        encoding=like.encoding,
        errors="backslashreplace",
        line_buffering=like.isatty(),
    )


def prepare() -> None:
    """Make this process' own streams what this module says; streams that were put in their place
    (by a test, a notebook) stay."""
    _open_closed()
    if _is_own("stdout"):
        sys.stdout = result_stream(OUTPUT, sys.stdout, close=False)
    if _is_own("stderr"):
        sys.stderr = io.TextIOWrapper(
            io.BufferedWriter(_Messages(ERROR, "w", closefd=False)),
            encoding=sys.stderr.encoding,
            errors="backslashreplace",
            line_buffering=True,
        )


def _is_own(name: str) -> bool:
    return getattr(sys, name) is getattr(sys, f"__{name}__")


def _open_closed() -> None:
    """The null device in the place of each stream that was closed: the next file that is opened
    would take its number, and what a library prints would go into that file."""
    for handle in (INPUT, OUTPUT, ERROR):
        try:
            os.fstat(handle)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # the lowest free number
    for name, handle, mode in (
        ("stdin", INPUT, "r"),
        ("stdout", OUTPUT, "w"),
        ("stderr", ERROR, "w"),
    ):
        if getattr(sys, name) is None:
            opened = open(handle, mode, closefd=False)  # noqa: SIM115
            setattr(sys, name, opened)
            setattr(sys, f"__{name}__", opened)


@contextlib.contextmanager
def written_out() -> Iterator[None]:
    """Write what is still in the buffer when the command is done, however it ends; a reader that
    left is no failure. HrgError: it cannot be written."""
    try:
        yield
    finally:
        try:
            sys.stdout.flush()
        except BrokenPipeError:
            drop(sys.stdout.fileno())
