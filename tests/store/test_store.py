"""Files: what is written is read back, opens in xarray, is whole or absent, and is refused in words
when it is wrong."""

import contextlib
import errno
import json
import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import xarray
from conftest import ringing
from small_records import small

from hrg_cli import store
from hrg_cli.errors import DiskFullError, HrgError
from hrg_cli.records import (
    KINDS,
    Compensated,
    Diagnosis,
    Periods,
    Recording,
    Resonator,
    Wave,
    collect,
)
from hrg_cli.store import atomic
from hrg_cli.store.atomic import name_host
from hrg_cli.store.heaps import check_heaps


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.kind)
def test_round_trip(kind, tmp_path):
    record = small(kind)
    store.write(tmp_path / "a.h5", record)
    back = store.read(tmp_path / "a.h5", kind)
    for name in kind.columns():
        found, put = getattr(back, name), getattr(record, name)
        if put is None:
            assert found is None
        else:
            np.testing.assert_array_equal(found, put)
    assert (
        back.provenance.sources == record.provenance.sources
        and back.provenance.history == record.provenance.history
    )


def test_texts_of_any_length_come_back_whole(tmp_path):
    """A diagnosis of twelve runs says more than the 64 kB that attributes of fixed size hold."""
    report = json.dumps({"remarks": ["ä" * 1000] * 300}, ensure_ascii=False)
    reasons = tuple(f"reason {k}" for k in range(9000))
    record = small(Diagnosis).replace(
        report=report,
        extended_model="# a line\n" * 30_000,
        status="suspect",
        status_reasons=reasons,
    )
    store.write(tmp_path / "d.h5", record)
    back = store.read(tmp_path / "d.h5", Diagnosis)
    assert back.report == report and back.status_reasons == reasons
    assert back.extended_model == record.extended_model
    assert xarray.open_dataset(tmp_path / "d.h5", group="diagnosis", engine="h5netcdf").sizes


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.kind)
def test_every_group_opens_in_xarray(kind, tmp_path):
    store.write(tmp_path / "a.h5", small(kind))
    with h5py.File(tmp_path / "a.h5") as file:
        groups = list(file)
        assert (
            file.attrs["format"] == "hrg"
            and file.attrs["format_version"] == "1.0"
            and file.attrs["kind"] == kind.kind
        )
        for key in (
            "generated_by",
            "created",
            "history",
            "settings",
            "sources",
            "status",
            "status_reasons",
        ):
            assert key in file.attrs
        json.loads(file.attrs["sources"]), json.loads(file.attrs["status_reasons"])
        file.visititems(lambda name, item: _has_unit(name, item))
    for group in groups:
        assert xarray.open_dataset(tmp_path / "a.h5", group=group, engine="h5netcdf").sizes


def _has_unit(name, item):
    if isinstance(item, h5py.Dataset) and "NAME" not in item.attrs:
        assert "units" in item.attrs, name


def test_a_time_that_was_ordered_is_one_threads_alone():
    """It stood in the environment, which all threads of a worker share."""
    with store.order_time(0), ThreadPoolExecutor(1) as other:
        assert store.stamp_now().startswith("1970")
        assert not other.submit(store.stamp_now).result().startswith("1970")
    assert not store.stamp_now().startswith("1970")


def test_a_stream_gives_the_same_bytes_as_the_whole(tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    whole = small(Periods, 100)
    store.write(tmp_path / "whole.h5", whole)
    store.write(tmp_path / "again.h5", whole)
    store.write(tmp_path / "stream.h5", whole.blocks(16))
    assert (tmp_path / "whole.h5").read_bytes() == (tmp_path / "again.h5").read_bytes()
    streamed = store.read(tmp_path / "stream.h5", Periods)
    np.testing.assert_array_equal(streamed.signals, whole.signals)
    np.testing.assert_array_equal(collect(whole.blocks(9)).signals, whole.signals)


def test_lazy_rows_read_only_what_is_asked(tmp_path):
    record = small(Wave, 50)
    store.write(tmp_path / "a.h5", record)
    with store.open_record(tmp_path / "a.h5", Wave) as opened:
        assert not isinstance(opened.time_s, np.ndarray)
        np.testing.assert_array_equal(
            opened.rows(10, 20).wave_angle_rad, record.wave_angle_rad[10:20]
        )


def test_existing_output_is_refused_and_kept(tmp_path):
    path = tmp_path / "a.h5"
    store.write(path, small(Wave))
    before = path.read_bytes()
    with pytest.raises(HrgError, match="exists already"):
        store.write(path, small(Wave, 9))
    assert path.read_bytes() == before
    store.write(path, small(Wave, 9), force=True)
    assert len(store.read(path, Wave)) == 9


def test_a_stage_that_fails_leaves_nothing(tmp_path):
    def stream():
        yield small(Wave)
        raise RuntimeError("in the middle")

    with pytest.raises(RuntimeError):
        store.write(tmp_path / "a.h5", stream())
    assert list(tmp_path.iterdir()) == []


def test_of_two_writers_one_wins_whole(tmp_path):
    path, results = tmp_path / "a.h5", []
    barrier = threading.Barrier(2)

    def writer(rows):
        def stream():
            yield small(Wave, rows)
            barrier.wait(10)

        try:
            store.write(path, stream())
            results.append("written")
        except HrgError as error:
            results.append(str(error))

    threads = [threading.Thread(target=writer, args=(n,)) for n in (5, 6)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert results.count("written") == 1 and any(
        "another program" in r or "exists already" in r for r in results
    )
    assert len(store.read(path, Wave)) in (5, 6)
    assert os.listdir(tmp_path) == ["a.h5"]


def test_left_over_of_a_killed_writer_is_removed(tmp_path):
    """Of this host, and of any after a day; another host's process numbers say nothing here."""
    stale = tmp_path / f".a.h5.hrg-{name_host()}-999999999-1.tmp"
    elsewhere = tmp_path / ".a.h5.hrg-otherhost.01234567-999999999-1.tmp"
    forgotten = tmp_path / ".a.h5.hrg-otherhost.01234567-999999999-2.tmp"
    for path in (stale, elsewhere, forgotten):
        path.write_bytes(b"half")
    os.utime(forgotten, (0, 0))
    store.write(tmp_path / "a.h5", small(Wave))
    assert not stale.exists() and not forgotten.exists() and elsewhere.exists()


def test_a_killed_writer_is_gone_before_its_parent_knows(tmp_path):
    """A lot whose worker was killed kept that one's half file where its parent was slow."""
    writer = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    left = tmp_path / f".a.h5.hrg-{name_host()}-{writer.pid}-1.tmp"
    left.write_bytes(b"half")
    atomic.remove_stale(tmp_path)
    assert left.exists(), "at work"
    writer.kill()
    os.waitid(os.P_PID, writer.pid, os.WEXITED | os.WNOWAIT)
    atomic.remove_stale(tmp_path)
    assert not left.exists()
    writer.communicate()


def test_two_hosts_write_one_name_in_one_folder(tmp_path, monkeypatch):
    """The one's half-written file stays while the other cleans up and writes, though its process
    number is nobody's on the other host; the first that is done keeps the name."""
    path = tmp_path / "a.h5"
    with pytest.raises(HrgError, match="another program"):
        with monkeypatch.context() as far:
            far.setattr(atomic, "name_host", lambda: "farhost.01234567")
            far.setattr(os, "getpid", lambda: 999999999)
            writing = atomic.write_whole(path)
            half = writing.__enter__()
        with contextlib.ExitStack() as end:
            end.push(writing)
            half.write_bytes(b"half")
            atomic.remove_stale(tmp_path, below=True)
            store.write(path, small(Wave))
            assert half.read_bytes() == b"half"
    assert os.listdir(tmp_path) == ["a.h5"] and len(store.read(path, Wave)) == 7


def damage(path, what):
    with h5py.File(path, "r+") as file:
        group = file["wave"]
        if what == "missing dataset":
            del group["wave_angle_rad"]
        elif what == "wrong unit":
            group["wave_angle_rad"].attrs["units"] = "deg"
        elif what == "unequal lengths":
            del group["phase_rad"]
            group["phase_rad"] = np.zeros(3)
        elif what == "text for numbers":
            del group["phase_rad"]
            group["phase_rad"] = ["a"] * 7
        elif what == "a group for a dataset":
            del group["phase_rad"]
            group.create_group("phase_rad")
        elif what == "no attribute":
            del group.attrs["window_s"]
        elif what == "attribute not a number":
            group.attrs["window_s"] = "long"
        elif what == "unknown kind":
            file.attrs["kind"] = "poem"
        elif what == "newer format":
            file.attrs["format_version"] = "2.0"
        elif what == "foreign HDF5":
            del file.attrs["format"]
        elif what == "claims a huge size":
            del group["phase_rad"]
            group.create_dataset("phase_rad", shape=(1 << 50,), chunks=(1024,), dtype="f8")
        elif what == "status":
            file.attrs["status"] = "splendid"
        elif what == "reasons are not JSON":
            file.attrs["status_reasons"] = "{"


@pytest.mark.parametrize(
    ("what", "says"),
    [
        ("missing dataset", "wave_angle_rad is missing"),
        ("wrong unit", "'deg', 'rad' was expected"),
        ("unequal lengths", "lengths must be equal"),
        ("text for numbers", "real numbers were expected"),
        ("a group for a dataset", "is a group"),
        ("no attribute", "window_s"),
        ("attribute not a number", "a number was expected"),
        ("unknown kind", "poem"),
        ("newer format", "format_version 2.0"),
        ("foreign HDF5", "hrg import"),
        ("claims a huge size", "lengths must be equal"),
        ("status", "splendid"),
        ("reasons are not JSON", "not JSON"),
    ],
)
def test_wrong_files_are_refused_in_words(what, says, tmp_path):
    path = tmp_path / "a.h5"
    store.write(path, small(Wave))
    damage(path, what)
    with pytest.raises(HrgError, match=says) as caught:
        store.read(path, Wave)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_not_hdf5_truncated_empty_missing_folder(tmp_path):
    (tmp_path / "text.h5").write_text("time,c,s\n1,2,3\n" * 100)
    (tmp_path / "empty.h5").touch()
    store.write(tmp_path / "whole.h5", small(Wave, 5000))
    whole = (tmp_path / "whole.h5").read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: len(whole) // 2])
    for name, says in (
        ("text.h5", "hrg import"),
        ("empty.h5", "is empty"),
        ("cut.h5", "truncated"),
        ("none.h5", "no such file"),
        (".", "folder"),
    ):
        with pytest.raises(HrgError, match=says):
            store.read(tmp_path / name, Wave)


def test_a_flipped_bit_does_not_pass(tmp_path):
    path = tmp_path / "a.h5"
    record = small(Wave, 4000)
    store.write(path, record)
    with h5py.File(path) as file:
        chunk = file["wave/wave_angle_rad"].id.get_chunk_info(0)
    raw = bytearray(path.read_bytes())
    raw[chunk.byte_offset + chunk.size // 2] ^= 16
    path.write_bytes(raw)
    with pytest.raises(HrgError, match="damaged"):
        store.read(path, Wave)


def test_a_wrong_kind_names_the_command_that_makes_the_right_one(tmp_path):
    store.write(tmp_path / "a.h5", small(Recording))
    with pytest.raises(
        HrgError,
        match="is a recording file, a periods file was expected; make one with `hrg demodulate`",
    ):
        store.read(tmp_path / "a.h5", Periods)


def test_status_only_gets_worse():
    record = small(Resonator)
    assert record.judged([]).status == "valid"
    assert record.judged(["a"], "refused").judged(["b"], "suspect").status == "refused"
    assert record.judged(["a"]).judged(["b"]).status_reasons == ("a", "b")
    assert small(Compensated) and small(Diagnosis)


def test_a_covariance_that_is_none_is_not_written(tmp_path):
    record = small(KINDS[3])
    broken = record.covariance.copy()
    broken[0, 1] = broken[1, 0] = 6.13 * np.sqrt(broken[0, 0] * broken[1, 1])
    with pytest.raises(HrgError, match=r"correlation of 6\.13"):
        store.write(tmp_path / "a.h5", record.replace(covariance=broken))
    assert not (tmp_path / "a.h5").exists()
    negative = record.covariance.copy()
    negative[2, 2] *= -1
    with pytest.raises(HrgError, match="negative variance"):
        store.write(tmp_path / "a.h5", record.replace(covariance=negative))


def test_every_row_column_is_stored_with_a_checksum(tmp_path):
    """Raw samples, too: a damaged chunk is noticed when it is read."""
    for kind in (Recording, Periods, Wave):
        store.write(tmp_path / f"{kind.kind}.h5", small(kind, 40))
        with h5py.File(tmp_path / f"{kind.kind}.h5") as file:
            own = file[kind.kind]
            names = [
                n
                for n, c in kind.columns().items()
                if c.dims and c.dims[0] == "row" and c.group is None and (c.name or n) in own
            ]
            assert names and all(own[kind.columns()[n].name or n].fletcher32 for n in names)


def test_a_size_that_is_hardly_stored_is_not_believed(tmp_path):
    """One chunk of a dataset of a gigabyte is there; the rest would read as zeros."""
    store.write(tmp_path / "a.h5", small(Recording))
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        for name in "cs":
            attributes = dict(file["recording"][name].attrs)
            del file["recording"][name]
            dataset = file["recording"].create_dataset(
                name, shape=(1 << 29,), dtype="i2", chunks=(1 << 16,)
            )
            dataset[: 1 << 16] = 1
            dataset.attrs["units"] = attributes["units"]
    with pytest.raises(HrgError, match=r"claims 536870912 values but stores 65536 at most"):
        store.read(tmp_path / "a.h5", Recording)


def test_a_zeroed_heap_is_refused_before_the_library_sees_it(tmp_path):
    """The library steps through it without end; the test would, too, without the look before."""
    path = tmp_path / "a.h5"
    store.write(path, small(Wave))
    assert store.find_kind(path) is Wave, "what passed once is looked at again when it changed"
    content = bytearray(path.read_bytes())
    at = content.index(b"GCOL\x01\x00\x00\x00")
    content[at + 16 : at + 64] = bytes(48)
    path.write_bytes(content)
    with pytest.raises(HrgError, match=f"texts at byte {at} are overwritten"):
        check_heaps(path)
    with pytest.raises(HrgError, match="are overwritten"):
        store.find_kind(path)


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="no /proc here")
def test_a_file_that_cannot_be_hashed_is_named(tmp_path):
    """The input is to blame, not the output that its hash goes into."""
    with pytest.raises(HrgError, match=r"gone\.h5: no such file"):
        store.compute_sha256(tmp_path / "gone.h5")
    with pytest.raises(HrgError, match=r"mem: is damaged \(.*Input/output error"):
        store.compute_sha256("/proc/self/mem")  # nothing is mapped at address 0


def test_whether_a_file_is_hdf5_is_not_said_where_it_cannot_be_read(tmp_path, monkeypatch):
    (tmp_path / "x.h5").write_bytes(b"x" * 2000)
    assert not store.is_hdf5(tmp_path / "x.h5")

    def failing(handle, length, place):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr("os.pread", failing)
    with pytest.raises(HrgError, match=r"x\.h5: is damaged \(.*Input/output error"):
        store.is_hdf5(tmp_path / "x.h5")
    with pytest.raises(HrgError, match=r"x\.h5: is damaged \(.*Input/output error"):
        store.find_kind(tmp_path / "x.h5")


def test_a_write_that_is_lost_while_an_object_is_let_go_is_none(tmp_path, capfd):
    """h5py can only print such an error; a file with a hole must not look whole."""

    def lose(last):
        error = RuntimeError(
            "Can't decrement id ref count (file write failed: errno = 28, error message = 'No space"
            " left on device', total write size = 16, offset = 2432)"
        )
        told = SimpleNamespace(
            exc_type=RuntimeError, exc_value=error, exc_traceback=None, err_msg=None, object=None
        )
        sys.excepthook(RuntimeError, error, None)
        sys.unraisablehook(told)
        return last

    with pytest.raises(DiskFullError, match="the disk is full"):
        store.write(tmp_path / "out.h5", ringing(), finish=lose)
    assert os.listdir(tmp_path) == [] and capfd.readouterr().err == ""


def test_other_errors_of_objects_let_go_are_told(tmp_path, monkeypatch):
    told = []

    class Failing:
        def __del__(self):
            raise ValueError("of somebody else")

    def fail(last):
        Failing()
        return last

    monkeypatch.setattr(sys, "unraisablehook", told.append)
    store.write(tmp_path / "out.h5", ringing(), finish=fail)
    assert [one.exc_type for one in told] == [ValueError]


@pytest.mark.parametrize("said", [b"\xf4able", b"caf\xe9", b"\xed\xa0\x80"])
def test_text_that_is_no_utf8_is_read_as_text(said, hrg, tmp_path):
    path = tmp_path / "run.h5"
    store.write(path, ringing(gyro_id="gyro"))
    with h5py.File(path, "r+") as file:
        file["recording"].attrs.create("gyro_id", said, dtype=h5py.string_dtype("utf-8"))
    read = store.read_any(path).gyro_id
    assert read.encode("utf-8") and "\ufffd" in read
    done = hrg("info", path, "-o", tmp_path / "info.json")
    assert done.status in (0, 3) and "internal" not in done.err, done


def test_a_kind_that_there_is_not_is_named_with_those_there_are(tmp_path):
    path = tmp_path / "run.h5"
    store.write(path, ringing())
    with h5py.File(path, "r+") as file:
        file.attrs["kind"] = "gyroscope"
    with pytest.raises(HrgError, match=r"its kind is 'gyroscope', expected one of .*recording"):
        store.read_any(path)


@pytest.mark.parametrize("value", [2.5, np.float32(1.5)])
def test_a_whole_number_that_is_none_is_refused(value, tmp_path):
    path = tmp_path / "run.h5"
    store.write(path, ringing())
    with h5py.File(path, "r+") as file:
        file["recording"].attrs["mode_number"] = value
    with pytest.raises(HrgError, match=rf"mode_number .*is '{value}', a number was expected"):
        store.read_any(path)


def test_what_shrinks_is_compressed_and_noise_is_not(tmp_path):
    """A constant column takes a small part of its size on disk; noise would only cost time."""
    wave = small(Wave, 4000)
    noise = np.random.default_rng(0).normal(size=4000)
    store.write(
        tmp_path / "wave.h5",
        wave.replace(temperature_degc=np.full(4000, 20.0), main_amplitude=2 + 0.1 * noise),
    )
    with h5py.File(tmp_path / "wave.h5") as file:
        constant, noisy = file["wave/temperature_degc"], file["wave/main_amplitude"]
        assert constant.id.get_storage_size() < 0.1 * constant.size * 8
        assert noisy.compression is None and noisy.id.get_storage_size() >= noisy.size * 8
