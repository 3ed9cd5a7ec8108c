"""Weak priors bend nothing that a passive resonator can be."""

import numpy as np
import pytest

from hrg_cli.fitting.envelopes.coordinates import COORDINATES
from hrg_cli.fitting.envelopes.weak_priors import DIAGNOSED, IDENTIFIED, PLANNED, find_natural_sizes


@pytest.mark.parametrize(
    ("widths", "cost"), [(IDENTIFIED, 0.25), (DIAGNOSED, 0.01), (PLANNED, 0.01)]
)
def test_the_largest_damping_split_costs_next_to_nothing(widths, cost):
    std = widths.scale_by(0.2, 0.5)
    assert len(std) == len(COORDINATES)
    assert (0.2 / std[1]) ** 2 == pytest.approx(cost)
    assert (0.5 / std[3]) ** 2 == pytest.approx(1 / 900)


def test_a_split_that_is_not_there_has_the_size_that_the_runs_would_show():
    assert find_natural_sizes(np.array([0.2, 0, 0, 0, 0, 0.55, 1.0]), 10.0) == (0.2, 0.2)
    assert find_natural_sizes(np.array([1e-6, 0, 0, 0, 0, 0.55, 1.0]), 10.0) == (0.001, 0.1)
