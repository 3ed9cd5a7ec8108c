"""Which recordings a lot's file names: none silently taken from one gyro for another."""

import pytest

from hrg_cli.errors import HrgError
from hrg_cli.lots.lot_settings import LotSettings, list_recordings


@pytest.fixture
def folder(tmp_path):
    for name in ("A0", "A1", "C0"):
        (tmp_path / f"{name}.h5").touch()
    return tmp_path


def test_a_recording_that_two_gyros_name_is_refused(folder):
    """Gyro A ran with what gyro C had left of its runs, "valid"."""
    gyros = [
        {"gyro_id": "A", "recordings": ["A*.h5"]},
        {"gyro_id": "C", "recordings": ["C*.h5", "A0.h5"]},
    ]
    with pytest.raises(HrgError, match=r"A0\.h5 is named by gyro A and by gyro C"):
        list_recordings(LotSettings(gyro=gyros), folder / "lot.toml")


def test_a_gyro_may_name_a_recording_twice_and_one_of_the_lot_s(folder):
    gyros = [{"gyro_id": "A", "recordings": ["A*.h5", "A0.h5"]}]
    found = list_recordings(LotSettings(recordings="*.h5", gyro=gyros), folder / "lot.toml")
    assert [(gyro, file.stem) for gyro, file in found] == [("A", "A0"), ("A", "A1"), (None, "C0")]
