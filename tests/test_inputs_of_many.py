"""What a command of many inputs owes to their state: a result is no surer than its inputs, and no run counts twice."""

import shutil

import pytest
from conftest import ringing

from hrg_cli import store
from hrg_cli.records import Wave


@pytest.fixture
def waves(hrg, tmp_path):
    """Wave files of three run-downs."""
    paths = []
    for k, angle in enumerate((0.1, 0.5, 0.9)):
        store.write(tmp_path / f"r{k}.h5", ringing(angle_rad=angle, seed=k, run_id=f"r{k}"))
        assert hrg("demodulate", tmp_path / f"r{k}.h5", "-o", tmp_path / f"p{k}.h5").status == 0
        assert hrg("estimate", tmp_path / f"p{k}.h5", "-o", tmp_path / f"w{k}.h5").status == 0
        paths.append(tmp_path / f"w{k}.h5")
    return paths


def test_a_suspect_input_makes_the_result_suspect(hrg, waves, tmp_path):
    clean = hrg("identify", *waves, "-o", tmp_path / "clean.h5", "--json")
    assert not any("w1.h5" in reason for reason in clean.json["status_reasons"])
    doubted = store.read(waves[1], Wave).judged(["the screws were loose"])
    store.write(waves[1], doubted, True)
    result = hrg("identify", *waves, "-o", tmp_path / "res.h5", "--json")
    assert result.status == 0 and result.json["status"] == "suspect"
    assert "w1.h5 is suspect: the screws were loose" in result.json["status_reasons"]
    assert result.json["parameters"] == clean.json["parameters"]
    assert hrg("identify", *waves, "-o", tmp_path / "strict.h5", "--strict").status == 3


def test_a_run_named_twice_is_refused(hrg, waves, tmp_path):
    shutil.copy(waves[0], tmp_path / "copy.h5")
    for twice in (waves[0], tmp_path / "copy.h5"):
        result = hrg("identify", *waves, twice, "-o", tmp_path / "res.h5")
        assert result.status == 1 and "same data" in result.err and not (tmp_path / "res.h5").exists()
