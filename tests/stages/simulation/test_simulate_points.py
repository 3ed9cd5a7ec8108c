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


def driven(**control):
    """A file whose amplitude would fall to a third within its length."""
    return table(rate_rad_s=0.3) | {
        "device": {
            "frequency_hz": 400.0,
            "damping_rate_1_s": 0.5,
            "frequency_split_rad_s": 0.2,
            "scale_factor": 0.5,
        },
        "control": {"mode": "forced"} | control,
    }


LOG = {
    "time_s": [0.0, 0.7, 2.0],
    "drive_main": [0.5, 0.8, 0.4],
    "drive_quadrature": [0.0, 0.05, -0.02],
}


@pytest.mark.parametrize("loop", ("finite", "spring"))
def test_a_logged_drive_is_replayed_by_both_engines_alike(loop):
    runs = [
        collect(simulate(driven(log=LOG, quadrature_loop=loop), model=model))
        for model in ("fast", "slow")
    ]
    for recording in runs:
        t = recording.auxiliary_time_s
        for name in ("drive_main", "drive_quadrature"):
            assert getattr(recording, name) == pytest.approx(
                np.interp(t, LOG["time_s"], LOG[name]), abs=2e-3
            )
    for name in ("truth_main_amplitude", "truth_quadrature_amplitude", "truth_wave_angle_rad"):
        assert getattr(runs[0], name) == pytest.approx(getattr(runs[1], name), abs=5e-5)
    if loop == "finite":  # a' = a_ΦA − νa along the main wave
        t = runs[0].truth_time_s
        fine = np.linspace(0, t[-1], 20001)
        force = np.interp(fine, LOG["time_s"], LOG["drive_main"]) * np.exp(0.5 * fine)
        work = np.concatenate([[0.0], np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(fine))])
        expected = np.interp(t, fine, (1 + work) * np.exp(-0.5 * fine))
        assert runs[0].truth_main_amplitude == pytest.approx(expected, abs=5e-3)


@pytest.mark.parametrize(
    ("control", "word"),
    [
        ({"log": LOG}, "quadrature_loop"),
        ({"log": LOG, "quadrature_loop": "finite", "amplitude": 1.0}, "amplitude"),
        ({"log": LOG | {"drive_main": [0.5]}, "quadrature_loop": "finite"}, "as many"),
        ({"log": LOG, "mode": "free"}, "log"),
    ],
)
def test_a_log_beside_loops_or_without_its_rows_is_refused(control, word):
    with pytest.raises(HrgError, match=word):
        collect(simulate(driven(**control)))
