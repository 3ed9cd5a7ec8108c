"""demodulate beside windows that hold no number: samples that are not finite, gaps of the sampling."""

import numpy as np
import pytest

from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate

FREQUENCY_HZ, RATE_HZ, SAMPLES, NOISE = 700.0, 3000.0, 30_000, 1e-4
TIME_S = np.arange(SAMPLES) / RATE_HZ


def channels(wander_rad=0.0):
    """A wave that turns by 0.07 rad a window of ten periods, and decays; its phase swings by
    `wander_rad` twice a second."""
    turn, size = 5.0 * TIME_S, np.exp(-0.4 * TIME_S)
    phase = 2 * np.pi * FREQUENCY_HZ * TIME_S + wander_rad * np.sin(4 * np.pi * TIME_S)
    c = np.cos(turn) * np.cos(phase) - 0.03 * np.sin(turn) * np.sin(phase)
    s = np.sin(turn) * np.cos(phase) + 0.03 * np.cos(turn) * np.sin(phase)
    return size * np.stack([c, s]) + NOISE * np.random.default_rng(1).normal(size=(2, SAMPLES))


def envelopes(c, s):
    """Times, complex envelopes against no reference (n, 2), their σ (n, 2), flags."""
    recording = Recording(c=c, s=s, sample_rate_hz=RATE_HZ, mode="free")
    found = collect(demodulate(recording, periods_per_window=10.0))
    turn = np.exp(2j * np.pi * found.reference_frequency_hz * found.time_s)[:, None]
    u = (found.signals[:, 0::2] - 1j * found.signals[:, 1::2]) * turn
    return u, found.signals_std[:, 0::2], found.flags


@pytest.mark.parametrize(
    "lost",
    [
        pytest.param(np.random.default_rng(2).integers(0, SAMPLES, 20), id="twenty at random"),
        pytest.param(np.random.default_rng(3).integers(0, SAMPLES, 200), id="two hundred"),
        pytest.param(np.arange(9000, 12_000), id="a tenth in one piece"),
        pytest.param(np.arange(500), id="the beginning"),
        pytest.param(np.arange(SAMPLES - 700, SAMPLES), id="the end"),
    ],
)
def test_windows_beside_lost_samples_are_those_of_the_whole_recording(lost):
    """What the wave's turning pulls a window by is known from its neighbours; beside a window that
    has no number it stayed in, by up to 19 σ and without a flag."""
    c, s = channels()
    whole, std, _ = envelopes(c, s)
    c = c.copy()
    c[lost] = np.nan
    with_lost, _, flags = envelopes(c, s)
    kept = flags == 0
    assert 0.6 * len(kept) < kept.sum() < len(kept)
    off = np.abs((with_lost - whole)[kept]) / std[kept]
    assert off.max() < 1.0
    assert np.sqrt(np.mean(off**2)) < 0.1


def test_a_gap_may_hold_a_whole_block_of_windows():
    """Where the frequency swings a block is a few windows long, and one without a sample ended in an
    internal error."""
    c, s = channels(wander_rad=3.0)
    kept = (TIME_S < 2.0) | (TIME_S > 3.5)
    recording = Recording(c=c[kept], s=s[kept], time_s=TIME_S[kept], mode="free")
    found = collect(demodulate(recording, periods_per_window=10.0))
    within = (found.time_s > 2.02) & (found.time_s < 3.48)
    assert (found.flags[within] != 0).all() and np.isnan(found.signals[within]).all()
    assert np.isfinite(found.signals[~within & (found.flags == 0)]).all()


@pytest.mark.parametrize("lost", (1, 3, 7))
@pytest.mark.parametrize("at", (SAMPLES // 2, SAMPLES // 2 + 21))
def test_the_noise_of_windows_beside_a_jump_is_the_others(lost, at):
    """Samples lost without a trace are a jump, and the slope of a window beside it is the jump's;
    what that slope would put into the window's residual was taken out of the pool, whose noise
    became 30 times too small in one channel."""
    c, s = (np.delete(x, slice(at, at + lost)) for x in channels())
    _, std, flags = envelopes(c, s)
    _, usual, _ = envelopes(*channels())
    clear = np.abs(np.arange(len(std)) * 10 / FREQUENCY_HZ - at / RATE_HZ) > 0.05
    ratio = std[clear & (flags == 0)] / np.median(usual, axis=0)
    # the jump stands in the residual's spectrum too, and widens every window alike
    assert ratio.min() > 0.7 and ratio.max() < 3
    of_c, of_s = np.median(ratio, axis=0)
    assert 0.75 < of_c / of_s < 1.33
