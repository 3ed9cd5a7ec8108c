"""Samples that no wave can hold: one flipped bit costs its window, is named, and moves nothing else."""

import numpy as np
import pytest
import records_by_hand as by_hand

from hrg_cli import store
from hrg_cli.fitting.samples.wild import ABOUT, CALM, WILD, find_lonely
from hrg_cli.records import FLAG_NOT_FINITE, collect
from hrg_cli.stages.demodulate import demodulate


def floats(recording):
    c, s = recording.physical()
    return recording.replace(
        c=c, s=s, c_scale_factor=1.0, s_scale_factor=1.0, truth_time_s=None, truth_settings=""
    )


def uneven(recording):
    times = recording.times()
    moved = times + 1e-5 * np.random.default_rng(2).uniform(-1, 1, len(times))
    return floats(recording).replace(sample_rate_hz=None, time_s=moved)


def long(recording):
    """So long that the looks of the survey leave most samples out."""
    some = floats(recording)
    return some.replace(c=np.tile(some.c, 35), s=np.tile(some.s, 35))


def counts(recording):
    """As of a converter of 24 bits, whose top bit flips."""
    return recording.replace(c=recording.c.astype("i4"), s=recording.s.astype("i4"))


FORMS = {"even": floats, "uneven": uneven, "counts": counts}


@pytest.fixture(scope="module")
def clean():
    return by_hand.recording(seconds=2.0)


def spoilt(recording, channel, place, value):
    values = np.array(getattr(recording, channel))
    values[place] = value
    return recording.replace(**{channel: values})


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("channel", "cs")
@pytest.mark.parametrize("size", [1e5, 1e30])
def test_a_wild_sample_is_named_and_costs_its_window(clean, form, channel, size):
    recording = FORMS[form](clean)
    place = 3123
    value = 2**30 if form == "counts" else -size
    told = collect(demodulate(spoilt(recording, channel, place, value)))
    true = collect(demodulate(recording))
    bad = told.flags & FLAG_NOT_FINITE > 0
    assert bad.sum() == 1 and abs(told.time_s[bad] - recording.times()[place]) < told.window_s
    assert told.status == "valid"
    said = " ".join(told.status_reasons)
    assert f"sample {place + 1} of channel {channel.upper()}" in said
    assert f"is {value * getattr(recording, f'{channel}_scale_factor'):.4g} V where" in said
    without = collect(demodulate(spoilt(floats(recording), channel, place, np.nan)))
    assert told.reference_frequency_hz == pytest.approx(without.reference_frequency_hz, abs=1e-6)
    close = {"rtol": 1e-6, "atol": 1e-9, "equal_nan": True}
    np.testing.assert_allclose(told.signals, without.signals, **close)
    np.testing.assert_allclose(told.signals_std, without.signals_std, **close)
    assert np.abs(told.signals_std / true.signals_std - 1)[~bad].max() < 0.1


def test_a_wild_sample_that_no_look_saw(clean):
    recording = long(clean)
    place = 20_000  # the second of 16 looks begins behind it
    told = collect(demodulate(spoilt(recording, "s", place, 1e30)))
    assert np.count_nonzero(told.flags & FLAG_NOT_FINITE) == 1
    assert any(f"sample {place + 1} of channel S" in reason for reason in told.status_reasons)


@pytest.mark.parametrize("every", [997, 3001])
def test_wild_samples_at_even_distances_make_no_lines(clean, every):
    """Every look holds some; they were the largest "of the others", and the lines they made causes."""
    recording = floats(clean)
    true = collect(demodulate(recording))
    size = 15 * np.abs(recording.c).max()
    told = collect(demodulate(spoilt(recording, "c", slice(500, None, every), size)))
    bad = told.flags & FLAG_NOT_FINITE > 0
    count = len(range(500, len(recording.c), every))
    assert bad.sum() == count and not told.flags[~bad].any()
    assert f"and {count - 1} more such" in " ".join(told.status_reasons)
    without = collect(demodulate(spoilt(recording, "c", slice(500, None, every), np.nan)))
    np.testing.assert_allclose(told.signals, without.signals, rtol=1e-6, atol=1e-9, equal_nan=True)
    assert len(told.spectrum_line_frequency_hz) <= len(true.spectrum_line_frequency_hz) + 1


def test_blocks_do_not_matter(clean):
    recording = floats(clean)
    for place in (4095, 4096):  # where a block ends
        recording = spoilt(recording, "c", place, 1e12)
    whole, pieces = (collect(demodulate(recording, block_samples=size)) for size in (1 << 21, 4096))
    assert np.array_equal(whole.flags, pieces.flags)
    assert np.count_nonzero(whole.flags & FLAG_NOT_FINITE) in (1, 2)
    assert np.array_equal(whole.signals, pieces.signals, equal_nan=True)


@pytest.mark.parametrize("per_period", [2.5, 4.0, 5.3, 12.0])
def test_a_wave_far_above_what_the_looks_hold_is_no_wild_sample(per_period):
    """At four samples a period a sine's neighbours of the top are zero: its next tops are not."""
    wave = np.sin(2 * np.pi * np.arange(400) / per_period + 1e-9) * np.exp(-np.arange(400) / 80)
    for limit in (0.8, 0.1, 1e-3):
        assert not len(find_lonely(np.abs(wave) > limit, np.abs(wave) <= limit * CALM / WILD))
    burst = np.zeros(400, bool)
    burst[[50, 51, 52]] = burst[50 + 2 * ABOUT + 9] = True
    assert find_lonely(burst).tolist() == [50, 51, 52, 50 + 2 * ABOUT + 9]


def test_the_commands_blame_the_sample(hrg, tmp_path, clean):
    """It was "its 6139 samples do not hold one window of 5 periods at 1.37402 Hz; record longer"."""
    store.write(tmp_path / "r.h5", spoilt(floats(clean), "c", 700, 1e30))
    done = hrg(
        "demodulate", tmp_path / "r.h5", "-o", tmp_path / "p.h5", "--set", "periods_per_window=5"
    )
    assert done.status == 0 and "sample 701 of channel C, at " in done.err
    assert "is 1e+30 V where the others stay within" in done.err
