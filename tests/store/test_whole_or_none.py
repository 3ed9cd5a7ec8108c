"""A command that fails leaves no output, also where it fails after writing one, or one of several;
its processes end with it."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
import synthetic_waves
from conftest import PACKAGE, ringing

from hrg_cli import store
from hrg_cli.commands import diagnose as diagnose_command
from hrg_cli.commands import simulate as simulate_command
from hrg_cli.errors import HrgError
from hrg_cli.reporting import console
from hrg_cli.store import atomic

ROOT = Path(__file__).parents[2]
GYRO = """
[device]
frequency_hz = 1000.0
quality_factor = 20000.0
[recording]
sample_rate_hz = 8000.0
duration_s = {duration_s}
"""
RUNS = "".join(f'[[run]]\nrun_id = "{k}"\nstart.wave_angle_rad = 0.{k}\n' for k in (1, 2, 3))


class LeavingError(Exception):
    """A way out that is no failure."""


def write(path, text="now"):
    with store.write_whole(path, force=True) as temporary:
        temporary.write_text(text)


def test_only_what_was_written_is_dropped(tmp_path):
    names = ("kept", "new", "changed", "foreign", "overwritten", "swapped")
    kept, new, changed, foreign, overwritten, swapped = (tmp_path / name for name in names)
    kept.write_text("before")
    changed.write_text("before")
    outputs = [kept, new, changed, foreign, overwritten, swapped]
    with pytest.raises(HrgError), store.keep_whole_or_none(outputs):
        for path in (new, changed, overwritten, swapped):
            write(path)
        foreign.write_text("precious")
        overwritten.write_text("precious")
        swapped.unlink()
        swapped.write_text("precious")
        raise HrgError("later")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "kept": "before",
        "foreign": "precious",
        "overwritten": "precious",
        "swapped": "precious",
    }
    with pytest.raises(LeavingError), store.keep_whole_or_none([new], unless=(LeavingError,)):
        write(new)
        raise LeavingError
    assert new.read_text() == "now"


@pytest.mark.parametrize("links", [True, False])
@pytest.mark.parametrize(
    ("words", "output"),
    [
        (("demodulate", "recording.h5"), "out.h5"),
        (("report", "recording.h5"), "out.html"),
        (("export", "recording.h5"), "out.csv"),
        (("info", "recording.h5"), "out.json"),
        (("simulate", "gyro.toml"), "out-2.h5"),
    ],
)
def test_what_another_program_wrote_meanwhile_stays(
    words, output, links, hrg, tmp_path, monkeypatch
):
    """It was deleted: the command that came second dropped its own result and the other's too."""
    store.write(tmp_path / "recording.h5", ringing(seconds=0.2))
    (tmp_path / "gyro.toml").write_text(GYRO.format(duration_s=0.1) + RUNS)
    before = {path.name for path in tmp_path.iterdir()}
    rename = atomic._rename_to_new

    def second(temporary, path):
        if path.name == output:
            path.write_text("precious")
        rename(temporary, path)

    def fail(*given):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(atomic, "_rename_to_new", second)
    if not links:  # a disk of another system
        monkeypatch.setattr(os, "link", fail)
    given = output.replace("-2", "")
    done = hrg(words[0], tmp_path / words[1], "-o", tmp_path / given)
    assert done.status == 1 and "by another program meanwhile" in done.err, done
    assert (tmp_path / output).read_text() == "precious"
    assert {path.name for path in tmp_path.iterdir()} == before | {output}


@pytest.mark.parametrize("error", [MemoryError(), OSError(28, "No space left on device")])
def test_a_result_that_cannot_be_told_leaves_no_output(error, hrg, tmp_path, monkeypatch):
    def fail(*given, **more):
        raise error

    store.write(tmp_path / "recording.h5", ringing())
    monkeypatch.setattr(console, "print_json", fail)
    for words in (("info",), ("demodulate",)):
        output = tmp_path / ("out.json" if words == ("info",) else "out.h5")
        done = hrg(*words, tmp_path / "recording.h5", "-o", output, "--json")
        assert done.status == 1 and not output.exists(), done


def test_a_refused_result_stays(hrg, tmp_path):
    store.write(tmp_path / "recording.h5", ringing())
    (tmp_path / "limits.toml").write_text("[recording]\nsample_rate_hz = { maximum = 1.0 }\n")
    done = hrg(
        "check", tmp_path / "recording.h5", "--limits", tmp_path / "limits.toml",
        "-o", tmp_path / "out.json",
    )  # fmt: skip
    assert done.status == 3 and (tmp_path / "out.json").exists(), done


def test_a_diagnosis_without_its_model_is_none(hrg, tmp_path, monkeypatch):
    def fail(*given):
        raise HrgError("out.extended.toml: cannot be written")

    monkeypatch.setattr(diagnose_command, "write_extended", fail)
    for n, theta in enumerate((0.1, 0.6)):
        wave = synthetic_waves.run_down(theta, 0.0, seconds=1.0, window=5e-3, seed=n)
        store.write(tmp_path / f"{n}.h5", wave)
    waves = [tmp_path / f"{n}.h5" for n in range(2)]
    done = hrg("diagnose", *waves, "-o", tmp_path / "out.h5", "--set", "most_effects=1")
    assert done.status == 1 and "out.extended.toml" in done.err
    assert not list(tmp_path.glob("out*"))


def test_of_several_runs_all_are_written_or_none(hrg, tmp_path, monkeypatch):
    simulated = simulate_command._simulate_one

    def fail_at_the_third(task, progress=None):
        if task.values["run"] == "3":
            raise HrgError("the third run fails")
        return simulated(task, progress)

    (tmp_path / "gyro.toml").write_text(GYRO.format(duration_s=0.1) + RUNS)
    words = ("simulate", tmp_path / "gyro.toml", "-o", tmp_path / "run.h5")
    monkeypatch.setattr(simulate_command, "_simulate_one", fail_at_the_third)
    assert hrg(*words).status == 1
    assert [path.name for path in tmp_path.iterdir()] == ["gyro.toml"]
    monkeypatch.undo()
    assert hrg(*words).status == 0
    assert len(list(tmp_path.glob("run-?.h5"))) == 3


def test_runs_shared_among_processes_are_the_same(hrg, tmp_path):
    (tmp_path / "gyro.toml").write_text(GYRO.format(duration_s=0.1) + RUNS)
    for jobs in (1, 2):
        done = hrg("simulate", tmp_path / "gyro.toml", "-o", tmp_path / f"j{jobs}.h5",
                   "--jobs", jobs, "--seed", 5)  # fmt: skip
        assert done.status == 0, done
    for run in (1, 2, 3):
        one, two = (store.read_any(tmp_path / f"j{jobs}-{run}.h5") for jobs in (1, 2))
        assert (one.c == two.c).all() and (one.s == two.s).all()


def start_long_simulation(folder, jobs):
    """The command at work, its first half-written file there."""
    (folder / "gyro.toml").write_text(GYRO.format(duration_s=3000.0) + RUNS)
    running = subprocess.Popen(
        [sys.executable, "-m", "hrg_cli.cli", "simulate", "gyro.toml", "-o", "run.h5",
         "--jobs", str(jobs), "-q"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(PACKAGE)},
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    own = re.compile(r"run-\d\.h5.*\.tmp$")
    while not any(own.search(path.name) for path in folder.iterdir()):
        assert running.poll() is None
        time.sleep(0.05)
    return running


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_terminated_command_leaves_nothing(jobs, tmp_path):
    """Its temporary files stayed until the next command wrote there."""
    running = start_long_simulation(tmp_path, jobs)
    running.terminate()
    said = running.communicate(timeout=30)[1]
    assert running.returncode == 143 and said == "hrg: terminated; no output was written\n", said
    assert [path.name for path in tmp_path.iterdir()] == ["gyro.toml"]


def test_simulating_processes_end_with_a_parent_that_is_killed(tmp_path):
    running = start_long_simulation(tmp_path, 2)
    children = psutil.Process(running.pid).children(recursive=True)
    running.kill()
    running.wait()
    assert len(children) >= 2
    assert not psutil.wait_procs(children, timeout=20)[1], "a worker works on"
