"""SIGTERM ends a command as Ctrl-C does: what it has begun is removed, what is whole stays.

Either is an exception, which Python drops where it meets a callback (of a weak reference, of h5py
that lets go of an object); it is sent again then, until it is heard.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType

AGAIN_S = 0.01
"""Seconds after which a signal that was dropped is sent again: a callback has ended by then."""


class TerminatedError(KeyboardInterrupt):
    """The process was asked to end (SIGTERM), which all that ends by Ctrl-C ends by as well."""


@contextlib.contextmanager
def end_when_terminated() -> Iterator[list[int]]:
    """Let SIGTERM end the block by an exception, so that what it has begun is cleaned up, and
    Ctrl-C wherever it comes.

    A handler that another program has set, and a signal that is ignored, stay as they are.

    Returns
    -------
    context manager of list
        The signals that came so far.

    Examples
    --------
    >>> import signal
    >>> from hrg_cli.commands.termination import TerminatedError, end_when_terminated
    >>> try:
    ...     with end_when_terminated() as received:
    ...         signal.raise_signal(signal.SIGTERM)
    ... except TerminatedError:
    ...     received == [signal.SIGTERM]
    True
    """
    received: list[int] = []
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL
    ):
        yield received
        return

    def end(number: int, _: FrameType | None) -> None:
        received.append(number)
        raise TerminatedError

    signal.signal(signal.SIGTERM, end)
    try:
        with _send_again_what_was_dropped():
            yield received
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextlib.contextmanager
def _send_again_what_was_dropped() -> Iterator[None]:
    hook = sys.unraisablehook
    waiting: list[threading.Timer] = []

    def send_again(told: sys.UnraisableHookArgs) -> None:
        if not isinstance(told.exc_value, KeyboardInterrupt):
            hook(told)
            return
        ended = isinstance(told.exc_value, TerminatedError)
        number = signal.SIGTERM if ended else signal.SIGINT
        timer = threading.Timer(AGAIN_S, os.kill, (os.getpid(), number))
        timer.daemon = True
        waiting.append(timer)
        timer.start()

    sys.unraisablehook = send_again
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for timer in waiting:
            timer.cancel()
