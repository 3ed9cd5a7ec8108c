"""Fourier × temperature tables: averages along a stretch, interpolation between nodes."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator

from hrg_cli.fourier import (
    build_harmonic_basis,
    compute_monotone_weights,
    compute_node_weights,
    evaluate,
    interpolate_coefficients,
)


@pytest.mark.parametrize("mode_number", [1, 2, 3])
def test_average_along_a_stretch_is_the_integral(mode_number):
    middle, travel = 0.7, 0.4
    basis = build_harmonic_basis(np.array([middle]), 3, mode_number, travel)[0]
    for column in range(7):
        k = (column + 1) // 2
        f = np.cos if column % 2 or column == 0 else np.sin
        mean = (
            quad(
                lambda x, f=f, k=k: f(2 * mode_number * k * x),
                middle - travel / 2,
                middle + travel / 2,
            )[0]
            / travel
        )
        assert basis[column] == pytest.approx(mean, abs=1e-12)


def test_triangle_average_is_the_average_of_averages():
    """The difference of two neighbouring block averages weighs the speed with a triangle: sinc
    squared."""
    start, width, n = 0.3, 0.25, 8
    inner = [
        quad(lambda y, x=x: np.cos(n * (x + y)), 0, width)[0] / width
        for x in start + (np.arange(2000) + 0.5) / 2000 * width
    ]
    basis = build_harmonic_basis(np.array([start + width]), 2, 2, width, width)[0]
    assert basis[3] == pytest.approx(np.mean(inner), abs=1e-6)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_node_weights_are_cardinal_and_sum_to_one(interpolation):
    nodes = np.array([-40.0, -10.0, 25.0, 60.0, 85.0])
    assert compute_node_weights(nodes, nodes, interpolation) == pytest.approx(np.eye(5), abs=1e-12)
    x = np.linspace(-45, 90, 57)
    weights = compute_node_weights(x, nodes, interpolation)
    assert weights.sum(axis=1) == pytest.approx(np.ones(57))
    power = 1 if interpolation == "linear" else 3
    inside = (x >= -40) & (x <= 85)
    assert (weights @ nodes**power)[inside] == pytest.approx(x[inside] ** power, abs=1e-6)


def test_two_nodes_and_one_node():
    assert compute_node_weights(np.array([15.0]), np.array([10.0, 20.0]), "cubic") == pytest.approx(
        np.array([[0.5, 0.5]])
    )
    assert compute_node_weights(np.array([15.0, 99.0]), np.array([10.0])) == pytest.approx(
        np.ones((2, 1))
    )


def test_monotone_weights_reproduce_pchip_and_do_not_overshoot():
    nodes, values = np.array([0.0, 1.0, 2.0, 5.0]), np.array([0.0, 0.1, 3.0, 3.1])
    x = np.linspace(0, 5, 101)
    found = np.einsum("nj,j->n", compute_monotone_weights(x, nodes, values), values)
    assert found == pytest.approx(PchipInterpolator(nodes, values)(x), abs=1e-8)
    assert (np.diff(found) >= -1e-9).all()
    assert interpolate_coefficients(x, nodes, values[:, None], "monotone")[:, 0] == pytest.approx(
        found
    )


def test_evaluate_is_periodic_and_linear_between_nodes():
    generator = np.random.default_rng(1)
    nodes, table = np.array([0.0, 10.0]), generator.normal(size=(2, 5))
    theta = generator.uniform(-3, 3, 20)
    low, high, middle = (evaluate(np.full(20, x), theta, nodes, table, 2) for x in (0.0, 10.0, 5.0))
    assert middle == pytest.approx((low + high) / 2)
    assert evaluate(np.zeros(20), theta + np.pi / 2, nodes, table, 2) == pytest.approx(low)
