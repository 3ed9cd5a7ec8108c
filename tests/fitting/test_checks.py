"""The closing checks: each fails a right result at its stated chance and no more, and a wrong one
nearly always."""

import numpy as np
import pytest
from scipy.stats import chi2 as chi2_law

from hrg_cli.fitting import checks

DRAWS = 400


@pytest.fixture
def often(monkeypatch):
    """A chance large enough to be counted."""
    monkeypatch.setattr(checks, "CHANCE", 0.1)


def share(passed):
    return 1 - np.mean(passed)


def test_white_residuals_fail_no_more_often_than_stated(often):
    """For all lengths of blocks tried together, not for each of them."""
    random = np.random.default_rng(1)
    failed = share(
        [
            checks.check_whiteness(
                [random.standard_normal((300, 2)), random.standard_normal(700)]
            ).passed
            for _ in range(DRAWS)
        ]
    )
    # Bonferroni's bound from above (4 σ of the count), correlated lengths from below
    assert 0.01 < failed < 0.1 + 4 * np.sqrt(0.09 / DRAWS)


def test_slow_residuals_are_not_white():
    slow = np.repeat(np.random.default_rng(2).standard_normal(100), 8)
    assert not checks.check_whiteness([slow]).passed
    # sums of 8 equal values have 8 times the power of white ones
    assert checks.measure_slow_part([slow]) == pytest.approx(8, rel=0.35)
    assert checks.measure_slow_part([np.random.default_rng(3).standard_normal(40_000)]) < 1.5


@pytest.mark.parametrize("dof", [5, 60, 2000])
def test_the_largest_chi_square_is_its_quantile_and_what_the_noise_is_known_to(dof):
    limit = checks.compute_largest_chi2_per_dof(dof) - checks.NOISE_KNOWN
    assert chi2_law.sf(limit * dof, dof) == pytest.approx(checks.CHANCE, rel=1e-6)
    assert checks.check_goodness(limit * dof, dof).passed
    assert not checks.check_goodness(1.01 * (limit + checks.NOISE_KNOWN) * dof, dof).passed


def test_noise_that_nothing_shows_is_told_and_a_filters_is_not():
    """A third of the stated σ, in runs of unequal length; then rows behind a filter, whose long
    averages need what they state; then too few rows to say so."""
    random = np.random.default_rng(4)
    runs = [random.standard_normal((n, 2)) / 3 for n in (40, 900, 2000)]
    found = checks.check_noise_shown(runs)
    assert not found.passed and 2.6 < found.value**-0.5 < 3.1
    behind = np.convolve(random.standard_normal(20_000), np.full(8, 1 / 8), "valid")
    assert np.var(behind) < 0.2 and checks.check_noise_shown([behind]).passed
    assert checks.check_noise_shown([random.standard_normal(6) / 3]).passed


def test_what_is_not_a_number_fails():
    nan = float("nan")
    for check in (
        checks.check_at_most("x", nan, 1.0),
        checks.check_at_least("x", nan, 1.0),
        checks.check_goodness(nan, 10),
        checks.check_whiteness([np.array([nan, 1.0])]),
        checks.check_covariance(np.array([[nan]])),
        checks.check_covariance(np.diag([1.0, -1.0])),
        checks.check_covariance(np.array([[1.0, 1.1], [1.1, 1.0]])),
    ):
        assert not check.passed, check
    assert (
        checks.check_at_most("x", 1.0, 1.0).passed and checks.check_at_least("x", 1.0, 1.0).passed
    )


def test_the_largest_correlation_is_told():
    cov = np.array([[4.0, 1.0, 0.0], [1.0, 1.0, -0.8], [0.0, -0.8, 1.0]])
    assert checks.check_covariance(cov).value == pytest.approx(0.8)
