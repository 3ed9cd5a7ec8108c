"""From raw samples of the second-order equations to tables: drift and scale factor known from the
device."""

import numpy as np
import pytest

from hrg_cli.records import collect
from hrg_cli.stages.calibrate import calibrate, summarise
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import simulate

pytest.importorskip("numba")

DEVICE = {
    "frequency_hz": 5000.0, "time_constant_s": 5.0, "damping_split": 0.02, "damping_axis_rad": 0.5, "frequency_split_hz": 0.0,
    "scale_factor": 0.55, "temperature": {"reference_degc": 20.0, "frequency_per_degc": [9e-5], "damping_split_per_degc": 0.005},
}  # fmt: skip


def waves(device, temperatures, rates, duration=8.0):
    runs = [
        {"run_id": f"T{T:g}R{R:g}", "environment": {"temperature_degc": T, "rate_rad_s": R}}
        for T in temperatures
        for R in rates
    ]
    config = {
        "device": device, "control": {"mode": "forced", "amplitude": 1.0, "quadrature_loop": "finite", "quadrature_gain_1_s": 20.0},
        "readout": {"noise": 1e-4}, "recording": {"sample_rate_hz": 20000.0, "duration_s": duration, "gyro_id": "S"}, "run": runs,
    }  # fmt: skip
    return [
        collect(
            estimate(
                collect(
                    demodulate(
                        collect(simulate(config, run=run["run_id"], seed=3)), periods_per_window=5
                    )
                )
            )
        )
        for run in runs
    ]


def test_damping_anisotropy_and_scale_factor_from_samples():
    """No frequency split, quadrature held: D = νδμ sin 2m(θ − θ_μ), νδμ growing by 0.005/°C; K =
    0.55."""
    record = calibrate(
        waves(DEVICE, (0.0, 40.0), (-3.0, 3.0)), harmonics=1, scale_factor_harmonics=1, bootstrap=0
    )
    assert record.status == "valid", record.status_reasons
    square = []
    for j, T in enumerate((0.0, 40.0)):
        split = 0.02 / 5 * (1 + 0.005 * (T - 20))
        truth = [0.0, -split * np.sin(2.0), split * np.cos(2.0)]
        square += list(((record.drift_harmonics[j] - truth) / record.drift_harmonics_std[j]) ** 2)
        square += list(
            (
                (record.scale_factor_harmonics[j] - [0.55, 0, 0])
                / record.scale_factor_harmonics_std[j]
            )
            ** 2
        )
        assert record.drift_harmonics[j] == pytest.approx(truth, abs=0.01 * split)
    assert np.mean(square) < 3 and max(square) < 20
    figures = summarise(record)["drift_rms_rad_s"]
    assert figures["before"] > 5 * figures["held_out"]


def test_drift_that_moves_with_the_quadrature_is_bought_back():
    """A frequency split under a soft quadrature loop: seed A (11) leaves less than a table over the
    angle."""
    runs = waves(
        DEVICE | {"frequency_split_hz": 0.1}, (20.0,), (-4.0, -2.0, 2.0, 4.0), duration=6.0
    )
    table, measured, chosen = (
        calibrate(runs, model=model, bootstrap=0) for model in ("table", "quadrature", "auto")
    )
    held_out = [summarise(record)["drift_rms_rad_s"]["held_out"] for record in (table, measured)]
    assert held_out[1] < 0.85 * held_out[0]
    assert table.status == "suspect" and any(
        "moves with the measured quadrature" in reason for reason in table.status_reasons
    )
    assert chosen.model in ("quadrature", "combined"), summarise(chosen)["choice"]
    assert not any("quadrature" in reason for reason in chosen.status_reasons), (
        chosen.status_reasons
    )
