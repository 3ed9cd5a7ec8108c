"""MATLAB, NumPy, TDMS, Parquet and HDF5 logs, each written by another library, become the same
recording."""

import builtins
import os
import shutil
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import psutil
import pytest
from scipy.io import savemat

from hrg_cli import settings as hrg_settings
from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.formats import hdf5, import_log, log, matlab, read_table
from hrg_cli.records import Recording, collect

RATE = 4000.0
N = 3000
T = np.arange(N) / RATE
RNG = np.random.default_rng(5)
C, S = RNG.standard_normal((2, N))
COUNTS = RNG.integers(-2000, 2000, (2, N)).astype("i2")


def whole(path: Path, **settings: object) -> Recording:
    return collect(import_log(path, **settings))  # type: ignore[arg-type]


def matlab_5(path: Path) -> None:
    savemat(
        path,
        {
            "fs": RATE,
            "ch1": C,
            "ch2": S[:, None],
            "name": "a text",
            "cells": np.array([1, "x"], dtype=object),
        },
        do_compression=True,
    )


def matlab_5_struct(path: Path) -> None:
    savemat(path, {"log": {"dt": 1 / RATE, "data": np.stack([C, S], 1), "note": "text"}})


def matlab_73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as f:
        for name, value in (("time", T), ("cos", C), ("sin", S)):
            f.create_dataset(name, data=value[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
        text = f.create_dataset(
            "title",
            data=np.array([[ord(x)] for x in "a long title that is no channel"], dtype="u2"),
        )
        text.attrs["MATLAB_class"] = np.bytes_("char")
    with open(path, "r+b") as f:
        f.write(
            b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: today HDF5 schema 1.00 .".ljust(
                124
            )
            + b"\0\2IM"
        )


def labone(path: Path) -> None:
    with h5py.File(path, "w") as f:
        for demod, values in ((0, C), (1, S)):
            g = f.create_group(f"000/demods/{demod}/sample")
            g["timestamp"] = (7_000_000_000 + np.arange(N) * 15_000).astype("u8")
            g["x"], g["y"] = values, RNG.standard_normal(N)
        f["000"].attrs["clockbase"] = 60e6


def generic(path: Path) -> None:
    with h5py.File(path, "w") as f:
        f.create_dataset(
            "daq/samples", data=np.stack([C, S], 1), compression="gzip", chunks=(256, 2)
        )
        f["daq/sample_rate"] = RATE


def tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    properties = {
        "wf_increment": 1 / RATE,
        "wf_start_time": np.datetime64("2026-03-01T12:00:00"),
        "unit_string": "V",
    }
    with TdmsWriter(str(path)) as writer:
        for part in np.array_split(np.arange(N), 3):
            writer.write_segment(
                [
                    ChannelObject("g", "ai0", C[part], properties=properties),
                    ChannelObject("g", "ai1", S[part], properties=properties),
                ]
            )


def parquet(path: Path) -> None:
    pd.DataFrame({"time (us)": T * 1e6, "C": C, "S": S, "label": ["a"] * N}).to_parquet(path)


def parquet_stamps(path: Path) -> None:
    stamps = pd.Timestamp("2026-03-01T12:00:00Z") + pd.to_timedelta(np.arange(N) * 250, unit="us")
    pd.DataFrame({"when": stamps, "C": C, "S": S}).to_parquet(path)


def save(path: Path, writer: Callable[..., None], *arrays: np.ndarray, **named: object) -> None:
    with path.open("wb") as file:  # numpy would add a suffix
        writer(file, *arrays, **named)


def numpy_columns(path: Path) -> None:
    save(path, np.save, np.stack([T, C, S], 1))


def numpy_fields(path: Path) -> None:
    rows = np.zeros(N, [("time (us)", "f8"), ("s", "f8"), ("c", "f8")])
    rows["time (us)"], rows["s"], rows["c"] = T * 1e6, S, C
    save(path, np.save, rows)


def numpy_variables(path: Path) -> None:
    save(path, np.savez, fs=RATE, c=C, s=S[:, None], label="a text")


def numpy_compressed(path: Path) -> None:
    save(path, np.savez_compressed, time=T, c=C, s=S)


WRITERS = {
    "matlab_5": matlab_5,
    "matlab_5_struct": matlab_5_struct,
    "matlab_73": matlab_73,
    "labone": labone,
    "generic": generic,
    "tdms": tdms,
    "parquet": parquet,
    "parquet_stamps": parquet_stamps,
    "numpy_columns": numpy_columns,
    "numpy_fields": numpy_fields,
    "numpy_variables": numpy_variables,
    "numpy_compressed": numpy_compressed,
}


IN_A_CHILD = ("matlab_5", "matlab_5_struct")
"""Formats whose reader first runs in a process of its own, which takes its time."""


def made(folder: Path, name: str) -> Path:
    """A log whose suffix says nothing."""
    if name == "tdms":
        pytest.importorskip("nptdms")
    if name.startswith("parquet"):
        pytest.importorskip("pyarrow")
    path = folder / "log.dat"
    WRITERS[name](path)
    return path


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_same_samples(tmp_path, name):
    r = whole(made(tmp_path, name))
    np.testing.assert_array_equal(r.c, C)
    np.testing.assert_array_equal(r.s, S)
    assert (
        r.sample_rate_hz == pytest.approx(RATE, rel=1e-12)
        and r.time_s is None
        and r.status == "valid"
    )
    if name in ("tdms", "parquet_stamps"):
        assert r.start_time.startswith("2026-03-01T12:00:00")
    assert r.c_units == ("V" if name == "tdms" else "1")


@pytest.mark.parametrize("name", WRITERS)
def test_blocks_and_truncated_files(tmp_path, name, monkeypatch):
    path = made(tmp_path, name)
    for module in (log, hdf5):
        monkeypatch.setattr(module, "BLOCK_ROWS", 700)
    for module in ("tdms", "parquet"):
        monkeypatch.setattr(f"hrg_cli.formats.{module}.BLOCK_ROWS", 700)
    assert len(list(import_log(path))) == 5
    data = path.read_bytes()
    for keep in (0.02, 0.4, 0.97):
        path.write_bytes(data[: int(keep * len(data))])
        with pytest.raises(HrgError, match=r"log\.dat"):
            whole(path)


@pytest.mark.parametrize("name", WRITERS)
def test_mutated_files_never_give_anything_but_a_sentence(tmp_path, name):
    fuzz(made(tmp_path, name), 3 if name in IN_A_CHILD else 25, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_many_mutated_files(tmp_path, name):
    fuzz(made(tmp_path, name), 100 if name in IN_A_CHILD else 400, 1)


def fuzz(path: Path, count: int, seed: int) -> None:
    rng, data = np.random.default_rng(seed), path.read_bytes()
    for _ in range(count):
        mutated = bytearray(data)
        for place in rng.integers(0, 600 if rng.random() < 0.6 else len(data), rng.integers(1, 8)):
            mutated[place] = rng.integers(0, 256)
        path.write_bytes(bytes(mutated))
        try:
            blocks = import_log(path)
            total = 0
            for block in [blocks] if isinstance(blocks, Recording) else blocks:
                total += len(block)
            assert total < 10**8
        except HrgError as error:
            assert "\n" not in str(error)


def test_slow_columns_with_times_of_their_own(tmp_path):
    savemat(
        tmp_path / "log.mat",
        {
            "fs": RATE,
            "ch1": C,
            "ch2": S,
            "temperature": [300.0, 301.0, 302.0],
            "temp_time": [0.0, 0.3, 0.6],
        },
    )
    r = whole(tmp_path / "log.mat", temperature_units="K")
    np.testing.assert_allclose(r.temperature_degc, [26.85, 27.85, 28.85])
    assert r.auxiliary_time_s.tolist() == [0, 0.3, 0.6]
    with pytest.raises(HrgError, match="auxiliary_time"):
        whole(tmp_path / "log.mat", auxiliary_time="none")
    assert (
        whole(tmp_path / "log.mat", temperature="none", auxiliary_time="none").temperature_degc
        is None
    )


def test_tdms_slow_channel_has_its_own_rate(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    channels = [
        nptdms.ChannelObject("g", name, values, properties={"wf_increment": step})
        for name, values, step in (
            ("ai0", COUNTS[0], 1 / RATE),
            ("ai1", COUNTS[1], 1 / RATE),
            ("temperature", np.array([20.0, 21.0, 22.0]), 0.25),
        )
    ]
    with nptdms.TdmsWriter(str(tmp_path / "log.tdms")) as writer:
        writer.write_segment(channels)
    r = whole(tmp_path / "log.tdms")
    assert (
        r.c.dtype == np.int16
        and r.temperature_degc.tolist() == [20, 21, 22]
        and r.auxiliary_time_s.tolist() == [0, 0.25, 0.5]
    )


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("import os; os.kill(os.getpid(), 11)", "crashed on it"),
        ('print(\'{"arrays": ["c"], "scalars": {}}\')', "crashed on it"),
        ("import sys; sys.exit(1)", "crashed on it"),
        ("import time; time.sleep(60)", "within 1 s"),
        ("print('{\"no_memory\": true}')", "more data than fits in memory"),
    ],
    ids=["crashes", "ends before its last", "fails", "hangs", "has no memory"],
)
def test_a_matlab_reader_takes_nothing_with_it(tmp_path, monkeypatch, program, said):
    """Damage may make the reader crash in one process and not in the next: it never runs in ours."""
    matlab_5(tmp_path / "log.mat")
    (tmp_path / "child.py").write_text(program)
    monkeypatch.setattr(matlab.matlab_child, "__file__", str(tmp_path / "child.py"))
    monkeypatch.setattr(matlab, "LEAST_S", 1.0)
    with pytest.raises(HrgError, match=said):
        whole(tmp_path / "log.mat")


def test_a_matlab_reader_ends_with_a_parent_that_is_killed(tmp_path):
    """Nobody would read what it hands over; it waits for a writer of its file when that happens."""
    os.mkfifo(tmp_path / "log.mat")
    script = (
        "import sys; from pathlib import Path; from hrg_cli.formats import matlab;"
        " matlab._read_in_a_child(Path(sys.argv[1]))"
    )
    with subprocess.Popen([sys.executable, "-c", script, str(tmp_path / "log.mat")]) as parent:
        deadline = time.monotonic() + 60.0
        while not (children := psutil.Process(parent.pid).children()):
            assert time.monotonic() < deadline, "no reader was started"
            time.sleep(0.05)
        parent.kill()
    left = psutil.wait_procs(children, timeout=20.0)[1]
    for child in left:
        child.kill()
    assert not left, "the reader works on"


def test_channels_of_different_length_are_refused(tmp_path):
    savemat(tmp_path / "log.mat", {"fs": RATE, "ch1": C, "ch2": S[:-5]})
    with pytest.raises(HrgError, match="c 3000, s 2995"):
        whole(tmp_path / "log.mat")


def test_one_demodulator_is_suspect_and_ticks_need_a_clock(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as f:
        g = f.create_group("000/dev1234/demods/0/sample")
        g["timestamp"], g["x"], g["y"] = (np.arange(N) * 15_000).astype("u8"), C, S
    with pytest.raises(HrgError, match="clock_hz"):
        whole(tmp_path / "log.h5")
    r = whole(tmp_path / "log.h5", clock_hz=60e6)
    assert (
        r.sample_rate_hz == RATE and r.status == "suspect" and "one pick-off" in r.status_reasons[0]
    )
    np.testing.assert_array_equal(r.s, S)


def test_labone_csv(tmp_path):
    lines = "".join(
        f"0;{7_000_000_000 + i * 15_000};{c!r};{s!r};130;0.1\n"
        for i, (c, s) in enumerate(zip(C[:500].tolist(), S.tolist()))
    )
    (tmp_path / "log.csv").write_text("chunk;timestamp;x;y;freq;phase\n" + lines)
    with pytest.raises(HrgError, match="clock_hz"):
        whole(tmp_path / "log.csv")
    r = whole(tmp_path / "log.csv", clock_hz=60e6)
    assert r.sample_rate_hz == RATE and r.status == "suspect"
    np.testing.assert_array_equal(r.c, C[:500])


def test_an_hrg_file_is_not_foreign(tmp_path):
    store.write(
        tmp_path / "r.h5", Recording(c=COUNTS[0], s=COUNTS[1], sample_rate_hz=RATE, mode="free")
    )
    with pytest.raises(HrgError, match="hrg file already"):
        whole(tmp_path / "r.h5")


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    (tmp_path / "a").write_bytes(b"TDSm" + bytes(100))
    (tmp_path / "b").write_bytes(b"PAR1" + bytes(100))
    real = builtins.__import__

    def without(name, *rest, **more):
        if name.split(".")[0] in ("nptdms", "pyarrow"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    for name in "ab":
        with pytest.raises(HrgError, match=r"pip install 'hrg-cli\[labs\]'"):
            import_log(tmp_path / name)


def test_a_claim_of_a_petabyte_is_refused(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as f:
        f.create_dataset("c", (10**14,), "f8", chunks=(1024,))
        f["c"][:10] = 1.0
        f.create_dataset("s", (10**14,), "f8", chunks=(1024,))
    with pytest.raises(HrgError, match="claims"):
        whole(tmp_path / "log.h5", sample_rate_hz=1.0)


def test_a_saved_mapping_imports_the_next_log(tmp_path):
    lab = {
        "c": "in phase",
        "s": 3,
        "rate": "table",
        "rate_units": "deg/h",
        "mode": "forced",
        "time_units": "ms",
    }
    table = pd.DataFrame({"t": T * 1e3, "in phase": C, "other": S, "table": np.full(N, 3600.0)})
    table.to_csv(tmp_path / "one.csv", index=False)
    shutil.copy(tmp_path / "one.csv", tmp_path / "two.csv")
    first = hrg_settings.resolve(import_log, flags=lab, table="import")
    (tmp_path / "lab.toml").write_text(hrg_settings.to_toml({"import": first}))
    again = hrg_settings.resolve(import_log, tmp_path / "lab.toml", table="import")
    a, b = whole(tmp_path / "one.csv", **first), whole(tmp_path / "two.csv", **again)
    assert a.run_id == "one" and b.run_id == "two"
    np.testing.assert_array_equal(a.c, b.c)
    np.testing.assert_allclose(b.rate_rad_s, np.pi / 180)
    assert b.mode == "forced" and len(read_table(tmp_path / "two.csv").columns) == 4


def test_a_log_that_changes_while_it_is_read_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "log.csv"
    path.write_text(
        "time,c,s\n"
        + "".join(f"{t!r},{c!r},{s!r}\n" for t, c, s in zip(T.tolist(), C.tolist(), S.tolist()))
    )
    monkeypatch.setattr("hrg_cli.formats.text_logs.BLOCK_BYTES", 5000)
    stream = import_log(path)
    with open(path, "a") as f:
        f.write("9.0,0,0\n")
    with pytest.raises(HrgError, match="changed while it was read"):
        collect(stream)


@pytest.mark.parametrize("writer", [np.save, np.savez])
def test_python_objects_are_not_unpacked(tmp_path, writer):
    path = tmp_path / "log.dat"
    save(path, writer, np.array([1.0, "x"], dtype=object))
    with pytest.raises(HrgError, match="holds Python objects, which are not read"):
        whole(path)


def test_an_archive_that_claims_more_than_it_holds_is_named(tmp_path):
    path = tmp_path / "log.dat"
    with zipfile.ZipFile(path, "w") as archive, archive.open("c.npy", "w") as file:
        np.lib.format.write_array_header_1_0(
            file, {"descr": "<f8", "fortran_order": False, "shape": (10**13,)}
        )
    with pytest.raises(HrgError, match="variable c claims"):
        whole(path)


def test_complex_arrays_are_two_columns(tmp_path):
    """As a lock-in's own library hands them over."""
    path = tmp_path / "log.dat"
    save(path, np.savez, demod=C + 1j * S, fs=RATE)
    record = whole(path, c="demod/re", s="demod/im")
    np.testing.assert_array_equal(record.c, C)
    np.testing.assert_array_equal(record.s, S)
