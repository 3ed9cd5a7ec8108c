"""Between the runs: a frequency that differs from run to run is named where a cause follows it, and only said where none does."""

import numpy as np
from diagnosis_programme import programme, verdict


def test_a_stiffness_lowered_by_rotation_is_found_from_runs_of_one_rate_each():
    table = programme(3, {"centrifugal_stiffness": {"coefficient": 20.0}}, runs=7)
    for run, rate in zip(table["run"], (0.0, 3.0, -3.0, 6.0, -6.0, 9.0, -9.0), strict=True):
        run["environment"]["rate_rad_s"] = rate
    _, out = verdict(table)
    assert [e["name"] for e in out["effects"]] == ["centrifugal_stiffness"] and out["verdict"] == "explained"
    found = out["effects"][0]["parameters"]["coefficient"]
    assert abs(found["value"] - 20.0) < 4 * found["std"] and found["std"] < 0.2
    assert out["frequencies"]["follow"] == ["centrifugal_stiffness"]


def test_frequencies_follow_temperatures_that_stand_still_in_every_run():
    table = programme(4, {"thermal_frequency": {"relative_1_k": 3e-7, "reference_temperature_degc": 22.0}}, runs=6)
    for run, warm in zip(table["run"], (20.0, 23.0, 26.0, 25.0, 21.0, 24.0), strict=True):
        run["environment"].pop("temperature")
        run["environment"]["temperature_degc"] = warm
    _, out = verdict(table)
    assert [e["name"] for e in out["effects"]] == ["thermal_frequency"] and out["verdict"] == "explained"
    found = out["effects"][0]["parameters"]["relative_1_k"]
    assert abs(found["value"] - 3e-7) < 4 * found["std"]


def test_a_wander_that_nothing_follows_is_said_and_blamed_on_nothing():
    table = programme(5, runs=6)
    random = np.random.default_rng(5)
    for run in table["run"]:
        run["device"] = {"frequency_hz": table["device"]["frequency_hz"] + 0.02 * random.standard_normal()}
    _, out = verdict(table)
    assert out["verdict"] == "adequate" and out["effects"] == []
    assert out["frequencies"]["sigma"] > 100 and 0.005 < out["frequencies"]["scatter_hz"] < 0.06
    assert "nothing in the catalogue follows it" in out["frequencies"]["sentence"]


def test_frequencies_that_agree_are_said_to():
    _, out = verdict(programme(6, runs=4))
    assert out["frequencies"]["sentence"] == "the runs' frequencies agree within their errors"
