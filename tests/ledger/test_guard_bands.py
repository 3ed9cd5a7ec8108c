"""Guard bands: the risks by integration against drawn decisions, a gyro's own risk against
counting."""

import numpy as np
import pytest
from scipy import stats

from hrg_cli.ledger.guard_bands import (
    compute_guard_limits,
    compute_probability_outside,
    compute_risks,
)

DRAWS = 1_000_000


@pytest.mark.parametrize(
    ("spread", "u", "low", "high", "k"),
    [
        (1.0, 0.3, -2.0, 2.0, 0.0),
        (1.0, 0.3, -2.0, 2.0, 1.0),
        (0.5, 0.5, None, 0.8, 0.7),
        (1.0, 0.01, -1.5, 2.5, 2.0),
        (0.05, 0.8, -1.0, 1.0, 0.5),
    ],
)
def test_risks_are_those_of_drawn_decisions(spread, u, low, high, k):
    rng = np.random.default_rng(4)
    true = 0.1 + spread * rng.standard_normal(DRAWS)
    seen = true + u * rng.standard_normal(DRAWS)
    accepted = np.ones(DRAWS, bool)
    good = np.ones(DRAWS, bool)
    a, b = compute_guard_limits(low, high, u, k)
    if low is not None:
        accepted &= seen >= a
        good &= true >= low
    if high is not None:
        accepted &= seen <= b
        good &= true <= high
    found = compute_risks((0.1, spread), u, low, high, k)
    for value, counted in (
        (found.false_acceptance, accepted & ~good),
        (found.false_rejection, ~accepted & good),
    ):
        share = counted.mean()
        assert value == pytest.approx(share, abs=5 * np.sqrt((share + 1e-6) / DRAWS))
    if (accepted & ~good).sum() > 100:
        share = (accepted & ~good).sum() / accepted.sum()
        assert found.outside_if_accepted == pytest.approx(share, rel=0.1)


def test_a_gyros_risk_is_that_of_its_like():
    """Of the drawn gyros that measured near 1.9, so many are beyond 2."""
    rng = np.random.default_rng(5)
    true = rng.standard_normal(4 * DRAWS)
    seen = true + 0.3 * rng.standard_normal(4 * DRAWS)
    like = np.abs(seen - 1.9) < 0.01
    counted = (true[like] > 2.0).mean()
    found = compute_probability_outside(1.9, 0.3, None, 2.0, (0.0, 1.0))
    assert found == pytest.approx(counted, abs=5 * np.sqrt(counted / like.sum()))


def test_without_a_population_the_measurement_alone_tells():
    assert compute_probability_outside(1.0, 0.5, None, 1.0) == pytest.approx(0.5)
    expected = stats.norm.sf(2.0) + stats.norm.cdf(-4.0)
    assert compute_probability_outside(0.0, 0.5, -2.0, 1.0) == pytest.approx(expected)
    assert compute_probability_outside(3.0, 0.0, None, 2.0) == 1.0


def test_a_wider_guard_band_accepts_less_that_is_bad_and_rejects_more_that_is_good():
    found = [compute_risks((0.0, 1.0), 0.3, -2.0, 2.0, k) for k in (0.0, 1.0, 2.0, 3.0)]
    assert np.all(np.diff([r.false_acceptance for r in found]) < 0)
    assert np.all(np.diff([r.false_rejection for r in found]) > 0)
    assert found[-1].false_acceptance < 2e-5
