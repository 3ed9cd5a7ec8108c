"""The closed form is the global least-squares solution, and the canonical one of its sixteen
copies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.solutions import symmetries

from hrg_cli.fitting.ellipse.closed_form import choose_canonical, solve_closed_form
from hrg_cli.physics.signals import make_signals


def random_waves(n: int, seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    return np.column_stack(
        [generator.uniform(-1, 1, (n, 2)), generator.uniform(0, 2 * np.pi, (n, 3))]
    )


def test_exact_signals_are_met_to_rounding():
    z = make_signals(random_waves(20000, 1))
    x, misfit = solve_closed_form(z)
    assert misfit.max() < 1e-15
    np.testing.assert_allclose(make_signals(x), z, atol=1e-14)
    assert (x[:, 0] >= np.abs(x[:, 1])).all()
    assert (np.abs(x[:, [2, 4]]) <= np.pi / 2 + 1e-15).all()


@settings(max_examples=50)
@given(
    st.tuples(
        st.floats(0.1, 2),
        st.floats(-0.9, 0.9),
        st.floats(-9, 9),
        st.floats(-9, 9),
        st.floats(-9, 9),
    )
)
def test_all_symmetric_copies_have_one_canonical_form(values):
    x = np.array(values) * [1, values[0], 1, 1, 1]
    forms = choose_canonical(symmetries(x))
    closed = solve_closed_form(make_signals(x)[None])[0]
    difference = (forms - closed)[:, 2:] / np.pi
    np.testing.assert_allclose(forms[:, :2], np.broadcast_to(closed[:, :2], (16, 2)), atol=1e-9)
    np.testing.assert_allclose(difference, np.round(difference), atol=1e-7)
    np.testing.assert_allclose(
        make_signals(forms), np.broadcast_to(make_signals(x), (16, 8)), atol=1e-9
    )
    assert (np.abs(forms[:, [2, 4]]) <= np.pi / 2 + 1e-9).all()


@pytest.mark.parametrize("carrier_known", [False, True])
def test_no_start_of_another_solver_ends_lower(carrier_known):
    from scipy.optimize import least_squares

    generator = np.random.default_rng(2)
    truth = random_waves(6, 3)
    z = make_signals(truth) + 0.1 * generator.standard_normal((6, 8))
    for row, psi in zip(z, truth[:, 4], strict=True):
        x, misfit = solve_closed_form(row[None], psi if carrier_known else None)
        assert np.sqrt(((make_signals(x[0]) - row) ** 2).mean()) == pytest.approx(
            misfit[0], rel=1e-12
        )

        def residual(values, row=row, psi=psi):
            return make_signals(np.append(values, psi) if carrier_known else values) - row

        costs = [
            2 * least_squares(residual, start).cost
            for start in generator.uniform(-3, 3, (20, 4 if carrier_known else 5))
        ]
        assert min(costs) == pytest.approx(8 * misfit[0] ** 2, rel=1e-6)


def test_known_carrier_phase_is_kept():
    x = random_waves(100, 4)
    found, misfit = solve_closed_form(make_signals(x[:, :]), x[:, 4])
    np.testing.assert_array_equal(found[:, 4], x[:, 4])
    assert misfit.max() < 1e-15


def test_invisible_defects_change_the_wave_but_leave_no_residual():
    """The redundant equations cannot see what acts before the carrier (PHYSICS §3)."""
    z = make_signals(random_waves(1000, 5))
    z[:, :4] *= 1.01
    x, misfit = solve_closed_form(z)
    assert misfit.max() < 1e-15
    z = make_signals(x)
    z[:, [1, 3]] *= 1.01
    assert solve_closed_form(z)[1].max() > 1e-3
