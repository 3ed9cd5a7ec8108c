"""A verdict on a change of the code holds while the code and the test that saw it stay."""

import pytest

from mutants import run

CODE = "def half(x):\n    return x / 2\n"
TESTS = """import pytest


@pytest.mark.parametrize("x", [2])
def test_half(x):
    assert half(x) == 1


def test_other():
    assert True
"""


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project of one file and its tests, which `written` changes."""
    monkeypatch.setattr(run, "ROOT", tmp_path)
    (tmp_path / "hrg_cli").mkdir()

    def written(code=CODE, tests=TESTS):
        (tmp_path / "hrg_cli" / "half.py").write_text(code)
        (tmp_path / "test_half.py").write_text(tests)
        run._text.cache_clear()
        run.source_of.cache_clear()

    yield written
    run._text.cache_clear()
    run.source_of.cache_clear()


@pytest.mark.parametrize("by", ["test_half.py::test_half[2]", ""])
def test_a_verdict_holds_while_what_it_rests_on_stays(by, project):
    change = run.Mutation("half.py", ("test_half.py",), "x / 2", "x")
    project()
    row = {"key": change.key(), "by": by, "seen_by": change.seen_by(by)}
    assert change.still(row)
    project(tests=TESTS + "\n\ndef test_more():\n    assert True\n")
    assert change.still(row) == bool(by), "who survived may be seen by a new test"
    project(tests=TESTS.replace("== 1", "> 0"))
    assert not change.still(row)
    project(code=CODE.replace("half", "part"))
    assert not change.still(row)


def test_every_change_is_one_of_the_code_as_it_is():
    assert run.stale() == []
