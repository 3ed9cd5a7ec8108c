"""Wrong and damaged inputs: each gets its sentence and its exit status, and leaves no output
behind."""

import os
import subprocess
import sys
from pathlib import Path
from unittest import mock

import h5py
import numpy as np
import pytest
from conftest import ringing

from hrg_cli import store
from hrg_cli.store.validity import WrittenBlocks


def edited(change, **recording):
    """A recording file changed in place with h5py."""

    def make(folder):
        path = folder / "bad.h5"
        store.write(path, ringing(**recording))
        with h5py.File(path, "r+") as file:
            change(file)
        return path

    return make


def changed(**fields):
    """A recording file with other fields (callables get the array)."""

    def make(folder):
        record = ringing()
        given = {
            key: value(getattr(record, key) if key != "time_s" else record.times())
            if callable(value)
            else value
            for key, value in fields.items()
        }
        with mock.patch.object(WrittenBlocks, "check"):  # as another program might write it
            store.write(folder / "bad.h5", record.replace(**given))
        return folder / "bad.h5"

    return make


def raw(content):
    """A file of these bytes (callable: of the bytes of a good recording)."""

    def make(folder):
        path = folder / "bad.h5"
        store.write(path, ringing())
        path.write_bytes(content(path.read_bytes()) if callable(content) else content)
        return path

    return make


def replace_dataset(name, data):
    def change(file):
        del file[name]
        file[name] = data

    return change


def even_time(t):
    return t


def with_jump(at, jump):
    def change(t):
        t = np.array(t)
        t[at:] += jump
        return t

    return change


def repeated(at):
    def change(t):
        t = np.array(t)
        t[at:] = t[at - 1 : -1]
        return t

    return change


def block(at, length, value):
    def change(x):
        x = np.array(x, dtype=float)
        x[at : at + length] = value
        return x

    return change


def remove(name):
    def change(file):
        del file[name]

    return change


def set_attribute(place, name, value):
    def change(file):
        file[place].attrs[name] = value

    return change


def drop_attribute(place, name):
    def change(file):
        del file[place].attrs[name]

    return change


REFUSED_WITH_1 = {
    "truncated file": (raw(lambda b: b[: len(b) // 3]), "truncated"),
    "text file": (raw(b"t,c,s\n0,1,2\n"), "hrg import"),
    "empty file": (raw(b""), "is empty"),
    "missing file": (lambda folder: folder / "none.h5", "no such file"),
    "a folder": (lambda folder: folder, "is a folder"),
    "missing dataset": (edited(remove("recording/s")), "/recording/s is missing"),
    "missing attribute": (edited(drop_attribute("recording", "mode")), "attribute mode"),
    "no sampling rate": (edited(drop_attribute("recording", "sample_rate_hz")), "sample_rate_hz"),
    "negative sampling rate": (
        edited(set_attribute("recording", "sample_rate_hz", -5.0)),
        "positive",
    ),
    "sampling rate is text": (
        edited(set_attribute("recording", "sample_rate_hz", "fast")),
        "a number was expected",
    ),
    "unknown mode": (edited(set_attribute("recording", "mode", "idle")), "idle"),
    "carrier without frequency": (
        edited(set_attribute("recording", "readout", "carrier")),
        "carrier_hz",
    ),
    "wrong unit": (edited(set_attribute("recording/c", "units", "rad")), "both must have one unit"),
    "scale factor zero": (
        edited(set_attribute("recording/c", "scale_factor", 0.0)),
        "scale_factor",
    ),
    "unequal lengths": (
        edited(replace_dataset("recording/s", np.zeros(17, "i2"))),
        "lengths must be equal",
    ),
    "two-dimensional channel": (
        edited(replace_dataset("recording/s", np.zeros((40, 2)))),
        "dimension",
    ),
    "complex numbers": (
        edited(replace_dataset("recording/s", np.zeros(4000, complex))),
        "real numbers",
    ),
    "one sample": (changed(c=np.zeros(1, "i2"), s=np.zeros(1, "i2")), "fewer than 6"),
    "no samples": (changed(c=np.zeros(0, "i2"), s=np.zeros(0, "i2")), "no samples"),
    "all zero": (changed(c=lambda x: 0 * x, s=lambda x: 0 * x), "all zero"),
    "constant": (
        changed(c=lambda x: 0 * x + 7, s=lambda x: 0 * x + 7),
        "both channels are constant",
    ),
    "nothing finite": (
        changed(c=lambda x: np.full(len(x), np.nan), s=lambda x: np.full(len(x), np.nan)),
        "hardly any finite sample",
    ),
    "frequency above Nyquist": (changed(nominal_frequency_hz=7000.0), "half the sampling rate"),
    "times decrease": (
        changed(sample_rate_hz=None, time_s=with_jump(2000, -0.1)),
        "increase from row to row",
    ),
    "times repeat": (
        changed(sample_rate_hz=None, time_s=repeated(2000)),
        "increase from row to row",
    ),
    "times not finite": (
        changed(sample_rate_hz=None, time_s=block(5, 3, np.nan)),
        "a finite number was expected",
    ),
    "log of the environment not sorted": (
        changed(auxiliary_time_s=np.array([0.0, 2.0, 1.0]), temperature_degc=np.zeros(3)),
        "increase",
    ),
    "newer format": (
        edited(lambda f: f.attrs.__setitem__("format_version", "9.0")),
        "format_version",
    ),
    "foreign HDF5": (edited(lambda f: f.attrs.__delitem__("format")), "not an hrg file"),
}


@pytest.mark.parametrize("case", REFUSED_WITH_1)
def test_refused_in_one_sentence_without_output(case, hrg, tmp_path):
    make, says = REFUSED_WITH_1[case]
    (tmp_path / "in").mkdir()
    path = make(tmp_path / "in")
    result = hrg("demodulate", path, "-o", tmp_path / "out.h5")
    assert result.status == 1, result
    lines = result.err.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("hrg: ") and "internal error" not in lines[0], (
        result.err
    )
    assert says in lines[0] and (
        "bad.h5" in lines[0]
        or "none.h5" in lines[0]
        or "in:" in lines[0]
        or "run r" in lines[0]
        or "'r'" in lines[0]
    ), lines[0]
    assert os.listdir(tmp_path) == ["in"]


FLAGGED = {
    "clipped": (
        changed(c=lambda x: np.clip(x, -9000, 9000), s=lambda x: np.clip(x, -9000, 9000)),
        1,
    ),
    "not a number block": (
        changed(c=block(1000, 200, np.nan), c_scale_factor=1.0, s_scale_factor=1.0),
        4,
    ),
    "infinite sample": (
        changed(c=block(1000, 1, np.inf), c_scale_factor=1.0, s_scale_factor=1.0),
        4,
    ),
    "huge gap": (changed(sample_rate_hz=None, time_s=with_jump(2000, 5.0)), 2),
}


@pytest.mark.parametrize("case", FLAGGED)
def test_flagged_never_hidden(case, hrg, tmp_path):
    make, bit = FLAGGED[case]
    result = hrg("demodulate", make(tmp_path), "-o", tmp_path / "out.h5", "--json")
    assert result.status in (0, 3), result
    with h5py.File(tmp_path / "out.h5") as file:
        assert np.any(file["periods/flags"][()] & bit)
    if case in ("clipped", "not a number block"):
        assert result.json["status"] in ("suspect", "refused")


def test_one_dead_channel_is_suspect_not_valid(hrg, tmp_path):
    result = hrg(
        "demodulate", changed(s=lambda x: 0 * x)(tmp_path), "-o", tmp_path / "out.h5", "--json"
    )
    assert (
        result.status == 0 and result.json["status"] == "suspect" and result.json["status_reasons"]
    )
    assert (
        hrg("demodulate", tmp_path / "bad.h5", "-o", tmp_path / "out2.h5", "--strict").status == 3
    )


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        (["--set", "periods_per_widnow=3"], 2, "periods_per_window"),
        (["--set", "periods_per_window=-1"], 2, "greater than 0"),
        (["--set", "nonsense"], 2, "key=value"),
        (["--periods-per-window", "many"], 2, "valid number"),
        (["--no-such-option"], 2, "no-such-option"),
        (["--config", "none.toml"], 1, "no such file"),
    ],
)
def test_wrong_settings(arguments, status, says, hrg, tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    result = hrg("demodulate", tmp_path / "a.h5", "-o", tmp_path / "out.h5", *arguments)
    assert result.status == status and says.replace("-", "") in result.err.replace("-", ""), (
        result.err
    )
    assert not (tmp_path / "out.h5").exists()


def test_no_output_named_and_missing_folder_and_output_is_the_input(hrg, tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    assert hrg("demodulate", tmp_path / "a.h5").status == 2
    assert (
        "does not exist" in hrg("demodulate", tmp_path / "a.h5", "-o", tmp_path / "no" / "b.h5").err
    )
    before = (tmp_path / "a.h5").read_bytes()
    assert hrg("demodulate", tmp_path / "a.h5", "-o", tmp_path / "a.h5", "--force").status == 1
    assert (tmp_path / "a.h5").read_bytes() == before


def test_wrong_kind_names_the_command(hrg, tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    result = hrg("estimate", tmp_path / "a.h5", "-o", tmp_path / "b.h5")
    assert (
        result.status == 1 and "hrg demodulate" in result.err and not (tmp_path / "b.h5").exists()
    )


@pytest.mark.skipif(
    os.geteuid() == 0, reason="root may read and write everywhere; run as a user to test rights"
)
def test_no_rights(hrg, tmp_path):
    store.write(tmp_path / "a.h5", ringing())
    (tmp_path / "a.h5").chmod(0)
    assert "no right to read" in hrg("demodulate", tmp_path / "a.h5", "-o", tmp_path / "b.h5").err
    (tmp_path / "locked").mkdir(mode=0o500)
    store.write(tmp_path / "c.h5", ringing())
    assert (
        "no right to write"
        in hrg("demodulate", tmp_path / "c.h5", "-o", tmp_path / "locked" / "b.h5").err
    )


@pytest.fixture
def tiny_disk(tmp_path):
    """A disk of one megabyte, where this process may mount one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)],
        capture_output=True,
        text=True,
        check=False,
    )
    if mounted.returncode:
        pytest.skip(f"no right to mount a small disk here: {mounted.stderr.strip()}")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def test_full_disk(tiny_disk, tmp_path):
    store.write(tmp_path / "a.h5", ringing(seconds=20.0))
    result = subprocess.run(
        [
            sys.executable,
            "-m",
            "hrg_cli.cli",
            "demodulate",
            str(tmp_path / "a.h5"),
            "-o",
            str(tiny_disk / "b.h5"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (
        result.returncode == 1
        and "disk is full" in result.stderr
        and len(result.stderr.splitlines()) == 1
    ), result
    assert list(Path(tiny_disk).iterdir()) == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[device]\nfrequency_hz = 'fast'\n", "frequency_hz"),
        ("[device]\nfrequenzy_hz = 5000.0\n", "frequenzy_hz"),
        ("[device\n", "not TOML"),
        ("", "device is missing"),
        ("[device]\nfrequency_hz = -1.0\n", "frequency_hz"),
    ],
)
def test_wrong_simulation_files(text, says, hrg, tmp_path):
    (tmp_path / "s.toml").write_text(text)
    result = hrg("simulate", tmp_path / "s.toml", "-o", tmp_path / "out.h5")
    assert result.status == 1 and says in result.err and "internal error" not in result.err, (
        result.err
    )
    assert str(tmp_path / "s.toml") in result.err
    assert os.listdir(tmp_path) == ["s.toml"]


@pytest.mark.parametrize(("bits", "size"), [(0, "1.6e+17"), (16, "4e+16"), (24, "8e+16")])
def test_a_run_that_no_disk_holds_is_refused_with_its_size(bits, size, hrg, tmp_path):
    """It would fill the disk first, for days."""
    (tmp_path / "s.toml").write_text(
        "[device]\nfrequency_hz = 1000.0\ntime_constant_s = 1.0\n"
        f"[readout]\nadc_bits = {bits}\n"
        "[recording]\nsample_rate_hz = 1e4\nduration_s = 1e12\n"
    )
    result = hrg("simulate", tmp_path / "s.toml", "-o", tmp_path / "out.h5")
    gigabytes = f"{float(size) / 1e9:.3g} GB of samples"
    assert result.status == 1 and gigabytes in result.err, result.err
    assert "duration_s" in result.err and os.listdir(tmp_path) == ["s.toml"]
