"""Courses of temperature and rate given by points, as a log gives them."""

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.records import collect
from hrg_cli.stages.simulate import simulate


def table(**environment):
    return {
        "device": {"frequency_hz": 400.0, "quality_factor": 5000.0},
        "recording": {"sample_rate_hz": 4000.0, "duration_s": 2.0},
        "environment": environment,
    }


def test_points_are_joined_by_straight_lines():
    warm = {"kind": "points", "time_s": [0.0, 0.5, 1.5], "temperature_degc": [20.0, 22.0, 19.0]}
    rate = {"kind": "points", "time_s": [0.2, 1.2], "rate_rad_s": [1.0, -1.0]}
    recording = collect(simulate(table(temperature=warm, rate=rate)))
    t = recording.auxiliary_time_s
    assert recording.temperature_degc == pytest.approx(
        np.interp(t, warm["time_s"], warm["temperature_degc"]), abs=1e-3
    )
    assert recording.rate_rad_s == pytest.approx(
        np.interp(t, rate["time_s"], rate["rate_rad_s"]), abs=1e-3
    )


@pytest.mark.parametrize(
    ("points", "word"),
    [
        ({"time_s": [0.0, 1.0], "temperature_degc": [20.0]}, "as many"),
        ({"time_s": [0.0, 0.0], "temperature_degc": [20.0, 21.0]}, "rise"),
        ({"time_s": [], "temperature_degc": []}, "time_s"),
    ],
)
def test_points_that_do_not_match_are_refused(points, word):
    with pytest.raises(HrgError, match=word):
        collect(simulate(table(temperature={"kind": "points", **points})))
