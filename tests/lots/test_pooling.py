"""Random effects: the common value, the spread and the false rate are what they claim; a gyro that
stands alone makes no common value."""

import numpy as np
import pytest

from hrg_cli.lots.pooling import (
    FEWEST,
    compute_equivalent_z,
    compute_far_limit,
    compute_improbability,
    find_outliers,
    pool_estimates,
)

LOTS = 4000


def drawn(rng, gyros, spread, mean=0.0):
    std = rng.uniform(0.7, 1.4, (gyros, LOTS))
    return mean + rng.standard_normal((gyros, LOTS)) * np.hypot(std, spread), std


@pytest.mark.parametrize("spread", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("gyros", [8, 40])
def test_value_and_spread_are_those_of_the_population(gyros, spread):
    x, std = drawn(np.random.default_rng(gyros), gyros, spread, mean=1.5)
    found = pool_estimates(x, std, 0.0)
    assert abs(np.mean(found.value) - 1.5) < 5 * np.std(found.value) / np.sqrt(LOTS)
    # σ of the value covers its scatter, by no more than the truncation of τ² costs
    assert 0.9 < np.mean(found.std) / np.std(found.value) < 1.2
    assert abs(np.median(found.spread) - spread) < 0.05 + 3 / gyros * max(spread, 0.5)


@pytest.mark.parametrize("gyros", [6, 10, 20, 40])
@pytest.mark.parametrize("spread", [0.0, 0.3, 3.0])
def test_the_false_rate_is_the_stated_one(gyros, spread):
    """At p = 0.01 of 4000 lots: 40 ± 6.3 at most; a spread as large as σ costs a factor below 2."""
    x, std = drawn(np.random.default_rng(100 * gyros + int(10 * spread)), gyros, spread)
    false = np.sum(compute_improbability(pool_estimates(x, std).z) < 0.01)
    assert false < 1.35 * 40 + 4 * 6.3


def test_power_grows_with_the_gyros():
    """1.5 σ a gyro: of 20 gyros most lots are beyond |z| = 4, of 40 all."""
    rng = np.random.default_rng(5)
    z = {n: np.abs(pool_estimates(*drawn(rng, n, 0.0, 1.5)).z) for n in (5, 20, 40)}
    assert np.mean(z[5] > 4) < 0.05 and np.mean(z[20] > 4) > 0.85 and np.mean(z[40] > 4) > 0.99


def test_no_number_of_gyros_makes_it_surer_than_the_model_is():
    x, std = np.full((2000, 1), 0.02), np.ones((2000, 1))
    assert pool_estimates(x, std).std[0] > 0.1 and pool_estimates(x, std, 0.0).std[0] < 0.025


def test_one_gyro_alone_makes_no_common_value():
    rng = np.random.default_rng(7)
    x, std = 1.5 + rng.standard_normal((20, 1)), np.ones((20, 1))
    x[4] = 900.0
    found = pool_estimates(x, std)
    assert list(np.flatnonzero(~found.used[:, 0])) == [4]
    assert abs(found.value[0] - 1.5) < 4 * found.std[0] and found.spread[0] < 1.5
    only = np.zeros((20, 1))
    only[4] = 900.0
    assert abs(pool_estimates(only + 0.1 * rng.standard_normal((20, 1)), std).z[0]) < 3


def test_unknown_estimates_are_left_out_and_few_say_nothing():
    x, std = np.ones((FEWEST, 2)), np.ones((FEWEST, 2))
    x[0, 1] = np.nan
    found = pool_estimates(x, std)
    assert list(found.count) == [FEWEST, FEWEST - 1]
    assert np.isfinite(found.value[0]) and np.isnan(found.value[1])
    assert not find_outliers(x[:3], std[:3], np.isfinite(x[:3])).any()


def test_the_scale_does_not_matter():
    rng = np.random.default_rng(1)
    x, std = rng.standard_normal((30, 5)) + 0.5, rng.uniform(0.5, 2, (30, 5))
    one, other = pool_estimates(x, std), pool_estimates(1e-9 * x, 1e-9 * std)
    np.testing.assert_allclose(other.z, one.z, rtol=1e-9)
    np.testing.assert_allclose(other.spread, 1e-9 * one.spread, rtol=1e-6, atol=1e-18)


def test_equivalent_is_as_improbable_as_student():
    from scipy.stats import t

    for dof in (4.0, 10.0, 60.0):
        for size in (1.0, 3.0, 5.0):
            p = compute_improbability(compute_equivalent_z(np.array(size), np.array(dof)))
            assert abs(np.log(p / (2 * t.sf(size, dof)))) < 0.12


@pytest.mark.parametrize("count", [6, 20, 100])
def test_normal_values_exceed_the_far_limit_at_most_at_its_rate(count):
    x = np.random.default_rng(count).standard_normal((count, LOTS))
    off = np.abs(x - np.median(x, axis=0))
    worst = (off / (1.4826 * np.median(off, axis=0))).max(axis=0)
    rate = np.mean(worst > compute_far_limit(count, 0.05))
    assert rate < 0.05 + 4 * 0.0035
