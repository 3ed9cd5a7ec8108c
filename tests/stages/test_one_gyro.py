"""Runs that several results are made of: of one gyro, each once."""

import numpy as np
import pytest
from synthetic_waves import GYRO, as_wave, envelope

from hrg_cli.errors import HrgError
from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.identify import identify

TIME = 0.01 * np.arange(1, 801)


def run_of(seed, name):
    u = envelope(GYRO, 0.2 + seed, lambda t: 0 * t, TIME)
    return as_wave(u, TIME, 1e-4, GYRO, np.random.default_rng(seed)).replace(run_id=name)


@pytest.mark.parametrize("command", [identify, diagnose])
def test_a_copy_under_another_name_is_no_second_run(command):
    """Files are told apart by the samples they go back to; records in memory by their rows."""
    with pytest.raises(HrgError, match="runs first and again hold the same rows"):
        command([run_of(0, "first"), run_of(1, "other"), run_of(0, "again")])


def test_runs_of_the_same_start_are_two():
    first, again = run_of(0, "first"), run_of(0, "again")
    noise = np.random.default_rng(9).standard_normal(len(TIME))
    found = identify([first, again.replace(phase_rad=again.phase_rad + 1e-5 * noise)])
    assert found.status == "valid", found.status_reasons
