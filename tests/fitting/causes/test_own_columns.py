"""Products of single runs' columns beside a fit, against the same of whole columns."""

from types import SimpleNamespace

import numpy as np
import pytest

from hrg_cli.fitting.causes.designs import Basis, Design, factor_design
from hrg_cli.fitting.causes.own_columns import OwnColumns

RUNS, ROWS, COUNT = 4, 10, 3


@pytest.mark.parametrize("variance", [None, np.array([np.inf, 0.5])])
def test_products_are_those_of_whole_columns(variance):
    """Of columns with zeros on all other runs' rows, less what is unknown, off the basis."""
    random = np.random.default_rng(7)
    size = 4 * RUNS * ROWS
    across, _ = np.linalg.qr(random.standard_normal((size, 2)))
    unknown = Basis((), across, variance)
    series = SimpleNamespace(weight=np.ones((RUNS, ROWS)), scatter=None, unsettled=unknown)
    values, residual = random.standard_normal((RUNS, ROWS, 4, COUNT)), random.standard_normal(size)
    rows = [slice(4 * ROWS * k, 4 * ROWS * (k + 1)) for k in range(RUNS)]
    blocks = tuple(
        (one, slice(k, k + 1), random.standard_normal((4 * ROWS, 1))) for k, one in enumerate(rows)
    )
    shared, place = random.standard_normal((size, 2)), np.arange(RUNS, RUNS + 2)
    basis = factor_design(Design(shared, place, blocks, unknown)).basis

    whole = np.zeros((size, RUNS, COUNT))
    for k, one in enumerate(rows):
        whole[one, k] = values[k].reshape(-1, COUNT)
    whole = unknown.project_out_shared(whole.reshape(size, -1))
    beside = basis.project_out(whole)
    found = OwnColumns.from_values(series, values).multiply_beside(basis, residual)
    assert np.allclose(found.A.reshape(RUNS * COUNT, -1), beside.T @ beside)
    assert np.allclose(found.b.ravel(), beside.T @ residual)
    assert np.allclose(found.square.ravel(), np.sum(whole**2, axis=0))
