"""χ² from summed normal equations: as precise as what is left of the turns, not as the turns."""

import numpy as np
import pytest
from forced_runs import Truth, forced_run

from hrg_cli.fitting.tables import joint
from hrg_cli.fitting.tables.increments import build_path
from hrg_cli.fitting.tables.normal_pieces import accumulate, compute_held_out_chi_square, solve
from hrg_cli.fitting.tables.table_design import predict_turn
from hrg_cli.fitting.tables.table_layout import Model, TableLayout

NOISE_RAD = 1e-10
LAYOUT = TableLayout(np.array([20.0]), "temperature", 2, 2, 2)
ALL = Model("everything", np.eye(LAYOUT.size))


@pytest.fixture(scope="module")
def quiet():
    """Quick turns of a table, seen with an angle noise of 1e-10 rad: Σ y² is some 1e19 of it."""
    runs = [
        forced_run(Truth(), 20.0, rate, 60.0, seed, noise=NOISE_RAD, start=0.3 * seed)
        for seed, rate in enumerate((3.0, -3.0, 1.0, -1.0))
    ]
    return joint.fit([build_path(run, harmonics=2) for run in runs], LAYOUT)


def squares_left(fitted, coefficients):
    """Whitened squares (runs, pieces) of what the coefficients leave, row by row."""
    left = [
        turn - predict_turn(path, fitted.layout, coefficients, None)
        for path, turn in zip(fitted.paths, fitted.turns, strict=True)
    ]
    return accumulate(fitted.paths, fitted.noises, fitted.layout, left).square


def test_chi2_keeps_its_digits(quiet):
    found = quiet.solution.coefficients
    by_rows = squares_left(quiet, found).sum()
    assert quiet.pieces.compute_chi_square(found) == pytest.approx(by_rows, rel=1e-6)
    about_zero = accumulate(quiet.paths, quiet.noises, quiet.layout, quiet.turns)
    # a difference of squares of whole turns has none of them left: why the pieces stand about β₀
    assert abs(about_zero.compute_chi_square(found) / by_rows - 1) > 1e-4


def test_a_shift_of_one_sigma_costs_one(quiet):
    found, covariance = quiet.solution.coefficients, quiet.solution.covariance
    least = quiet.pieces.compute_chi_square(found)
    for k in range(LAYOUT.size):
        along = covariance[:, k] / np.sqrt(covariance[k, k])
        rise = quiet.pieces.compute_chi_square(found + along) - least
        # σ of K is 1e-11 of it: Xᵀy of whole coefficients, as it is solved, is rounded to a
        # hundredth of σ where the runs' weights differ by 1e4
        assert rise == pytest.approx(1.0, rel=5e-2)


def test_data_left_out_are_judged_as_row_by_row(quiet):
    folds = np.broadcast_to(np.arange(5), quiet.pieces.rows.shape)
    A, b, _ = quiet.pieces.sum()
    total = 0.0
    for f in range(5):
        A_f, b_f, _ = quiet.pieces.sum(folds == f)
        others = solve(A - A_f, b - b_f, ALL).coefficients
        total += squares_left(quiet, others)[folds == f].sum()
    held = compute_held_out_chi_square(quiet.pieces, folds, ALL)
    assert held == pytest.approx(total, rel=1e-3)


def test_the_sum_is_that_of_the_rows_wherever_the_pieces_stand(quiet):
    moved = accumulate(
        quiet.paths, quiet.noises, quiet.layout, quiet.turns, about=0.9 * quiet.pieces.about
    )
    for one, other in zip(quiet.pieces.sum(), moved.sum(), strict=True):
        assert np.allclose(one, other, rtol=1e-9)
