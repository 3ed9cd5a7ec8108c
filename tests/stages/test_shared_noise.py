"""One recording under two names, by its noise: whatever was done to the copy; and runs that are two."""

from itertools import pairwise

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.records import Recording, collect
from hrg_cli.stages import shared_noise
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify
from hrg_cli.stages.shared_noise import find_shared_noise, need_own_noise

SAMPLING_HZ, FREQUENCY_HZ, LENGTH_S = 8123.0, 1000.3, 12.0


def samples(angle, noise_seed, hum=0.0, rate=0.3, noise=3e-4, size=1.0):
    """Both channels (n, 2) of a wave that turns evenly and decays, with white noise and a line."""
    t = np.arange(0, LENGTH_S, 1 / SAMPLING_HZ)
    theta = angle + rate * t
    direction = np.stack([np.cos(2 * theta), np.sin(2 * theta)], axis=1)
    wave = size * np.exp(-t / 20) * np.cos(2 * np.pi * FREQUENCY_HZ * t)
    line = hum * np.cos(2 * np.pi * 993.0 * t)
    white = np.random.default_rng(noise_seed).standard_normal((len(t), 2))
    return wave[:, None] * direction + line[:, None] + noise * white


def waved(values, run_id, first=0):
    """Of the samples from the first on, by the chain."""
    values = values[first:]
    recording = Recording(
        c=values[:, 0], s=values[:, 1], sample_rate_hz=SAMPLING_HZ, mode="free", gyro_id="G", run_id=run_id,
        auxiliary_time_s=np.array([0.0, LENGTH_S]), rate_rad_s=np.array([-0.6, -0.6]) / 0.55,
    )  # fmt: skip
    return collect(estimate(collect(demodulate(recording, periods_per_window=20.0))))


COPIES = {
    "single precision": lambda x: (x.astype("f4"), 0),
    "six digits": lambda x: (np.round(x, 6), 0),
    "cut by whole windows": lambda x: (x, 8 * 162),
    "cut within a window": lambda x: (x, 4061),
    "twice as large": lambda x: (2 * x, 0),
    "in millivolts, cut, and turned over": lambda x: (-1000 * x, 8 * 162),
    "longer than the other": lambda x: (x[: len(x) // 2], 0),
}


@pytest.mark.parametrize("kind", COPIES)
def test_a_copy_is_told_by_its_noise(kind):
    whole, other = samples(0.3, 1), samples(1.1, 2)
    values, first = COPIES[kind](whole)
    waves = [waved(whole, "a"), waved(other, "b"), waved(values, "copy", first)]
    found = find_shared_noise(waves)
    assert (found.first, found.second) == (0, 2)
    assert found.shift_s == pytest.approx(first / SAMPLING_HZ, abs=0.02)
    with pytest.raises(HrgError, match=r"runs a and copy share .* one recording under two names"):
        identify(waves)


def test_runs_are_two_that_move_alike_with_noise_of_their_own():
    need_own_noise([waved(samples(0.3, seed), str(seed)) for seed in range(4)])


def test_runs_are_two_that_a_simulator_gave_the_same_noise():
    need_own_noise([waved(samples(angle, 5), str(angle)) for angle in (0.1, 0.6, 1.2)])


def test_runs_are_two_that_differ_in_amplitude_and_not_in_noise():
    """As a simulator's seed gives them, started alike."""
    need_own_noise([waved(samples(0.3, 5, size=size), str(size)) for size in (1.0, 0.5, 1.1)])


def test_a_line_in_all_runs_makes_no_copies():
    """At every period of its beat the runs agree, so that no shift stands out."""
    need_own_noise(
        [waved(samples(angle, k, hum=2e-3), str(k)) for k, angle in enumerate((0.1, 0.7))]
    )


def test_stationary_runs_are_told_by_noise_alone():
    """Held waves at one angle move alike at any shift."""
    waves = [waved(samples(0.4, seed, rate=0.0), str(seed)) for seed in range(3)]
    need_own_noise(waves)
    for one, other in pairwise(waves):
        assert find_shared_noise([one, other, one.replace(run_id="copy")]) is not None


def test_the_motion_is_taken_off_by_savitzky_and_golays_polynomials():
    from scipy.signal import savgol_filter

    columns = np.random.default_rng(5).standard_normal((2, 300)).cumsum(axis=1)
    expected = savgol_filter(columns, shared_noise.SMOOTHED, shared_noise.DEGREE)
    assert np.allclose(shared_noise._smooth(columns), expected, rtol=0, atol=1e-9)
