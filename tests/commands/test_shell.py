"""The shell: pipes by temporary names, export of every kind, `hrg run` on a folder that resumes,
refuses mixed gyros and tells its plan."""

import gzip
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
import records_by_hand as by_hand
from conftest import PACKAGE, ringing

from hrg_cli import store
from hrg_cli.records import Recording, Resonator, Wave

ROOT = Path(__file__).parent.parent.parent
SAMPLE = sorted((ROOT / "sample_data").glob("free-*.h5"))[:2]


def bash(line, folder, **more):
    """A line of shell with `hrg` in it."""
    (folder / "bin").mkdir(exist_ok=True)
    tool = folder / "bin" / "hrg"
    tool.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m hrg_cli.cli "$@"\n')
    tool.chmod(0o755)
    environment = (
        os.environ
        | {
            "PYTHONPATH": str(PACKAGE),
            "PATH": f"{tool.parent}:{os.environ['PATH']}",
            "TMPDIR": str(folder / "tmp"),
        }
        | more
    )
    (folder / "tmp").mkdir(exist_ok=True)
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", line],
        cwd=folder,
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )


def test_pipes_hand_on_names(tmp_path):
    store.write(tmp_path / "r.h5", ringing())
    done = bash("hrg demodulate r.h5 -o - -q | hrg estimate - -o w.h5 -q", tmp_path)
    assert done.returncode == 0, done.stderr
    assert len(store.read(tmp_path / "w.h5", Wave)) > 10 and not list(
        (tmp_path / "tmp").iterdir()
    ), "nothing is left behind"
    named = bash("hrg demodulate r.h5 -o -", tmp_path)
    name = Path(named.stdout.strip())
    assert name.exists() and name.parent == tmp_path / "tmp" and named.stdout.count("\n") == 1


def test_a_broken_pipe_of_commands_is_an_error(tmp_path):
    done = bash("hrg demodulate missing.h5 -o - | hrg estimate - -o w.h5", tmp_path)
    assert (
        done.returncode == 1
        and "nothing came through the pipe" in done.stderr
        and not (tmp_path / "w.h5").exists()
    )


def test_own_files_named_through_a_pipe_stay(tmp_path):
    store.write(tmp_path / "r.h5", ringing())
    assert (
        bash("echo r.h5 | hrg info - -q", tmp_path).returncode == 0 and (tmp_path / "r.h5").exists()
    )


def test_pipes_that_make_no_sense(hrg, tmp_path):
    store.write(tmp_path / "r.h5", ringing())
    for command in (
        ("demodulate", tmp_path / "r.h5", "-o", "-", "--json"),
        ("report", tmp_path / "r.h5", "-o", "-"),
    ):
        assert hrg(*command).status == 2


@pytest.fixture(scope="module")
def kinds(tmp_path_factory):
    return by_hand.write_all(tmp_path_factory.mktemp("kinds"))


@pytest.mark.parametrize(
    "suffix", [".csv", ".csv.gz", ".json", ".json.gz", ".parquet", ".xlsx", ".mat"]
)
def test_every_kind_is_exported(hrg, kinds, tmp_path, suffix):
    """Row for row the same numbers come back from every format."""
    pd = pytest.importorskip("pandas")
    if suffix == ".xlsx":
        pytest.importorskip("openpyxl")
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    for path in kinds:
        output = tmp_path / f"{path.stem}{suffix}"
        done = hrg("export", path, "-o", output)
        assert done.status == 0 and output.stat().st_size > 50, (path, done.err)
    wave = store.read(kinds[2], Wave)
    output = tmp_path / f"wave{suffix}"
    if suffix.startswith(".csv"):
        back = pd.read_csv(output)["wave_angle_rad"].to_numpy()
    elif suffix.startswith(".json"):
        text = (
            gzip.decompress(output.read_bytes()) if suffix.endswith(".gz") else output.read_bytes()
        )
        back = np.array(json.loads(text)["columns"]["wave_angle_rad"], float)
    elif suffix == ".parquet":
        back = pd.read_parquet(output)["wave_angle_rad"].to_numpy()
    elif suffix == ".xlsx":
        back = pd.read_excel(output, sheet_name="wave")["wave_angle_rad"].to_numpy()
    else:
        from scipy.io import loadmat

        back = loadmat(output, simplify_cells=True)["wave"]["wave_angle_rad"]
    assert back == pytest.approx(np.asarray(wave.wave_angle_rad), rel=1e-12, nan_ok=True)


def test_exports_that_cannot_be(hrg, kinds, tmp_path):
    for name in ("a.h", "a.doc", "a.parquet.gz"):
        done = hrg("export", kinds[2], "-o", tmp_path / name)
        assert done.status == 2 and not (tmp_path / name).exists(), done.err


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("gyro") / "recordings"
    folder.mkdir()
    for path in SAMPLE:
        shutil.copy(path, folder)
    return folder


FEW = ("--set", "demodulate.periods_per_window=20", "--set", "diagnose.most_effects=1")


def test_what_a_run_would_do_can_be_done_by_hand(hrg, recordings, tmp_path):
    """Its lines named files by themselves, which no shell finds, and left the settings out."""
    out, config = tmp_path / "by hand", tmp_path / "chain.toml"
    config.write_text("[demodulate]\nperiods_per_window = 20\n")
    planned = hrg("run", recordings, "-o", out, "--config", config, "--dry-run")
    assert planned.status == 0 and not out.exists()
    steps = [shlex.split(line) for line in planned.out.splitlines()]
    assert "--model" in steps[-1] and steps[-1][1] == "diagnose"
    assert hrg(*steps[-1][1:], "--show-config").status == 0, "its options are the command's"
    out.mkdir()
    for _, *words in steps[:-1]:
        assert hrg(*words).status == 0, words
    assert store.read(out / "resonator.h5", Resonator).gyro_id
    times = store.read(out / "free-1.wave.h5", Wave).time_s
    assert np.median(np.diff(times)) == pytest.approx(20 / 1003.7, rel=0.01)


def test_run_takes_a_folder_and_resumes(hrg, recordings, tmp_path):
    out = tmp_path / "out"
    first = hrg("run", recordings, "-o", out, *FEW, "--json")
    assert first.status in (0, 3) and (out / "diagnosis.extended_resonator.h5").exists(), first.err
    assert first.json["answer"]["sentence"] and "<svg" in (out / "report.html").read_text()
    before = {p.name: p.stat().st_mtime_ns for p in out.glob("*.h5")}
    again = hrg("run", recordings, "-o", out, *FEW, "--json")
    assert {p.name: p.stat().st_mtime_ns for p in out.glob("*.h5")} == before, (
        "nothing is made twice"
    )
    assert [s["status"] for s in again.json["steps"]] == [s["status"] for s in first.json["steps"]]
    (out / "free-1.wave.h5").write_bytes(b"somebody else's")
    refused = hrg("run", recordings, "-o", out, *FEW)
    assert (
        refused.status == 3
        and "free-1.wave.h5" in refused.err
        and (out / "free-1.wave.h5").read_bytes() == b"somebody else's"
    )


def test_run_refuses_mixed_gyros(hrg, tmp_path):
    for gyro in "AB":
        with store.open_record(SAMPLE[0], Recording) as record:
            store.write(
                tmp_path / f"{gyro}.h5",
                record.replace(gyro_id=gyro, c=record.c[:1000], s=record.s[:1000]),
            )
    done = hrg("run", tmp_path, "-o", tmp_path / "out")
    assert done.status == 1 and "is of gyro B" in done.err and not (tmp_path / "out").exists()


def test_run_tells_a_reason_once():
    from hrg_cli.chain import Step
    from hrg_cli.commands.run import list_reasons

    steps = [
        Step("estimate", (f"{k}.periods.h5",), f"{k}.wave.h5", "suspect", ("windows too long",))
        for k in range(12)
    ]
    inherited = (
        *(f"{k}.wave.h5 is suspect: windows too long" for k in range(6)),
        "6 more inputs are suspect or refused",
    )
    steps.append(Step("identify", (), "resonator.h5", "suspect", (*inherited, "its own doubt")))
    assert list_reasons(steps) == [
        "0.wave.h5 and 11 more: windows too long",
        "resonator.h5: its own doubt",
    ]


def test_temporary_folder_is_the_system_s():
    assert tempfile.gettempdir()
