"""A gain that steps within one run, and what is none: beside a rate that steps at the same time in
another run, and as a gain that one whole run has otherwise."""

import numpy as np
import pytest
from diagnosis_programme import programme

from hrg_cli import collect, demodulate, diagnose, estimate, simulate
from hrg_cli.stages.diagnose import summarise
from hrg_cli.stages.simulate import list_run_ids

STEP = 0.01
STRUCK = 1


def make_recordings():
    """Four runs of which the last one's table steps from 0.5 to −0.5 rad/s at half of the run."""
    table = programme(11, runs=4, noise=1e-4)
    for run in table["run"]:
        del run["environment"]["temperature"]
    half_s = table["recording"]["duration_s"] / 2
    table["run"][3]["environment"]["rate"] = {
        "kind": "steps",
        "levels_rad_s": [0.5, -0.5],
        "dwell_s": half_s,
    }
    del table["run"][3]["environment"]["rate_rad_s"]
    return [collect(simulate(table, run=name, seed=0)) for name in list_run_ids(table)]


def report_with(first):
    """The diagnosis of the runs, C of one of them a part larger from its sample `first` on."""
    recordings = make_recordings()
    c = np.array(recordings[STRUCK].c, float)
    c[first(len(c)) :] *= 1 + STEP
    recordings[STRUCK] = recordings[STRUCK].replace(c=c)
    waves = [collect(estimate(collect(demodulate(r, periods_per_window=40.0)))) for r in recordings]
    return summarise(diagnose(waves))


def test_a_step_while_another_run_turns_over_is_named_alone():
    """The other run's bend was taken for a jump at the same time of all runs: χ² 432, "unexplained"; and
    an instant a hundredth of a row off left 5 σ in that row, or a knock beside the step."""
    report = report_with(lambda samples: samples // 2)
    (found,) = report["effects"]
    assert found["name"] == "gain_step"
    size = found["parameters"]["c_gain"]
    assert size["value"] == pytest.approx(STEP, abs=4 * size["std"])
    # the window that holds the step states so much noise that its instant is known to a window only,
    # which the raw samples of the written model may show
    failed = {check["name"] for check in report["checks"] if not check["passed"]}
    assert failed <= {"written_model"}


def test_a_gain_that_one_run_has_otherwise_is_no_step_of_it():
    """A step of 5 σ was named, whose sizes were a fiftieth of the gain that differed."""
    report = report_with(lambda samples: 0)
    assert report["effects"] == []
    assert report["verdict"] == "unexplained"
