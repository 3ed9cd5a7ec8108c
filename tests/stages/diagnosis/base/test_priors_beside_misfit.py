"""What is known of a resonator beside a misfit far beyond the noise: the priors keep their weight."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli.fitting.causes import descent, extended_fit
from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors
from hrg_cli.fitting.envelopes.coordinates import COORDINATES
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base

SPLIT = COORDINATES.index("split_cos")


@pytest.fixture(scope="module")
def bent():
    """Base fit of free runs whose frequency follows the amplitude, which it does not hold."""
    table = programme(71, {"cubic_stiffness": {"pull_rad_s": 3.0}}, runs=3, noise=1e-5)
    return fit_base(waves(table), scale_factor=0.55, blocks=300, free_phase=False)


def test_the_optimum_beside_a_gross_misfit_is_the_same_at_any_stated_noise(bent):
    assert bent.chi2 / bent.dof > 1e4
    quieter = replace(bent.series, weight=10 * bent.series.weight)
    # a prior elsewhere, about as narrow as the misfit lets a split be known
    inflated = np.sqrt(np.diag(bent.coordinate_covariance())[:5] * bent.chi2 / bent.dof)
    mean, std = bent.freedom.mean.copy(), bent.freedom.std.copy()
    mean[SPLIT], std[SPLIT] = bent.point.p[SPLIT] + 3 * inflated[SPLIT], inflated[SPLIT]
    elsewhere = CoordinatePriors(mean, std)
    stated, again = (
        extended_fit.fit(series, bent.point, elsewhere) for series in (bent.series, quieter)
    )
    assert again.chi2 / stated.chi2 == pytest.approx(100, rel=1e-3)
    assert (np.abs(again.point.p[:5] - stated.point.p[:5]) < 0.02 * inflated).all()
    assert 1 < (stated.point.p[SPLIT] - bent.point.p[SPLIT]) / inflated[SPLIT] < 2


def test_the_cost_is_chi2_within_the_noise_and_smooth_where_it_leaves_it(bent):
    reals = descent.count_reals(bent.series)
    level = descent.find_level(bent.residual, bent.series)
    assert level == pytest.approx(bent.chi2 / reals)
    free = CoordinatePriors(np.zeros(7), np.full(7, np.inf))
    for part in (1e-4, 1.0001):
        series = replace(bent.series, weight=bent.series.weight * np.sqrt(part / level))
        prediction = replace(bent.prediction, series=series)
        cost = reals * part if part < 1 else reals * (1 + np.log(part))
        assert descent.cost_of(prediction, free) == pytest.approx(cost, rel=1e-3)
    assert descent.find_level(bent.residual / np.sqrt(2 * level), bent.series) == 1.0
