"""Runs whose files say something else than they are: free where the amplitude holds, and a thermometer
in K: named as that, not left out in silence, and not blamed on the programme."""

import numpy as np
import pytest
from forced_runs import Truth, forced_run, programme

from hrg_cli.stages.calibrate import calibrate

TRUTH = Truth(5, curved=False)


@pytest.fixture(scope="module")
def runs():
    return programme(TRUTH, (0, 30), (-0.5, 0.02, 0.5), duration=20)


@pytest.fixture(scope="module")
def status(runs):
    return tables(runs).status


def tables(waves):
    return calibrate(waves, model="table", harmonics=2, scale_factor_harmonics=2, bootstrap=0)


def test_a_driven_run_that_says_free_is_named(runs):
    another = forced_run(TRUTH, 30, 0.3, 20, 77, run_id="mislabelled").replace(mode="free")
    record = tables([*runs, another])
    assert record.status == "suspect"
    said = [reason for reason in record.status_reasons if "--mode forced" in reason]
    assert len(said) == 1 and said[0].startswith("mislabelled is free by its file")


def test_a_run_down_among_forced_runs_is_noted_and_no_more(runs, status):
    down = forced_run(TRUTH, 30, 0.3, 20, 78, run_id="down").replace(mode="free")
    fall = np.exp(-down.time_s / 600)
    record = tables([*runs, down.replace(main_amplitude=down.main_amplitude * fall)])
    assert "free, and not in the tables of forced runs: down" in record.status_reasons
    assert record.status == status


def test_one_thermometer_in_kelvin_is_named_and_no_other_fault(runs):
    warm = np.asarray(runs[-1].temperature_degc) + 273.15
    record = tables([*runs[:-1], runs[-1].replace(temperature_degc=warm)])
    assert record.status == "refused"
    said = [r for r in record.status_reasons if "thermometer in K" in r]
    assert len(said) == 1 and said[0].startswith(runs[-1].run_id)
    assert not any("one rate only" in reason for reason in record.status_reasons)


def test_all_thermometers_in_kelvin_are_doubted(runs):
    warm = [run.replace(temperature_degc=np.asarray(run.temperature_degc) + 273.15) for run in runs]
    record = tables(warm)
    assert record.status == "suspect"
    assert any("thermometer in K" in reason for reason in record.status_reasons)
