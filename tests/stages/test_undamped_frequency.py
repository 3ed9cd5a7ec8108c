"""Which frequency is meant: a resonator's is the undamped one of its stiffness, a wave's that of the
oscillation as it is seen, lower by ν²/2ω."""

import numpy as np
from scipy.linalg import expm

from hrg_cli import collect, demodulate, estimate, identify
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.records import Recording

FREQUENCY_HZ, DAMPING_1_S = 50.0, 0.5
"""Of low quality (Q = 314): ν²/2ω is 63 µHz, a thousand standard deviations and more."""
SHIFT_HZ = DAMPING_1_S**2 / (2 * 2 * np.pi * FREQUENCY_HZ) / (2 * np.pi)
TRUE = Mechanics(FREQUENCY_HZ, DAMPING_1_S, 0.02, 0.35, 0.08, 0.9)


def run_down(angle, rng, sample_rate_hz=4000.0, seconds=6.0, noise=1e-5):
    """Samples of z̈ + 2Nż + Wz = 0 from rest at a wave angle, step by step by its own matrix
    exponential: no envelope, no averaging."""
    motion = np.block(
        [
            [np.zeros((2, 2)), np.eye(2)],
            [-TRUE.build_stiffness_matrix(), -2 * TRUE.build_damping_matrix()],
        ]
    )
    step = expm(motion / sample_rate_hz)
    state = np.array([np.cos(2 * angle), np.sin(2 * angle), 0.0, 0.0])
    z = np.empty((int(seconds * sample_rate_hz), 2))
    for row in z:
        row[:] = state[:2]
        state = step @ state
    z += noise * rng.standard_normal(z.shape)
    return Recording(
        c=z[:, 0], s=z[:, 1], sample_rate_hz=sample_rate_hz, mode="free", run_id=f"{angle:g}"
    )


def test_of_one_mode_in_one_channel_it_is_the_seen_one():
    omega = 2 * np.pi * FREQUENCY_HZ
    seen = np.sqrt(omega**2 - DAMPING_1_S**2)
    t = np.arange(24_000) / 4000.0
    c = np.exp(-DAMPING_1_S * t) * np.cos(seen * t)
    c += 1e-5 * np.random.default_rng(0).standard_normal(len(t))
    heard = Recording(c=c, s=0 * c, sample_rate_hz=4000.0, mode="free", run_id="one")
    wave = collect(estimate(collect(demodulate(heard, periods_per_window=4))))
    value, std, _ = identify([wave]).parameters()["frequency_hz"]
    assert std < SHIFT_HZ / 100
    assert abs(value - seen / 2 / np.pi) < 4 * std


def test_a_resonators_frequency_is_the_undamped_one_and_a_waves_the_seen_one():
    rng = np.random.default_rng(5)
    waves = [
        collect(estimate(collect(demodulate(run_down(a, rng), periods_per_window=4))))
        for a in (0.0, 0.3, 0.6, 1.0, 1.3)
    ]
    found = identify(waves)
    assert found.status == "valid", found.status_reasons
    value, std, _ = found.parameters()["frequency_hz"]
    assert std < SHIFT_HZ / 100, "else the test tells nothing"
    assert abs(value - FREQUENCY_HZ) < 4 * std
    seen = np.mean([np.nanmedian(wave.frequency_hz) for wave in waves])
    # the split moves a single run's by less than it moves the mean over angles
    assert abs(seen - (FREQUENCY_HZ - SHIFT_HZ)) < SHIFT_HZ / 5
