"""What a person gets who mistypes: one line that names the command, what is wrong and what to do."""

import io

import pytest
import records_by_hand
import typer.main

from docs.handbook.man_page import list_commands
from hrg_cli import store
from hrg_cli.cli import app

COMMANDS = sorted(list_commands(typer.main.get_command(app)))
LONGEST = 160
"""Characters: two lines of a terminal of 80 columns."""


def told(result):
    """The one line of a wrong use."""
    assert result.status == 2 and result.out == "", result
    assert result.err.count("\n") == 1 and result.err.startswith("hrg: "), result.err
    assert len(result.err) <= LONGEST
    return result.err


@pytest.mark.parametrize("command", COMMANDS)
def test_an_option_that_there_is_not(hrg, command):
    said = told(hrg(*command.split(), "--no-such-option"))
    assert said.startswith(f"hrg: {command}: no such option: --no-such-option")
    assert f"`hrg {command} -h`" in said


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("demodulat",), "did you mean 'demodulate'?"),
        (("ledger", "sho"), "did you mean 'show'?"),
        (("demodulate", "--periods-per-windw", 3), "did you mean --periods-per-window?"),
        (("demodulate", "x.h5", "--jobs", 0), "'--jobs'"),
        (("ledger", "show", "--kind", "wave"), "'wave' is not one of 'resonator'"),
        (("identify", "x.h5", "-o"), "'-o' requires an argument"),
        (("--nope",), "no such option: --nope; see `hrg -h`"),
        (("identify", "\x1b[31m", "--no\x1b[31m"), "no such option"),
    ],
)
def test_what_may_be_meant_is_said(hrg, words, meant):
    said = told(hrg(*words))
    assert meant in said and "\x1b" not in said and "Value error" not in said


def test_two_kinds_are_named_with_their_files(hrg, tmp_path):
    for kind in ("resonator", "calibration"):
        store.write(tmp_path / f"{kind}.h5", records_by_hand.RECORDS[kind]())
    result = hrg("diff", tmp_path / "resonator.h5", tmp_path / "calibration.h5")
    assert result.status == 1 and result.err.count("\n") == 1
    for part in ("resonator.h5 is a resonator", "calibration.h5 a calibration", "name two of one"):
        assert part in result.err


def test_a_calibration_is_told_of_the_header_too(hrg, tmp_path):
    for kind, header in (("resonator", False), ("calibration", True)):
        store.write(tmp_path / f"{kind}.h5", records_by_hand.RECORDS[kind]())
        result = hrg("export", tmp_path / f"{kind}.h5", "-o", tmp_path / "x.docx")
        assert result.status == 2 and (", .h" in result.err) == header


def test_a_column_that_there_is_not_is_answered_with_those_there_are(hrg, tmp_path):
    (tmp_path / "log.csv").write_text("t,c,s\n" + "".join(f"{k},1,2\n" for k in range(9)))
    log = ("import", tmp_path / "log.csv", "-o", tmp_path / "x.h5", "--time", 1, "--c", 2)
    result = hrg(*log, "--s", 9)
    assert result.status == 1 and "it has 3 columns" in result.err
    assert result.err.rstrip().endswith("name one of these")


def test_what_came_by_standard_input_is_called_that(hrg, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"a,b\n1,x\n")))
    result = hrg("import", "-", "-o", tmp_path / "x.h5")
    assert result.status == 1 and result.err.startswith("hrg: standard input: "), result.err


def test_a_run_of_nothing_leaves_nothing(hrg, tmp_path):
    (tmp_path / "empty.h5").touch()
    assert hrg("run", tmp_path / "empty.h5", "-o", tmp_path / "out").status == 1
    assert not (tmp_path / "out").exists()
