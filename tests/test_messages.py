"""A message has two lines of a terminal of 100 columns: what a program says by itself, lists of what
a file holds, words of a file."""

import ast
from pathlib import Path

import pytest
import records_by_hand
from conftest import ringing
from hypothesis import given
from hypothesis import strategies as st

from hrg_cli import store
from hrg_cli.errors import ROOM, name_some
from hrg_cli.reporting.text import LONGEST_LINE, LONGEST_WORD, fold_line, shorten
from hrg_cli.store.atomic import explain_write_error

PACKAGE = Path(__file__).parent.parent / "hrg_cli"
LONGEST_TEXT, VALUE = 180, 10
"""Characters of a message without its file's name; what a value in it is taken to need."""
TWO_LINES = 200


def longest_text(node):
    """Characters of a message's text in the source, the longer one of two."""
    if isinstance(node, ast.Constant):
        return len(str(node.value))
    if isinstance(node, ast.JoinedStr):
        return sum(longest_text(v) if isinstance(v, ast.Constant) else VALUE for v in node.values)
    if isinstance(node, ast.BinOp):
        return longest_text(node.left) + longest_text(node.right)
    if isinstance(node, ast.IfExp):
        return max(longest_text(node.body), longest_text(node.orelse))
    return VALUE


def test_what_the_program_says_of_a_failure_has_two_lines():
    """Thirteen were longer, up to 252 characters."""
    found = {
        f"{path.relative_to(PACKAGE)}:{node.lineno}": longest_text(node.args[0])
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and node.args
        and ast.unparse(node.func).split(".")[-1].endswith("Error")
    }
    assert len(found) > 300
    assert not {place: size for place, size in found.items() if size > LONGEST_TEXT}


@given(st.text(max_size=300), st.integers(5, 100))
def test_a_shortened_text_keeps_its_ends(text, most):
    short = shorten(text, most)
    assert len(short) <= most and (short == text) == (len(text) <= most)
    assert text[:2] == short[:2] and text[-1:] == short[-1:]


@pytest.mark.parametrize(
    "said",
    [
        f"x.toml: unknown key {'k' * 4000}; correct it",
        f"x.toml: {'word ' * 4000}; correct it",
        f"{'n' * 250}.h5: no such file; correct it",
    ],
)
def test_foreign_words_do_not_fill_the_terminal(said):
    line = fold_line(said)
    assert len(line) <= LONGEST_LINE and line.endswith("; correct it") and "…" in line
    assert all(len(word) <= LONGEST_WORD for word in line.split())


def test_a_path_is_told_whole():
    path = f"/{'/'.join(['folder'] * 60)}/g.h5"
    assert fold_line(f"{path}: no such file") == f"{path}: no such file"


@given(st.lists(st.text(min_size=1, max_size=12), max_size=200))
def test_a_list_has_room_or_says_how_many_there_are(names):
    said = name_some(names)
    assert len(said) <= ROOM + len(" … (200 in all)")
    assert said == ", ".join(names) or said.endswith(f" … ({len(names)} in all)")


def test_a_log_of_many_columns_is_told_in_two_lines(hrg, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    head = ",".join(f"a rather long title {k}" for k in range(300))
    rows = "".join(",".join([str(k)] * 300) + "\n" for k in range(20))
    Path("log.csv").write_text(f"{head}\n{rows}")
    said = hrg("import", "log.csv", "-o", "x.h5")
    assert said.status == 1 and said.err.count("\n") == 1
    assert len(said.err) <= TWO_LINES and "300 in all" in said.err


def test_one_column_for_two_channels_is_named(hrg, tmp_path):
    """All columns were named as that one."""
    (tmp_path / "log.csv").write_text("t,c,s\n" + "".join(f"{k},1,2\n" for k in range(9)))
    said = hrg(
        *("import", tmp_path / "log.csv", "-o", tmp_path / "x.h5"),
        *("--time", 1, "--c", 2, "--s", 2),
    )
    assert said.status == 1 and "c and s are both column 2; name two of 1 t, 2 c, 3 s" in said.err


def test_a_key_that_there_is_not_is_answered_with_those_there_are(hrg):
    said = hrg("demodulate", "x.h5", "-o", "y.h5", "--set", "nope=1")
    assert said.status == 2 and "unknown key nope (there are periods_per_window" in said.err
    assert len(said.err) <= TWO_LINES


LOT = 'lot_id = "x"\nrecordings = ["{}"]\nstages = ["identify"]\n'


@pytest.mark.parametrize(
    ("text", "status", "said"),
    [
        (LOT.format("none-*.h5"), 1, "lot.toml: no file fits 'none-*.h5' in "),
        (LOT.format("*.h5") + "[demodulate]\nx = 2\n", 1, "lot.toml: unknown key demodulate.x ("),
        (
            LOT.format("*.h5") + "[limits.resonater]\nscale_factor = 1\n",
            2,
            "did you mean resonator?",
        ),
    ],
)
def test_a_lots_mistakes_are_told_with_its_file_before_it_begins(
    hrg, tmp_path, monkeypatch, text, status, said
):
    monkeypatch.chdir(tmp_path)
    store.write("run.h5", ringing(gyro_id="SN-1"))
    Path("lot.toml").write_text(text)
    told = hrg("batch", "lot.toml", "-o", "lot")
    assert told.status == status and told.err.startswith("hrg: ") and said in told.err
    assert told.err.count("\n") == 1 and not Path("lot").exists()


def test_a_kind_made_in_two_ways_is_said_as_two_commands(hrg, tmp_path):
    store.write(tmp_path / "r.h5", records_by_hand.RECORDS["resonator"]())
    told = hrg("demodulate", tmp_path / "r.h5", "-o", tmp_path / "p.h5")
    assert told.err.endswith("make one with `hrg import` or `hrg simulate`\n")


def test_a_write_that_fails_does_not_tell_of_temporary_files():
    told = str(
        explain_write_error(FileNotFoundError(2, "No such file", "/.x.hrg.tmp"), Path("x.csv"))
    )
    assert told == "x.csv: cannot be written (No such file); choose another --output"
