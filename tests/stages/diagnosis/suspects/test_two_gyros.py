"""Two gyros' runs in one lot are told; what parts the frequencies of one gyro's runs is not."""

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.suspects.two_gyros import _are_alike, _part_in_groups


def of_two_gyros(seed, second, runs):
    """A programme at one temperature whose runs `second` are of a gyro 0.5 Hz beside."""
    table = programme(seed, runs=runs, duration_s=1.0)
    other = programme(seed + 50)["device"]
    other["frequency_hz"] = table["device"]["frequency_hz"] + 0.5
    for k, run in enumerate(table["run"]):
        run["environment"].pop("temperature", None)
        run["start"] = {"wave_angle_rad": 0.5 * k}
        if k in second:
            run["device"] = other
    return table


@pytest.mark.parametrize(("runs", "second"), [(4, (2, 3)), (5, (1, 3))])
def test_runs_of_a_second_gyro_are_named(runs, second):
    """Two of four: "frequency split that changes with run", in 51 s."""
    diagnosis = diagnose(waves(of_two_gyros(3, second, runs)))
    out = summarise(diagnosis)
    assert diagnosis.status == "refused"
    named = {one["run_id"]: one["what"] for one in out["suspect_runs"]}
    assert named == {f"run{k}": "another gyro" for k in second}


def test_groups_are_two_runs_at_least_and_far_apart():
    assert _part_in_groups(np.array([5e3, 5001.0, 5e3 + 1e-4, 5001.0])) == [[0, 2], [1, 3]]
    assert _part_in_groups(np.array([5e3, 5001.0, 5e3, 5e3])) is None
    assert _part_in_groups(np.array([5e3, 5e3 + 0.01, 5e3, 5e3 + 0.01])) is None
    assert _part_in_groups(np.array([5e3, 5001.0, 5000.2, 5001.3])) is None


def test_runs_at_two_temperatures_or_amplitudes_are_no_two_gyros():
    measured = waves(of_two_gyros(3, (), 4))
    groups = [[0, 1], [2, 3]]
    measured = [w.replace(temperature_degc=0 * w.time_s) for w in measured]
    assert _are_alike(measured, groups)
    for change in (
        lambda w: w.replace(temperature_degc=25 + w.temperature_degc),
        lambda w: w.replace(temperature_degc=None),
        lambda w: w.replace(main_amplitude=3 * w.main_amplitude),
        lambda w: w.replace(mode="forced"),
    ):
        assert not _are_alike([*measured[:2], *map(change, measured[2:])], groups)
