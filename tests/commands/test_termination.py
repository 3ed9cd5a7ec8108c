"""A signal ends a command wherever it comes."""

import signal
import subprocess
import sys

import pytest

PROGRAM = """
import signal, sys, time, weakref
from hrg_cli.commands.termination import TerminatedError, end_when_terminated

class Thing:
    pass

# a shell in the background leaves its children deaf to Ctrl-C
signal.signal(signal.SIGINT, signal.default_int_handler)
thing = Thing()
reference = weakref.ref(thing, lambda _: signal.raise_signal(int(sys.argv[1])))
started = time.monotonic()
try:
    with end_when_terminated():
        del thing
        while time.monotonic() - started < 20:
            time.sleep(0.01)
except KeyboardInterrupt as error:
    soon = reference() is None and time.monotonic() - started < 10
    left = signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    print(isinstance(error, TerminatedError), soon, left)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_that_python_drops_is_sent_again(number):
    """In the callback of a weak reference it was printed, and the command went on to its end; in a
    process of its own, since a test's worker has handlers, and threads, of its own."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(int(number))],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout.split() == [str(number == signal.SIGTERM), "True", "True"], done.stderr
