"""Places and names that a file system allows and few expect: said in words, and nothing else
changed."""

import errno
import os
import stat

import pytest
import typer
from conftest import ringing

from hrg_cli import store
from hrg_cli.commands import guard


@pytest.fixture
def recording(tmp_path):
    """A short recording on disk."""
    path = tmp_path / "in.h5"
    store.write(path, ringing(seconds=0.1))
    return path


@pytest.mark.parametrize(
    ("number", "advice"),
    [
        (errno.EACCES, "ask for the right"),
        (errno.ENAMETOOLONG, "choose a shorter name"),
        (errno.ELOOP, "links lead in a circle"),
        (errno.EIO, "check its disk"),
    ],
)
def test_what_the_system_refuses_is_no_internal_error(number, advice, capsys):
    """An input, a --config or --limits in a folder that may not be searched was one."""

    def refused():
        raise OSError(number, os.strerror(number), "folder/in.h5")

    with pytest.raises(typer.Exit) as left:
        guard.run_guarded(refused)
    assert left.value.exit_code == 1
    said = capsys.readouterr().err
    assert said.startswith("hrg: folder/in.h5: cannot be used (") and advice in said


@pytest.mark.parametrize("error", [OSError("no number"), OSError(errno.EINVAL, "argument", "x")])
def test_what_may_be_the_programs_own_error_is_told_as_one(error, capsys):
    def fails():
        raise error

    with pytest.raises(typer.Exit):
        guard.run_guarded(fails)
    assert "internal error" in capsys.readouterr().err


def test_a_name_that_leaves_no_room_for_those_of_the_outputs(hrg, recording, tmp_path):
    long = recording.rename(tmp_path / f"{'a' * 251}.h5")
    told = hrg("run", long, "-o", tmp_path / "out")
    assert told.status == 1 and "choose a shorter" in told.err, told


def test_a_folder_that_is_gone_under_ones_feet(hrg, recording, tmp_path, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    told = hrg("demodulate", recording, "-o", "out.h5")
    assert told.status == 1 and "the folder that this was started in is gone" in told.err


def test_a_link_that_leads_nowhere_exists(hrg, recording, tmp_path):
    """It was called "written by another program meanwhile", after the work."""
    link = tmp_path / "out.h5"
    link.symlink_to("nothing.h5")
    told = hrg("demodulate", recording, "-o", link)
    assert told.status == 1 and "exists already" in told.err and link.is_symlink()
    assert hrg("demodulate", recording, "-o", link, "--force").status == 0
    assert not link.is_symlink() and not (tmp_path / "nothing.h5").exists()


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664])
def test_a_replaced_file_keeps_its_readers(mode, hrg, recording, tmp_path):
    """A private result was readable by all once it had been made again."""
    out = tmp_path / "out.h5"
    assert hrg("demodulate", recording, "-o", out).status == 0
    out.chmod(mode)
    assert hrg("demodulate", recording, "-o", out, "--force").status == 0
    assert stat.S_IMODE(out.stat().st_mode) == mode


@pytest.mark.parametrize("sign", ["\n", "\r", "\u2028", "\x85", "\x0b"])
def test_a_line_break_in_a_name_makes_no_line_of_history(sign, hrg, recording, tmp_path):
    """One command stood there as two."""
    named = recording.rename(tmp_path / f"new{sign}line.h5")
    out = tmp_path / "out.h5"
    assert hrg("demodulate", named, "-o", out).status == 0
    (line,) = store.find_provenance(out).history
    assert f"new{sign.encode('unicode_escape').decode()}line.h5" in line
    assert hrg("verify", out).status == 0
