"""What leaves the program: outputs that are regular files, names that a file can have, texts that
stay texts wherever they are read."""

import json
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import records_by_hand
from conftest import PACKAGE, ringing

from hrg_cli import store
from hrg_cli.errors import HrgError, UsageError
from hrg_cli.exporting import export
from hrg_cli.exporting_records import export_record
from hrg_cli.lots.lot_table import write_table
from hrg_cli.reporting.text import clean_text, escape_c_comment, escape_for_spreadsheet

ATTACKS = (
    "*/ int owned(void){return 1;} /*",
    "*\\\n/ int owned(void){return 1;}",
    "*//**//",
    "??/",
    "a\nb",
    "\x1b[31m",
    "ü" * 400,
    "/*",
    "**/",
    "*/*/",
)


@pytest.mark.parametrize("attack", ATTACKS)
def test_texts_stay_inside_a_comment_of_c(attack, tmp_path):
    said = escape_c_comment(attack)
    assert (
        "*/" not in said
        and "/*" not in said
        and "\\" not in said
        and "??" not in said
        and "\n" not in said
        and said.isascii()
    )
    if shutil.which("cc") is None:
        return
    record = records_by_hand.calibration().replace(gyro_id=attack, model=attack, correction=attack)
    (tmp_path / "table.h").write_text(export(record, ".h").text, encoding="utf-8")
    (tmp_path / "a.c").write_text(
        '#include "table.h"\nint owned(void) { return 0; }\nint main(void) { return owned(); }\n'
    )
    command = [
        "cc",
        "-std=c99",
        "-Wall",
        "-Werror=comment",
        "-trigraphs",
        "-o",
        str(tmp_path / "a"),
        str(tmp_path / "a.c"),
        "-lm",
    ]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr


FORMULAS = ("=cmd|' /C calc'!A0", "+1+1", "-2+3", "@SUM(A1)", " =1", "\t=1", "＝1", "\x1b[31m=1")


@pytest.mark.parametrize("attack", FORMULAS)
@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".xlsx"])
def test_an_exported_file_holds_no_formulas(suffix, attack, tmp_path):
    """Names of parameters and gyros came through as they were; a sheet had a rule of its own that
    knew "=", "+" and "@"."""
    record = records_by_hand.RECORDS["resonator"]()
    names = np.array([attack, *record.name[1:]], dtype=object)
    written = tmp_path / f"t{suffix}"
    written.write_bytes(export_record(record.replace(name=names, gyro_id=attack), written))
    read = {".csv": pd.read_csv, ".parquet": pd.read_parquet}.get(suffix, pd.read_excel)
    tables = [read(written)]
    if suffix == ".xlsx":
        tables.append(pd.read_excel(written, sheet_name="about", header=None))
    said = [cell for table in tables for cell in table.to_numpy().ravel() if isinstance(cell, str)]
    assert sum(escape_for_spreadsheet(attack) == cell for cell in said) == len(tables)
    assert [cell for cell in said if escape_for_spreadsheet(cell) != cell] == []


@pytest.mark.parametrize("attack", FORMULAS)
def test_texts_are_no_formulas_in_a_spreadsheet(attack, tmp_path):
    assert (
        escape_for_spreadsheet(attack)[0] in ("'", "\ufffd")
        and escape_for_spreadsheet(-2.5) == -2.5
        and escape_for_spreadsheet("G-17") == "G-17"
    )
    write_table(
        tmp_path, [{"gyro_id": attack, "status": "valid", "passed": True, "frequency_hz": -1.5}]
    )
    for table in (pd.read_csv(tmp_path / "lot.csv"), pd.read_parquet(tmp_path / "lot.parquet")):
        assert (
            table["gyro_id"][0][0] in ("'", "\ufffd")
            and table["frequency_hz"][0] == -1.5
            and bool(table["passed"][0])
        )


def test_no_text_of_a_file_reaches_the_terminal_unchanged(hrg, tmp_path):
    attack = "\x1b]0;owned\x07\x9b31m\u202e"
    assert not set(clean_text(attack)) & set("\x1b\x07\x9b\u202e")
    path = tmp_path / "a\x1b[31m.h5"
    record = (
        records_by_hand.wave()
        .rows(0, 100)
        .replace(  # nothing that a fit ends soon on
            gyro_id=attack, run_id=attack, units="V", status="suspect", status_reasons=(attack,)
        )
    )
    store.write(path, record)
    for words in (
        ["info", path],
        ["verify", path],
        ["estimate", path, "-o", tmp_path / "b.h5"],
        ["identify", path, "-o", tmp_path / "c.h5"],
    ):
        told = hrg(*words)
        assert not set(told.out + told.err) & set("\x1b\x07\x9b\u202e"), (words[0], told)


def test_no_text_of_a_result_reaches_the_terminal_unchanged(hrg, tmp_path):
    """A ledger printed the gyro's name as the file holds it."""
    attack = "\x1b]0;owned\x07\x9b31m\u202e"
    path, ledger = tmp_path / "a\x1b[31m.h5", tmp_path / "l\x1b[31m.sqlite"
    store.write(path, records_by_hand.RECORDS["resonator"]().replace(gyro_id=attack))
    for words in (
        ["ledger", "add", path, "--ledger", ledger],
        ["ledger", "show", "--ledger", ledger],
        ["diff", path, path],
        ["info", path],
    ):
        told = hrg(*words)
        assert told.out and not set(told.out + told.err) & set("\x1b\x07\x9b\u202e"), words


@pytest.mark.parametrize(
    "make",
    [os.mkfifo, lambda path: os.symlink("/dev/null", path)],
    ids=["fifo", "link to a device"],
)
def test_only_a_regular_file_is_replaced(make, hrg, tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    target = tmp_path / "out.h5"
    make(target)
    before = _identity(target)
    told = hrg("demodulate", tmp_path / "a.h5", "-o", target, "--force")
    assert told.status == 1 and "only a regular file may be replaced" in told.err
    assert _identity(target) == before and not Path("/dev/null").is_file()


def _identity(path: Path) -> tuple[int, int, int]:
    """What makes it the same entry of the folder: type with permissions, inode and device (its
    times of access move under other programs too)."""
    known = os.lstat(path)
    return known.st_mode, known.st_ino, known.st_dev


def test_standard_output_is_no_file(hrg, tmp_path, monkeypatch):
    """`-o -` passes the name of a file to the next command, and never makes one called `-`."""
    monkeypatch.chdir(tmp_path)
    store.write(tmp_path / "a.h5", ringing())
    told = hrg("demodulate", "a.h5", "-o", "-")
    passed = Path(told.out.strip())
    assert told.status == 0 and passed.is_file() and os.listdir(tmp_path) == ["a.h5"]
    passed.unlink()
    with pytest.raises(UsageError, match="name a file"):
        store.check_output(Path("-"))


@pytest.mark.parametrize(
    ("words", "output", "wanted"),
    [
        (["report", "a.h5"], "y.pdf", "report.html"),
        (["demodulate", "a.h5"], "out.csv", "periods.h5"),
        (["info", "a.h5"], "out.html", "report.json"),
        (["export", "c.h5"], "out.pdf", "table.csv"),
    ],
)
def test_a_suffix_promises_its_content(words, output, wanted, hrg, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    store.write(tmp_path / "a.h5", ringing())
    store.write(tmp_path / "c.h5", records_by_hand.calibration())
    told = hrg(*words, "-o", output)
    assert told.status == 2 and wanted in told.err and not (tmp_path / output).exists()


@pytest.mark.parametrize(
    "name", ["periods.hdf5", "periods", "périodes.h5", "x" * 240 + ".h5", "ä" * 110 + ".h5"]
)
def test_usual_names_are_written(name, hrg, tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    assert hrg("demodulate", tmp_path / "a.h5", "-o", tmp_path / name).status == 0
    assert sorted(os.listdir(tmp_path)) == sorted(["a.h5", name])


@pytest.mark.parametrize(
    ("name", "says"),
    [("x" * 300 + ".h5", "too long"), ("ä" * 130 + ".h5", "too long"), ("\udcff.h5", "not UTF-8")],
)
def test_names_that_no_file_can_have_are_refused(name, says, hrg, tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    told = hrg("demodulate", tmp_path / "a.h5", "-o", tmp_path / name)
    assert (
        told.status == 1
        and says in told.err
        and "internal" not in told.err
        and os.listdir(tmp_path) == ["a.h5"]
    )


@pytest.mark.parametrize("name", ["x" * 300 + ".h5", "ä" * 130 + ".h5"])
def test_a_name_that_is_too_long_is_told_before_the_work(name, tmp_path):
    """The system says so when the file is made, after all that was to go into it."""
    with pytest.raises(HrgError, match="the name is too long; choose a shorter --output"):
        store.check_output(tmp_path / name, False)
    store.check_output(tmp_path / ("x" * 250 + ".h5"), False)


def test_an_input_whose_name_is_no_text_is_read(tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    os.rename(tmp_path / "a.h5", os.fsencode(tmp_path) + b"/\xff.h5")
    command = [
        sys.executable,
        "-m",
        "hrg_cli.cli",
        "demodulate",
        os.fsencode(tmp_path) + b"/\xff.h5",
        "-o",
        tmp_path / "b.h5",
        "--json",
    ]
    done = subprocess.run(
        command,
        capture_output=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(PACKAGE)},
    )
    assert done.returncode == 0 and json.loads(done.stdout)["status"] == "valid", done
    assert "demodulate" in store.read_any(tmp_path / "b.h5").provenance.history[-1]


@pytest.mark.parametrize("text", ["9" * 5000, "1" + "0" * 100, "[" * 3000])
def test_numbers_and_brackets_beyond_reason_are_refused_in_words(text, hrg, tmp_path):
    (tmp_path / "s.toml").write_text(f"[device]\nfrequency_hz = {text}\n")
    (tmp_path / "l.toml").write_text(f"[calibration]\nbias_rad_s = {text}\n")
    store.write(tmp_path / "c.h5", records_by_hand.calibration())
    for words in (
        ["simulate", tmp_path / "s.toml", "-o", tmp_path / "o.h5"],
        ["check", tmp_path / "c.h5", "--limits", tmp_path / "l.toml"],
    ):
        told = hrg(*words)
        assert (
            told.status == 1
            and "toml" in told.err
            and "internal" not in told.err
            and "sys." not in told.err
            and len(told.err.splitlines()) == 1
        ), told
    told = hrg(
        "demodulate",
        tmp_path / "c.h5",
        "-o",
        tmp_path / "o.h5",
        "--set",
        f"periods_per_window={text}",
    )
    assert told.status == 2 and "internal" not in told.err, told


def test_limits_by_the_hundred_thousand_are_refused(hrg, tmp_path):
    (tmp_path / "l.toml").write_text(
        "[calibration]\n" + "".join(f"a{n} = 1.0\n" for n in range(10_001))
    )
    store.write(tmp_path / "c.h5", records_by_hand.calibration())
    told = hrg("check", tmp_path / "c.h5", "--limits", tmp_path / "l.toml")
    assert told.status == 1 and "10001 entries" in told.err


def test_words_of_libraries_do_not_reach_standard_output(tmp_path):
    """LAPACK prints where Python cannot see it; --json promises one object and nothing else."""
    script = "\n".join(
        [
            "import sys, ctypes",
            "from hrg_cli.commands import guard",
            "def body():",
            "    libc = ctypes.CDLL(None)",
            "    libc.puts(b' ** On entry to DLASCL parameter number 4 had an illegal value')",
            "    libc.fflush(None)",
            "    print('{}')",
            "guard.run_guarded(body)",
            "print('after')",
        ]
    )
    environment = os.environ | {"PYTHONPATH": str(PACKAGE)}
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stdout == "{}\nafter\n" and done.stderr == ""


@pytest.mark.parametrize(
    "detail",
    [
        '{"measured": {"kind": "quadrature"}}',
        '{"measured": 3}',
        '{"measured": {"kind": "phase", "mean_frequency_hz": ["x"]}}',
    ],
)
def test_damaged_details_are_refused_in_words(detail, hrg, tmp_path):
    store.write(tmp_path / "c.h5", records_by_hand.calibration().replace(details=detail))
    told = hrg("export", tmp_path / "c.h5", "-o", tmp_path / "t.h")
    assert told.status == 1 and "details are damaged (measured)" in told.err
    with pytest.raises(HrgError, match="details are damaged"):
        export(store.read_any(tmp_path / "c.h5"), ".h")
    (tmp_path / "l.toml").write_text("[calibration]\nbias_rad_s = 1.0\n")
    told = hrg("check", tmp_path / "c.h5", "--limits", tmp_path / "l.toml")
    assert told.status == 1 and "details of this calibration are damaged" in told.err


def test_a_damaged_input_is_blamed_not_the_output(hrg, tmp_path):
    """A chunk whose checksum does not hold, found while the output is being written."""
    path = tmp_path / "in.h5"
    store.write(path, ringing(seconds=60.0))
    whole = bytearray(path.read_bytes())
    at = len(whole) // 8
    whole[at : at + 64] = bytes(63) + b"\xff"
    path.write_bytes(whole)
    told = hrg("demodulate", path, "-o", tmp_path / "out.h5")
    assert (
        told.status == 1
        and "in.h5: dataset /recording/" in told.err
        and "is damaged" in told.err
        and "--output" not in told.err
    )
    assert os.listdir(tmp_path) == ["in.h5"]


def test_a_table_of_numbers_that_are_none_is_not_exported(hrg, tmp_path):
    import h5py

    store.write(tmp_path / "c.h5", records_by_hand.calibration())
    for name in (
        "drift_rad_s",
        "drift_harmonics",
        "scale_factor_std",
        "temperature_degc",
        "covariance",
    ):
        with h5py.File(tmp_path / "c.h5", "r+") as file:
            before = file["calibration"][name][()]
            file["calibration"][name][...] = np.nan
        told = hrg("export", tmp_path / "c.h5", "-o", tmp_path / "t.csv")
        assert (
            told.status == 1
            and f"/calibration/{name} holds nan" in told.err
            and not (tmp_path / "t.csv").exists()
        )
        with h5py.File(tmp_path / "c.h5", "r+") as file:
            file["calibration"][name][...] = before


@pytest.mark.parametrize(
    "words",
    [
        ["import", "log.h5", "-o", "log.h5"],
        ["ledger", "show", "--ledger", "ledger", "-o", "ledger"],
        ["check", "r.h5", "--limits", "limits", "-o", "limits"],
        ["check", "r.h5", "--limits", "limits", "--junit", "r.h5"],
        ["check", "r.h5", "--limits", "limits", "--markdown", "limits"],
        ["check", "r.h5", "--config", "limits", "-o", "limits"],
        ["verify", "r.h5", "-o", "link"],
        ["simulate", "gyro", "-o", "gyro"],
        ["diagnose", "w.h5", "--model", "out.extended.toml", "-o", "out.h5"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_no_input_is_replaced(words, hrg, tmp_path, monkeypatch):
    """Whatever option names it; `--force` replaces earlier outputs only."""
    monkeypatch.chdir(tmp_path)
    store.write(Path("r.h5"), records_by_hand.RECORDS["resonator"]())
    store.write(Path("w.h5"), records_by_hand.RECORDS["wave"]())
    assert hrg("ledger", "add", "r.h5", "--ledger", "ledger").status == 0
    with h5py.File("log.h5", "w") as log:
        for name, phase in (("c", 0.0), ("s", 1.0)):
            log[name] = np.cos(np.arange(400) / 2 + phase)
        log["time"] = np.arange(400) / 5000
    for name in ("limits", "gyro", "out.extended.toml"):
        Path(name).write_text("[resonator]\nscale_factor = { maximum = 1.0 }\n")
    os.link("r.h5", "link")
    before = {name: Path(name).read_bytes() for name in os.listdir()}
    told = hrg(*words, "--force")
    assert told.status == 1 and "is an input of this command too" in told.err, told
    assert {name: Path(name).read_bytes() for name in os.listdir()} == before


def test_outputs_of_one_command_are_different_files(hrg, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    store.write(Path("r.h5"), records_by_hand.RECORDS["resonator"]())
    limits = ("--set", "resonator.scale_factor.maximum=1.0")
    for words in (["--junit", "a", "--markdown", "./a"], ["-o", "a", "--junit", "a"]):
        told = hrg("check", "r.h5", *limits, *words, "--force")
        assert told.status == 2 and "two outputs" in told.err, told
    (tmp_path / "no").mkdir()
    for words in (["-o", "r.pdf"], ["-o", "no"], ["--markdown", "no"]):
        told = hrg("check", "r.h5", *limits, "--junit", "j.xml", *words)
        assert told.status in (1, 2) and set(os.listdir()) == {"r.h5", "no"}, told


def test_the_name_of_a_ledger_is_one_that_a_file_can_have(hrg, tmp_path):
    store.write(tmp_path / "r.h5", records_by_hand.RECORDS["resonator"]())
    for words in (["add", tmp_path / "r.h5"], ["show"], ["history", "G-17"]):
        told = hrg("ledger", *words, "--ledger", tmp_path / ("x" * 300))
        assert told.status == 1 and "too long" in told.err and "internal" not in told.err, told


@pytest.mark.parametrize(
    "words",
    [
        ["demodulate"], ["info"], ["import"], ["simulate"], ["export"], ["verify"], ["run"], ["batch"],
        ["check", "r.h5", "--limits"], ["check", "r.h5", "--baseline"],
        ["check", "r.h5", "--config"], ["diff", "r.h5"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_an_input_that_no_file_can_be_is_refused_in_words(words, hrg, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    store.write(Path("r.h5"), records_by_hand.RECORDS["resonator"]())
    told = hrg(*words, "x" * 300, "-o", "out")
    assert told.status == 1 and "too long" in told.err and "internal" not in told.err, told
    assert os.listdir() == ["r.h5"]


def test_a_pipe_is_imported_and_no_other_command_waits_for_one(hrg, tmp_path, monkeypatch):
    """A pipe can be read once; samples are read again and again."""
    monkeypatch.chdir(tmp_path)
    os.mkfifo("log")
    for command in ("demodulate", "info", "identify"):
        told = hrg(command, "log", "-o", "out")
        assert told.status == 1 and "pipe" in told.err, told
    time_s = np.arange(400) / 5000
    rows = "\n".join(f"{t:.6f},{np.cos(2700 * t):.6f},{np.sin(2700 * t):.6f}" for t in time_s)
    writer = threading.Thread(
        target=Path("log").write_text, args=(f"time [s],C [V],S [V]\n{rows}\n",)
    )
    writer.start()
    told = hrg("import", "log", "-o", "out.h5")
    writer.join()
    assert told.status == 0 and len(store.read_any("out.h5")) == 400, told


def test_a_refused_file_is_not_hashed_to_its_end(hrg, tmp_path):
    """200 GB of nothing are refused at once: nobody needs their SHA-256 then."""
    with open(tmp_path / "huge.h5", "wb") as huge:
        huge.truncate(200 << 30)
    started = time.process_time()
    told = hrg("demodulate", tmp_path / "huge.h5", "-o", tmp_path / "out.h5")
    assert told.status == 1 and "not an HDF5 file" in told.err, told
    assert time.process_time() - started < 10
