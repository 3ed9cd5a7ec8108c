"""Codes that run over the end of their range are refused; codes that end there, or jump, are not."""

import numpy as np
import pytest

from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate

TIMES = np.arange(40_000)
DECAY = np.exp(-TIMES / 5e4)


def codes(amplitude, turn=0.7539, offset=0.0, noise=0.3):
    """Rounded samples of a decaying wave, in codes."""
    scatter = noise * np.random.default_rng(1).standard_normal(len(TIMES))
    return np.round(amplitude * DECAY * np.cos(turn * TIMES) + offset + scatter).astype(int)


def wrapped(values, bits):
    """Of a converter of so many bits."""
    half = 1 << (bits - 1)
    return (values + half) % (2 * half) - half


def judged(c, dtype, **more):
    """Status and reasons of a recording whose C are these codes, and S half of a small wave."""
    run = Recording(
        c=np.asarray(c).astype(dtype), s=(codes(50, **more) // 2).astype(dtype),
        c_scale_factor=0.01, s_scale_factor=0.01, sample_rate_hz=25e3, mode="free", run_id="r1",
    )  # fmt: skip
    periods = collect(demodulate(run, periods_per_window=12))
    return periods.status, " ".join(periods.status_reasons)


@pytest.mark.parametrize(
    ("c", "dtype", "size"),
    [
        (wrapped(codes(200), 8), "i1", 256),
        (wrapped(codes(133), 8), "i1", 256),
        (wrapped(codes(120, offset=20), 8), "i1", 256),
        (wrapped(codes(200), 8) + 128, "i2", 256),
        (wrapped(codes(40_000), 16), "i2", 65536),
        (wrapped(codes(2500), 12), "i2", 4096),
        (16 * wrapped(codes(2500), 12), "i4", 4096),
        (0.25 * wrapped(codes(200), 8), "f8", 256),
    ],
)
def test_an_overflow_is_refused(c, dtype, size):
    status, reasons = judged(c, dtype)
    assert status == "refused"
    assert f"channel C overflows: past the end of their range of {size} codes" in reasons
    assert "channel S overflows" not in reasons


TORN = codes(120)
TORN[::977] ^= 1 << 6


@pytest.mark.parametrize(
    ("c", "turn"),
    [
        (codes(127, noise=0.0), 0.7539),
        (np.clip(codes(200), -128, 127), 0.7539),
        (np.clip(codes(4e7, turn=0.0501), -128, 127), 0.0501),
        (np.clip(codes(200, turn=np.pi / 2), -128, 127), np.pi / 2),
        (codes(3), 0.7539),
        (codes(30, turn=0.0501, noise=0.1), 0.0501),
        (codes(50, noise=20.0), 0.7539),
        (TORN, 0.7539),
    ],
    ids=[
        "full",
        "clipped",
        "square",
        "clipped at four",
        "three codes",
        "few codes",
        "noise",
        "torn",
    ],
)
def test_what_is_no_overflow(c, turn):
    assert "overflows" not in judged(c, "i2", turn=turn)[1]
