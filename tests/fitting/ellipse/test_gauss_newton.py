"""The explicit formulas (2) are the Gauss–Newton step, and the iteration ends where it should."""

import numpy as np
import pytest

from hrg_cli.fitting.ellipse.closed_form import choose_canonical, solve_closed_form
from hrg_cli.fitting.ellipse.gauss_newton import (
    compute_half_products,
    compute_model_signals,
    make_step,
    solve_amplitudes,
    solve_gauss_newton,
)
from hrg_cli.physics.signals import make_signals


def random_waves(n: int, seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    return np.column_stack(
        [generator.uniform(-1, 1, (n, 2)), generator.uniform(0, 2 * np.pi, (n, 3))]
    )


def jacobian(x: np.ndarray) -> np.ndarray:
    """∂F/∂x (8, 5) by central differences of F alone."""
    columns = [
        (make_signals(x + 1e-6 * unit) - make_signals(x - 1e-6 * unit)) / 2e-6 for unit in np.eye(5)
    ]
    return np.stack(columns, axis=-1)


def test_the_normal_matrix_has_the_stated_form():
    for x in random_waves(20, 1):
        A, B = x[:2]
        power, twice = A**2 + B**2, 2 * A * B
        expected = 2 * np.diag([1, 1, power, power, power])
        expected[2, 3] = expected[3, 2] = 2 * twice
        np.testing.assert_allclose(jacobian(x).T @ jacobian(x), expected, atol=1e-8)
        np.testing.assert_allclose(jacobian(x)[:, 2:].T @ make_signals(x), 0, atol=1e-8)


@pytest.mark.parametrize("carrier_known", [False, True])
def test_one_step_is_the_pseudo_inverse_step(carrier_known):
    """With A and B already optimal for the old angles, (2) equals x + (JᵀJ)⁻¹Jᵀ(z − F)."""
    generator = np.random.default_rng(2)
    for x in random_waves(200, 3):
        z = generator.standard_normal(8)
        x[:2] = np.ravel(solve_amplitudes(z[:, None], compute_half_products(*x[2:, None])))
        free = slice(0, 4 if carrier_known else 5)
        expected = x.copy()
        expected[free] += np.linalg.pinv(jacobian(x)[:, free]) @ (z - make_signals(x))
        found = make_step(z[None], x[None], carrier_known)[0]
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_the_fast_model_is_the_model():
    x = random_waves(100, 4).T
    np.testing.assert_allclose(
        compute_model_signals(x[0], x[1], compute_half_products(*x[2:])).T,
        make_signals(x.T),
        atol=1e-15,
    )


def test_from_zero_every_exact_vector_is_solved():
    x = random_waves(20000, 5)
    z = make_signals(x)
    found = solve_gauss_newton(z, np.zeros_like(x), residual_tolerance=1e-6, step_tolerance=0.0)
    assert (found.evaluations > 0).all()
    np.testing.assert_allclose(make_signals(found.x), z, atol=1e-5)
    assert found.evaluations.mean() == pytest.approx(5.736, abs=4 * 1.35 / np.sqrt(len(x)))


def test_started_at_the_closed_form_it_stays_there():
    z = make_signals(random_waves(5000, 6)) + 0.05 * np.random.default_rng(7).standard_normal(
        (5000, 8)
    )
    best, misfit = solve_closed_form(z)
    found = solve_gauss_newton(z, best, step_tolerance=1e-6)
    assert (found.evaluations == 1).mean() > 0.999
    np.testing.assert_allclose(found.residual_rms, misfit, atol=1e-15)


def test_noisy_vectors_converge_to_the_least_misfit_from_nearby():
    truth = random_waves(3000, 8)
    truth[:, 0], truth[:, 1] = 1.0, 0.3 * truth[:, 1]
    z = make_signals(truth) + 0.01 * np.random.default_rng(9).standard_normal((3000, 8))
    best, misfit = solve_closed_form(z)
    found = solve_gauss_newton(z, truth + np.array([0, 0, 0.1, 0.1, 0.1]), carrier_known=False)
    assert (found.evaluations > 1).all()
    np.testing.assert_allclose(found.residual_rms, misfit, rtol=1e-9)
    np.testing.assert_allclose(choose_canonical(found.x)[:, :2], best[:, :2], atol=1e-9)


def test_what_does_not_converge_says_so():
    z = make_signals(random_waves(500, 10))
    found = solve_gauss_newton(
        z, np.zeros((500, 5)), residual_tolerance=1e-6, step_tolerance=0.0, max_iterations=4
    )
    late = found.evaluations < 0
    assert 0.5 < late.mean() < 1
    assert (found.evaluations[late] == -4).all()
    assert (found.residual_rms[late] > 1e-6).all()
