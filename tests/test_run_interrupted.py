"""A chain that was killed at any place goes on with the same command, and takes no file of somebody
else's for its own."""

import pytest
from conftest import ringing
from file_digests import rows

from hrg_cli import memory, pipeline, store
from hrg_cli.gyro import run_gyro

QUICK = {"diagnose": {"most_effects": 1}}


class Killed(BaseException):
    """In place of SIGKILL: nothing after it runs."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    paths = [folder / f"r{k}.h5" for k in range(2)]
    for k, path in enumerate(paths):
        store.write(path, ringing(mode="free", seed=k, run_id=str(k)))
    return paths


@pytest.fixture(scope="module")
def whole(recordings, tmp_path_factory):
    """A chain that nobody disturbed: its folder, and what its steps told."""
    folder = tmp_path_factory.mktemp("whole")
    return folder, told(run_gyro(recordings, folder, QUICK))


def kill_after(monkeypatch, stage):
    """The chain is killed when the stage's output is whole, before anything is noted of it."""
    run_stage = pipeline.run_stage

    def then_killed(name, *given, **more):
        done = run_stage(name, *given, **more)
        if name == stage:
            raise Killed
        return done

    monkeypatch.setattr(pipeline, "run_stage", then_killed)


def told(steps):
    return [(step.name, step.output, step.status, step.reasons) for step in steps]


@pytest.mark.parametrize(
    "stage",
    [
        pytest.param("demodulate", marks=pytest.mark.slow),
        "estimate",
        "identify",
        pytest.param("diagnose", marks=pytest.mark.slow),
    ],
)
def test_a_killed_chain_goes_on(stage, recordings, whole, tmp_path, monkeypatch):
    kill_after(monkeypatch, stage)
    with pytest.raises(Killed):
        run_gyro(recordings, tmp_path, QUICK)
    monkeypatch.undo()
    folder, steps = whole
    assert {name for name, *_ in steps} >= {"demodulate", "estimate", "identify", "diagnose"}
    assert told(run_gyro(recordings, tmp_path, QUICK)) == steps
    assert rows(tmp_path) == rows(folder)


def test_what_was_there_before_is_not_replaced(recordings, tmp_path):
    theirs = tmp_path / "r0.wave.h5"
    theirs.write_bytes(b"somebody's")
    for _ in range(2):
        steps = told(run_gyro(recordings[:1], tmp_path))
        assert any("exists already" in why for *_, reasons in steps for why in reasons)
        assert theirs.read_bytes() == b"somebody's"


def test_a_note_of_what_is_begun_is_none_of_what_is_done(tmp_path):
    note, output = tmp_path / "note.json", tmp_path / "a.h5"
    memory.begin(note, [output])
    assert memory.recall(note, "key") is None and memory.recall(note, "") is None
    output.write_bytes(b"1")
    (tmp_path / "b.h5").write_bytes(b"1")
    assert memory.is_ours(note, output) and not memory.is_ours(note, tmp_path / "b.h5")
    memory.remember(note, "key", {"steps": [1]}, [output])
    output.write_bytes(b"2")
    assert not memory.is_ours(note, output), "what is done and then changed is the changer's"
