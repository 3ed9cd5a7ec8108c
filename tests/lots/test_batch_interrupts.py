"""A lot that is interrupted: says how far it came, leaves no process and no half file behind, and
goes on; a full disk is no verdict."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from conftest import PACKAGE
from lot_recordings import run_down, split_of

from hrg_cli import store
from hrg_cli.errors import DiskFullError, HrgError
from hrg_cli.executors import run_tasks, start_processes
from hrg_cli.lots.batch import choose_executor, run_lot
from hrg_cli.records import Resonator

SOON_S = 20.0
"""Generous: this machine may be busy; without the mend it took the rest of the lot."""


@pytest.fixture(scope="module")
def lot(tmp_path_factory) -> Path:
    """Gyros enough that a lot of two processes is interrupted in the middle."""
    folder = tmp_path_factory.mktemp("lot")
    (folder / "data").mkdir()
    for gyro in range(6):
        for run, theta in enumerate((0.1, 0.6)):
            store.write(
                folder / "data" / f"g{gyro}-{run}.h5",
                run_down(f"G{gyro}", f"{run}", theta, split_of(gyro), 10 * gyro + run),
            )
    (folder / "lot.toml").write_text(
        'lot_id = "L"\nrecordings = "data/*.h5"\nstages = ["identify"]\n'
    )
    return folder


def batch(lot: Path, out: Path, *options: str) -> subprocess.Popen[str]:
    """`hrg batch` as a terminal starts it: Ctrl-C reaches it and all its children."""
    return subprocess.Popen(
        [
            sys.executable,
            "-m",
            "hrg_cli.cli",
            "batch",
            str(lot / "lot.toml"),
            "-o",
            str(out),
            *options,
        ],
        cwd=lot,
        env=os.environ
        | {
            "PYTHONPATH": str(PACKAGE),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        },
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def wait_for_a_wave(out: Path, running: subprocess.Popen[str]) -> list[psutil.Process]:
    """Wait until the first wave is written; the process's children."""
    while not list(out.rglob("*.wave.h5")):
        assert running.poll() is None, running.communicate()
        time.sleep(0.01)
    return psutil.Process(running.pid).children(recursive=True)


def gone(children: list[psutil.Process]) -> bool:
    """Whether they end soon."""
    return not psutil.wait_procs(children, timeout=SOON_S)[1]


@pytest.mark.parametrize(
    "jobs",
    [
        pytest.param(("--jobs", "1"), marks=pytest.mark.slow, id="alone"),
        pytest.param(("--jobs", "2"), id="processes"),
        pytest.param(("--jobs", "2", "--dask"), marks=pytest.mark.slow, id="dask"),
    ],
)
def test_an_interrupted_lot_says_how_far_it_came_and_goes_on(jobs, lot, tmp_path):
    """With Dask the workers' tracebacks stood before the sentence."""
    if "--dask" in jobs:
        pytest.importorskip("distributed")
    out = tmp_path / "out"
    running = batch(lot, out, *jobs, "-q")
    children = wait_for_a_wave(out, running)
    started = time.monotonic()
    os.killpg(running.pid, signal.SIGINT)
    told, said = running.communicate(timeout=120)
    assert running.returncode == 130 and told == "" and time.monotonic() - started < SOON_S
    assert (
        len(said.splitlines()) == 1
        and "interrupted" in said
        and "of 6 gyros" in said
        and "the same command goes on" in said
    ), said
    assert gone(children) and not list(out.rglob("*.tmp"))
    for path in out.rglob("*.h5"):
        store.read_any(path)
    assert run_lot(lot / "lot.toml", out)["passed"] == 6


def test_what_runs_does_not_run_to_its_end_after_an_interrupt():
    """A task of minutes held an interrupted lot for its whole length."""
    with pytest.raises(KeyboardInterrupt), start_processes(2) as pool:
        task = pool.submit(time.sleep, 10 * SOON_S)
        while not task.running():
            time.sleep(0.01)
        started = time.monotonic()
        raise KeyboardInterrupt
    assert time.monotonic() - started < SOON_S


def test_workers_end_with_a_parent_that_is_killed(lot, tmp_path):
    out = tmp_path / "out"
    running = batch(lot, out, "--jobs", "2", "-q")
    children = wait_for_a_wave(out, running)
    assert len(children) >= 2
    running.kill()
    running.communicate()
    assert gone(children)


def full(task: int) -> int:
    """The second task finds the disk full."""
    if task == 1:
        raise DiskFullError("out.h5: the disk is full")
    time.sleep(0.05)
    return task


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_full_disk_ends_the_lot_and_judges_no_gyro(jobs, lot, tmp_path, monkeypatch):
    with pytest.raises(DiskFullError, match="the disk is full"):
        run_tasks(full, list(range(40)), choose_executor(jobs))
    if jobs == 1:

        def no_room(*arguments, **more):
            raise DiskFullError("x.h5: the disk is full; free space")

        monkeypatch.setattr("hrg_cli.pipeline.run_stage", no_room)
        with pytest.raises(
            DiskFullError,
            match=(
                r"the disk is full.*0 of 6 gyros and 0 of 12 recordings done; the same command"
                r" goes on"
            ),
        ):
            run_lot(lot / "lot.toml", tmp_path / "out")


def test_histories_tell_the_true_time_and_command(lot, tmp_path, monkeypatch):
    """Results of one and two processes differ in the stamp alone; each step is told with its
    command, the lot's file and its settings."""
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    before = store.stamp_now()
    changed = ("demodulate.periods_per_window=2.0", 'recordings="data/g1-*.h5"')
    for jobs in (1, 2):
        run_lot(
            lot / "lot.toml",
            tmp_path / f"{jobs}",
            open_executor=choose_executor(jobs),
            assignments=changed,
        )
    after = store.stamp_now()
    one, two = (
        store.read(tmp_path / f"{jobs}" / "G1" / "resonator.h5", Resonator) for jobs in (1, 2)
    )
    for name, spec in Resonator.columns().items():
        found, other = getattr(one, name), getattr(two, name)
        assert (found == other).all() if spec.dims and found is not None else found == other, name
    assert one.provenance.settings == two.provenance.settings
    for record in (one, two):
        assert before <= record.provenance.created <= after
        steps = [line.split(" ", 3) for line in record.provenance.history]
        assert all(before <= time <= after for time, *_ in steps)
        assert [words.split()[1] for *_, words in steps[:2]] == ["demodulate", "estimate"]
        digest = store.compute_sha256(lot / "lot.toml")
        assert all(
            "hrg batch lot.toml --set demodulate.periods_per_window=2.0" in words
            and digest in words
            for *_, words in steps
        )
        assert not any(
            str(tmp_path) in line or "--jobs" in line for line in record.provenance.history
        )
    assert (tmp_path / "1" / "lot.csv").read_bytes() == (tmp_path / "2" / "lot.csv").read_bytes()


def test_a_scheduler_without_workers_is_said(lot, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr("hrg_cli.executors.WORKERS_S", 1.0)
    monkeypatch.setattr("hrg_cli.executors.LOOK_S", 0.3)
    with (
        distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster,
        contextlib.ExitStack(),
    ):
        started = time.monotonic()
        with pytest.raises(
            HrgError, match=r"has had no worker for 1 s; start one with `dask worker"
        ):
            run_lot(
                lot / "lot.toml",
                tmp_path / "out",
                open_executor=choose_executor(scheduler=cluster.scheduler_address),
            )
        assert time.monotonic() - started < SOON_S


@pytest.mark.slow
def test_a_lot_shared_by_dask_ends_in_silence(lot, tmp_path):
    pytest.importorskip("distributed")
    running = batch(lot, tmp_path / "out", "--jobs", "2", "--dask", "-q")
    told, said = running.communicate(timeout=300)
    assert (running.returncode, told, said) == (0, "", "")
