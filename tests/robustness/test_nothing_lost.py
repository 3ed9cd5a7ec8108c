"""Outputs are whole or absent: under kill -9, on a full disk, with two writers, when a source
changes, with hostile names."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import records_by_hand
from conftest import importing_the_same

from hrg_cli import pipeline, settings, store
from hrg_cli.errors import HrgError
from hrg_cli.records import Periods, Recording

FORK = multiprocessing.get_context("fork")
ROWS = 3000


def stamped(number: int, rows: int = ROWS) -> Periods:
    """Periods whose every value tells which write they are of."""
    one = np.full(rows, float(number))
    return Periods(
        time_s=np.arange(rows) + float(number),
        signals=np.full((rows, 4), float(number)),
        signals_std=np.full((rows, 4), float(number)),
        residual_rms=np.stack([one, one], 1),
        flags=np.zeros(rows, "u1"),
        reference_frequency_hz=float(number) + 1,
        periods_per_window=1.0,
        window_s=1.0,
        mode="free",
        run_id=f"write {number}",
    )


def assert_whole(path: Path) -> int:
    """The number of the one write that all of the file's values are of."""
    record = store.read(path, Periods)
    number = int(record.reference_frequency_hz) - 1
    assert record.run_id == f"write {number}" and len(record) == ROWS
    assert np.all(record.signals == number) and np.all(record.residual_rms == number)
    return number


def write_for_ever(path: Path, first: int) -> None:
    """Replace the output again and again, block by block."""
    for number in range(first, first + 10_000):
        whole = stamped(number)
        store.write(path, whole.blocks(500), force=True)


def kill_at_random(path: Path, tries: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    seen = set()
    started = time.monotonic()
    store.write(path, stamped(0).blocks(500), force=True)
    once = time.monotonic() - started
    for number in range(tries):
        writer = FORK.Process(target=write_for_ever, args=(path, 100 * number))
        writer.start()
        time.sleep(float(rng.uniform(0, 4 * once)))
        os.kill(writer.pid, signal.SIGKILL)
        writer.join()
        if path.exists():
            seen.add(assert_whole(path))
    assert len(seen) > 1, (
        "every writer died before its first file was whole; the kills tested nothing"
    )
    store.write(path, stamped(7), force=True)
    assert sorted(p.name for p in path.parent.iterdir()) == [path.name]


def test_killed_writers_leave_whole_files(tmp_path):
    kill_at_random(tmp_path / "out.h5", 25, 1)


@pytest.mark.slow
def test_hundreds_of_killed_writers_leave_whole_files(tmp_path):
    kill_at_random(tmp_path / "out.h5", 250, 2)


def test_a_killed_command_leaves_nothing(tmp_path):
    store.write(tmp_path / "in.h5", records_by_hand.recording(seconds=30.0, truth=False))
    command = [
        sys.executable,
        "-m",
        "hrg_cli.cli",
        "demodulate",
        str(tmp_path / "in.h5"),
        "-o",
        str(tmp_path / "out.h5"),
        "-q",
    ]
    running = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    for _ in range(600):
        if running.poll() is not None or any(".hrg-" in p.name for p in tmp_path.iterdir()):
            break
        time.sleep(0.01)
    running.kill()
    running.wait()
    if (tmp_path / "out.h5").exists():
        store.read(tmp_path / "out.h5", Periods)
    else:
        assert subprocess.run(command, check=False).returncode == 0
    assert {p.name for p in tmp_path.iterdir()} == {"in.h5", "out.h5"}


def write_once(path: Path, number: int, force: bool, barrier, outcome) -> None:
    record = stamped(number)
    barrier.wait()
    try:
        store.write(path, record.blocks(500), force=force)
        outcome.put(("done", number))
    except HrgError as error:
        outcome.put(("refused", str(error)))


@pytest.mark.parametrize("force", [False, True])
def test_many_writers_of_one_output(tmp_path, force):
    writers = 6
    barrier, outcome = FORK.Barrier(writers), FORK.Queue()
    processes = [
        FORK.Process(target=write_once, args=(tmp_path / "out.h5", k, force, barrier, outcome))
        for k in range(writers)
    ]
    for process in processes:
        process.start()
    answers = [outcome.get(timeout=60) for _ in processes]
    for process in processes:
        process.join()
    winners = [number for result, number in answers if result == "done"]
    assert assert_whole(tmp_path / "out.h5") in winners
    assert len(winners) == (writers if force else 1)
    assert [p.name for p in tmp_path.iterdir()] == ["out.h5"]


def write_with_little_room(
    folder: str, limit: int | None, conclusion: str
) -> subprocess.CompletedProcess:
    """A process that writes a few megabytes, where a file may not grow beyond `limit`."""
    script = f"""
import sys
from robustness import test_nothing_lost as t
from hrg_cli import store
from hrg_cli.errors import HrgError
try:
    store.write({folder!r} + "/out.h5", (t.noise(k) for k in range(40)))
    print("written")
except HrgError as error:
    print(type(error).__name__, error)
    {conclusion}
"""

    def limited() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.run(
        [sys.executable, "-c", script],
        env=importing_the_same(),
        capture_output=True,
        text=True,
        preexec_fn=limited,
        timeout=120,
        check=False,
    )


def noise(seed: int) -> Periods:
    """Rows that do not compress."""
    rng = np.random.default_rng(seed)
    record = stamped(0)
    return record.replace(
        time_s=record.time_s + seed * ROWS,
        signals=rng.standard_normal((ROWS, 4)),
        signals_std=rng.random((ROWS, 4)),
    )


def mount(disk: Path, options: str) -> subprocess.CompletedProcess:
    """Try to put a small disk in memory there."""
    return subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(disk)],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("limit", [3000, 50_000, 1_000_000])
def test_a_file_that_may_not_grow_is_refused_in_words(tmp_path, limit):
    result = write_with_little_room(
        str(tmp_path), limit, "import os; sys.stdout.flush(); os._exit(1)"
    )
    assert result.stdout.startswith("DiskFullError") and "may not grow so large" in result.stdout, (
        result
    )
    assert "Traceback" not in result.stderr
    assert result.returncode == 1 and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("size_kb", [64, 3000, 5500])
def test_a_full_disk_is_said_and_leaves_nothing(tmp_path, size_kb):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = mount(disk, f"size={size_kb}k")
    if mounted.returncode:
        pytest.skip(f"no right to mount a small disk here: {mounted.stderr.strip()}")
    try:
        result = write_with_little_room(
            str(disk), None, "import os; sys.stdout.flush(); os._exit(1)"
        )
        left = list(disk.iterdir())
    finally:
        subprocess.run(["umount", str(disk)], check=True)
    assert result.returncode == 1 and "the disk is full" in result.stdout and left == [], result


def test_a_folder_on_a_read_only_disk(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = mount(disk, "size=1m,ro")
    if mounted.returncode:
        pytest.skip(f"no right to mount a read-only disk here: {mounted.stderr.strip()}")
    try:
        with pytest.raises(HrgError, match="no right to write"):
            store.write(disk / "out.h5", stamped(1))
    finally:
        subprocess.run(["umount", str(disk)], check=True)


CHANGES = {
    "grown": lambda path: path.open("ab").write(b"more"),
    "replaced": lambda path: store.write(path, records_by_hand.recording(seconds=2.0), force=True),
    "removed": lambda path: path.unlink(),
    "cut": lambda path: os.truncate(path, path.stat().st_size // 2),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_source_that_changes_while_it_is_read(change, tmp_path):
    source = tmp_path / "in.h5"
    store.write(source, records_by_hand.recording(seconds=20.0, truth=False))
    values = settings.check_settings(
        pipeline.STAGES["demodulate"].load_function(), {"block_samples": 20_000}
    )
    done = []

    def spoil(share: float | None) -> None:
        if not done:
            done.append(share)
            CHANGES[change](source)

    with pytest.raises(HrgError, match=r"changed while it was read|is damaged"):
        pipeline.run_stage("demodulate", [source], tmp_path / "out.h5", values, progress=spoil)
    assert done and not (tmp_path / "out.h5").exists()
    assert not [p for p in tmp_path.iterdir() if ".hrg-" in p.name]


HOSTILE = (
    "../../escaped",
    "/tmp/escaped-hrg-test",
    "..",
    "a\\b",
    "con\x1b[31m\nline",
    "x" * 400,
    "ün☃ $(touch x)",
)


def inside(folder: Path, before: set[str]) -> None:
    assert {p.name for p in folder.parent.iterdir()} == before
    assert (
        not Path("/tmp/escaped-hrg-test").exists() and not Path("/tmp/escaped-hrg-test.h5").exists()
    )


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_names_stay_inside_the_output_folder(name, hrg, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    recording = tmp_path / "in.h5"
    store.write(
        recording,
        records_by_hand.recording(seconds=1.0).replace(gyro_id=name, run_id=name, lot_id=name),
    )
    before = {p.name for p in tmp_path.iterdir()}
    for command in (
        ["demodulate", recording, "-o", folder / "periods.h5"],
        ["estimate", folder / "periods.h5", "-o", folder / "wave.h5"],
        ["info", folder / "wave.h5"],
        ["report", folder / "wave.h5", "-o", folder / "figures", "--format", "png"],
    )[: 4 if name == HOSTILE[0] else 3]:
        result = hrg(*command)
        assert result.status in (0, 3), result
        assert "\x1b" not in result.out + result.err
    inside(folder, before)


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_runs_of_a_simulation_stay_inside(name, hrg, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    config = tmp_path / "two.toml"
    text = (
        "[device]\nfrequency_hz = 500.0\ntime_constant_s = 2.0\n[recording]\nsample_rate_hz ="
        " 4000.0\nduration_s = 0.2\n"
    )
    config.write_text(text + settings.to_toml({"run": [{"run_id": name}, {"run_id": "other"}]}))
    before = {p.name for p in tmp_path.iterdir()}
    result = hrg("simulate", config, "-o", folder / "run.h5", "--seed", "1")
    assert result.status in (0, 1) and "Traceback" not in result.err, result
    inside(folder, before)
    for path in folder.iterdir():
        assert (
            path.is_file()
            and path.name.startswith("run-")
            and store.read(path, Recording).run_id in (name, "other")
        )


def test_nothing_in_a_file_is_executed(tmp_path):
    """Objects another library would unpickle are opaque bytes here, and links lead nowhere
    outside."""
    path = tmp_path / "in.h5"
    store.write(path, records_by_hand.recording(seconds=1.0))
    other = tmp_path / "other.h5"
    store.write(other, records_by_hand.recording(seconds=1.0))
    for change in (
        lambda f: f["recording"].__setitem__("c", h5py.ExternalLink(str(other), "/recording/c")),
        lambda f: f["recording"].create_dataset(
            "c", shape=(5000,), dtype="i2", external=[("/etc/passwd", 0, 10_000)]
        ),
        lambda f: f["recording"].create_dataset(
            "c", data=np.array([np.void(b"cos\nsystem\n")] * 5000)
        ),
    ):
        with h5py.File(path, "r+") as file:
            units = dict(file["recording/c"].attrs) if "c" in file["recording"] else {}
            del file["recording/c"]
            change(file)
            if isinstance(file["recording"].get("c", getlink=True), h5py.HardLink):
                file["recording/c"].attrs["units"] = units.get("units", "V")
        with pytest.raises(HrgError, match=r"another file|real numbers"):
            store.read(path, Recording)
