"""Where the fit of driven runs starts: a regression on the logged commands, from raw samples of the
engine with loops closed on them."""

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli.fitting.envelopes import coordinates, envelope_runs
from hrg_cli.fitting.envelopes.propagator import guess_roughly
from hrg_cli.stages.diagnosis.base.first_guess import regress_driven
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base


@pytest.fixture(scope="module")
def driven():
    """Three driven runs of a gyro whose split would turn a wave into a circle within each of them;
    its coordinates."""
    table = programme(61, runs=4, duration_s=3.0, forced=True, quadrature_loop="finite")
    table["run"] = [run | {"control": table["run"][0]["control"]} for run in table["run"][:3]]
    for k, run in enumerate(table["run"]):
        run["start"] |= {"quadrature": 0.0, "amplitude": 1.0}
        run["environment"]["rate_rad_s"] = 0.25 * (-1) ** k
    device = table["device"]
    device |= {"frequency_split_rad_s": 1.2, "stiffness_axis_rad": 0.4}
    damping, stiffness = (4 * device[name] for name in ("damping_axis_rad", "stiffness_axis_rad"))
    true = np.array(
        [
            device["damping_rate_1_s"],
            device["damping_split_1_s"] * np.cos(damping),
            device["damping_split_1_s"] * np.sin(damping),
            device["frequency_split_rad_s"] * np.cos(stiffness),
            device["frequency_split_rad_s"] * np.sin(stiffness),
            device["scale_factor"],
        ]
    )
    return waves(table), true


def test_commands_tell_the_resonator_before_any_fit(driven):
    recorded, true = driven
    runs = [envelope_runs.from_wave(wave) for wave in recorded]
    p, offsets = regress_driven(runs, recorded, guess_roughly(runs)[1], None)
    assert np.abs(p[:5] - true[:5]).max() < 0.01 and abs(p[5] / true[5] - 1) < 0.02
    found_hz = [run.reference_frequency_hz + one / (2 * np.pi) for run, one in zip(runs, offsets)]
    assert np.ptp(found_hz) < 0.01
    known, _ = regress_driven(runs, recorded, guess_roughly(runs)[1], 0.5)
    assert known[coordinates.SCALE_FACTOR] == 0.5


def test_a_split_that_the_loop_hides_is_found(driven):
    recorded, true = driven
    fit = fit_base(recorded, scale_factor=None, blocks=300, free_phase=False)
    std = np.sqrt(np.diag(fit.coordinate_covariance())[:6])
    assert fit.converged and fit.chi2 / fit.dof < 1.3
    assert np.abs((fit.point.p[:6] - true) / std).max() < 4.5


def test_free_runs_ask_for_no_regression():
    free = waves(programme(62, runs=2))
    runs = [envelope_runs.from_wave(wave) for wave in free]
    assert regress_driven(runs, free, guess_roughly(runs)[1], None) is None
