"""Driven runs at several temperatures and rates, whose frequency, damping, damping split and scale
factor follow the temperature: each dependence is a cause, with its size, and nothing else is named."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from hrg_cli import collect, demodulate, diagnose, estimate, simulate

SHIPPED = Path(__file__).parents[3] / "configs" / "forced_temperature.toml"
CAUSES = {"thermal_damping", "scale_factor_temperature", "damping_split_temperature"}
OF_FREQUENCY = {
    "thermal_frequency": ("relative_1_k", 0),
    "thermal_frequency_curvature": ("relative_1_k2", 1),
}
"""Causes of a frequency that follows temperature: their parameter, and the power that it goes with."""
SMALL = {
    "device": {
        "frequency_hz": 2000.0,
        "time_constant_s": 4.0,
        "damping_split": 0.03,
        "damping_axis_rad": 0.5,
        "frequency_split_hz": 0.03,
        "stiffness_axis_rad": 0.2,
        "scale_factor": 0.55,
        "temperature": {
            "frequency_per_degc": [88e-6, -4e-8],
            "damping_rate_per_degc": 0.006,
            "damping_split_per_degc": 0.02,
            "scale_factor_per_degc": 1e-4,
        },
    },
    "control": {
        "mode": "forced",
        "quadrature_loop": "finite",
        "quadrature_gain_1_s": 10.0,
        "quadrature_integral_1_s2": 25.0,
    },
    "readout": {"noise": 5e-4},
    "recording": {"sample_rate_hz": 13000.0, "duration_s": 5.0, "gyro_id": "SIM-2"},
    "run": [
        {
            "run_id": f"{name}{rate:+g}",
            "environment": {"temperature_degc": warm, "rate_rad_s": rate},
        }
        for name, warm in (("cold", 0.0), ("room", 20.0), ("hot", 40.0))
        for rate in (2.0, -3.0)
    ],
}


def diagnosed(config, seed, periods):
    waves = []
    for run in config["run"]:
        recording = collect(simulate(config, run=run["run_id"], seed=seed))
        waves.append(collect(estimate(collect(demodulate(recording, periods_per_window=periods)))))
    found = diagnose(waves)
    return found, json.loads(found.report)


def check(config, found, report):
    causes = {cause["name"]: cause["parameters"] for cause in report["effects"]}
    bends = config["device"]["temperature"].get("frequency_per_degc", [])
    assert found.verdict == "explained"
    assert set(causes) == CAUSES | (set(OF_FREQUENCY) if bends else set())
    device, courses = config["device"], config["device"]["temperature"]
    for cause, key in (
        ("thermal_damping", "damping_rate_per_degc"),
        ("scale_factor_temperature", "scale_factor_per_degc"),
    ):
        slope = causes[cause]["relative_1_k"]
        # four σ, and the reference that is not the simulation's
        assert slope["value"] == pytest.approx(courses[key], abs=4 * slope["std"], rel=5e-3)
    split = device["damping_split"] / device["time_constant_s"] * courses["damping_split_per_degc"]
    angle = 4 * device["damping_axis_rad"]
    for name, true in (("cos_1_s_k", split * np.cos(angle)), ("sin_1_s_k", split * np.sin(angle))):
        slope = causes["damping_split_temperature"][name]
        assert abs(slope["value"] - true) < 4 * slope["std"]
    shares = {cause["name"]: cause["share"] for cause in report["effects"]}
    for cause, (name, power) in OF_FREQUENCY.items() if bends else ():
        # each run's own frequency takes it over in the base model: it turns no wave by more than
        # what the loops' trackers may leave
        assert shares[cause]["drift_deg_h"] < 2
        slope = causes[cause][name]
        assert abs(slope["value"] - bends[power]) < 4 * slope["std"]


def test_what_follows_the_temperature_in_driven_runs_is_named_with_its_size():
    check(SMALL, *diagnosed(SMALL, seed=3, periods=20))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_the_shipped_forced_runs_are_explained(seed):
    config = tomllib.loads(SHIPPED.read_text())
    check(config, *diagnosed(config, seed, periods=20))
