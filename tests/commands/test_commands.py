"""Commands on small data: the whole chain, lots, the shell (completion, colour, pipes, standard
input), options that act."""

import csv
import json
import os
import pty
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import typer.main
from conftest import PACKAGE, ringing
from file_digests import rows
from forced_runs import Truth, programme

from docs.handbook.man_page import list_commands
from hrg_cli import store
from hrg_cli.chain import Step
from hrg_cli.cli import app
from hrg_cli.commands.run import _list_shown
from hrg_cli.gyro import Input, run_gyro
from hrg_cli.records import Recording
from hrg_cli.stages.calibrate import calibrate

ROOT = Path(__file__).parent.parent.parent
SAMPLE = sorted((ROOT / "sample_data").glob("free-*.h5"))[:2]
FEW_WINDOWS = ("--set", "demodulate.periods_per_window=20", "--set", "diagnose.most_effects=1")
COMMANDS = list_commands(typer.main.get_command(app))


def shell(*arguments, stdin=None, **environment):
    """`hrg` in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "hrg_cli.cli", *map(str, arguments)],
        input=stdin,
        capture_output=True,
        env=os.environ | {"PYTHONPATH": str(PACKAGE)} | environment,
        check=False,
    )


# The whole chain


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """`hrg run` on two recordings and a foreign log that is no log."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "notes.csv").write_text("nothing,here\nat,all\n")
    done = shell(
        "run",
        *SAMPLE,
        folder / "notes.csv",
        "-o",
        folder / "out",
        "--json",
        "--seed",
        5,
        *FEW_WINDOWS,
    )
    return folder, done


def test_run_makes_every_step_and_a_page(ran):
    folder, done = ran
    report = json.loads(done.stdout)
    assert done.returncode == 3 and report["status"] == "refused", (
        "a recording that failed is not hidden"
    )
    by_output = {step["output"]: step for step in report["steps"]}
    for path in SAMPLE:
        assert by_output[f"{path.stem}.wave.h5"]["status"] == "valid"
    assert (
        by_output["resonator.h5"]["name"] == "identify"
        and by_output["resonator.h5"]["status"] != "failed"
    )
    assert (
        by_output["notes.recording.h5"]["status"] == "failed"
        and "notes.csv" in by_output["notes.recording.h5"]["reasons"][0]
    )
    assert not (folder / "out" / "notes.recording.h5").exists()
    assert "<svg" in (folder / "out" / "report.html").read_text()
    assert "seed = 5" in store.read_any(folder / "out" / "resonator.h5").provenance.settings
    assert set(report["steps"][0]) == {
        "name",
        "inputs",
        "output",
        "status",
        "reasons",
        "json",
        "checks",
    }


def test_run_shares_recordings_among_processes(tmp_path):
    """The same steps, in the same order, and the same rows from two processes as from one; a
    damaged recording stops neither."""
    paths = [tmp_path / f"r{k}.h5" for k in range(3)]
    for k, path in enumerate(paths):
        store.write(path, ringing(mode="forced", seed=k, run_id=str(k)))
    paths[1].write_bytes(paths[1].read_bytes()[:3000])
    made = {}
    for jobs in (1, 2):
        (tmp_path / f"out{jobs}").mkdir()
        steps = run_gyro(paths, tmp_path / f"out{jobs}", jobs=jobs)
        made[jobs] = [
            (step.name, step.inputs, step.output, step.status, step.reasons) for step in steps
        ]
    assert made[1] == made[2] and [step[3] for step in made[1][:5]] == [
        "valid",
        "valid",
        "failed",
        "valid",
        "valid",
    ]
    assert rows(tmp_path / "out1") == rows(tmp_path / "out2") and len(rows(tmp_path / "out1")) == 2


def test_run_says_that_forced_runs_beside_free_ones_are_not_diagnosed(tmp_path):
    """Nothing told that twelve of sixteen runs were not in the diagnosis."""
    free, forced = [tmp_path / f"{mode}.h5" for mode in ("free", "forced")]
    for path in (free, forced):
        store.write(path, ringing(mode=path.stem, run_id=path.stem))
    done = shell("run", free, forced, "-o", tmp_path / "out", *FEW_WINDOWS)
    report = json.loads((tmp_path / "out" / "run.json").read_text())
    assert report["undiagnosed"] == ["forced.wave.h5"]
    told = (done.stdout + done.stderr).decode()
    assert "with the 1 forced run it may take" in told
    assert f"hrg diagnose {tmp_path}/out/*.wave.h5 -o" in told


def recordings_of_one_gyro(folder, count=3):
    folder.mkdir()
    paths = [folder / f"r{k}.h5" for k in range(count)]
    for k, path in enumerate(paths):
        store.write(path, ringing(mode="forced", seed=k, run_id=str(k)))
    return paths


def test_run_opens_every_recording_before_any_work(hrg, tmp_path):
    """A truncated one ended it after 70 % of the work."""
    paths = recordings_of_one_gyro(tmp_path / "in")
    for path in paths[1:]:
        path.write_bytes(path.read_bytes()[:3000])
    told = hrg("run", tmp_path / "in", "-o", tmp_path / "out")
    assert told.status == 1 and not (tmp_path / "out").exists()
    assert "r1.h5: is truncated (3000 bytes are there)" in told.err
    assert "nor can these be read: r2.h5" in told.err


def test_a_recording_that_a_step_fails_on_is_not_asked_for_on_the_page(tmp_path):
    """The page read it again, and the run ended with 1 and no report of the others."""
    paths = recordings_of_one_gyro(tmp_path / "in", 2)
    steps = [
        Step("demodulate", ("r0.h5",), "r0.periods.h5", "failed", ("r0.h5: c is damaged",)),
        Step("demodulate", ("r1.h5",), "r1.periods.h5", "valid"),
    ]
    assert _list_shown([Input(path, path.stem) for path in paths], steps) == paths[1:]


def test_run_refuses_what_it_cannot_know(hrg, tmp_path):
    assert hrg("run", "-o", tmp_path / "out").status == 2
    assert hrg("run", SAMPLE[0]).status == 2
    wrong = hrg("run", SAMPLE[0], "-o", tmp_path / "out", "--set", "demodulat.periods_per_window=2")
    assert wrong.status == 1 and "demodulat" in wrong.err and not (tmp_path / "out").exists()
    missing = hrg("run", tmp_path / "missing.h5", "-o", tmp_path / "out")
    assert missing.status == 1 and "no such file" in missing.err
    shown = hrg("run", "--show-config", "--seed", 9, "--set", "demodulate.periods_per_window=3")
    tables = tomllib.loads(shown.out)
    assert tables["identify"]["seed"] == 9 and tables["demodulate"]["periods_per_window"] == 3
    (tmp_path / "same.toml").write_text(shown.out)
    assert hrg("run", "--show-config", "--config", tmp_path / "same.toml").out == shown.out


# Lots


@pytest.fixture(scope="module")
def lot(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lot")
    for gyro in ("A", "B"):
        for k, path in enumerate(SAMPLE):
            with store.open_record(path, Recording) as record:
                store.write(
                    folder / f"{gyro}-{k}.h5",
                    record.replace(gyro_id=gyro, c=record.c[:], s=record.s[:]),
                )
    (folder / "lot.toml").write_text(
        'lot_id = "L"\nrecordings = "*.h5"\nstages = ["identify"]\n[limits.resonator]\nscale_factor'
        " = 0.1\n"
    )
    done = shell("batch", folder / "lot.toml", "-o", folder / "out", "--json")
    return folder, done


def test_batch_tells_every_gyro(lot):
    folder, done = lot
    report = json.loads(done.stdout)
    assert done.returncode == 3 and report["status"] == "refused", (
        "no gyro is within a limit that none can hold"
    )
    assert {row["gyro_id"] for row in report["rows"]} == {"A", "B"} and not any(
        row["passed"] for row in report["rows"]
    )
    with open(folder / "out" / "lot.csv", encoding="utf-8") as table:
        assert [row["gyro_id"] for row in csv.DictReader(table)] == ["A", "B"]
    page = (folder / "out" / "lot.html").read_text()
    assert (
        'href="./A/report.html"' in page
        and (folder / "out" / "A" / "report.html").exists()
        and "scale factor K " in page
        and "limit ≤ 0.1" in page
    )


def test_batch_settings(lot, hrg, tmp_path):
    """--config is put over the lot's file, --set and --seed over both; what --show-config prints is
    the same lot again."""
    folder, _ = lot
    (tmp_path / "over.toml").write_text(
        "[batch.limits.resonator]\nscale_factor = 0.9\n[batch.demodulate]\nperiods_per_window ="
        " 2.0\n"
    )
    shown = hrg(
        "batch",
        folder / "lot.toml",
        "--config",
        tmp_path / "over.toml",
        "--set",
        "outlier_z=5",
        "--seed",
        3,
        "--show-config",
    )
    tree = tomllib.loads(shown.out)["batch"]
    assert (
        tree["limits"]["resonator"]["scale_factor"] == 0.9
        and tree["demodulate"]["periods_per_window"] == 2
    )
    assert tree["outlier_z"] == 5 and tree["identify"]["seed"] == 3 and tree["lot_id"] == "L"
    (tmp_path / "whole.toml").write_text(shown.out)
    again = hrg(
        "batch", folder / "lot.toml", "--config", tmp_path / "whole.toml", "--show-config", "--json"
    )
    assert again.json["batch"] == tree
    wrong = hrg("batch", folder / "lot.toml", "-o", tmp_path / "out", "--set", "outlier=5")
    assert wrong.status == 1 and "outlier_z" in wrong.err and not (tmp_path / "out").exists()


# The shell


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("hrg ide", {"identify"}),
        ("hrg demodulate --periods", {"--periods-per-window"}),
        ("hrg effects gain_m", {"gain_mismatch"}),
        ("hrg study red", {"redundancy"}),
    ],
)
def test_completion_of_bash(words, offered):
    done = shell(
        _HRG_COMPLETE="complete_bash", COMP_WORDS=words, COMP_CWORD=str(len(words.split()) - 1)
    )
    assert (
        done.returncode == 0 and set(done.stdout.decode().split()) == offered and done.stderr == b""
    )


def test_completion_script_is_bash(tmp_path):
    script = shell(_HRG_COMPLETE="source_bash").stdout
    assert b"complete" in script and b"_HRG_COMPLETE=complete_bash" in script
    if shutil.which("bash"):
        assert subprocess.run(["bash", "-n"], input=script, check=False).returncode == 0


def on_terminal(*arguments, **environment):
    """What `hrg` writes when standard output and error are a terminal."""
    ours, theirs = pty.openpty()
    given = (
        {k: v for k, v in os.environ.items() if k != "NO_COLOR"}
        | {"PYTHONPATH": str(PACKAGE), "TERM": "xterm-256color"}
        | environment
    )
    child = subprocess.Popen(
        [sys.executable, "-m", "hrg_cli.cli", *map(str, arguments)],
        stdout=theirs,
        stderr=theirs,
        env=given,
    )
    os.close(theirs)
    text = b""
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:
            break
        if not part:
            break
        text += part
    os.close(ours)
    assert child.wait(60) == 0
    return text


def test_no_colour_when_it_is_not_wanted(tmp_path):
    store.write(tmp_path / "a.h5", ringing(seconds=1.0))
    text = on_terminal("demodulate", tmp_path / "a.h5", "-o", tmp_path / "p.h5", NO_COLOR="1")
    assert b"demodulate" in text and b"periods, valid" in text
    codes = [
        code
        for part in text.split(b"\x1b[")[1:]
        for code in [part.split(b"m")[0]]
        if code.replace(b";", b"").isdigit()
    ]
    assert not [
        code
        for code in codes
        if any(30 <= int(n) <= 49 or int(n) >= 90 for n in code.split(b";") if n)
    ], codes


def test_plain_lines_when_piped(tmp_path):
    store.write(tmp_path / "a.h5", ringing(seconds=1.0))
    done = shell("demodulate", tmp_path / "a.h5", "-o", tmp_path / "p.h5")
    assert (
        done.returncode == 0
        and b"\x1b" not in done.stdout + done.stderr
        and b"\r" not in done.stdout + done.stderr
    )
    info = shell("info", tmp_path / "p.h5")
    assert info.returncode == 0 and b"\x1b" not in info.stdout and info.stderr == b""


@pytest.mark.parametrize(
    "command",
    [("info", "a.h5"), ("effects",), ("info", "a.h5", "--json"), ("demodulate", "--show-config")],
)
def test_closed_pipe_is_quiet(command, tmp_path):
    """A reader that left before anything was written: no message, no failure."""
    store.write(tmp_path / "a.h5", ringing())
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-m", "hrg_cli.cli", *command],
        cwd=tmp_path,
        stdout=writing,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(PACKAGE)},
        check=False,
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


def test_closed_pipe_keeps_the_verdict(tmp_path):
    """The exit status tells the result's validity even when nobody reads what is printed."""
    store.write(tmp_path / "a.h5", ringing().judged(["doubted"], "refused"))
    (tmp_path / "limits.toml").write_text('rows = 1\nstatus = "any"\n')
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "hrg_cli.cli",
            "check",
            tmp_path / "a.h5",
            "--limits",
            tmp_path / "limits.toml",
            "-q",
            "--json",
        ],
        stdout=writing,
        env=os.environ | {"PYTHONPATH": str(PACKAGE)},
        check=False,
    )
    os.close(writing)
    assert done.returncode == 3


def test_import_reads_standard_input(tmp_path):
    log = (ROOT / "sample_data" / "lab_log.csv").read_bytes()
    flags = ("--time", 1, "--c", 2, "--s", 3, "--temperature", 4)
    done = shell("import", "-", "-o", tmp_path / "a.h5", *flags, "--json", stdin=log)
    assert done.returncode == 0 and json.loads(done.stdout)["samples"] > 1000, done.stderr
    assert (
        shell(
            "import", ROOT / "sample_data" / "lab_log.csv", "-o", tmp_path / "b.h5", *flags
        ).returncode
        == 0
    )
    one, other = (store.read(tmp_path / f"{name}.h5", Recording) for name in "ab")
    assert np.array_equal(one.c, other.c) and one.sample_rate_hz == other.sample_rate_hz
    empty = shell("import", "-", "-o", tmp_path / "c.h5", stdin=b"")
    assert empty.returncode == 1 and not (tmp_path / "c.h5").exists()


# Options that act, or say that they do not


def test_import_flags_for_odd_logs(hrg, tmp_path):
    """Ticks of a clock, a comma as decimal sign, kelvins, slow columns with times of their own
    names."""
    lines = ["ticks;c;s;kelvin"]
    lines += [
        f"{k * 50};{np.cos(0.3 * k):.6f};{np.sin(0.3 * k):.6f};293,15".replace(".", ",")
        for k in range(400)
    ]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    names = ("--time", "ticks", "--c", "c", "--s", "s", "--temperature", "kelvin")
    kinds = ("--clock-hz", 1e6, "--separator", ";", "--decimal", ",", "--temperature-units", "K")
    done = hrg("import", tmp_path / "log.csv", "-o", tmp_path / "r.h5", *names, *kinds, "--json")
    assert done.status == 0, done.err
    record = store.read(tmp_path / "r.h5", Recording)
    assert record.sample_rate_hz == pytest.approx(20000.0) and record.temperature_degc[
        0
    ] == pytest.approx(20.0)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_json_is_there_for_every_command(name, hrg):
    """--show-config --json prints the settings as one JSON object; the help of a command without
    settings does not offer it."""
    if "--show-config" not in hrg(*name.split(), "--help").out:
        assert name in ("diff", "effects", "info", "verify")
        return
    needed = {
        "batch": [ROOT / "configs" / "lot.toml"],
        "check": ["--limits", ROOT / "configs" / "limits.toml"],
        "ledger history": ["SN", "--limits", ROOT / "configs" / "limits.toml"],
        "ledger show": ["--limits", ROOT / "configs" / "limits.toml"],
        "plan": ["--menu", ROOT / "configs" / "menu.toml"],
        "simulate": [ROOT / "configs" / "free_run_downs.toml"],
        "study": ["redundancy"],
    }
    shown = hrg(*name.split(), *needed.get(name, []), "--show-config", "--json")
    assert shown.status == 0 and isinstance(shown.json, dict) and shown.json, shown.err


def test_seed_and_jobs_act_or_say_so(hrg):
    """Where the help offers it, --seed changes a setting; elsewhere it is taken with a sentence."""
    for name in ("identify", "calibrate", "run"):
        shown = hrg(name, "--show-config", "--json", "--seed", 77).json
        assert "77" in json.dumps(shown) and "--seed" in hrg(*name.split(), "--help").out
    for name in (
        "demodulate",
        "estimate",
        "compensate",
        "info",
        "effects",
        "check",
        "report",
        "export",
        "plan",
    ):
        assert "--seed" not in hrg(*name.split(), "--help").out
    told = hrg("effects", "--seed", 3, "--config", "x.toml")
    assert told.status == 0 and "--seed has no effect here: nothing is drawn" in told.err
    assert "--config has no effect here" in told.err and "--jobs" not in told.err
    assert not hrg("effects", "--seed", 3, "-q").err
    for name in ("simulate", "run", "batch"):
        assert "Processes" in hrg(*name.split(), "--help").out


def test_answers_are_kept_as_json(hrg, tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    (tmp_path / "limits.toml").write_text("rows = 1\n")
    for command in (
        ("info", tmp_path / "a.h5"),
        ("effects",),
        ("check", tmp_path / "a.h5", "--limits", tmp_path / "limits.toml"),
    ):
        out = tmp_path / f"{command[0]}.json"
        told = hrg(*command, "-o", out, "--json")
        assert (
            told.status == (3 if command[0] == "check" else 0)
            and json.loads(out.read_text()) == told.json
        )
        assert {"kind", "status", "status_reasons", "output", "elapsed_s"} <= set(told.json)
        assert hrg(*command, "-o", out).status == 1, "an existing output is refused"


def test_check_takes_limits_from_everywhere(hrg, tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    (tmp_path / "limits.toml").write_text("rows = 1\n")
    given = ("check", tmp_path / "a.h5", "--limits", tmp_path / "limits.toml")
    assert hrg(*given).status == 3 and hrg(*given, "--set", "rows=1000000").status == 0
    (tmp_path / "more.toml").write_text("[recording]\nrows = 1000000\n")
    assert hrg("check", tmp_path / "a.h5", "--config", tmp_path / "more.toml").status == 0
    assert hrg("check", tmp_path / "a.h5").status == 2


def test_report_takes_settings(hrg, tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    made = hrg(
        "report", tmp_path / "a.h5", "-o", tmp_path / "figures", "--set", "format=png", "--json"
    )
    assert made.status == 0 and all(
        Path(name).suffix == ".png" and Path(name).exists() for name in made.json["files"]
    )
    assert hrg("report", tmp_path / "a.h5", "-o", tmp_path / "x", "--format", "pdf").status == 2
    page = hrg("report", tmp_path / "a.h5", "-o", tmp_path / "a.html", "-v")
    assert page.status == 0 and "report: " in page.err


def test_export_takes_settings(hrg, tmp_path):
    waves = programme(Truth(3), (-10, 15, 40), (-0.5, 0.5), duration=15, noise=1e-4)
    store.write(
        tmp_path / "c.h5", calibrate(waves, harmonics=2, scale_factor_harmonics=2, bootstrap=0)
    )
    made = hrg(
        "export",
        tmp_path / "c.h5",
        "-o",
        tmp_path / "t.h",
        "--set",
        "fixed_point_bits=16",
        "--json",
    )
    assert made.status in (0, 3) and "int16_t" in (tmp_path / "t.h").read_text()
    assert hrg("export", tmp_path / "c.h5", "-o", tmp_path / "u.h", "--precision", "-1").status == 2
    for bits, name in (("12", "u.h"), ("12", "u.csv"), ("16.5", "u.h")):  # 12 was exit 1, or 0
        told = hrg("export", tmp_path / "c.h5", "-o", tmp_path / name, "--fixed-point-bits", bits)
        assert told.status == 2 and "'0', '16', '32'" in told.err and not (tmp_path / name).exists()
