"""Monotone tables: their weights follow their own values, and a fit ends where both agree."""

import numpy as np
import pytest
from forced_runs import Truth, forced_run

from hrg_cli.fitting.noise.increment_noise import AngleNoise, build_covariance_bands, whiten
from hrg_cli.fitting.tables import bends
from hrg_cli.fitting.tables.increments import build_path
from hrg_cli.fitting.tables.joint import fit
from hrg_cli.fitting.tables.table_design import predict_turn
from hrg_cli.fitting.tables.table_layout import Model, TableLayout

NODES = np.linspace(-20.0, 60.0, 6)


@pytest.fixture(scope="module")
def paths():
    truth = Truth(8, curved=False)
    return [
        build_path(
            forced_run(truth, lambda t: -20 + 2 * t, rate, 40, i, dt=0.04, run_id=f"sweep {i}"),
            harmonics=2,
        )
        for i, rate in enumerate((-0.5, 0.5, -0.5, 0.5))
    ]


def layout(interpolation):
    return TableLayout(NODES, "temperature", 2, 2, 2, interpolation)


def left(fitted, coefficients):
    """χ² of the turns with the weights that the coefficients themselves ask for."""
    return sum(
        float(
            np.sum(
                whiten(
                    build_covariance_bands(p, AngleNoise(n.white, n.walk)),
                    (t - predict_turn(p, fitted.layout, coefficients, coefficients))[:, None],
                )[0]
                ** 2
            )
        )
        for p, t, n in zip(fitted.paths, fitted.turns, fitted.noises)
    )


def test_only_tables_that_follow_their_own_values_bend():
    assert bends.has_bends(layout("monotone"))
    assert not bends.has_bends(layout("linear"))
    assert not bends.has_bends(TableLayout(NODES[:2], "temperature", 2, 2, 2, "monotone"))


def test_no_step_in_any_direction_lowers_what_the_fit_leaves(paths):
    fitted = fit(paths, layout("monotone"))
    at = fitted.solution.coefficients
    least = left(fitted, at)
    assert least / (len(np.concatenate(fitted.turns)) - layout("monotone").size) < 1.1
    draw = np.random.default_rng(3)
    spread = np.linalg.cholesky(fitted.solution.covariance + 1e-30 * np.eye(len(at)))
    for _ in range(40):
        step = spread @ draw.standard_normal(len(at))
        assert left(fitted, at + 0.3 * step) > least - 1.0


def test_it_ends_as_low_from_tables_of_another_interpolation(paths):
    fitted = fit(paths, layout("monotone"))
    linear = fit(paths, layout("linear")).solution.coefficients
    everything = Model("everything", np.eye(len(linear)))
    found = bends.settle_bends(
        fitted.paths, fitted.noises, fitted.layout, fitted.turns, everything, linear
    )
    least = left(fitted, fitted.solution.coefficients)
    assert left(fitted, linear) > least + 20
    assert left(fitted, found) == pytest.approx(least, abs=5)
