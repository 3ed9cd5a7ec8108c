"""Forecasts along the orbit on which a driven wave settles, against steps all the way, and for
hours and days."""

import numpy as np
import pytest

from hrg_cli.fitting.envelopes.resonator_spread import (
    compute_vector_covariance,
    from_vector,
    make_mechanics,
    make_vector,
    spread_points,
)
from hrg_cli.physics.resonator import PARAMETERS
from hrg_cli.records import Resonator
from hrg_cli.stages.forecast import forecast
from hrg_cli.stages.forecasting import wave_path


def make_resonator(nu, split, spread=0.005):
    values = {
        "frequency_hz": 5000.0, "damping_rate_1_s": nu, "damping_split_1_s": 0.01 * nu,
        "damping_axis_rad": 0.35, "frequency_split_rad_s": split, "stiffness_axis_rad": 0.9,
        "scale_factor": 0.55,
    }  # fmt: skip
    value = np.array([values[name] for name, _ in PARAMETERS])
    std = np.abs(value) * np.array([1e-9, 1e-3, spread, spread, spread, spread, 1e-6])
    names, units = (np.array(column) for column in zip(*PARAMETERS))
    return Resonator(name=names, value=value, std=std, units=units, covariance=np.diag(std**2))


@pytest.mark.parametrize(
    ("nu", "split", "drive", "gain", "rate", "duration"),
    [
        (0.02, 0.004, "force", 0.0, 0.5, 3000.0),  # turns much faster than the quadrature settles
        (0.02, 0.004, "force", 0.5, 0.03, 600.0),
        (0.26, 0.17, "force", 5.0, 0.02, 300.0),  # hardly turns on
        (0.26, 0.17, "force", 5.0, 0.001, 600.0),  # is held fast
        (0.02, 0.004, "parametric", 0.0, 0.3, 2000.0),
        (0.02, 0.004, "parametric", 0.0, 0.0, 4000.0),
    ],
)
def test_the_orbit_and_steps_all_the_way_agree(monkeypatch, nu, split, drive, gain, rate, duration):
    record = make_resonator(nu, split)
    mechanics = make_mechanics(record)
    points = spread_points(make_vector(mechanics), compute_vector_covariance(record))
    gyros = from_vector(points, mechanics)
    run = wave_path.Conditions(drive, gain, 0.7, rate, duration)
    assert wave_path._find_usable_orbits(gyros, run) is not None
    table, error = wave_path.follow_wave(gyros, mechanics, run)
    with monkeypatch.context() as patch:
        patch.setattr(wave_path, "_find_usable_orbits", lambda *_: None)
        stepped, _ = wave_path.follow_wave(gyros, mechanics, run)
    assert error < 1e-3
    for name, found in table.items():
        largest = np.abs(stepped[name]).max()
        np.testing.assert_allclose(found, stepped[name], atol=2e-5 * largest + 1e-9, rtol=0)


@pytest.mark.parametrize("duration", [600.0, 3600.0, 1e6])
@pytest.mark.parametrize("rate", [0.0, 0.002, 0.5])
def test_hours_and_days_are_forecast_behind_a_fast_loop(rate, duration):
    """ν = 0.26 1/s and a loop of 50 1/s: 600 s at 0.5 rad/s were 1.2 million steps, refused. Turning
    on and on, the mean drift is −2KΩ δω²/(λ² + (2KΩ)²) + ((νδμ)² + (δω²/λ)²)/2KΩ, λ = ν + k_q;
    turning slowly the wave is held fast within a period, and the whole rate is its error."""
    found = forecast(
        make_resonator(0.26, 0.17), rate_rad_s=rate, duration_s=duration, quadrature_gain_1_s=50.0
    )
    assert found.status == "valid" and found.table["time_s"][-1] == duration
    error = found.table["error_rad"][-1]
    if rate == 0.5:
        turning = 2 * 0.55 * 0.5
        drift = -turning * 0.17**2 / (50.26**2 + turning**2)
        drift += (0.0026**2 + (0.17**2 / 50.26) ** 2) / turning
        assert -error * 0.55 / duration == pytest.approx(drift, rel=0.01, abs=0.003 / duration)
    else:
        assert error == pytest.approx(-rate * duration, abs=np.pi / 0.55)


def test_a_run_down_is_followed_until_it_has_faded_however_long_is_asked_for():
    found = forecast(make_resonator(0.26, 0.004), drive="free", rate_rad_s=0.5, duration_s=1e6)
    assert found.table["time_s"][-1] == 10.0
    assert any("faded" in reason for reason in found.status_reasons)
