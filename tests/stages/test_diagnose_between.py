"""Between the runs: a frequency that differs from run to run is named where a cause follows it, and
only said where none does."""

import numpy as np
import pytest
from diagnosis_programme import programme, verdict, waves

from hrg_cli.stages.diagnose import diagnose, summary


def test_a_stiffness_lowered_by_rotation_is_found_from_runs_of_one_rate_each():
    table = programme(3, {"centrifugal_stiffness": {"coefficient": 20.0}}, runs=7)
    for run, rate in zip(table["run"], (0.0, 3.0, -3.0, 6.0, -6.0, 9.0, -9.0), strict=True):
        run["environment"]["rate_rad_s"] = rate
    _, out = verdict(table)
    assert [e["name"] for e in out["effects"]] == ["centrifugal_stiffness"] and out[
        "verdict"
    ] == "explained"
    found = out["effects"][0]["parameters"]["coefficient"]
    assert abs(found["value"] - 20.0) < 4 * found["std"] and found["std"] < 0.2
    assert out["frequencies"]["follow"] == ["centrifugal_stiffness"]


def test_a_stiffness_lowered_by_rotation_is_found_and_sized_in_runs_whose_rate_steps():
    """What a step of the rate leaves unknown takes no part of a cause that acts between the
    steps."""
    steps = {"kind": "steps", "levels_rad_s": [1.0, -1.0, 2.0, 0.0], "dwell_s": 0.45}
    _, out = verdict(programme(4, {"centrifugal_stiffness": {"coefficient": 20.0}}, rate=steps))
    assert [e["name"] for e in out["effects"]] == ["centrifugal_stiffness"] and out[
        "verdict"
    ] == "explained"
    found = out["effects"][0]["parameters"]["coefficient"]
    assert abs(found["value"] - 20.0) < 4 * found["std"] and found["std"] < 1.0


def test_frequencies_follow_temperatures_that_stand_still_in_every_run():
    table = programme(
        4, {"thermal_frequency": {"relative_1_k": 3e-7, "reference_temperature_degc": 22.0}}, runs=6
    )
    for run, warm in zip(table["run"], (20.0, 23.0, 26.0, 25.0, 21.0, 24.0), strict=True):
        run["environment"].pop("temperature")
        run["environment"]["temperature_degc"] = warm
    _, out = verdict(table)
    assert [e["name"] for e in out["effects"]] == ["thermal_frequency"] and out[
        "verdict"
    ] == "explained"
    found = out["effects"][0]["parameters"]["relative_1_k"]
    assert abs(found["value"] - 3e-7) < 4 * found["std"]


def test_a_cause_of_the_runs_motion_takes_their_frequencies_too():
    """Ramps of one slope each: within a run a gradient shows its splits alone, its frequency is the
    run's own; no second cause is asked for what it does between the runs."""
    true = {"frequency_s_k": 2e-7, "split_cos_rad_k": 0.02, "split_sin_rad_k": -0.03}
    table = programme(8, {"thermal_gradient": true}, runs=6)
    for run, slope in zip(table["run"], (1.0, -0.8, 0.5, -1.2, 0.7, -0.4), strict=True):
        ramp = {"kind": "ramp", "start_degc": 22.0, "stop_degc": 22.0 + 2 * slope}
        run["environment"]["temperature"] = ramp
    _, out = verdict(table)
    assert [e["name"] for e in out["effects"]] == ["thermal_gradient"]
    assert out["verdict"] == "explained" and out["frequencies"]["follow"] == ["thermal_gradient"]
    for name, found in out["effects"][0]["parameters"].items():
        assert abs(found["value"] - true[name]) < 4 * found["std"], name
    assert out["effects"][0]["parameters"]["frequency_s_k"]["std"] < 1e-7


def test_too_few_runs_name_no_cause_of_their_frequencies_but_say_which_would_do():
    """Four offsets less their mean lie by chance along one of eighteen directions too often."""
    table = programme(3, {"centrifugal_stiffness": {"coefficient": 1.5}}, runs=4, noise=3e-3)
    for run, rate in zip(table["run"], (0.0, 3.0, -6.0, 9.0), strict=True):
        run["environment"]["rate_rad_s"] = rate
    _, out = verdict(table)
    assert out["effects"] == [] and out["verdict"] == "unexplained"
    assert "centrifugal_stiffness" in out["frequencies"]["would_follow"]
    assert "by chance with p = 0.0" in out["frequencies"]["sentence"]


def test_a_wander_that_nothing_follows_is_said_and_blamed_on_nothing():
    table = programme(5, runs=6)
    random = np.random.default_rng(5)
    for run in table["run"]:
        run["device"] = {
            "frequency_hz": table["device"]["frequency_hz"] + 0.02 * random.standard_normal()
        }
    _, out = verdict(table)
    assert out["verdict"] == "unexplained" and out["effects"] == []
    assert out["frequencies"]["sigma"] > 100 and 0.005 < out["frequencies"]["scatter_hz"] < 0.06
    assert "nothing in the catalogue follows it" in out["frequencies"]["sentence"]


def test_frequencies_that_agree_are_said_to():
    _, out = verdict(programme(6, runs=4))
    assert out["frequencies"]["sentence"] == "the runs' frequencies agree within their errors"


def test_one_sign_of_rotation_hides_a_gain_behind_the_damping_split():
    """PHYSICS gauge theorem: the group and the next experiment, not a name."""
    table = programme(7, {"gain_mismatch": {"gain": 2e-3}}, runs=4)
    for run in table["run"]:
        run["environment"]["rate_rad_s"] = 2.0
    out = summary(diagnose(waves(table)))
    entry = next(g for g in out["not_separable"] if g["effects"] == ["gain_mismatch"])
    assert (
        out["effects"] == []
        and entry["base"] == "damping split"
        and "rotating" in entry["next_experiment"]
    )


def test_a_logged_loop_is_measured_and_not_named():
    _, out = verdict(
        programme(7, {"finite_quadrature_gain": {"gain_1_s": 5.0}}, runs=4, forced=True)
    )
    entry = next(g for g in out["not_separable"] if g["effects"] == ["finite_quadrature_gain"])
    assert out["effects"] == [] and "its gain is 5 ±" in entry["base"] and entry["next_experiment"]


@pytest.mark.slow
def test_a_gradient_beside_a_temperature_dependence_has_its_own_size():
    """Slopes that stand still in every run show the split's gradient; the frequency's is hidden and
    stays at nothing."""
    warm = {"reference_temperature_degc": 22.0}
    effects = {
        "thermal_frequency": {"relative_1_k": 3e-7} | warm,
        "split_temperature": {"cos_rad_s_k": 0.008, "sin_rad_s_k": 0.006} | warm,
        "thermal_gradient": {"split_cos_rad_k": 4e-3},
    }
    _, out = verdict(programme(6, effects))
    assert sorted(e["name"] for e in out["effects"]) == sorted(effects)
    gradient = next(e for e in out["effects"] if e["name"] == "thermal_gradient")
    assert (
        abs(gradient["parameters"]["split_cos_rad_k"]["value"] - 4e-3)
        < 4 * gradient["parameters"]["split_cos_rad_k"]["std"]
    )
    assert gradient["held"]["frequency_s_k"]["value"] == 0


def test_a_rate_of_the_wrong_sign_is_suspect():
    found = [w.replace(rate_rad_s=-w.rate_rad_s) for w in waves(programme(8, runs=4))]
    diagnosis = diagnose(found)
    assert diagnosis.status == "refused" and "rate log of wrong sign" in diagnosis.status_reasons[0]


def test_a_scale_factor_that_no_run_shows_is_assumed_and_not_measured():
    table = programme(6, runs=4)
    table["device"]["scale_factor"] = 0.3
    for run in table["run"]:
        run["environment"]["rate_rad_s"] = 0.0
    _, out = verdict(table)
    told = next(v for v in out["values"] if v["name"] == "scale_factor")
    assert out["verdict"] == "adequate"
    assert told["assumed"] and abs(told["value"] - 0.3) < told["std"]
