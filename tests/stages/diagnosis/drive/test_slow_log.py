"""A log of few rows beside a moving rate or drive: a clean gyro stays clean, whatever the log's
step."""

import numpy as np
from diagnosis_programme import programme

from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import list_run_ids, simulate

LOG = ("auxiliary_time_s", "temperature_degc", "rate_rad_s", "drive_main", "drive_quadrature")


def thinned(recording: Recording, step_s: float) -> Recording:
    """The recording with a log of that step."""
    time = np.asarray(recording.auxiliary_time_s)
    keep = slice(None, None, max(1, round(step_s / float(np.median(np.diff(time))))))
    return recording.replace(
        **{
            name: getattr(recording, name)[keep]
            for name in LOG
            if getattr(recording, name) is not None
        }
    )


def diagnosed(table: dict, step_s: float) -> dict:
    waves = []
    for run in list_run_ids(table):
        recording = thinned(collect(simulate(table, run=run, seed=1)), step_s)
        waves.append(collect(estimate(collect(demodulate(recording, periods_per_window=40.0)))))
    return summarise(diagnose(waves))


def test_a_rate_that_swings_beside_a_log_of_twenty_rows_a_period():
    """Straight lines between the rows would lose (ωh)²/12 = 0.8 % of the swing: tens of σ of the
    angle."""
    out = diagnosed(
        programme(71, runs=4, rate={"kind": "sine", "amplitude_rad_s": 2.0, "frequency_hz": 1.0}),
        0.05,
    )
    assert out["verdict"] == "adequate" and out["effects"] == []


def test_loops_that_settle_beside_a_log_of_twenty_rows_a_second():
    """The commands fall as e^{−8t}: h²·64/8 = 2 % of them would be missed between rows."""
    table = programme(72, runs=4, forced=True, quadrature_loop="finite")
    for run in table["run"]:
        if run.get("control", {}).get("mode") == "forced":
            run["control"] |= {"quadrature_gain_1_s": 8.0}
            run["start"]["quadrature"] = 0.05
    out = diagnosed(table, 0.05)
    assert out["verdict"] == "adequate" and out["effects"] == []
