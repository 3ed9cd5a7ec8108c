"""A recording that cannot be read is its gyro's all the same: by what is left of it, its name, its
neighbours; what cannot be told is not guessed."""

import h5py
import numpy as np
import pytest

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.lots.groups import Origin
from hrg_cli.lots.identity import Told, find_owner, group_keys, is_readable, read_gyro_id
from hrg_cli.lots.lot_settings import LotSettings
from hrg_cli.records import Recording


def written(path, gyro="SN-104", start="2026-05-04T08:00:00Z"):
    x = np.random.default_rng(0).standard_normal(4000)
    record = Recording(
        c=x, s=x, sample_rate_hz=1e3, mode="free", gyro_id=gyro, run_id="1", start_time=start
    )
    store.write(path, record)
    return path


def test_a_recording_says_where_and_when(tmp_path):
    path = written(tmp_path / "a.h5")
    with h5py.File(path, "a") as file:
        file["recording"].attrs["station"] = "2"
        file["recording"].attrs["shift"] = "night"
    assert read_gyro_id(path) == Told("SN-104", "2026-05-04", {"station": "2"})


def test_a_damaged_dataset_leaves_the_name(tmp_path):
    path = written(tmp_path / "x.h5")
    assert is_readable(path)
    with h5py.File(path, "a") as file:
        del file["recording/s"]
    assert read_gyro_id(path).gyro_id == "SN-104" and not is_readable(path)
    assert find_owner(path, {}) == ("SN-104", "its gyro_id can still be read")


def test_a_file_of_another_kind_is_no_recording(tmp_path):
    path = tmp_path / "w.h5"
    (tmp_path / "log.csv").write_text("time,c,s\n0,1,2\n")
    assert read_gyro_id(tmp_path / "log.csv") is None
    with h5py.File(path, "w") as file:
        file["x"] = np.zeros(3)
    assert read_gyro_id(path) is None
    with h5py.File(written(tmp_path / "r.h5"), "a") as file:
        file.attrs["kind"] = "wave"
    with pytest.raises(HrgError, match="is a wave file, a recording file was expected"):
        read_gyro_id(tmp_path / "r.h5")


@pytest.mark.parametrize(
    ("name", "readable", "gyro"),
    [
        ("sn-104-run3.h5", {"a.h5": "SN-104", "b.h5": "SN-105"}, "SN-104"),
        ("sn-1041-run3.h5", {"a.h5": "SN-104", "b.h5": "SN-105"}, ""),
        ("left-7.h5", {"left-1.h5": "G1", "right-1.h5": "G2"}, "G1"),
        ("left-7.h5", {"left-1.h5": "G1", "left-2.h5": "G2"}, ""),
        ("odd.h5", {"left-1.h5": "G1", "right-2.h5": "G1"}, "G1"),
        ("odd.h5", {"left-1.h5": "G1", "right-2.h5": "G2"}, ""),
        ("odd.h5", {}, ""),
    ],
)
def test_a_lost_recording_goes_to_the_gyro_it_is_named_with(tmp_path, name, readable, gyro):
    lost = tmp_path / name
    lost.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(3000))
    found, by = find_owner(lost, {tmp_path / file: g for file, g in readable.items()})
    assert found == gyro and bool(by) == bool(gyro)


def test_what_is_no_hdf5_behind_its_name_is_no_log_of_its_folders_name(tmp_path):
    """Overwritten at its head: whose it is, its neighbours tell, and not the folder."""
    lost = tmp_path / "left-7.H5"
    lost.write_bytes(bytes(3000))
    with pytest.raises(HrgError, match="is no HDF5 file"):
        read_gyro_id(lost)
    assert (
        find_owner(lost, {tmp_path / "left-1.h5": "G1", tmp_path / "right-1.h5": "G2"})[0] == "G1"
    )


def test_a_file_cut_off_still_holds_its_name(tmp_path):
    whole = written(tmp_path / "whole.h5")
    cut = tmp_path / "cut" / "other.h5"
    cut.parent.mkdir()
    cut.write_bytes(whole.read_bytes()[:9000])
    known = {whole: "SN-104", tmp_path / "b.h5": "SN-10"}
    assert find_owner(cut, known)[0] == "SN-104"


def test_the_lots_file_groups_gyros_before_their_recordings_do():
    lot = LotSettings(
        recordings=["x"],
        groups={"station": {"1": "SN-0*", "2": ["SN-1*"]}, "fixture": {"A": ["*"]}},
        gyro=[{"gyro_id": "SN-104", "station": 3, "day": "2026-05-04"}],
    )
    assert lot.find_groups("SN-104") == {"station": "3", "fixture": "A"}
    assert lot.find_groups("SN-105") == {"station": "2", "fixture": "A"}
    assert lot.find_day("SN-104") == "2026-05-04" and lot.find_day("SN-105") == ""
    told = [Told("g", "", {"station": "9", "operator": "m"}), Told("g", "", {"operator": "m"})]
    assert group_keys({"station": "3"}, told) == {"station": "3", "operator": "m"}
    assert group_keys({}, [Told("g", "", {"station": s}) for s in "12"]) == {}
    assert Origin({}).day == ""
