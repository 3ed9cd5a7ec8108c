"""The angle random walk that `compensate` reads off a rate, from raw samples of a gyro whose noise
is all Brownian, against fluctuation and dissipation."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from hrg_cli import calibrate, collect, compensate, demodulate, estimate, simulate
from hrg_cli.physics.noise import BOLTZMANN_J_K

CONFIG = Path(__file__).parents[2] / "configs" / "brownian.toml"


def formula(config):
    """√(2νk_BT/M)/(ωaK), rad/√s."""
    device, noise = config["device"], config["noise"]
    mass = noise["effective_mass_kg"] * noise["metres_per_unit"] ** 2
    walk = 2 / device["time_constant_s"] * BOLTZMANN_J_K * noise["temperature_k"] / mass
    return np.sqrt(walk) / (2 * np.pi * device["frequency_hz"] * device["scale_factor"])


def test_a_brownian_gyro_shows_the_angle_random_walk_of_physics():
    """Windows of 32 periods stand for their middle; read as plain means they gave 2.9 % more. Each
    run's σ is 1.2 %."""
    config = tomllib.loads(CONFIG.read_text())
    waves = []
    for run in ("plus", "minus"):
        samples = collect(simulate(config, run=run, seed=0))
        waves.append(collect(estimate(collect(demodulate(samples, periods_per_window=32)))))
    assert {wave.window_stands_for for wave in waves} == {"middle"}
    tables = calibrate(waves)
    found = []
    for wave in waves:
        allan = json.loads(collect(compensate(wave, tables)).details)["allan"]
        walk = allan["angle_random_walk_rad_sqrt_s"]
        found.append(walk["value"])
        assert walk["low"] < formula(config) < walk["high"]
        assert allan["bias_instability_rad_s"]["value"] == 0
    assert np.mean(found) == pytest.approx(formula(config), rel=0.022)
