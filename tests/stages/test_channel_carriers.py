"""Read-outs by a carrier whose phase is not the same in both channels, from raw samples."""

import numpy as np
import pytest

from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate, summarise

RATE_HZ, CARRIER_HZ, TONE_HZ, SECONDS, NOISE = 200e3, 30e3, 5e3, 0.5, 1e-4
ANGLE_RAD, TURN_RAD_S, QUADRATURE = 0.1, 2.0, 0.05


def by_carrier(ahead_rad, seed, drift_rad_s=0.0):
    """A wave that turns, its S multiplied by a carrier that is ahead."""
    random = np.random.default_rng(seed)
    t = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ
    electrical = 2 * (ANGLE_RAD + TURN_RAD_S * t)
    turn = np.exp(2j * np.pi * TONE_HZ * t)
    moves = (
        np.cos(electrical) + 1j * QUADRATURE * np.sin(electrical),
        np.sin(electrical) - 1j * QUADRATURE * np.cos(electrical),
    )
    psi = random.uniform(-1, 1) + drift_rad_s * t
    c, s = (
        -2 * (u * turn).real * np.sin(2 * np.pi * CARRIER_HZ * t + psi + more)
        + NOISE * random.standard_normal(len(t))
        for u, more in zip(moves, (0.0, ahead_rad), strict=True)
    )
    recording = Recording(
        c=c, s=s, sample_rate_hz=RATE_HZ, mode="free", readout="carrier", carrier_hz=CARRIER_HZ
    )
    return collect(estimate(collect(demodulate(recording, periods_per_window=20))))


def angle_errors(wave):
    """(found − true)/σ of the wave angle."""
    off = wave.wave_angle_rad - (ANGLE_RAD + TURN_RAD_S * wave.time_s)
    return ((off + np.pi / 4) % (np.pi / 2) - np.pi / 4) / wave.wave_angle_rad_std


@pytest.mark.parametrize("ahead_rad", [-0.02, 0.003, 0.3])
@pytest.mark.parametrize("drift_rad_s", [0.0, 0.05])
def test_what_one_channel_is_ahead_is_found_and_taken_off(ahead_rad, drift_rad_s):
    """One phase for both left the signals short by 4e-5 that moved with the angle at 0.02 rad."""
    wave = by_carrier(ahead_rad, 1, drift_rad_s)
    found = summarise(wave)["carrier_phase_difference_rad"]
    assert abs(found["value"] - ahead_rad) < 5 * found["std"] < 1e-4
    assert np.sqrt(np.mean(angle_errors(wave) ** 2)) < 1.15
    # three redundant equations of eight at σ a signal
    assert np.mean(wave.residual_rms**2) < 1.5 * 3 / 8 * 2 * np.mean(wave.signal_std**2)
    amplitude = np.hypot(wave.main_amplitude, wave.quadrature_amplitude)
    assert np.ptp(amplitude) < 12 * np.median(wave.main_amplitude_std)


def test_its_standard_deviation_is_right():
    errors = [
        found["value"] / found["std"]
        for found in (
            summarise(by_carrier(0.0, seed))["carrier_phase_difference_rad"] for seed in range(30)
        )
    ]
    # of 30 draws the rms of unit errors is within 0.63 and 1.40 with 99.9 %
    assert 0.63 < np.sqrt(np.mean(np.square(errors))) < 1.40
    assert np.max(np.abs(errors)) < 5


def test_a_direct_read_out_has_none():
    t = np.arange(8000) / 8000
    c = np.cos(2 * np.pi * 1000 * t)
    recording = Recording(c=c, s=0.5 * c, sample_rate_hz=8000.0, mode="free")
    wave = collect(estimate(collect(demodulate(recording, periods_per_window=20))))
    assert wave.carrier_phase_difference_rad is None
    assert "carrier_phase_difference_rad" not in summarise(wave)
