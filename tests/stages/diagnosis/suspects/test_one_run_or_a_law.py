"""One run's mistake against a law of what is logged of all runs, which bends the run farthest out
most."""

import numpy as np
import pytest
from synthetic_waves import as_wave, envelope

from hrg_cli.physics.resonator import Mechanics
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
    t = (np.arange(WINDOWS) + 0.5) * WINDOW_S

    def warm(t):
        return first + (last - first) * t / (WINDOWS * WINDOW_S)

    def bent(t):
        return rate * (1 + square * (warm(t) - 27.0) ** 2)

    u = envelope(DEVICE, 0.1 + 0.4 * number, bent, t, ratio=0.05, phase=0.3)
    return as_wave(
        u, t, NOISE, DEVICE, np.random.default_rng(number), rate=np.full(WINDOWS, rate * log_scale),
        run_id=f"q{number}", temperature_degc=warm(t),
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
