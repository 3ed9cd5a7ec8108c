"""A variant whose tables are not those of the widest one is not valid, whatever its own checks
say."""

from types import SimpleNamespace

import numpy as np
import pytest

from hrg_cli.fitting.tables.normal_pieces import TableSolution
from hrg_cli.fitting.tables.table_layout import TableLayout
from hrg_cli.stages.calibration.choice import TriedVariant
from hrg_cli.stages.calibration.wider_model import hold_against_widest

LAYOUT = TableLayout(np.array([0.0, 40.0]), "temperature", 2, 1, 0)


def variant(name, shift, std, place=0):
    coefficients = np.zeros(LAYOUT.size)
    coefficients[place :: LAYOUT.size // 2] = shift
    solution = TableSolution(coefficients, std**2 * np.eye(LAYOUT.size), 1.0)
    tried = SimpleNamespace(solution=solution, foreign=False)
    return TriedVariant(name, tried, (1, 0), (1, 0), (), (), 0.0)


@pytest.mark.parametrize("place", [0, 3])
@pytest.mark.parametrize(
    ("shift", "own", "wide", "fits"),
    [(5.0, 1.0, 1.0, False), (5.0, 1.0, 10.0, True), (5.0, 10.0, 1.0, True), (0.5, 1.0, 1.0, True)],
)
def test_tables_apart_by_more_than_both_errors_are_named(place, shift, own, wide, fits):
    """Drift or scale factor, in the larger of both errors: a wide model that knows nothing
    contradicts nothing."""
    tried = [variant("table", shift, own, place), variant("combined", 0.0, wide)]
    table, combined = hold_against_widest(LAYOUT, tried)
    assert table.fits is fits and combined.fits
    assert fits or "--model combined or auto" in table.failed[0]
