"""What stands between a command's body and the shell: every failure becomes one line and an exit
status, standard output is the command's alone."""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from typing import NoReturn

import typer

from ..errors import (
    NO_MEMORY,
    DiskFullError,
    HrgError,
    InterruptedRunError,
    UsageError,
    is_no_memory,
)
from ..extras import find_optional, tell_how_to_install
from ..reporting.text import fold_line
from ..streams import drop, make_result_stream
from .termination import TerminatedError, end_when_terminated

DONE, FAILED, USAGE, REFUSED, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143


@contextlib.contextmanager
def forgive_closed_pipe() -> Iterator[None]:
    """Let a reader leave (`hrg info x | head -1`): what is printed from then on is dropped.

    Returns
    -------
    context manager
        Of what prints.

    Examples
    --------
    >>> from hrg_cli.commands.guard import forgive_closed_pipe
    >>> with forgive_closed_pipe():
    ...     print("a line")
    a line
    """
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        drop(sys.stdout.fileno())


@contextlib.contextmanager
def _keep_standard_output() -> Iterator[None]:
    """Standard output for this program alone: libraries below Python (LAPACK) that print there
    would break --json. HrgError: what is printed cannot be written.
    """
    stream = sys.stdout
    try:
        handle = stream.fileno()
    except (OSError, ValueError, AttributeError):  # a test's or a notebook's
        yield
        return
    stream.flush()
    kept = os.dup(handle)
    sys.stdout = own = make_result_stream(kept, stream, close=True)
    drop(handle)
    try:
        yield
    finally:
        sys.stdout = stream
        try:
            with contextlib.suppress(BrokenPipeError):
                own.flush()
        finally:
            os.dup2(kept, handle)
            with contextlib.suppress(BrokenPipeError):
                own.close()


@contextlib.contextmanager
def _silence_libraries(verbose: bool) -> Iterator[None]:
    """Without the warnings and logs of libraries, which are for programmers: here results are
    judged, in sentences."""
    if verbose:
        yield
        return
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def run_guarded(body: Callable[[], None], verbose: bool = False) -> None:
    """Run a command's body; every failure becomes one line on standard error and an exit status.

    Parameters
    ----------
    body
        Without arguments.
    verbose
        An error of the program's own is shown with its trace, and what libraries print.

    Raises
    ------
    Exit
        Of typer, with the status: 1 the input or the run failed, 2 usage, 130 interrupted, 143
        terminated.

    Examples
    --------
    >>> import typer
    >>> from hrg_cli.commands.guard import run_guarded
    >>> from hrg_cli.errors import HrgError
    >>> def fail():
    ...     raise HrgError("a.h5: no such file")
    >>> try:
    ...     run_guarded(fail)
    ... except typer.Exit as left:
    ...     print(left.exit_code)
    1
    """
    with end_when_terminated() as received:
        try:
            with _silence_libraries(verbose), _keep_standard_output(), forgive_closed_pipe():
                body()
        except UsageError as error:
            leave(str(error), USAGE)
        except DiskFullError as error:
            print(f"hrg: {fold_line(str(error))}", file=sys.stderr, flush=True)
            sys.stdout.flush()
            os._exit(FAILED)  # HDF5 crashes at a normal exit after a full disk
        except InterruptedRunError as error:
            leave(str(error), TERMINATED if received else INTERRUPTED)
        except HrgError as error:
            leave(str(error), FAILED)
        except TerminatedError:
            leave("terminated; no output was written", TERMINATED)
        except KeyboardInterrupt:
            leave("interrupted; no output was written", INTERRUPTED)
        except typer.Exit:
            raise
        except Exception as error:
            _unforeseen(error, verbose)


def _unforeseen(error: Exception, verbose: bool) -> NoReturn:
    """Memory that ran out, an optional package that is missing, or an error of the program's
    own."""
    if is_no_memory(error):
        leave(NO_MEMORY, FAILED)
    if gone := find_optional(error):
        leave(f"this needs {tell_how_to_install(gone)}", FAILED)
    if isinstance(error, OSError) and (said := _explain_system_error(error)):
        leave(said, FAILED)
    if verbose:
        import traceback

        traceback.print_exception(error)
    leave(
        f"internal error: {type(error).__name__}: {str(error)[:200]}; run again with -v and"
        " report it",
        FAILED,
    )


REFUSALS = {
    errno.EACCES: "ask for the right to use it and its folder",
    errno.EPERM: "ask for the right to use it and its folder",
    errno.EROFS: "choose another place",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.ELOOP: "its links lead in a circle; name the file itself",
    errno.ENOTDIR: "a file stands where a folder was expected; correct the path",
    errno.EMFILE: "raise the limit (ulimit -n) or give fewer --jobs",
    errno.ENFILE: "close other programs",
    errno.EIO: "check its disk",
    errno.ESTALE: "the disk of another host is gone; run the command again when it is back",
    errno.ENOSPC: "free space",
    errno.EDQUOT: "free space",
}
"""What the system refuses wherever a file is touched, and what to do then."""


def _explain_system_error(error: OSError) -> str | None:
    """The sentence for what the system refused; None where it may be an error of the program."""
    if isinstance(error, FileNotFoundError) and error.filename is None and _folder_is_gone():
        return "the folder that this was started in is gone; change into one that is there"
    if error.filename is None or error.errno not in REFUSALS:
        return None
    name = os.fsdecode(error.filename) if isinstance(error.filename, bytes) else error.filename
    return f"{name}: cannot be used ({error.strerror}); {REFUSALS[error.errno]}"


def _folder_is_gone() -> bool:
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def leave(text: str, status: int) -> NoReturn:
    """Print one line on standard error and leave with an exit status.

    Parameters
    ----------
    text
        What is said after `hrg:`, folded to one line.
    status
        Of the program.

    Returns
    -------
    NoReturn
        It does not return.

    Raises
    ------
    Exit
        Of typer, with the status.

    Examples
    --------
    >>> import typer
    >>> from hrg_cli.commands.guard import leave
    >>> try:
    ...     leave("a.h5: no such file", 1)
    ... except typer.Exit as left:
    ...     print(left.exit_code)
    1
    """
    print(f"hrg: {fold_line(text)}", file=sys.stderr, flush=True)
    raise typer.Exit(status) from None
