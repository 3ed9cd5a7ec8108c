"""One pick-off under both names: told by its noise, and never by the wave alone."""

import numpy as np
import pytest

from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate

SAMPLES = 40_000
WAVE = np.exp(-np.arange(SAMPLES) / 5e4) * np.cos(0.7539 * np.arange(SAMPLES))
NOISE = 1e-4 * np.random.default_rng(4).standard_normal((2, SAMPLES))
C = WAVE + NOISE[0]


def judged(c, s, **more):
    """Status and reasons of both channels' samples, demodulated."""
    run = Recording(c=c, s=s, sample_rate_hz=25e3, mode="free", run_id="r1", **more)
    periods = collect(demodulate(run, periods_per_window=12))
    return periods.status, " ".join(periods.status_reasons)


@pytest.mark.parametrize(
    ("c", "s", "said"),
    [
        (C, C, "channel C, noise"),
        (C, -C, "multiplied by -1, noise"),
        (C, 0.37 * C, "multiplied by 0.37, noise"),
        (C.astype("f4"), (3 * C).astype("f4"), "multiplied by 3, noise"),
        (np.round(3e4 * C).astype("i2"), np.round(3e4 * C).astype("i2"), "channel C, noise"),
    ],
)
def test_one_pick_off_twice_is_doubted(c, s, said):
    status, reasons = judged(c, s)
    assert status == "suspect"
    assert "channel S holds the samples of channel C" in reasons
    assert said in reasons


@pytest.mark.parametrize(
    ("c", "s"),
    [
        (C, WAVE + NOISE[1]),
        (C, C + 1e-6 * NOISE[1] / 1e-4),
        (WAVE, WAVE),
        (WAVE, 0.5 * WAVE),
        (WAVE + 1e-11 * NOISE[0], WAVE + 1e-11 * NOISE[0]),
        (np.round(3e4 * WAVE).astype("i2"), np.round(3e4 * WAVE).astype("i2")),
        (np.round(300 * WAVE).astype("i2"), np.round(300 * WAVE).astype("i2")),
        (C, np.zeros(SAMPLES)),
    ],
)
def test_a_wave_at_45_degrees_is_not(c, s):
    """Of own noise, however small, and of no noise at all."""
    assert "holds the samples" not in judged(c, s)[1]
