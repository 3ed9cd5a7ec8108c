"""Rows that deviate from the curve of the others, where that curve could follow them."""

import numpy as np
import pytest

from hrg_cli.fitting.tables.dwell_spikes import find_deviating_rows
from hrg_cli.fitting.tables.dwells import find_least_count


def line_with(seed, shifts, rows=10):
    x = np.linspace(-1, 1, rows)
    y = x + 1e-3 * np.random.default_rng(seed).standard_normal(rows)
    for row, shift in shifts.items():
        y[row] += shift
    return y, np.stack([np.ones(rows), x, x**2], axis=1)


@pytest.mark.parametrize("shifts", [{}, {4: 0.1}, {9: 0.1}, {2: 0.1, 7: 0.1}, {0: 0.2, 5: -0.1}])
def test_each_spike_is_found_and_none_hides_another(shifts):
    """The end of ten rows takes two thirds of the curve with it; two spikes swell the scatter that
    each is judged by."""
    for seed in range(10):
        y, X = line_with(seed, shifts)
        assert set(find_deviating_rows(y, X, 2, 1e-3, 6.0, 0.0)) == set(shifts)


def test_units_do_not_matter_and_rounding_is_no_scatter():
    y, X = line_with(1, {4: 0.1})
    assert find_deviating_rows(1e9 * y, X, 2, 1e-3, 6.0, 0.0).tolist() == [4]
    assert find_deviating_rows(y, X, 2, 1e-3, 6.0, 0.1).size == 0


def test_large_multiples_of_a_step_show_no_grid():
    """Three bands of rates, in each a line at even temperatures: every difference but two is one
    step, those two are a thousand."""
    values = np.concatenate([band + 2e-4 * np.arange(3) for band in (-0.5, 0.0001231, 0.5)])
    noise = 1e-6 * np.random.default_rng(0).standard_normal(9)
    assert find_least_count(values + noise) == 0
