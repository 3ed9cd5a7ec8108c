"""A signal ends a command wherever it comes."""

import signal
import time
import weakref

import pytest

from hrg_cli.commands.termination import TerminatedError, end_when_terminated


class Thing:
    """What a weak reference can be of."""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_that_python_drops_is_sent_again(number):
    """In the callback of a weak reference it was printed, and the command went on to its end."""
    thing = Thing()
    reference = weakref.ref(thing, lambda _: signal.raise_signal(number))
    ended = TerminatedError if number == signal.SIGTERM else KeyboardInterrupt
    started = time.monotonic()
    with pytest.raises(ended), end_when_terminated():
        del thing
        while time.monotonic() - started < 5:
            time.sleep(0.01)
    assert reference() is None and time.monotonic() - started < 2
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
