"""Jumps of one run: lost samples in a wave that turns fast beside its windows, and no jump where
there is none."""

import numpy as np
import pytest
from scipy.linalg import expm
from synthetic_waves import as_wave, envelope

from hrg_cli.physics import resonator
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.stages.diagnosis.samples.jumps import find_jumps

WINDOWS, WINDOW_S, NOISE = 160, 6e-3, 1e-5
FAST = Mechanics(523.0, 0.9, 0.25, 0.35, 21.0, 0.9, 0.55)
"""A split and rates that turn the wave by some tenths of a radian a window."""


def turning(seed, rate, lost_s=0.0):
    """A run at a constant rate, `lost_s` missing from its middle on: the wave goes on as if the
    time had passed."""
    random = np.random.default_rng(seed)
    t = WINDOW_S * (np.arange(WINDOWS) + 0.5)
    after = t > t[WINDOWS // 2] - WINDOW_S / 2
    u = envelope(FAST, 0.3, rate, t + lost_s * after, ratio=0.2)
    u[after] *= np.exp(2j * np.pi * FAST.frequency_hz * lost_s)
    return as_wave(u, t, NOISE, FAST, random, rate=np.full(WINDOWS, rate))


@pytest.mark.parametrize("rate", [0.0, 9.0, -24.0])
def test_a_wave_that_turns_fast_has_no_jump(rate):
    assert [find_jumps(turning(seed, rate)) for seed in range(4)] == [[]] * 4


@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("width_s", [0.01, 0.02, 0.03])
def test_a_rate_that_changes_within_some_windows_makes_no_jump(ratio, width_s):
    """Two steps of the rate within the rows about an instant, as a table makes them; the log has
    them."""
    gyro = Mechanics(660.0, 3.0, 0.25, 0.35, 2.0, 0.9, 0.29)
    fine, random = 10, np.random.default_rng(0)
    step = WINDOW_S / fine
    at = step * (np.arange(WINDOWS * fine) + 0.5)
    rate = (
        -15.0
        - 5.75 * (1 + np.tanh((at - 0.35 * at[-1]) / width_s))
        + 9.25 * (1 + np.tanh((at - 0.65 * at[-1]) / width_s))
    )
    u = np.empty((len(at), 2), complex)
    state = envelope(gyro, 0.3, 0.0, np.zeros(1), ratio=ratio)[0]
    halves = expm(np.stack([resonator.build_generator(gyro, float(r)) for r in rate]) * step / 2)
    for k, half in enumerate(halves):
        u[k], state = half @ state, half @ half @ state
    rows = np.arange(WINDOWS) * fine + fine // 2
    means = rate.reshape(WINDOWS, fine).mean(axis=1)
    wave = as_wave(u[rows], at[rows], NOISE, gyro, random, rate=means)
    assert [jump for jump in find_jumps(wave) if jump.alike] == []


@pytest.mark.parametrize("rate", [0.0, 9.0, -24.0])
@pytest.mark.parametrize("lost_s", [1.9e-4, 4.7e-4])
def test_what_is_lost_turns_both_channels_alike_by_its_time(rate, lost_s):
    wave = turning(5, rate, lost_s)
    (jump,) = find_jumps(wave)
    expected = (2 * np.pi * FAST.frequency_hz + jump.rate_rad_s) * lost_s
    assert jump.alike and not jump.knock
    assert abs(np.angle(np.exp(1j * (jump.turn_rad - expected)))) < 5 * jump.turn_std_rad
    assert jump.turn_std_rad < 1e-3
    assert abs(jump.time_s - wave.time_s[WINDOWS // 2]) < 2.5 * WINDOW_S


def swinging(seed, lost_s, amplitude_rad_s=6.0, swings=1.7):
    """A run on a table that swings, its motion integrated in small steps; `lost_s` missing from its
    middle on."""
    gyro = Mechanics(1912.0, 2.0, 0.15, 0.35, 3.8, 0.9, 0.6)
    fine, random = 12, np.random.default_rng(seed)
    step = WINDOW_S / fine
    lost = round(lost_s / step)
    at = step * (np.arange(WINDOWS * fine + lost) + 0.5)
    rate = amplitude_rad_s * np.sin(2 * np.pi * swings * at / at[-1] + random.uniform(0, 6))
    u = np.empty((len(at), 2), complex)
    state = envelope(gyro, 0.3, 0.0, np.zeros(1), ratio=0.4)[0]
    halves = expm(np.stack([resonator.build_generator(gyro, float(r)) for r in rate]) * step / 2)
    for k, half in enumerate(halves):
        u[k], state = half @ state, half @ half @ state
    middle = WINDOWS // 2 * fine
    kept = np.concatenate([np.arange(middle), np.arange(middle + lost, len(at))])
    u, rate = u[kept], rate[kept]
    u[middle:] *= np.exp(2j * np.pi * gyro.frequency_hz * lost * step)
    rows = np.arange(WINDOWS) * fine + fine // 2
    means = rate.reshape(WINDOWS, fine).mean(axis=1)
    t = step * (np.arange(WINDOWS * fine) + 0.5)
    return gyro, lost * step, as_wave(u[rows], t[rows], NOISE, gyro, random, rate=means)


@pytest.mark.parametrize("swings", [0.6, 1.7, 4.0])
def test_a_table_that_swings_makes_no_jump(swings):
    found = [find_jumps(swinging(seed, 0.0, swings=swings)[2]) for seed in range(4)]
    assert [[j for j in one if j.alike or j.knock] for one in found] == [[]] * 4


@pytest.mark.parametrize("swings", [0.6, 1.7])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_lost_while_a_table_swings_is_found(swings, seed):
    gyro, lost_s, wave = swinging(seed, 5e-4, swings=swings)
    (jump,) = [one for one in find_jumps(wave) if one.alike]
    expected = (2 * np.pi * gyro.frequency_hz + jump.rate_rad_s) * lost_s
    assert abs(np.angle(np.exp(1j * (jump.turn_rad - expected)))) < 5 * jump.turn_std_rad
    assert jump.turn_std_rad < 0.03 and not jump.knock
