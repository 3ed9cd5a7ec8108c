"""The standard deviation of a compensated rate, held against its errors from raw samples on."""

import json

import numpy as np
import pytest
from forced_runs import Truth, forced_run, programme

from hrg_cli import calibrate, collect, compensate, demodulate, estimate, simulate
from hrg_cli.records.windowed import FLAG_GAP
from hrg_cli.stages.compensate import summarise
from hrg_cli.stages.compensation import logged_run

RATE = 0.7
CONFIG = {
    "device": {"frequency_hz": 1000.0, "quality_factor": 20_000.0},
    "control": {"mode": "free"},
    "readout": {"noise": 1e-5},
    "recording": {"sample_rate_hz": 8000.0, "duration_s": 6.0},
    "run": [
        {"run_id": "left", "environment": {"rate_rad_s": 2.0}},
        {"run_id": "right", "environment": {"rate_rad_s": -2.0}},
        {"run_id": "flight", "environment": {"rate_rad_s": RATE}},
    ],
}


def wave_of(run, seed, periods=50):
    samples = collect(simulate(CONFIG, model="slow", run=run, seed=seed))
    return collect(estimate(collect(demodulate(samples, periods_per_window=periods))))


@pytest.fixture(scope="module")
def raw():
    """Tables and runs of one simulated gyro, each with noise of its own in the samples."""
    waves = [wave_of(run, seed) for seed, run in enumerate(("left", "right"))]
    tables = calibrate(waves, harmonics=1, scale_factor_harmonics=0, model="table")
    return tables, [wave_of("flight", seed) for seed in range(20, 30)]


def ratios(tables, waves, **how):
    done = [collect(compensate(wave, tables, **how)) for wave in waves]
    return np.concatenate(
        [(d.rate_estimate_rad_s - RATE) / d.rate_estimate_rad_s_std for d in done]
    )


@pytest.mark.parametrize("windows", [1, 4])
def test_errors_are_as_large_as_stated_from_raw_samples(raw, windows):
    z = ratios(*raw, windows_per_increment=windows)
    assert 0.9 < np.sqrt(np.mean(z**2)) < 1.1


@pytest.mark.parametrize("windows", [1, 4])
def test_angles_are_off_by_what_is_stated_from_raw_samples(raw, windows):
    """Ten flights with one table; the noise of the first block is in all of a flight's angles."""
    tables, waves = raw
    z = []
    for wave in waves:
        done = collect(compensate(wave, tables, windows_per_increment=windows))
        begin = float(np.mean(wave.time_s[:windows]))
        off = done.angle_estimate_rad - RATE * (done.time_s - begin)
        z.append(off / done.angle_estimate_rad_std)
    assert 0.55 < np.sqrt(np.mean(np.square(z))) < 1.5


@pytest.mark.parametrize("windows", [1, 4])
def test_errors_are_as_large_as_stated_beside_windows_that_are_left_out(raw, windows):
    """Increments across holes are longer and so better known; blocks that lost windows are worse."""
    tables, waves = raw
    draw = np.random.default_rng(5)

    def holed(wave):
        lost = draw.random(len(wave)) < 0.3
        lost[40:55] = True
        return wave.replace(flags=np.where(lost, FLAG_GAP, 0).astype("u1"))

    waves = [holed(wave) for wave in waves]
    across = collect(compensate(waves[0], tables)).rate_estimate_rad_s_std
    assert across.min() < 0.2 * across.max()
    z = ratios(tables, waves, windows_per_increment=windows)
    assert 0.88 < np.sqrt(np.mean(z**2)) < 1.1


def test_a_log_that_ends_early_changes_no_deviation(raw):
    tables, (wave, *_) = raw
    rate = np.full(len(wave), RATE)
    whole = collect(compensate(wave.replace(rate_rad_s=rate), tables))
    short = collect(
        compensate(wave.replace(rate_rad_s=np.where(wave.time_s < 3, rate, np.nan)), tables)
    )
    assert short.rate_estimate_rad_s_std == pytest.approx(whole.rate_estimate_rad_s_std)
    for done in (whole, short):
        assert 0.8 < summarise(done)["error_over_std_rms"] < 1.25


def test_the_tables_own_errors_are_in_it():
    """Tables from noisy runs: the mean of a standing wave's rates is off by what they are, and the
    stated part is as large; the noise of the flight itself is 1e-9."""
    truth, off, told, summed = Truth(4, scale_ripple=0), [], [], []
    for seed in range(25):
        runs = programme(truth, (20,), (-0.5, 0.5), duration=12, noise=2e-5, seed=seed)
        tables = calibrate(runs, harmonics=2, scale_factor_harmonics=0, model="table", bootstrap=0)
        flight = forced_run(truth, 20, 0.2, 3, 1, noise=1e-9, start=0.4)
        done = collect(compensate(flight, tables))
        off.append(np.mean(done.rate_estimate_rad_s) - 0.2)
        told.append(summarise(done)["rate_std_rad_s"]["by_tables"])
        angle = done.angle_estimate_rad - 0.2 * (done.time_s - done.time_s[0] + 0.01)
        summed.append((angle / done.angle_estimate_rad_std)[-1])
    assert 0.6 < np.sqrt(np.mean(np.square(off) / np.square(told))) < 1.4
    assert 0.6 < np.sqrt(np.mean(np.square(summed))) < 1.4


def test_a_stream_of_pieces_states_what_the_whole_does(raw, monkeypatch):
    tables, (wave, *_) = raw
    whole = collect(compensate(wave, tables))
    monkeypatch.setattr(logged_run, "ROWS_AT_ONCE", 32)
    joined = collect(list(compensate(wave, tables)))
    assert joined.rate_estimate_rad_s_std == pytest.approx(whole.rate_estimate_rad_s_std)
    assert joined.angle_estimate_rad_std == pytest.approx(whole.angle_estimate_rad_std)
    assert json.loads(joined.details)["rate_std_rad_s"] == pytest.approx(
        json.loads(whole.details)["rate_std_rad_s"]
    )


def test_windows_without_a_deviation_have_none_afterwards(raw):
    tables, (wave, *_) = raw
    std = np.where(np.arange(len(wave)) == 20, 0.0, wave.wave_angle_rad_std)
    done = collect(compensate(wave.replace(wave_angle_rad_std=std), tables))
    assert np.flatnonzero(~np.isfinite(done.rate_estimate_rad_s_std)).tolist() == [19, 20]
