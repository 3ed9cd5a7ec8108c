"""The run-down of a struck body is found within a recording: strike, other sounds and silence are
flagged, and nothing else ever is."""

import numpy as np
import pytest

from hrg_cli.records import FLAG_SETTLING, Recording, collect
from hrg_cli.stages.demodulate import demodulate

RATE = 8000.0


def struck(strike_s, touched_s, seconds, hz=523.0, decay=0.4, noise=2e-4, seed=0, split_hz=0.7):
    """Silence, a strike with a short rattle and dying partials, a decaying pair of modes, a hand
    that stops it with a noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE)) / RATE
    since, touched = np.maximum(t - strike_s, 0), np.maximum(t - touched_s, 0)
    rings = (t >= strike_s) * np.exp(-decay * since - 8 * touched)
    pair = [np.cos(2 * np.pi * (hz + k * split_hz) * since) for k in (0, 1)]
    partial = (t >= strike_s) * np.exp(-9 * since) * np.cos(2 * np.pi * 2.7 * hz * since)
    rattle = (t >= strike_s) * np.exp(-30 * since) * rng.standard_normal(len(t))
    hand = (t >= touched_s) * 4e-3 * rng.standard_normal(len(t))
    c = (
        rings * (0.2 * pair[0] + 0.08 * pair[1])
        + 0.3 * partial
        + 0.3 * rattle
        + hand
        + noise * rng.standard_normal(len(t))
    )
    s = (
        rings * (0.1 * pair[0] - 0.15 * pair[1])
        + 0.2 * partial
        + 0.3 * rattle
        + hand
        + noise * rng.standard_normal(len(t))
    )
    return Recording(
        c=c, s=s, sample_rate_hz=RATE, mode="free", run_id="bell", nominal_frequency_hz=hz
    )


@pytest.mark.parametrize("seed", range(4))
def test_strike_and_hand_are_flagged(seed):
    rng = np.random.default_rng(seed)
    strike, touched = rng.uniform(0.3, 2), rng.uniform(7, 9)
    made = collect(demodulate(struck(strike, touched, 10.0, seed=seed), periods_per_window=20))
    inside = made.flags & FLAG_SETTLING == 0
    assert made.time_s[inside][0] > strike and made.time_s[inside][-1] < touched + 0.1
    assert made.time_s[inside][0] < strike + 0.6 and made.time_s[inside][-1] > touched - 0.2
    assert inside[(made.time_s > strike + 0.7) & (made.time_s < touched - 0.3)].all(), (
        "nothing between is lost"
    )
    said = " ".join(made.status_reasons)
    assert "begins with a strike" in said and "is over at" in said and made.status == "valid"


def test_a_wave_that_is_gone_is_flagged():
    """Noise alone remains when the wave has fallen below it; a strike at the very beginning needs
    no flag but its rattle's."""
    made = collect(
        demodulate(struck(0.0, 99.0, 20.0, decay=1.5, noise=2e-3), periods_per_window=20)
    )
    inside = made.flags & FLAG_SETTLING == 0
    gone = np.log(0.2 / 2e-3) / 1.5
    assert gone < made.time_s[inside][-1] < 3 * gone


def free(kind, rng):
    """A run-down without a strike and its sampling rate: decays, beats (one channel too), dry
    friction, a tone of its own beside it."""
    rate = 10 ** rng.uniform(2, 5)
    hz, n = rate / rng.uniform(4, 30), int(10 ** rng.uniform(4, 4.7))
    t = np.arange(n) / rate
    span = t[-1]
    decay, split = 10 ** rng.uniform(-2, 0.7) / span, min(rng.uniform(0, 30) / span, hz / 5)
    u = np.exp((2j * np.pi * hz - decay) * t)
    c = u * (1 + rng.uniform(0, 1.1) * np.exp(2j * np.pi * split * t + 1j * rng.uniform(0, 6)))
    s = rng.uniform(0.1, 1) * u * np.exp(1j)
    if kind == "one channel":
        s = 0 * s
    if kind == "dry friction":
        c, s = (w * np.maximum(0.05, 1 - t / span / rng.uniform(1.05, 1.3)) for w in (c, s))
    tone = 0.02 * np.cos(2 * np.pi * 0.31 * hz * t) * (kind == "tone")
    noise = 10 ** rng.uniform(-5, -2.5)
    return [w.real + tone + noise * rng.standard_normal(n) for w in (c, s)], rate


@pytest.mark.parametrize("kind", ["two channels", "one channel", "dry friction", "tone"])
def test_nothing_of_an_ordinary_run_down_is_flagged(kind):
    rng = np.random.default_rng(7)
    for _ in range(6):
        (c, s), rate = free(kind, rng)
        made = collect(
            demodulate(Recording(c=c, s=s, sample_rate_hz=rate, mode="free"), periods_per_window=10)
        )
        assert not any("run-down" in reason for reason in made.status_reasons), made.status_reasons


def test_a_forced_run_is_never_cut():
    made = collect(demodulate(struck(1.0, 99.0, 6.0).replace(mode="forced"), periods_per_window=20))
    assert not any("strike" in reason for reason in made.status_reasons)


def test_a_measured_bowl(measured_data):
    """Struck at 0.8 s and touched from about 19.5 s on: between, both modes are found as by an
    independent fit (0.56 Hz, 0.13 1/s)."""
    from hrg_cli.formats import import_log

    recording = collect(import_log(measured_data / "singing_bowl" / "bowl.flac", s="none"))
    made = collect(demodulate(recording, periods_per_window=20))
    inside = made.time_s[made.flags == 0]
    assert 0.8 < inside[0] < 2.2 and 18.5 < inside[-1] < 19.8


def test_a_measured_bell(measured_data):
    """Nothing is cut off the end of a bell whose mode stands out of the noise to the last window
    but the faded ones."""
    from hrg_cli.formats import import_log

    recording = collect(
        import_log(measured_data / "bell" / "perc_bell.flac", nominal_frequency_hz=3618.0)
    )
    made = collect(demodulate(recording, periods_per_window=100))
    assert made.time_s[made.flags == 0][-1] > 6.0
