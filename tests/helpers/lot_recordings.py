"""Short run-downs of the gyros of a small lot, each gyro with a frequency split of its own."""

import numpy as np

from hrg_cli.physics.resonator import Mechanics, build_generator, exponentiate
from hrg_cli.records import Recording

RATE, FREQUENCY, SECONDS = 4000.0, 503.0, 2.0


def run_down(gyro: str, run: str, theta: float, split: float, seed: int) -> Recording:
    """A free run-down of the linear slow model."""
    rng = np.random.default_rng(seed)
    device = Mechanics(
        frequency_hz=FREQUENCY,
        damping_rate_1_s=0.5,
        damping_split_1_s=0.02,
        damping_axis_rad=0.3,
        frequency_split_rad_s=split,
        stiffness_axis_rad=0.8,
        scale_factor=0.55,
    )
    t = np.arange(int(SECONDS * RATE)) / RATE
    u = exponentiate(build_generator(device), t) @ np.array([np.cos(2 * theta), np.sin(2 * theta)])
    x = (u * np.exp(2j * np.pi * FREQUENCY * t)[:, None]).real + 5e-4 * rng.standard_normal(u.shape)
    return Recording(
        c=x[:, 0], s=x[:, 1], sample_rate_hz=RATE, mode="free", gyro_id=gyro, run_id=run
    )


def split_of(gyro: int) -> float:
    return 0.3 + 0.05 * gyro
