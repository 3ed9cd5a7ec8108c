"""The trim that a forecast states, on a gyro whose loops act late: what the spring leaves, and the
fight of a spring that follows the wave at high rates (seed A, remarks after (16))."""

import numpy as np
import pytest

from hrg_cli.physics.resonator import PARAMETERS
from hrg_cli.records import Resonator, collect
from hrg_cli.stages.forecast import forecast
from hrg_cli.stages.simulate import simulate

pytest.importorskip("numba")
DEVICE = {
    "frequency_hz": 1000.0, "damping_rate_1_s": 0.5, "damping_split_1_s": 0.02, "damping_axis_rad": 0.3,
    "frequency_split_rad_s": 1.2, "stiffness_axis_rad": 0.6, "scale_factor": 0.55,
}  # fmt: skip
LATE = {"periods_per_update": 8, "delay_periods": 40.0, "phase_loop_hz": 1.0}
"""τ = 48 ms from the middle of what is read to the middle of what is held."""


def trim():
    value = np.array([DEVICE[name] for name, _ in PARAMETERS])
    std = 1e-4 * np.abs(value)
    identified = Resonator(
        name=np.array([name for name, _ in PARAMETERS]),
        value=value,
        std=std,
        units=np.array([unit for _, unit in PARAMETERS]),
        covariance=np.diag(std**2),
    )
    found = forecast(identified, trim=True, quadrature_gain_1_s=10.0, duration_s=1.0).trim
    return {"size_rad_s": found.size_rad_s, "axis_rad": found.axis_rad}


def quadrature(rate, loop="off", **tables):
    """√2 times the rms of a_B/a_A of a board's gyro, settled: the amplitude of a sine."""
    control = {"mode": "forced", "amplitude_gain_1_s": 5.0, "quadrature_loop": loop}
    if loop != "off":
        control["quadrature_gain_1_s"] = 10.0
    record = collect(
        simulate(
            {
                "device": DEVICE, "control": control, "electronics": LATE, "environment": {"rate_rad_s": rate},
                "recording": {"sample_rate_hz": 8000.0, "duration_s": 8.0},
            } | tables,
            seed=1,
        )
    )  # fmt: skip
    late = record.truth_time_s > 4
    ratio = (record.truth_quadrature_amplitude / record.truth_main_amplitude)[late]
    return float(np.sqrt(2 * np.mean(ratio**2)))


def test_the_trim_leaves_what_lateness_makes_and_not_the_split():
    """Untrimmed the quadrature of a turning wave is δω/√(ν² + (2KΩ)²); the trim leaves no split,
    only what the late main force and the turning itself make, some KΩ/2ω."""
    rate = 8.0
    rough, trimmed = quadrature(rate), quadrature(rate, spring=trim())
    assert rough == pytest.approx(1.2 / np.hypot(0.5, 2 * 0.55 * rate), rel=0.02)
    assert trimmed < 3 * 0.55 * rate / (2 * 2 * np.pi * 1000.0)


def test_at_high_rates_a_spring_that_follows_the_wave_feeds_what_the_constant_one_has_taken_away():
    """Late by τ it stands 2KΩτ = 0.59 π behind the wave. A constant one does not follow; a loop
    beside it brings the fight back where it is a spring, and none where it is a force."""
    rate, spring = 35.0, trim()
    off, follows = quadrature(rate), quadrature(rate, "spring")
    assert follows > 8 * off
    constant = quadrature(rate, spring=spring)
    assert constant < 0.12 * off
    assert quadrature(rate, "spring", spring=spring) > 8 * off
    assert quadrature(rate, "finite", spring=spring) < constant
