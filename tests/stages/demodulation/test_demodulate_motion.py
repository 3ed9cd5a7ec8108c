"""demodulate where much happens within a window: beats of whole turns, and rates that are logged more
often than there are windows."""

import numpy as np
import pytest

from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate

RATE_HZ, FREQUENCY_HZ, SECONDS = 31_500.0, 5000.0, 1.0
TIME_S = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ


def recording_of(c, s, **more):
    return Recording(
        c=c, s=s, sample_rate_hz=RATE_HZ, **({"mode": "free", "run_id": "run-1"} | more)
    )


def split_pair(split_hz, noise, seed=1):
    """Two modes of 1 and 0.6, split_hz apart, each seen in both channels, decaying alike."""
    a, b = (
        np.exp((-1.0 + 2j * np.pi * (FREQUENCY_HZ + sign * split_hz / 2)) * TIME_S)
        for sign in (1, -1)
    )
    quiet = np.random.default_rng(seed).normal(size=(2, len(TIME_S))) * noise
    return recording_of((0.8 * a + 0.36 * b).real + quiet[0], (0.6 * a - 0.48 * b).real + quiet[1])


@pytest.mark.parametrize("turns", [0.35, 0.5, 0.97, 1.1, 2.03])
@pytest.mark.parametrize("noise", [1e-5, 3e-3])
def test_a_beat_of_turns_a_window_is_doubted(turns, noise):
    """Where the pair beats once a window its envelope looks still from one window to the next, and a
    split 25 times too small was valid; what the windows leave of the samples tells."""
    window_s = 100 / FREQUENCY_HZ
    periods = collect(demodulate(split_pair(turns / window_s, noise), periods_per_window=100))
    assert periods.status == "suspect"
    assert "periods_per_window of" in " ".join(periods.status_reasons)


@pytest.mark.parametrize("turns", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("noise", [1e-5, 3e-3, 0.3])
def test_a_beat_that_windows_hold_is_not(turns, noise):
    window_s = 20 / FREQUENCY_HZ
    periods = collect(demodulate(split_pair(turns / window_s, noise), periods_per_window=20))
    assert not any("more than they hold" in reason for reason in periods.status_reasons)


@pytest.mark.parametrize("log_step_s", [1e-3, 7e-3, 60e-3])
def test_the_rate_of_windows_keeps_the_integral_of_its_log(log_step_s):
    """Ramps of 30 ms in windows of 40 ms: the sum of the windows' rates is the angle that the log
    turned, which values at the windows' middles miss by up to an eighth of a window at a corner."""
    corners = (0.0, 0.253, 0.283, 0.611, 0.641, SECONDS)
    t = np.unique(np.concatenate([np.arange(0, SECONDS, log_step_s), corners]))
    values = (0.0, 0.0, 2.0, 2.0, -1.0, -1.0)
    c = np.cos(2 * np.pi * FREQUENCY_HZ * TIME_S)
    log = dict(auxiliary_time_s=t, rate_rad_s=np.interp(t, corners, values))
    periods = collect(demodulate(recording_of(c, c, **log), periods_per_window=200))
    window_s = periods.window_s
    half = window_s / 2
    begin, end = periods.time_s[0] - half, periods.time_s[-1] + half
    fine = np.linspace(begin, end, 200_001)
    angle = np.trapezoid(np.interp(fine, corners, values), fine)
    # the table rests at both ends, where a sum of rows is their integral
    assert periods.rate_rad_s.sum() * window_s == pytest.approx(angle, abs=2e-6)


def test_the_rate_of_a_smooth_swing_is_that_of_the_middle():
    """No mean is taken off a swing: its value at the middle of a window is what turns the wave
    there."""
    t = np.arange(0, SECONDS + 1e-9, 2e-3)
    c = np.cos(2 * np.pi * FREQUENCY_HZ * TIME_S)
    swing = dict(auxiliary_time_s=t, rate_rad_s=0.3 * np.sin(2 * np.pi * 2 * t))
    periods = collect(demodulate(recording_of(c, c, **swing), periods_per_window=50))
    inner = slice(4, -4)
    true = 0.3 * np.sin(2 * np.pi * 2 * periods.time_s)
    assert np.allclose(periods.rate_rad_s[inner], true[inner], atol=3e-6)
