"""Mismatch signals: what they say of a known wave, their noise counted, and a loop closed over them
in theory."""

import csv

import numpy as np
import pytest

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.mismatch import mismatch
from hrg_cli.stages.simulate import simulate


def wave(noise=1e-3):
    config = dict(
        device=dict(frequency_hz=1000.0, damping_rate_1_s=0.2),
        start=dict(amplitude=1.2, quadrature=0.05, wave_angle_rad=0.4, phase_rad=0.3),
        readout=dict(noise=noise), environment=dict(rate_rad_s=0.5), recording=dict(sample_rate_hz=10_000.0, duration_s=4.0),
    )  # fmt: skip
    recording = collect(simulate(config, seed=2))
    return recording, collect(estimate(collect(demodulate(recording, periods_per_window=10))))


def test_signals_and_their_noise():
    recording, seen = wave()
    made = mismatch(seen, main_amplitude=1.0, computing_s=2e-3)
    c = made.columns
    assert made.delay_s == pytest.approx(0.005 + 2e-3)
    assert c["available_s"] - c["time_s"] == pytest.approx(made.delay_s)
    at = recording.truth_time_s
    for name, truth in (
        ("amplitude_error", 1.0 - recording.truth_main_amplitude), ("quadrature", recording.truth_quadrature_amplitude),
        ("wave_angle_rad", recording.truth_wave_angle_rad),
    ):  # fmt: skip
        error = c[name] - np.interp(c["time_s"], at, truth)
        assert np.sqrt(np.mean((error / c[f"{name}_std"]) ** 2)) == pytest.approx(
            1, abs=5 / np.sqrt(2 * len(error))
        ), name
        assert np.std(error) * np.sqrt(2 * 0.01) == pytest.approx(made.noise_density[name], rel=0.2)
    assert np.abs(c["phase_error_rad"]).max() <= np.pi
    assert np.mean(c["angle_rate_rad_s"][1:]) == pytest.approx(
        -0.55 * 0.5 / 2, abs=5 * np.mean(c["angle_rate_rad_s_std"][1:]) / 10
    )


def test_latency_buys_quiet():
    """Four times the noise's half a window more: σ falls as n^−3/2; the scatter found is what the
    windows' deviations say."""
    _, seen = wave()
    rows = mismatch(seen).latency
    noise = np.array([row["rate_noise_rad_s"] for row in rows])
    assert noise[1:] / noise[:-1] == pytest.approx(2**-1.5, rel=0.2)
    for row in rows[:4]:
        count = 400 / row["windows"]
        assert row["rate_noise_found_rad_s"] == pytest.approx(
            row["rate_noise_rad_s"], rel=5 / np.sqrt(count)
        )
    assert np.all(np.diff([row["latency_s"] for row in rows]) > 0)


def test_no_good_window_is_no_signal():
    _, seen = wave()
    with pytest.raises(HrgError, match="no good window"):
        mismatch(seen.replace(flags=np.ones_like(seen.flags)))


def test_mismatch_command(tmp_path, hrg):
    _, seen = wave()
    store.write(tmp_path / "wave.h5", seen)
    done = hrg("mismatch", tmp_path / "wave.h5", "-o", tmp_path / "m.csv", "--json")
    assert done.status == 0, done.err
    rows = list(csv.DictReader((tmp_path / "m.csv").open()))
    assert len(rows) == done.json["rows"] and set(done.json["noise_density"]) <= set(rows[0])
    shown = hrg("mismatch", tmp_path / "wave.h5", "-o", tmp_path / "again.csv").out
    assert "rad/√Hz" in shown and "noise, °/h" in shown and "_rad" not in shown
    assert hrg("mismatch", tmp_path / "wave.h5", "-o", tmp_path / "m.h5").status == 2
