"""The angle at which an increment is taken, of a wave that its own drift bends: no K of its own."""

from dataclasses import MISSING, fields

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hrg_cli.fitting.tables.increments import build_path
from hrg_cli.records import Wave

K, RATE, DRIFT, MODE, SECONDS = 0.28, 0.3, 2e-2, 2, 60.0


def turned(rate, start, time):
    """θ of m dθ/dt = −KΩ + D cos 2mθ."""

    def speed(_, angle):
        return (-K * rate + DRIFT * np.cos(2 * MODE * angle)) / MODE

    course = solve_ivp(speed, (0.0, SECONDS), [start], "DOP853", time, rtol=1e-12, atol=1e-13)
    return course.y[0]


def wave_of(rate, start, step_s):
    """Windows that stand for their middle, without noise."""
    t = np.arange(0.0, SECONDS, step_s)
    blank = dict.fromkeys([f.name for f in fields(Wave) if f.default is MISSING], np.ones(len(t)))
    given = {
        "time_s": t,
        "wave_angle_rad": turned(rate, start, t),
        "rate_rad_s": np.full(len(t), rate),
        "flags": np.zeros(len(t), "u1"),
        "iterations": np.zeros(len(t), "i4"),
        "mode_number": MODE,
        "window_s": step_s,
        "reference_frequency_hz": 5e3,
    }
    return Wave(**blank | given)


@pytest.mark.parametrize(("step_s", "per_block"), ((0.3, 1), (0.075, 4), (0.03, 10)))
def test_a_drift_that_bends_the_wave_is_no_scale_factor(step_s, per_block):
    """K came out 1.6e-6 (6 ppm of it) too small, at the mean of neighbouring blocks' angles."""
    design, turn = [], []
    for rate, start in ((RATE, 0.1), (-RATE, 0.8), (0.0, 0.3)):
        path = build_path(wave_of(rate, start, step_s), harmonics=1, per_block=per_block)
        columns = np.column_stack(
            [-path.rotation, path.build_angle_basis(1) * path.interval_s[:, None]]
        )
        design.append(columns)
        turn.append(path.turn)
    found = np.linalg.lstsq(np.concatenate(design), np.concatenate(turn), rcond=None)[0]
    assert abs(found[0] - K) < 1e-7
    np.testing.assert_allclose(found[1:], [0.0, DRIFT, 0.0], atol=3e-7)
