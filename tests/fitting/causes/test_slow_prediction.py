"""What a fit minimises, along the way to its optimum."""

from dataclasses import MISSING, fields

import numpy as np

from hrg_cli.fitting.causes.fit_point import Point
from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
from hrg_cli.fitting.causes.slow_prediction import predict


def test_the_residual_has_no_step_where_the_phase_begins_to_run_off():
    """A wave of 1e5 σ whose model runs off by 0 to 0.06 rad: from 0.02 rad on a turn is taken out
    of the difference. What it leaves of the amplitude came in at once there, 20 σ a row, and held
    the fit of a driven gyro up, whose loops answer for the phase but not for the amplitude."""
    needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    series = MeasuredRuns(
        **dict.fromkeys(needed, none)
        | {
            "names": ("left",),
            "time_s": t,
            "envelope": (none + 1.0)[..., None] * [1, 0],
            "weight": none + 1e5,
            "reference_frequency_hz": 5e3,
            "mode_number": 2,
            "turn_rad_s": np.zeros(1),
            "held_amplitude": none + np.nan,
        }
    )
    held, start = np.zeros(7), np.array([[1, 0j]])
    along = np.array(
        [
            predict(series, Point(held, start, np.array([w]))).compute_residual()[0, :, 0]
            for w in np.linspace(0.0, 0.006, 601)
        ]
    )
    assert abs(along).max() > 10
    assert abs(np.diff(along, axis=0)).max() < 2
