"""A read-out's harmonics, folded by even sampling, leave the signals alone, and their standard
deviations are those of the noise."""

import numpy as np
import pytest

from hrg_cli.physics.resonator import Mechanics, build_generator, exponentiate
from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate

FREQUENCY_HZ, NOISE, SECONDS = 1200.0, 1e-4, 20.0


def motion(rate_hz: float) -> np.ndarray:
    """A free run-down of the linear slow model, both channels (n, 2)."""
    device = Mechanics(
        frequency_hz=FREQUENCY_HZ, damping_rate_1_s=0.08, damping_split_1_s=0.004, damping_axis_rad=0.3,
        frequency_split_rad_s=0.06, stiffness_axis_rad=1.1, scale_factor=0.554,
    )  # fmt: skip
    t = np.arange(int(SECONDS * rate_hz)) / rate_hz
    u = exponentiate(build_generator(device), t) @ np.array([0.98, 0.2])
    return (u * np.exp(2j * np.pi * FREQUENCY_HZ * t)[:, None]).real


@pytest.mark.parametrize("periods", [3.0, 10.0, 50.0])
@pytest.mark.parametrize("samples_a_period", [2.7, 2.71, 3.3, 4.3])
@pytest.mark.parametrize("bend", [2e-3, 2e-2])
def test_a_square_of_the_motion_moves_no_signal(samples_a_period, periods, bend):
    """Locked sampling makes the leak the same in every window: at 2.7 samples a period and ten
    periods it moved the mean over the run by 5.8 of its σ."""
    rate_hz = samples_a_period * FREQUENCY_HZ
    clean = motion(rate_hz)
    noise = NOISE * np.random.default_rng(0).standard_normal(clean.shape)
    plain, bent = (
        collect(
            demodulate(
                Recording(c=x[:, 0], s=x[:, 1], sample_rate_hz=rate_hz, mode="free"),
                periods_per_window=periods,
            )
        )
        for x in (clean + noise, clean + bend * clean**2 + noise)
    )
    assert len(plain) == len(bent)
    moved = bent.signals - plain.signals
    if periods == 3 and samples_a_period < 3.3:  # eight samples: no room for columns of their own
        assert (moved / bent.signals_std).std() < 1.0
        return
    of_mean = np.abs(moved.mean(axis=0)) / plain.signals_std.mean(axis=0) * np.sqrt(len(plain))
    assert of_mean.max() < (0.2 if bend < 0.01 else 1.0)
    assert (moved / plain.signals_std).std() < 0.25
    own = np.median(bent.signals_std, axis=0) / np.median(plain.signals_std, axis=0)
    assert own == pytest.approx(1.0, abs=0.1)
