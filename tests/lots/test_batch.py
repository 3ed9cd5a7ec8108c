"""Lots: the same bytes for any executor, nothing done twice, killed workers' work done again,
failures kept to their gyro."""

import contextlib
import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from conftest import importing_the_same
from lot_recordings import run_down, split_of

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.executors import InlineExecutor, run_tasks
from hrg_cli.formats.hdf5 import SIGNATURE
from hrg_cli.lots.batch import choose_executor, run_lot
from hrg_cli.lots.lot_settings import LotSettings
from hrg_cli.lots.lot_table import judge_rows
from hrg_cli.lots.lot_tasks import make_safe_name
from hrg_cli.records import Resonator
from hrg_cli.reporting.lot_words import make_sentence

GYROS = 3
CREATED = "2026-01-01T00:00:00Z"


@pytest.fixture(scope="module")
def lot(tmp_path_factory) -> Path:
    """Gyros of two hrg recordings each, one gyro of laboratory logs, one file that was cut off, one
    of which nothing is left."""
    folder = tmp_path_factory.mktemp("lot")
    (folder / "data").mkdir()
    for gyro in range(GYROS):
        for run, theta in enumerate((0.1, 0.6)):
            record = run_down(f"G{gyro}", f"{run}", theta, split_of(gyro), 10 * gyro + run)
            if gyro == 0:
                table = pd.DataFrame({"time": record.times(), "c": record.c, "s": record.s})
                table.to_csv(folder / "data" / f"lab-{run}.csv", index=False)
            else:
                store.write(folder / "data" / f"g{gyro}-{run}.h5", record)
    (folder / "data" / "damaged.h5").write_bytes((folder / "data" / "g1-0.h5").read_bytes()[:9000])
    (folder / "data" / "unknown.h5").write_bytes(SIGNATURE + bytes(4000))
    (folder / "lot.toml").write_text(f"""
lot_id = "L7"
created = "{CREATED}"
recordings = ["data/g*.h5", "data/damaged.h5", "data/unknown.h5"]
stages = ["identify"]

[[gyro]]
gyro_id = "../LAB 0"
recordings = ["data/lab-*.csv"]

[demodulate]
periods_per_window = 2.0

[runs."g2-*".estimate]
start = "closed-form"

[limits.resonator]
status = "any"
frequency_split_rad_s = {{ maximum = 0.375 }}
""")
    return folder


@pytest.fixture(scope="module")
def reference(lot, tmp_path_factory) -> tuple[Path, dict]:
    """The lot done by this process alone."""
    folder = tmp_path_factory.mktemp("reference") / "out"
    return folder, run_lot(lot / "lot.toml", folder)


def content(folder: Path) -> dict[str, str]:
    """Digest of every file."""
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


def test_every_gyro_has_its_row(reference):
    folder, report = reference
    assert report["kind"] == "lot" and report["status"] == "refused"
    rows = {row["gyro_id"]: row for row in report["rows"]}
    assert set(rows) == {"../LAB 0", "G1", "G2", ""}
    for gyro, name in enumerate(("../LAB 0", "G1", "G2")):
        error = rows[name]["frequency_split_rad_s"] - split_of(gyro)
        assert abs(error) < 5 * rows[name]["frequency_split_rad_s_std"]
    assert rows["../LAB 0"]["passed"]
    assert not rows["G1"]["passed"] and "damaged.h5" in rows["G1"]["why"]
    assert not rows["G2"]["passed"] and "at most 0.375 was wanted" in rows["G2"]["why"]
    assert not rows[""]["passed"] and "unknown.h5" in rows[""]["why"]
    said = next(r for r in report["status_reasons"] if r.startswith("G2: "))
    assert "frequency split Δf" in said and "limit ≤ 119.366 mHz" in said, "as the page says it"
    assert "rad_s" not in said and "0.375" not in said
    assert report["recordings"] == 8 and report["recordings_failed"] == 2
    assert [(r["name"], r["gyro_id"]) for r in report["unreadable"]] == [
        ("damaged.h5", "G1"),
        ("unknown.h5", ""),
    ]
    table = pd.read_csv(folder / "lot.csv")
    assert list(table["gyro_id"].fillna("")) == [row["gyro_id"] for row in report["rows"]]
    assert table.loc[1, "frequency_hz"] == report["rows"][1]["frequency_hz"]
    if (folder / "lot.parquet").exists():
        pd.testing.assert_frame_equal(
            pd.read_parquet(folder / "lot.parquet")[["frequency_hz"]].astype(float),
            table[["frequency_hz"]],
        )
    assert str(folder) not in (folder / "lot.csv").read_text()


def test_names_stay_inside_the_folder(reference):
    folder, _ = reference
    assert {p.name for p in folder.iterdir() if p.is_dir()} == {
        make_safe_name("../LAB 0"),
        "G1",
        "G2",
    }
    assert not list(folder.parent.glob("LAB*")) and not list(folder.rglob("*.tmp"))
    for name in ("..", "/etc/passwd", "", "a/b", "x" * 300, "\n"):
        assert (
            "/" not in make_safe_name(name)
            and make_safe_name(name) not in ("", ".", "..")
            and len(make_safe_name(name)) < 80
        )
    assert make_safe_name("a/b") != make_safe_name("a:b")


def test_provenance_leads_back_to_the_recordings(reference, lot):
    folder, _ = reference
    resonator = store.read(folder / "G1" / "resonator.h5", Resonator)
    assert resonator.provenance.created == CREATED
    assert [s.name for s in resonator.provenance.sources] == ["g1-0.wave.h5", "g1-1.wave.h5"]


def test_two_processes_make_the_same_bytes(reference, lot, tmp_path):
    run_lot(lot / "lot.toml", tmp_path / "out", open_executor=choose_executor(2))
    assert content(tmp_path / "out") == content(reference[0])


def test_a_second_time_nothing_is_done_again(reference, lot, monkeypatch):
    folder, report = reference
    before = {p: p.stat().st_mtime_ns for p in folder.rglob("*.h5")}
    monkeypatch.setattr(
        "hrg_cli.pipeline.run_stage", lambda *a, **k: pytest.fail("a stage was run again")
    )
    again = run_lot(lot / "lot.toml", folder)
    assert {k: v for k, v in again.items() if k != "elapsed_s"} == {
        k: v for k, v in report.items() if k != "elapsed_s"
    }
    assert before == {p: p.stat().st_mtime_ns for p in folder.rglob("*.h5")}


def test_only_what_changed_is_done_again(reference, lot, tmp_path, monkeypatch):
    import shutil

    from hrg_cli import pipeline

    folder = tmp_path / "out"
    shutil.copytree(reference[0], folder)
    (folder / "G1" / "g1-0.wave.h5").unlink()
    done: list[tuple[str, str]] = []
    real = pipeline.run_stage

    def watched(name, inputs, output, *rest, **more):
        done.append((name, output.name))
        return real(name, inputs, output, *rest, **more)

    monkeypatch.setattr(pipeline, "run_stage", watched)
    run_lot(lot / "lot.toml", folder)
    assert done == [("demodulate", "g1-0.periods.h5"), ("estimate", "g1-0.wave.h5")]
    assert content(folder) == content(reference[0])
    done.clear()
    run_lot(lot / "lot.toml", folder, assignments=("identify.blocks=100",))
    assert [name for name, _ in done] == ["identify"] * 3


def dies_once(task: tuple[str, int]) -> int:
    """Kills its own process the first time it is asked for 3, and every time for 5."""
    mark, number = task
    if number == 5 or (number == 3 and not Path(mark).exists()):
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2


def test_a_killed_process_harms_only_the_task_that_kills_it(tmp_path):
    tasks = [(str(tmp_path / "mark"), n) for n in range(8)]
    assert run_tasks(dies_once, tasks, choose_executor(2)) == [0, 1, 4, 9, 16, None, 36, 49]


def stamped(task: tuple[str, float]) -> tuple[float, float]:
    """When a task began and ended, on the clock that all processes of a machine share."""
    began = time.monotonic()
    time.sleep(task[1])
    return began, time.monotonic()


def test_what_follows_from_a_task_waits_for_no_other():
    """A quick gyro's own task is done while a slow recording still runs."""
    told: dict[str, tuple[float, float]] = {}

    def then(task: tuple[str, float], result: tuple[float, float]) -> list[tuple[str, float]]:
        told[task[0]] = result
        return [("gyro", 0.0)] if task[0] == "quick" else []

    tasks = [("slow", 3.0), ("quick", 0.0)]
    assert run_tasks(stamped, tasks, choose_executor(2), then=then) == [told["slow"], told["quick"]]
    assert told["gyro"][1] < told["slow"][1]


def test_what_follows_goes_before_what_waits():
    order: list[str] = []

    def work(task: str) -> str:
        order.append(task)
        return task.upper()

    counts: list[int] = []

    def then(task: str, result: str) -> list[str]:
        assert result == task.upper()
        return [task + "1", task + "2"] if len(task) == 1 else []

    assert run_tasks(work, ["a", "b"], choose_executor(1), counts.append, then) == ["A", "B"]
    assert order == ["a", "a1", "a2", "b", "b1", "b2"] and counts == [1, 2, 3, 4, 5, 6]


def test_what_follows_from_a_killed_task_is_done(tmp_path):
    told: dict[int, int | None] = {}

    def then(task: tuple[str, int], result: int | None) -> list[tuple[str, int]]:
        told[task[1]] = result
        return [(task[0], task[1] + 10)] if task[1] < 10 else []

    tasks = [(str(tmp_path / "mark"), n) for n in (2, 3, 5)]
    assert run_tasks(dies_once, tasks, choose_executor(2), then=then) == [4, 9, None]
    assert told == {2: 4, 3: 9, 5: None, 12: 144, 13: 169, 15: 225}


class Counting(InlineExecutor):
    """Counts the tasks that were given to it and not ended yet."""

    room = 3

    def __init__(self) -> None:
        self.waiting: list[tuple[Future, object]] = []
        self.most = 0

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        self.waiting.append((future, fn(*args)))
        self.most = max(self.most, len(self.waiting))
        if len(self.waiting) == self.room:
            ended, result = self.waiting.pop(0)
            ended.set_result(result)
        return future


def test_few_tasks_are_on_their_way_at_a_time(monkeypatch):
    """The parent's memory does not grow with what waits."""
    executor = Counting()
    monkeypatch.setattr("hrg_cli.executors.LOOK_S", 0.01)

    def end_the_rest(count: int) -> None:
        if count > 995:
            while executor.waiting:
                ended, result = executor.waiting.pop(0)
                ended.set_result(result)

    tasks = list(range(1000))
    found = run_tasks(abs, tasks, lambda: contextlib.nullcontext(executor), end_the_rest)
    assert found == tasks and executor.most == 3


BY_ITSELF = 'recordings = "*.h5"\n'
BY_THE_LOT = '[[gyro]]\ngyro_id = "G7"\nrecordings = ["*.h5"]\n'


@pytest.mark.parametrize(
    ("whose", "told_by"),
    [(BY_ITSELF, "its gyro_id can still be read"), (BY_THE_LOT, "by the lot's file")],
)
def test_a_damaged_dataset_is_its_gyros_and_named_unreadable(whose, told_by, tmp_path):
    """Whose a recording is, its attributes tell, or the lot's file; what else is wrong with it, the
    work finds."""
    store.write(tmp_path / "a.h5", run_down("G7", "0", 0.1, 0.3, 0))
    store.write(tmp_path / "b.h5", run_down("G7", "1", 0.6, 0.3, 1))
    with h5py.File(tmp_path / "b.h5", "a") as file:
        del file["recording/s"]
    stages = 'stages = ["identify"]\n'
    (tmp_path / "lot.toml").write_text(stages + whose)
    report = run_lot(tmp_path / "lot.toml", tmp_path / "out")
    assert report["status"] == "refused" and [row["gyro_id"] for row in report["rows"]] == ["G7"]
    row = report["rows"][0]
    assert row["runs"] == 2 and row["runs_failed"] == 1 and "frequency_split_rad_s" in row
    lost = report["unreadable"]
    assert [(r["name"], r["gyro_id"]) for r in lost] == [("b.h5", "G7")]
    assert "recording/s is missing" in lost[0]["error"] and lost[0]["told_by"] == told_by
    assert (told_by in lost[0]["error"]) is (whose is BY_ITSELF)  # what was asked for goes unsaid


def started(*arguments: str) -> subprocess.Popen[bytes]:
    environment = importing_the_same() | {"OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", f"distributed.cli.{arguments[0]}", *arguments[1:]]
    return subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)


@pytest.fixture
def cluster(tmp_path):
    """Address of a scheduler with two workers, and these."""
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    processes = [
        started(
            "dask_scheduler",
            "--port",
            "0",
            "--host",
            "127.0.0.1",
            "--no-dashboard",
            "--scheduler-file",
            str(file),
        )
    ]
    try:
        deadline = time.monotonic() + 30
        while not file.exists() or not file.read_text():
            assert time.monotonic() < deadline, "the scheduler did not start"
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        options = (
            "--no-nanny",
            "--nthreads",
            "1",
            "--no-dashboard",
            "--local-directory",
            str(tmp_path),
        )
        processes += [started("dask_worker", address, *options) for _ in range(2)]
        yield address, processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_cluster_that_loses_a_worker_makes_the_same_bytes(reference, lot, tmp_path, cluster):
    address, workers = cluster
    out = tmp_path / "out"
    deadline = time.monotonic() + 30

    def kill_one() -> None:
        while not list(out.rglob("*.periods.h5")) and time.monotonic() < deadline:
            time.sleep(0.01)
        workers[0].send_signal(signal.SIGKILL)

    killer = threading.Thread(target=kill_one)
    killer.start()
    run_lot(lot / "lot.toml", out, open_executor=choose_executor(2, scheduler=address))
    killer.join()
    assert workers[0].wait(10) == -signal.SIGKILL and workers[1].poll() is None
    assert content(out) == content(reference[0])


def interrupted(program: str, out: Path) -> None:
    """Run a program and kill it when the first wave is written."""
    child = subprocess.Popen([sys.executable, "-c", program], env=importing_the_same())
    while not list(out.rglob("*.wave.h5")) and child.poll() is None:
        time.sleep(0.01)
    child.kill()
    assert child.wait() == -signal.SIGKILL, "the program ended before it could be killed"


def test_a_cluster_whose_client_is_killed_takes_the_lot_up_again(reference, lot, tmp_path, cluster):
    out = tmp_path / "out"
    program = (
        f"from hrg_cli.lots.batch import choose_executor, run_lot; run_lot({str(lot / 'lot.toml')!r},"
        f" {str(out)!r}, open_executor=choose_executor(2, scheduler={cluster[0]!r}))"
    )
    interrupted(program, out)
    run_lot(lot / "lot.toml", out, open_executor=choose_executor(2, scheduler=cluster[0]))
    assert content(out) == content(reference[0])


def test_an_interrupted_lot_is_resumed(reference, lot, tmp_path):
    out = tmp_path / "out"
    interrupted(
        f"from hrg_cli.lots.batch import run_lot; run_lot({str(lot / 'lot.toml')!r}, {str(out)!r})",
        out,
    )
    run_lot(lot / "lot.toml", out)
    assert content(out) == content(reference[0])


def test_a_scheduler_that_is_not_there_is_named(lot, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("hrg_cli.executors.CONNECT_S", 1)
    with pytest.raises(HrgError, match="no Dask scheduler answers"):
        run_lot(
            lot / "lot.toml",
            tmp_path / "out",
            open_executor=choose_executor(scheduler="tcp://127.0.0.1:9"),
        )


def test_two_programs_do_not_work_on_one_lot(lot, tmp_path):
    from hrg_cli.lots.lot_folder import hold_as_only_writer

    (tmp_path / "out").mkdir()
    with (
        hold_as_only_writer(tmp_path / "out"),
        pytest.raises(HrgError, match="another program works on this lot"),
    ):
        run_lot(lot / "lot.toml", tmp_path / "out")


WRONG = {
    "unknown key": ("recordings = 'data/*.h5'\nlimit = 3\n", "unknown key limit"),
    "unknown setting": (
        "recordings = 'data/*.h5'\n[demodulate]\nperiod = 3\n",
        "unknown key demodulate.period",
    ),
    "wrong value": (
        "recordings = 'data/*.h5'\n[runs.x.demodulate]\nperiods_per_window = -1\n",
        "demodulate.periods_per_window",
    ),
    "nothing named": ("lot_id = 'x'\n", "names no recordings"),
    "no such file": ("recordings = 'nothing/*.h5'\n", "no file fits"),
    "unknown stage": ("recordings = 'data/*.h5'\nstages = ['guess']\n", "stages"),
    "not TOML": ("recordings = [\n", "is not TOML"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_lot_is_one_sentence(lot, tmp_path, name):
    text, expected = WRONG[name]
    path = lot / f"wrong-{name.replace(' ', '-')}.toml"
    path.write_text(text)
    with pytest.raises(HrgError) as error:
        run_lot(path, tmp_path / "out")
    assert expected in str(error.value) and not (tmp_path / "out").exists()


def test_a_folder_of_something_else_is_refused(lot, tmp_path):
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(HrgError, match="not of a lot"):
        run_lot(lot / "lot.toml", tmp_path)


def test_outliers_stand_out_of_the_lot():
    rng = np.random.default_rng(0)
    values = 5000 + rng.normal(0, 2.0, 20)
    values[7] += 40
    identified = [
        {"status": "valid", "parameters": {"frequency_hz": {"value": v, "std": 0.1}}}
        for v in values.tolist()
    ]
    gyros = [
        {"gyro_id": f"{i}", "status": "valid", "results": {"identify": result}}
        for i, result in enumerate(identified)
    ]
    rows = judge_rows(LotSettings(recordings=["x"]), [], gyros)
    assert [row["gyro_id"] for row in rows if row["outliers"]] == ["7"]
    z = np.array([row["frequency_hz_z"] for row in rows])
    spread = 1.4826 * np.median(abs(values - np.median(values)))
    np.testing.assert_allclose(z[7], (values[7] - np.median(values)) / spread)
    assert not any(
        row["outliers"] for row in judge_rows(LotSettings(recordings=["x"]), [], gyros[:4])
    )


def test_a_diagnosis_own_values_go_before_the_linear_fit():
    """A row has the parameters of one model: the extended one where the gyro has a diagnosis; what
    that only assumed is left out."""
    linear = {
        "frequency_hz": {"value": 5000.0, "std": 0.1},
        "scale_factor": {"value": 0.5, "std": 0.1},
    }
    extended = [
        {"name": "frequency_hz", "value": 5001.0, "std": 0.01},
        {"name": "scale_factor", "value": 0.554, "std": 0.0, "assumed": True},
    ]
    results = {"identify": {"status": "valid", "parameters": linear}}
    gyros = [
        {"gyro_id": "a", "status": "valid", "results": results},
        {
            "gyro_id": "b",
            "status": "valid",
            "results": results | {"diagnose": {"status": "valid", "values": extended}},
        },
    ]
    a, b = judge_rows(LotSettings(recordings=["x"]), [], gyros)
    assert (a["frequency_hz"], a["scale_factor"]) == (5000.0, 0.5)
    assert (b["frequency_hz"], b["frequency_hz_std"], b["scale_factor"]) == (5001.0, 0.01, None)


def identified(values, std):
    """Results of gyros whose scale factor is one of these values."""
    return [
        {
            "gyro_id": f"{k}",
            "status": "valid",
            "results": {
                "identify": {
                    "status": "valid",
                    "parameters": {"scale_factor": {"value": float(v), "std": std}},
                }
            },
        }
        for k, v in enumerate(values)
    ]


def test_a_gyro_of_wide_sigma_stands_out_all_the_same():
    """K 17 robust σ off the lot, of a gyro that does not know it well."""
    rng = np.random.default_rng(3)
    values = 0.554 + 1e-4 * rng.standard_normal(40)
    values[11] += 17e-4
    gyros = identified(values, 1e-5)
    gyros[11]["results"]["identify"]["parameters"]["scale_factor"]["std"] = 6e-4
    rows = judge_rows(LotSettings(recordings=["x"]), [], gyros)
    assert [row["gyro_id"] for row in rows if row["outliers"]] == ["11"]
    assert next(row["rank"] for row in rows if row["gyro_id"] == "11") == 1


def test_a_gyro_that_its_own_sigma_holds_within_the_lot_does_not_stand_off():
    """13 robust σ off and a third of its own: the gyro is badly measured, which is no distance."""
    values = 0.554 + 1e-4 * np.random.default_rng(3).standard_normal(40)
    values[11] += 13e-4
    gyros = identified(values, 1e-5)
    gyros[11]["results"]["identify"]["parameters"]["scale_factor"]["std"] = 40e-4
    assert not any(row["outliers"] for row in judge_rows(LotSettings(recordings=["x"]), [], gyros))


def test_the_distance_of_a_damping_is_told_of_the_damping():
    """ν below the lot's is a decay time above it."""
    values = 0.4 + 1e-5 * np.random.default_rng(5).standard_normal(12)
    values[3] -= 1e-3
    gyros = identified(values, 1e-6)
    for gyro in gyros:
        result = gyro["results"]["identify"]
        result["parameters"] = {"damping_rate_1_s": result["parameters"].pop("scale_factor")}
    row = judge_rows(LotSettings(recordings=["x"]), [], gyros)[3]
    assert row["reason"].startswith("damping rate ν −")


@pytest.mark.parametrize("count", [8, 40, 200])
def test_clean_lots_have_outliers_at_the_stated_rate(count):
    """At most `outlier_rate` of lots of normal values; 300 lots: 5 % are 15 ± 3.8."""
    rng = np.random.default_rng(count)
    lot = LotSettings(recordings=["x"], outlier_rate=0.05)
    false = sum(
        any(row["outliers"] for row in judge_rows(lot, [], identified(values, 1e-9)))
        for values in rng.standard_normal((300, count))
    )
    assert false <= 15 + 4 * 3.8


def outliers_of(values):
    rows = judge_rows(LotSettings(recordings=["x"]), [], identified(values, 0.0))
    return [row["gyro_id"] for row in rows if row["outliers"]]


def test_gyros_that_were_given_a_value_do_not_stand_out_by_rounding():
    """The last digits of a value that is held are no spread; another value stands out against it."""
    digits = np.random.default_rng(2).integers(-2, 3, 12)
    digits[3] = 60
    assert outliers_of(0.554 * (1 + digits * np.finfo(float).eps)) == []
    held = np.full(12, 0.554)
    held[3] = np.nextafter(0.554, 1)
    assert outliers_of(held) == []
    held[7] = 0.5541
    assert outliers_of(held) == ["7"]


def test_four_gyros_have_no_common_value_to_stand_out_of():
    values = np.array([1.0, 1.001, 0.999, 1.002, 0.9985, 1e6])
    assert outliers_of(values) == ["5"]
    assert outliers_of(values[2:]) == []


@pytest.mark.parametrize(("wanted", "passed"), [("", False), ('status = "suspect"', True)])
def test_a_gyro_whose_result_is_suspect_passes_only_where_the_lot_says_so(tmp_path, wanted, passed):
    """The valid status that `hrg check` wants where nothing is said holds for a lot without a table
    of limits too."""
    for run, split in enumerate((0.30, 0.303)):  # rad/s: two gyros under one name
        store.write(tmp_path / f"{run}.h5", run_down("G", f"{run}", 0.1 + run, split, run))
    limits = f"[limits.resonator]\n{wanted}\n" if wanted else ""
    (tmp_path / "lot.toml").write_text(f"recordings = '*.h5'\nstages = ['identify']\n{limits}")
    report = run_lot(tmp_path / "lot.toml", tmp_path / "out")
    row = report["rows"][0]
    assert row["status"] == "suspect" and row["chi2_per_dof"] > 1.2
    assert row["passed"] is passed and report["passed"] == passed
    assert report["status"] == ("suspect" if passed else "refused")
    if not passed:
        assert row["why"].startswith("identify is suspect: ") and row["why"] in row["reason"]


def test_samples_that_two_gyros_share_pass_neither(tmp_path):
    """A recording copied under another gyro's name: both were valid, equal to the last digit, and
    counted twice in the lot."""
    for gyro, seed in (("A", 0), ("B", 10), ("copy", 0)):
        for run, theta in enumerate((0.1, 0.6)):
            record = run_down(gyro, f"{run}", theta, 0.3 + 0.01 * (gyro == "B"), seed + run)
            store.write(tmp_path / f"{gyro}-{run}.h5", record)
    (tmp_path / "lot.toml").write_text("recordings = '*.h5'\nstages = ['identify']\n")
    report = run_lot(tmp_path / "lot.toml", tmp_path / "out")
    rows = {row["gyro_id"]: row for row in report["rows"]}
    assert report["status"] == "refused"
    assert rows["B"]["passed"] and not rows["A"]["passed"] and not rows["copy"]["passed"]
    assert "copy-0: holds the samples of A's A-0;" in rows["copy"]["why"]


def test_a_lot_says_which_forced_runs_no_diagnosis_took(tmp_path):
    """Two free runs of a gyro are diagnosed, a run that calibrate works on is not."""
    for run, mode in enumerate(("free", "free", "forced")):
        record = run_down("G1", f"{run}", 0.1 + 0.4 * run, split_of(1), run)
        store.write(tmp_path / f"{mode}-{run}.h5", record.replace(mode=mode))
    (tmp_path / "lot.toml").write_text(
        'recordings = "*.h5"\nstages = ["identify", "calibrate", "diagnose"]\n'
        "[demodulate]\nperiods_per_window = 2.0\n"
    )
    report = run_lot(tmp_path / "lot.toml", tmp_path / "out")
    (row,) = report["rows"]
    assert row["verdict"] and row["runs"] == 3
    assert row["runs_undiagnosed"] == report["runs_undiagnosed"] == 1
    assert "1 forced run is in none; hrg diagnose" in make_sentence(report)
