"""A frequency that moves within a run tells nothing against its resonator: the rate stands beside it,
and so do its standard deviations."""

import numpy as np
import pytest
from synthetic_waves import GYRO, as_wave, envelope
from test_rate_nodes import known_resonator

from hrg_cli.stages.rate import rate

SECONDS, WINDOW_S, NOISE = 6.0, 5e-3, 1e-4


def drawn(course, seed):
    """A run at a swinging rate whose frequency is `course` Hz off, and that rate."""
    t = np.arange(1, int(SECONDS / WINDOW_S) + 1) * WINDOW_S

    def swing(time):
        return 0.5 * np.sin(2 * np.pi * time / SECONDS + 0.3)

    phase = 2 * np.pi * np.cumsum(course(t)) * WINDOW_S
    u = envelope(GYRO, 0.2, swing, t) * np.exp(1j * phase)[:, None]
    return as_wave(u, t, NOISE, GYRO, np.random.default_rng(seed)), swing


@pytest.mark.parametrize(
    "course",
    (lambda t: 1e-2 * t / SECONDS, lambda t: 0.1 * np.exp(-t), lambda t: 0.02 * np.sin(2 * t)),
    ids=("ramp", "settling", "swing"),
)
def test_the_rate_beside_a_moving_frequency_is_right(course):
    """A ramp of 10 mHz was "refused", another resonator blamed; rms of error/σ over 8 draws of 20
    nodes is 1 ± 0.06 by chance."""
    squares = []
    for seed in range(8):
        wave, swing = drawn(course, seed)
        found = rate(wave, known_resonator())
        assert found.status == "valid", found.status_reasons
        assert "the frequency moves by" in " ".join(found.status_reasons)
        error = found.rate_estimate_rad_s - swing(found.time_s)
        squares.append(np.mean((error / found.rate_estimate_rad_s_std) ** 2))
    assert 0.8 < np.sqrt(np.mean(squares)) < 1.22


def test_a_constant_frequency_is_not_said_to_move():
    wave, _ = drawn(lambda t: 0.1 + 0 * t, 0)
    found = rate(wave, known_resonator())
    assert found.status == "valid" and "moves" not in " ".join(found.status_reasons)


def test_another_gyro_s_resonator_is_no_moving_frequency():
    wave, _ = drawn(lambda t: 0 * t, 0)
    other = known_resonator()
    other = other.replace(value=other.value * np.where(other.name == "damping_rate_1_s", 1.1, 1.0))
    assert rate(wave, other).status != "valid"
