"""Medians agree with numpy's to the last bit."""

import numpy as np
import pytest

from hrg_cli.fitting.medians import find_known_median, find_median


@pytest.mark.parametrize("count", [1, 2, 3, 8, 31])
@pytest.mark.parametrize("axis", [None, 0, 1, -1])
def test_medians_are_those_of_numpy(count, axis):
    random = np.random.default_rng(count)
    values = random.standard_normal((3, count))
    np.testing.assert_array_equal(find_median(values, axis), np.median(values, axis=axis))
    values[1, 0] = np.nan
    values[2, -1] = np.inf
    np.testing.assert_array_equal(find_median(values, axis), np.median(values, axis=axis))
    assert find_known_median(values) == np.nanmedian(values)


def test_whole_numbers_do_not_overflow():
    assert find_median(np.array([30_000, 30_002], "i2")) == 30_001


def test_of_nothing_nothing_is_the_median():
    assert np.isnan(find_median([])) and np.isnan(find_median(np.zeros((2, 0)), 1)).all()
    assert np.isnan(find_known_median([np.nan]))
