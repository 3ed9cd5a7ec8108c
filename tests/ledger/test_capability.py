"""Cp and Cpk: closed forms, the coverage of their intervals over drawn populations."""

import numpy as np
import pytest
from scipy import stats

from hrg_cli.ledger.capability import compute_capability, compute_noncentral_t

DRAWS = 1000


def test_values_are_the_definitions():
    x = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    found = compute_capability(x, -3.0, 12.0)
    s = np.sqrt(2.5)
    assert found.cp == pytest.approx(15 / (6 * s)) and found.cpk == pytest.approx(6 / (3 * s))
    assert found.cp_interval[0] < found.cp < found.cp_interval[1]
    assert found.cpk_interval[0] < found.cpk < found.cpk_interval[1]


def test_cannot_be_told():
    assert compute_capability(np.arange(4.0), 0.0, 9.0) is None
    assert compute_capability(np.arange(9.0), None, None) is None
    assert compute_capability(np.ones(9), 0.0, 9.0) is None


@pytest.mark.parametrize("n", [8, 40])
def test_interval_of_cp_holds_in_95_of_100(n):
    rng = np.random.default_rng(n)
    true = 10 / 6
    inside = [
        low < true < high
        for low, high in (
            compute_capability(rng.standard_normal(n), -5.0, 5.0).cp_interval for _ in range(DRAWS)
        )
    ]
    assert np.mean(inside) == pytest.approx(0.95, abs=4 * np.sqrt(0.05 * 0.95 / DRAWS))


@pytest.mark.parametrize("n", [8, 40])
def test_interval_of_one_limit_holds_in_95_of_100(n):
    """Exact by the noncentral t distribution: tested on draws that do not use it."""
    rng = np.random.default_rng(n)
    true = 4 / 3
    inside = [
        low < true < high
        for low, high in (
            compute_capability(rng.standard_normal(n), None, 4.0).cpk_interval for _ in range(DRAWS)
        )
    ]
    assert np.mean(inside) == pytest.approx(0.95, abs=4 * np.sqrt(0.05 * 0.95 / DRAWS))


@pytest.mark.parametrize("offset", [0.0, 0.3, 1.5])
def test_interval_of_cpk_holds_in_at_least_95_of_100(offset):
    """Between two limits, centred or not: at least the level, and not everything."""
    rng = np.random.default_rng(int(10 * offset))
    true = (4 - offset) / 3
    inside, widths = [], []
    for _ in range(DRAWS):
        low, high = compute_capability(offset + rng.standard_normal(20), -4.0, 4.0).cpk_interval
        inside.append(low < true < high)
        widths.append(high - low)
    assert np.mean(inside) > 0.95 - 4 * np.sqrt(0.05 * 0.95 / DRAWS)
    assert np.mean(widths) < 1.2


@pytest.mark.parametrize("degrees", [4, 24, 300])
@pytest.mark.parametrize("t", [-3.0, 0.5, 12.0])
@pytest.mark.parametrize("shift", [-1.5, 0.0, 2.0])
def test_noncentral_t_is_the_librarys(degrees, t, shift):
    expected = stats.nct.cdf(t, degrees, t - shift)
    assert compute_noncentral_t(t, degrees, t - shift) == pytest.approx(expected, abs=1e-9)


def test_what_is_not_normal_is_called_so():
    rng = np.random.default_rng(3)
    alarms = sum(
        not compute_capability(rng.standard_normal(50), -9.0, 9.0).is_normal for _ in range(500)
    )
    assert alarms / 500 < 0.03, "1 % of normal populations"
    assert not compute_capability(np.exp(2 * rng.standard_normal(50)), 0.0, 900.0).is_normal
