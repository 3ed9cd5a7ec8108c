"""What of a file cannot be read is said; it is never taken for missing, for another program's, or
for nothing."""

import errno
import subprocess
import sys

import h5py
import pytest
from small_records import small

from hrg_cli import store
from hrg_cli.errors import HrgError, NotHrgError
from hrg_cli.records import Recording, Wave
from hrg_cli.sources import Sources
from hrg_cli.store import handles, heaps


@pytest.fixture
def wave(tmp_path):
    """A small wave file with every optional column."""
    path = tmp_path / "wave.h5"
    store.write(path, small(Wave))
    return path


def spoil_header(path, place):
    """Make the object header of a dataset one that HDF5 does not know."""
    with h5py.File(path) as file:
        at = h5py.h5o.get_info(file[place].id).addr
    content = bytearray(path.read_bytes())
    assert content[at] == 1, "the version of the header"
    content[at] = 0x7F
    path.write_bytes(content)


@pytest.mark.parametrize("column", ["temperature_degc", "rate_rad_s"])
def test_a_column_that_may_be_missing_is_not_missed_where_it_is_damaged(column, wave):
    """A damaged header made an optional column vanish: the run was read without temperatures."""
    assert getattr(store.read(wave, Wave), column) is not None
    spoil_header(wave, f"wave/{column}")
    with pytest.raises(HrgError, match=r"wave\.h5: is damaged \(.*object header"):
        store.read(wave, Wave)


def test_the_heaps_of_a_file_are_looked_through_once(wave, monkeypatch):
    looked = []
    monkeypatch.setattr(handles, "check_heaps", looked.append)
    for _ in range(3):
        store.read(wave, Wave)
    assert looked == [wave]


def test_a_file_cut_while_its_heaps_are_looked_at_ends_no_process(wave):
    """A map of it would end the process by SIGBUS."""
    script = """
import os, sys
from pathlib import Path
from hrg_cli.store import heaps
path, own = Path(sys.argv[1]), heaps._ends
with path.open("ab") as file:
    file.write(bytes(1 << 20))
def cut_first(*arguments):
    os.truncate(path, 100)
    return own(*arguments)
heaps._ends = cut_first
heaps.check_heaps(path)
print("went on")
"""
    done = subprocess.run(
        [sys.executable, "-c", script, str(wave)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and done.stdout == "went on\n", done


def collection(size, *objects):
    """A global heap's collection: signature, size, and of each object its index and length."""
    pairs = b"".join(
        index.to_bytes(8, "little") + length.to_bytes(8, "little") + bytes(room)
        for index, length, room in objects
    )
    return heaps.SIGNATURE + size.to_bytes(8, "little") + pairs


def test_the_tail_of_a_long_file_is_looked_at(tmp_path, monkeypatch):
    """Texts written last lie there."""
    monkeypatch.setattr(heaps, "SCANNED_BYTES", 64)
    path = tmp_path / "x.h5"
    path.write_bytes(bytes(1000) + collection(48, (0, 0, 16)))
    with pytest.raises(HrgError, match="texts at byte 1000 are overwritten"):
        heaps.check_heaps(path)


@pytest.mark.parametrize("place", [57, 60, 63, 64])
def test_a_heap_across_two_pieces_is_looked_at(place, tmp_path, monkeypatch):
    monkeypatch.setattr(heaps, "PIECE_BYTES", 64)
    path = tmp_path / "x.h5"
    path.write_bytes(bytes(place) + collection(48, (0, 0, 16)) + bytes(200))
    with pytest.raises(HrgError, match=f"texts at byte {place} are overwritten"):
        heaps.check_heaps(path)


def test_a_collection_may_go_on_behind_the_part_that_was_read(tmp_path, monkeypatch):
    monkeypatch.setattr(heaps, "SCANNED_BYTES", 64)
    path = tmp_path / "x.h5"
    path.write_bytes(bytes(40) + collection(72, (1, 8, 8), (0, 32, 16)) + bytes(200))
    heaps.check_heaps(path)


@pytest.mark.parametrize("block", [0, 512, 1024, 4096])
def test_hdf5_is_known_behind_a_user_block(block, wave):
    wave.write_bytes(bytes(block) + wave.read_bytes())
    assert store.is_hdf5(wave) and h5py.is_hdf5(wave)


@pytest.mark.parametrize("block", [1, 256, 513, 1536])
def test_hdf5_is_known_nowhere_else(block, wave):
    wave.write_bytes(bytes(block) + wave.read_bytes())
    assert not store.is_hdf5(wave) and not h5py.is_hdf5(wave)
    with pytest.raises(NotHrgError, match="is not an HDF5 file"):
        store.find_kind(wave)


def test_a_source_that_cannot_be_read_is_not_one_without_samples(tmp_path, monkeypatch):
    """One failing read while the channels were fingerprinted, and the output went back to no
    samples: the same run could count twice."""
    path, log = tmp_path / "run.h5", tmp_path / "log.csv"
    store.write(path, small(Recording))
    log.write_text("time [s],C,S\n0,1,2\n")
    with Sources([path, log]) as sources:
        run, foreign = sources.finish()
    assert len(run.samples) == 1 and foreign.samples == () and foreign.kind == "csv"

    def failing(self):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(handles.Handle, "open_file", failing)
    with pytest.raises(HrgError, match=r"run\.h5: is damaged"), Sources([path]):
        pass
