"""Programmes of run-downs drawn over the whole range of gyros, tables and laboratories, for what
must hold of every answer."""

from dataclasses import dataclass

import numpy as np
from synthetic_waves import run_down

from hrg_cli.physics.environment import EARTH_RATE_RAD_S
from hrg_cli.physics.resonator import Mechanics

MOST_WINDOWS = 12_000


@dataclass(frozen=True)
class Programme:
    """The gyro, its waves, and Earth's rate about the axis, which the logs leave out [rad/s]."""

    gyro: Mechanics
    waves: list
    earth_rad_s: float
    told: bool


def draw(seed: int) -> Programme:
    """One programme: τ 1…1000 s, rates 0.01…100 °/s, ½ to 3 τ long, 300 to 12 000 windows, with and
    without Earth's rate."""
    rng = np.random.default_rng(seed)

    def over(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    tau = over(1, 1000)
    nu = 1 / tau
    gyro = Mechanics(
        over(2000, 10_000),
        nu,
        nu * over(1e-3, 0.3),
        rng.uniform(0, np.pi / 2),
        nu * over(0.01, 30),
        rng.uniform(0, np.pi / 2),
        rng.uniform(0.25, 0.85),
    )
    seconds = tau * over(0.5, 3)
    rate = np.radians(over(0.01, 100))
    fastest = gyro.scale_factor * rate + gyro.frequency_split_rad_s + nu
    windows = int(
        np.clip(over(300, MOST_WINDOWS), min(MOST_WINDOWS, seconds * fastest / 0.8), MOST_WINDOWS)
    )
    earth = EARTH_RATE_RAD_S * np.sin(rng.uniform(0, np.pi / 2)) if rng.random() < 0.5 else 0.0
    told = bool(rng.random() < 0.8)
    std = over(1e-6, 1e-2)
    signs = [1.0, -1.0, 0.0, 0.5, 1.0, -1.0][: rng.integers(2, 7)]
    waves = []
    for i, sign in enumerate(signs):
        wave = run_down(
            rng.uniform(0, np.pi / 2),
            sign * rate + earth,
            mechanics=gyro,
            std=std,
            seconds=seconds,
            window=seconds / windows,
            seed=1000 * seed + i,
            ratio=rng.uniform(-0.1, 0.1),
        )
        waves.append(wave.replace(rate_rad_s=wave.rate_rad_s - earth))
    return Programme(gyro, waves, earth, told)
