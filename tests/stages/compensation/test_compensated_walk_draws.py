"""A compensated rate and the angle that it sums up to, over many draws of a gyro that walks: means of
the output equation over each window, no simulator."""

import numpy as np
import pytest
from forced_runs import Truth, forced_run, wave_of

from hrg_cli.records import collect
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.compensate import compensate

RATE, SECONDS, FINE, WINDOW, NOISE = 0.3, 8.0, 0.004, 0.02, 1e-6
WALK = 1e-9
"""rad²/s of mθ: what the angle walks by in 8 s is a hundred times its noise."""
DRAWS = 200


def walking(truth, rate, seconds, seed):
    """A run whose windows hold the mean angle of five instants each."""
    many = round(WINDOW / FINE)
    fine = forced_run(truth, 20.0, rate, seconds, seed, dt=FINE, noise=0.0, walk=WALK)
    time, angle = (
        column[: len(column) // many * many].reshape(-1, many).mean(axis=1)
        for column in (fine.time_s, fine.wave_angle_rad)
    )
    angle = angle + NOISE * np.random.default_rng([seed, 1]).normal(size=len(angle))
    same = np.full_like(time, 1.0)
    return wave_of(time, angle, 20.0 * same, rate * same, NOISE, f"R{rate:g} {seed}")


@pytest.mark.slow
def test_rates_and_their_sum_are_off_by_what_is_stated():
    truth = Truth(4)
    runs = [walking(truth, rate, 120.0, k) for k, rate in enumerate((-0.5, 0.5))]
    tables = calibrate(runs, harmonics=2, scale_factor_harmonics=2, model="table", bootstrap=0)
    z, angle, summed = [], [], []
    for seed in range(DRAWS):
        done = collect(compensate(walking(truth, RATE, SECONDS, 100 + seed), tables))
        error = done.rate_estimate_rad_s - RATE
        z.append(error / done.rate_estimate_rad_s_std)
        angle.append(np.mean(error) * SECONDS)
        off = done.angle_estimate_rad - RATE * (done.time_s - done.time_s[0] + WINDOW / 2)
        summed.append((off / done.angle_estimate_rad_std)[[0, 3, 50, 200, -1]])
    assert 0.92 < np.sqrt(np.mean(np.square(z))) < 1.08
    assert np.all(np.abs(np.sqrt(np.mean(np.square(summed), axis=0)) - 1) < 0.17)
    # the sum walks as N√t, N = √WALK/K: 200 values, chance 1e-3
    walked = np.sqrt(WALK * SECONDS) / truth.k[0, 0]
    assert 0.85 < np.sqrt(np.mean(np.square(angle))) / walked < 1.2
