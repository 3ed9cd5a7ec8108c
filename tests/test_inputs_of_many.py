"""What a command of many inputs owes to their state: a result is no surer than its inputs, and no
run counts twice."""

import shutil

import pytest
from conftest import ringing

from hrg_cli import store
from hrg_cli.origins import name_part, overlap
from hrg_cli.records import Recording, Wave
from hrg_cli.sources import Sources


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
        assert (
            result.status == 1 and "same data" in result.err and not (tmp_path / "res.h5").exists()
        )


@pytest.mark.parametrize("command", ["identify", "calibrate", "diagnose"])
def test_a_copied_recording_is_known_after_its_own_demodulation(hrg, waves, tmp_path, command):
    """The same samples under another name, stored again and demodulated with other windows: no byte
    of the wave files is the same."""
    copied = store.read(tmp_path / "r0.h5", Recording)
    store.write(
        tmp_path / "other.h5",
        copied.replace(c=copied.c.astype("f8"), s=copied.s.astype("f8"), run_id="other"),
    )
    assert (
        hrg(
            "demodulate",
            tmp_path / "other.h5",
            "-o",
            tmp_path / "op.h5",
            "--periods-per-window",
            "3",
        ).status
        == 0
    )
    assert hrg("estimate", tmp_path / "op.h5", "-o", tmp_path / "ow.h5").status == 0
    result = hrg(command, *waves, tmp_path / "ow.h5", "-o", tmp_path / "out.h5")
    assert (
        result.status == 1
        and "same data" in result.err
        and "w0.h5" in result.err
        and "ow.h5" in result.err
    )
    assert not (tmp_path / "out.h5").exists()


def test_a_lot_does_not_count_a_copied_recording_twice(hrg, tmp_path):
    for k, angle in enumerate((0.1, 0.5)):
        store.write(tmp_path / f"r{k}.h5", ringing(angle_rad=angle, seed=k, run_id=f"r{k}"))
    shutil.copy(tmp_path / "r0.h5", tmp_path / "r2.h5")
    (tmp_path / "lot.toml").write_text(
        'lot_id = "L"\nrecordings = ["r*.h5"]\nstages = ["identify"]\n'
    )
    result = hrg("batch", tmp_path / "lot.toml", "-o", tmp_path / "lot", "--json")
    assert result.json["status"] == "refused" and any(
        "same data" in reason for reason in result.json["status_reasons"]
    )


def test_parts_of_one_recording_are_no_duplicates():
    assert name_part({"from_s": None}) == "" and name_part({"from_s": 1, "to_s": 2.5}) == "@1.0:2.5"
    assert overlap("", "1.0:2.0") and overlap("1.0:", "0.0:1.5") and not overlap(":1.0", "1.0:")


def test_a_source_tells_the_part_that_was_taken(tmp_path):
    """Else two parts of one recording would be the same samples named twice."""
    path = tmp_path / "run.h5"
    store.write(path, ringing(seconds=0.1))
    told = []
    for taken in ({}, {"from_s": 0.0, "to_s": 0.05}):
        with Sources([path], taken=taken) as sources:
            told += sources.finish()[0].samples
    assert told[1] == f"{told[0]}@0.0:0.05"
