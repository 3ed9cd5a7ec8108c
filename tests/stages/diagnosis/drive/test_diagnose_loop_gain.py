"""The most that a loop's gain can be, from its log and from waves that show its amplitude in noise."""

import numpy as np
import pytest

from hrg_cli.stages.diagnosis.drive import loop_gain

ROWS, STEP_S, GAIN_1_S, INTEGRAL_1_S2, SIGMA = 400, 0.02, 12.0, 6.0, 1e-5


def loop(seed, size):
    """A held amplitude about 0 that scatters by `size`, seen in noise, and the command."""
    random = np.random.default_rng(seed)
    x = size * random.normal(size=ROWS)
    command = 1.5 - GAIN_1_S * x - INTEGRAL_1_S2 * STEP_S * np.cumsum(x)
    return x + SIGMA * random.normal(size=ROWS), command


def bound(held, command):
    class Runs:
        weight, forced = np.full((1, ROWS), 1 / SIGMA), np.ones((1, ROWS))

    return loop_gain._bound(Runs, held[None], command[None])


@pytest.mark.parametrize("size", [1e-4, 1e-5, 2e-6])
def test_a_gain_is_bounded_from_above_however_small_its_amplitude_in_noise(size):
    """2 σ and a variance of differences that is taken twice too large: one in a thousand below."""
    bounds = np.array([bound(*loop(seed, size)) for seed in range(40)])
    assert bounds.min() > 0.98 * GAIN_1_S
    # what is taken off 1/k is 2 · 2σ/√ΣΔf²
    assert np.median(bounds) < 1.1 * GAIN_1_S / max(1 - 4 * SIGMA / size / np.sqrt(2 * ROWS), 0.05)


def test_what_moves_the_command_alone_makes_the_bound_looser():
    held, command = loop(3, 1e-4)
    noisy = command + 2e-3 * np.random.default_rng(4).normal(size=ROWS)
    assert bound(held, noisy) > 1.5 * bound(held, command)


def test_a_command_that_stands_still_has_no_gain():
    held, _ = loop(5, 1e-4)
    assert bound(held, np.full(ROWS, 1.5)) == 0.0


def test_an_amplitude_lost_in_noise_bounds_nothing():
    held, command = loop(6, 1e-8)
    assert bound(held, command) == np.inf
