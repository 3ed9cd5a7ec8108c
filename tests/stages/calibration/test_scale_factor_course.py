"""K over the nodes: one that is off a smooth course of the others has a log of another scale."""

import numpy as np
import pytest

from hrg_cli.stages.calibration.scale_factor_course import ScaleFactors

STD = 2e-7


def course(values, nodes=None):
    nodes = np.linspace(0, 50, len(values)) if nodes is None else np.array(nodes)
    return ScaleFactors(nodes, np.array(values), np.full(len(values), STD))


@pytest.mark.parametrize(
    "values",
    [
        (0.54257, 0.55, 0.559075),
        (0.54299, 0.54618, 0.55, 0.55443, 0.55949),
        (0.53, 0.55, 0.57, 0.59),
        (0.55, 0.55001, 0.55003),
    ],
)
def test_an_even_course_has_no_odd_node(values):
    assert course(values).find_odd_node() is None
    assert course(values[::-1]).find_odd_node() is None


@pytest.mark.parametrize("count, size", [(3, 0.02), (4, 0.01), (4, 0.003), (6, 0.003)])
def test_a_step_of_one_node_is_found_wherever_it_stands(count, size):
    for odd in range(count):
        values = np.full(count, 0.55) + 1e-5 * np.arange(count)
        values[odd] *= 1 + size
        assert course(values).find_odd_node() == odd


def test_a_step_on_a_strong_even_course_is_found():
    values = np.array([0.54, 0.545, 0.55, 0.555, 0.56])
    for odd in range(5):
        assert course(values * (1 + 0.02 * (np.arange(5) == odd))).find_odd_node() == odd


def test_nodes_that_are_little_apart_carry_no_line_far_beyond_them():
    assert course((0.55, 0.55001, 0.55005), (20.0, 21.0, 60.0)).find_odd_node() is None
