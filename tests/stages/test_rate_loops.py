"""What the loops of a driven run had to give, against the resonator that its rate is taken from."""

import numpy as np
import pytest
from test_rate_driven import resonator, truth, wave_of

from hrg_cli.stages.rate import rate


@pytest.fixture(scope="module")
def driven():
    return wave_of(dict(quadrature_loop="finite", quadrature_gain_1_s=5.0))


def doubts(found):
    return [why for why in found.status_reasons if " force asks for a " in why]


@pytest.mark.parametrize(
    "change, words",
    [
        (dict(damping_split_1_s=0.033), "main force asks for a damping split"),
        (dict(damping_axis_rad=0.4), "main force asks for a damping split"),
        (dict(frequency_split_rad_s=0.2), "quadrature force asks for a frequency split"),
    ],
)
def test_another_gyro_s_resonator_is_told_by_the_forces(driven, change, words):
    found = rate(driven, resonator(**change))
    error = np.asarray(found.rate_estimate_rad_s) - truth(np.asarray(found.time_s))
    assert np.sqrt(np.mean((error / found.rate_estimate_rad_s_std) ** 2)) > 3
    (why,) = doubts(found)
    assert found.status == "suspect" and words in why


@pytest.mark.parametrize(
    "change, scale",
    [(dict(), 1.0), (dict(), 1e-3), (dict(damping_rate_1_s=0.31), 1.0)],
    ids=["right", "counts", "gain"],
)
def test_scale_and_gain_of_the_forces_turn_nothing(driven, change, scale):
    wave = driven.replace(
        drive_main=scale * driven.drive_main, drive_quadrature=scale * driven.drive_quadrature
    )
    found = rate(wave, resonator(**change))
    assert found.status == "valid" and not doubts(found)


def test_a_split_that_its_errors_hold_is_not_doubted(driven):
    value = resonator(damping_split_1_s=0.033)
    std = np.where(value.name == "damping_split_1_s", 0.003, 0.0)
    assert not doubts(rate(driven, value.replace(std=std, covariance=np.diag(std**2))))


def test_across_a_gap_of_the_drive_log_nothing_is_claimed(driven):
    hole = (driven.time_s > 8) & (driven.time_s < 12)
    wave = driven.replace(drive_main=np.where(hole, np.nan, driven.drive_main))
    assert not doubts(rate(wave, resonator()))
    assert doubts(rate(wave, resonator(damping_split_1_s=0.036)))
