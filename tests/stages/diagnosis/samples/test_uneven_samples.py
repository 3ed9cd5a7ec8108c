"""A tone from outside that stands where even sampling would fold a harmonic of the oscillation."""

import numpy as np
import pytest

from hrg_cli import Recording, collect, demodulate, estimate
from hrg_cli.stages.diagnose import diagnose, summarise

FREQUENCY_HZ, SAMPLING_HZ, LENGTH_S, NOISE = 1000.0, 9499.35, 6.0, 1e-3
DAMPING_1_S, SPLIT_RAD_S = 0.3, 0.2
IMAGE_HZ = abs((20 * FREQUENCY_HZ + SAMPLING_HZ / 2) % SAMPLING_HZ - SAMPLING_HZ / 2)
"""Harmonic 20 of the oscillation, folded: 1.3 Hz beside it."""


def recording(run, jitter, seed):
    """Two modes along the electrodes, each a plain decay, and the tone in both channels."""
    random = np.random.default_rng([seed, run])
    count = int(LENGTH_S * SAMPLING_HZ)
    t = (np.arange(count) + jitter * random.uniform(-1, 1, count)) / SAMPLING_HZ
    start, omega = 0.3 + 0.7 * run, 2 * np.pi * FREQUENCY_HZ
    c = np.cos(start) * np.exp(-DAMPING_1_S * t) * np.cos((omega + SPLIT_RAD_S) * t)
    s = np.sin(start) * np.exp(-DAMPING_1_S * t) * np.cos((omega - SPLIT_RAD_S) * t)
    tone = 2 * np.pi * IMAGE_HZ * t
    sampled = {"time_s": t} if jitter else {"sample_rate_hz": SAMPLING_HZ}
    return Recording(
        c=c + 2e-3 * np.cos(tone + 0.3) + NOISE * random.standard_normal(count),
        s=s + 1e-3 * np.cos(tone + 0.9) + NOISE * random.standard_normal(count),
        mode="free",
        readout="direct",
        mode_number=2,
        run_id=f"r{run}",
        gyro_id="g",
        auxiliary_time_s=np.array([0, LENGTH_S]),
        rate_rad_s=np.zeros(2),
        **sampled,
    )


@pytest.mark.parametrize(
    ("jitter", "verdict", "causes"), [(0.2, "explained", ["mains_tone"]), (0.0, "unexplained", [])]
)
def test_uneven_samples_fold_no_harmonic_onto_a_tone(jitter, verdict, causes):
    """Evenly sampled the tone may be the harmonic, and is not named; unevenly it can only be a tone."""
    assert abs(IMAGE_HZ - FREQUENCY_HZ) < 2
    waves = [
        collect(estimate(collect(demodulate(recording(run, jitter, 3), periods_per_window=20))))
        for run in range(3)
    ]
    out = summarise(diagnose(waves))
    assert (out["verdict"], [cause["name"] for cause in out["effects"]]) == (verdict, causes)
