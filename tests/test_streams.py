"""Standard streams as a shell may hand them over: full, closed, read by nobody."""

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import PACKAGE, ringing

from hrg_cli import store

FULL = Path("/dev/full")


@pytest.fixture
def recording(tmp_path):
    """A short recording on disk."""
    path = tmp_path / "in.h5"
    store.write(path, ringing(seconds=0.1))
    return path


def hrg(redirected, *words):
    """Run `hrg WORDS` in a shell with its streams redirected: (status, output, messages)."""
    command = [sys.executable, "-m", "hrg_cli", *map(str, words)]
    done = subprocess.run(
        ["bash", "-c", f'"$@" {redirected}; exit "${{PIPESTATUS[0]}}"', "hrg", *command],
        capture_output=True,
        text=True,
        check=False,
        cwd=PACKAGE,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.skipif(not FULL.exists(), reason="no /dev/full here")
@pytest.mark.parametrize(
    "words",
    [
        ("--help",),
        ("--version",),
        ("info", "{in}", "--json"),
        ("demodulate", "{in}", "-o", "{out}"),
    ],
    ids=lambda words: words[0],
)
def test_a_result_that_cannot_be_written_is_a_failure_in_words(words, recording, tmp_path):
    """It was an internal error, or a traceback."""
    out = tmp_path / "out.h5"
    named = [word.format(**{"in": recording, "out": out}) for word in words]
    status, _, said = hrg("> /dev/full", *named)
    assert status == 1 and not out.exists()
    assert said.splitlines()[-1].startswith("hrg: standard output: cannot be written (No space")
    assert "Traceback" not in said and "internal error" not in said


@pytest.mark.parametrize("closed", ["<&- >&- 2>&-", "2>&-", ">&-"])
def test_a_closed_stream_is_none_to_write_to(closed, recording, tmp_path):
    """The output file would get the closed stream's number, and take what libraries print."""
    out = tmp_path / "out.h5"
    status, _, said = hrg(closed, "demodulate", recording, "-o", out)
    assert status == 0 and "internal error" not in said
    assert store.find_changes(out) == []


@pytest.mark.skipif(not FULL.exists(), reason="no /dev/full here")
def test_messages_that_cannot_be_written_stop_nothing(recording, tmp_path):
    """The disk of a log was full, and with it the result was lost."""
    out = tmp_path / "out.h5"
    assert hrg("2> /dev/full", "demodulate", recording, "-o", out)[0] == 0
    assert store.find_changes(out) == []
    assert hrg("2> /dev/full", "info", tmp_path / "gone.h5")[0] == 1


def test_a_reader_that_left_is_no_failure(recording):
    status, _, said = hrg("| true", "info", recording, "--json")
    assert status == 0 and said == ""
