"""Levenberg–Marquardt ends at the least misfit and never rises on its way."""

from itertools import pairwise

import numpy as np

from hrg_cli.fitting.ellipse.closed_form import choose_canonical, solve_closed_form
from hrg_cli.fitting.ellipse.levenberg_marquardt import solve_levenberg_marquardt
from hrg_cli.physics.signals import make_signals


def random_waves(n: int, seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    return np.column_stack(
        [generator.uniform(-1, 1, (n, 2)), generator.uniform(0, 2 * np.pi, (n, 3))]
    )


def test_from_zero_every_exact_vector_is_solved():
    x = random_waves(20000, 1)
    z = make_signals(x)
    found = solve_levenberg_marquardt(
        z, np.zeros_like(x), residual_tolerance=1e-6, step_tolerance=0.0
    )
    assert (found.evaluations > 0).all()
    np.testing.assert_allclose(make_signals(found.x), z, atol=1e-5)


def test_more_iterations_never_leave_a_greater_misfit():
    z = make_signals(random_waves(2000, 2)) + 0.2 * np.random.default_rng(3).standard_normal(
        (2000, 8)
    )
    ends = [
        solve_levenberg_marquardt(z, np.zeros((2000, 5)), max_iterations=k).residual_rms
        for k in (1, 2, 4, 8, 16)
    ]
    for earlier, later in pairwise(ends):
        assert (later <= earlier).all()


def test_noisy_vectors_reach_the_closed_form():
    truth = random_waves(3000, 4)
    truth[:, 0], truth[:, 1] = 1.0, 0.5 * truth[:, 1]
    z = make_signals(truth) + 0.02 * np.random.default_rng(5).standard_normal((3000, 8))
    best, misfit = solve_closed_form(z)
    found = solve_levenberg_marquardt(z, truth + np.array([0, 0, 0.3, 0.3, 0.3]))
    assert (found.evaluations > 0).mean() > 0.99
    np.testing.assert_allclose(found.residual_rms, misfit, rtol=1e-9)
    done = found.evaluations > 0
    np.testing.assert_allclose(choose_canonical(found.x)[done, :2], best[done, :2], atol=1e-8)


def test_known_carrier_phase_stays():
    x = random_waves(100, 6)
    x[:, 1] *= 0.3
    found = solve_levenberg_marquardt(
        make_signals(x), x + np.array([0, 0, 0.1, 0.1, 0]), carrier_known=True
    )
    np.testing.assert_array_equal(found.x[:, 4], x[:, 4])
    assert found.residual_rms.max() < 1e-9
