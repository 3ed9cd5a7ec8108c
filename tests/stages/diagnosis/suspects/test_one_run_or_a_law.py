"""One run's mistake against a law of what is logged of all runs, which bends the run farthest out
most."""

import numpy as np
import pytest

from hrg_cli.physics import ellipse
from hrg_cli.physics.resonator import Mechanics, build_generator, exponentiate
from hrg_cli.records import Wave
from hrg_cli.stages.diagnose import diagnose, summarise

DEVICE = Mechanics(5000.0, 0.01, 4e-4, 0.2, 0.02, 0.6, 0.277)
WINDOWS, WINDOW_S, NOISE = 1000, 0.02, 1.5e-6
RUNS = (
    (20.0, 20.0, 0.4),
    (30.0, 30.0, -0.4),
    (22.0, 32.0, 0.0),
    (33.0, 21.0, 0.15),
    (20.0, 26.0, 0.1),
)
"""First and last temperature [°C], and rate [rad/s]."""


def run(number, square, log_scale=1.0):
    """A free run whose K is bent by square·(T − 27 °C)²."""
    first, last, rate = RUNS[number]
    random = np.random.default_rng(number)
    t = (np.arange(WINDOWS) + 0.5) * WINDOW_S
    warm = first + (last - first) * t / (WINDOWS * WINDOW_S)
    bent = rate * (1 + square * (warm - 27.0) ** 2)
    steps = exponentiate(build_generator(DEVICE, bent), np.full(WINDOWS, WINDOW_S))
    u = [ellipse.compute_envelopes(*map(np.array, (1.0, 0.05, 0.1 + 0.4 * number, 0.3)))]
    for step in steps[:-1]:
        u.append(step @ u[-1])
    u = np.array(u) + NOISE * random.standard_normal((WINDOWS, 4)).view(complex)
    a_A, a_B, angle, phase = ellipse.find_wave(u)
    angle, phase = ellipse.unwrap(angle, phase)
    std, zero = np.full(WINDOWS, NOISE), np.zeros(WINDOWS)
    return Wave(
        time_s=t, main_amplitude=a_A, quadrature_amplitude=a_B, wave_angle_rad=angle,
        phase_rad=phase, carrier_phase_rad=zero, main_amplitude_std=std,
        quadrature_amplitude_std=std, wave_angle_rad_std=std, phase_rad_std=std,
        carrier_phase_rad_std=zero, residual_rms=zero, signal_std=std,
        iterations=np.zeros(WINDOWS, "i2"), flags=np.zeros(WINDOWS, "u1"),
        temperature_degc=warm, rate_rad_s=np.full(WINDOWS, rate * log_scale),
        frequency_hz=np.full(WINDOWS, 5000.0), reference_frequency_hz=5000.0,
        window_s=WINDOW_S, mode="free", run_id=f"q{number}",
    )  # fmt: skip


def test_a_scale_factor_bent_in_temperature_is_no_wrong_log():
    """The log of the coldest run was "of wrong scale" by 1.2e-5, refused: two open terms, a slope and
    a curve, leave clearly less."""
    out = summarise(diagnose([run(k, 3e-7) for k in range(5)]))
    assert out["suspect_runs"] == []
    assert out["verdict"] != "explained"
    assert "rate and temperature" in out["remainder"]["terms"][0]["covariate"]


@pytest.mark.parametrize("number", [0])
def test_a_log_of_another_scale_is_told_all_the_same(number):
    waves = [run(k, 0.0, 1.00001 if k == number else 1.0) for k in range(5)]
    (one,) = summarise(diagnose(waves))["suspect_runs"]
    assert (one["run_id"], one["what"]) == (f"q{number}", "rate log of wrong scale")
