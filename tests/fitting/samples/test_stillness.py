"""A recorder that stands still for a while, in samples of an oscillation."""

import numpy as np
import pytest

from hrg_cli.records import FLAG_GAP, Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate

RATE_HZ, FREQUENCY_HZ = 12e3, 1483.7


def record(still_s, value, even=True, bits=None):
    """A ring-down of four seconds, whose channels repeat one value between two times."""
    t = np.arange(int(4 * RATE_HZ)) / RATE_HZ
    noise = 1e-4 * np.random.default_rng(3).standard_normal((2, len(t)))
    wave = np.exp(-0.1 * t) * np.cos(2 * np.pi * FREQUENCY_HZ * t)
    c, s = 0.8 * wave + noise[0], 0.6 * wave + noise[1]
    if bits is not None:
        c, s = (np.round(one * 2 ** (bits - 1)) / 2 ** (bits - 1) for one in (c, s))
    within = (t >= still_s[0]) & (t < still_s[1])
    first = int(np.argmax(within))
    c[within], s[within] = (0.0, 0.0) if value == "zero" else (c[first], s[first])
    clock = {"sample_rate_hz": RATE_HZ} if even else {"time_s": t}
    return Recording(c=c, s=s, mode="free", run_id="still", **clock)


@pytest.mark.parametrize("even", (True, False))
@pytest.mark.parametrize("value", ("zero", "last"))
def test_windows_in_which_the_recorder_stood_still_are_left_out(value, even):
    periods = collect(demodulate(record((1.0, 1.3), value, even), periods_per_window=30.0))
    left_out = periods.flags & FLAG_GAP != 0
    at = periods.time_s[left_out]
    assert 15 <= left_out.sum() <= 17 and at.min() > 0.98 and at.max() < 1.32
    said = " ".join(periods.status_reasons)
    assert "both channels repeat one value in" in said and "first at 1.00" in said

    wave = collect(estimate(periods))
    good = wave.flags == 0
    off = wave.main_amplitude[good] - np.exp(-0.1 * wave.time_s[good])
    assert np.abs(off / wave.main_amplitude_std[good]).max() < 6


def test_a_coarse_converter_does_not_stand_still():
    """Of three bits values come twice and three times in a row."""
    periods = collect(demodulate(record((9.0, 9.1), "zero", bits=3), periods_per_window=30.0))
    assert not np.any(periods.flags & FLAG_GAP)
