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
    """Let what is written to an open file from now on vanish.

    Parameters
    ----------
    handle
        Its number.

    Examples
    --------
    >>> import os
    >>> from tempfile import TemporaryFile
    >>> from hrg_cli.streams import drop
    >>> with TemporaryFile() as file:
    ...     drop(file.fileno())
    ...     os.write(file.fileno(), b"lost")
    4
    """
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, handle)
    os.close(silent)


def make_result_stream(handle: int, like: TextIO, close: bool) -> TextIO:
    r"""Text for an open file that takes a result.

    Characters that the encoding lacks are shown as escapes.

    Parameters
    ----------
    handle
        The file's number.
    like
        A stream of the same encoding.
    close
        The file is closed with it.

    Returns
    -------
    TextIO
        Writing to it fails with one sentence, once.

    Examples
    --------
    >>> import io
    >>> from tempfile import TemporaryFile
    >>> from hrg_cli.streams import make_result_stream
    >>> like = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    >>> with TemporaryFile() as file:
    ...     with make_result_stream(file.fileno(), like, close=False) as stream:
    ...         _ = stream.write("15 °/h")
    ...     _ = file.seek(0)
    ...     print(file.read())
    b'15 \\xb0/h'
    """
    return io.TextIOWrapper(
        io.BufferedWriter(_Result(handle, "w", closefd=close)),
        encoding=like.encoding,
        errors="backslashreplace",
        line_buffering=like.isatty(),
    )


def prepare() -> None:
    """Make this process' own streams what this module says.

    Streams that were put in their place (by a test, a notebook) stay.

    Examples
    --------
    >>> import io, sys
    >>> from contextlib import redirect_stdout
    >>> from hrg_cli.streams import prepare
    >>> with redirect_stdout(io.StringIO()) as theirs:
    ...     prepare()
    ...     stays = sys.stdout is theirs
    >>> stays
    True
    """
    _open_closed()
    if _is_own("stdout"):
        sys.stdout = make_result_stream(OUTPUT, sys.stdout, close=False)
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
def flush_at_end() -> Iterator[None]:
    """Write what is still in the buffer when the command is done, however it ends.

    A reader that left is no failure.

    Returns
    -------
    context manager
        Of the command.

    Raises
    ------
    HrgError
        It cannot be written.

    Examples
    --------
    >>> from hrg_cli.streams import flush_at_end
    >>> with flush_at_end():
    ...     print("the result")
    the result
    """
    try:
        yield
    finally:
        try:
            sys.stdout.flush()
        except BrokenPipeError:
            drop(sys.stdout.fileno())
