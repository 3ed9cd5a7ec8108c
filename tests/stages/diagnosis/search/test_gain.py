"""The gain on data held out: its standard deviation is that of its mean, and folds are runs or
stretches of time."""

from types import SimpleNamespace

import numpy as np
import pytest

from hrg_cli.fitting.causes.left_out_folds import HeldOut
from hrg_cli.stages.diagnosis.search.gain import _root, choose_left_out_folds

FOLDS, DRAWS = 16, 600


def test_the_ratios_deviation_is_its_scatter():
    """Errors of independent folds about a true ratio of 3: the stated σ over many programmes is how
    far the ratio really scatters."""
    random = np.random.default_rng(1)
    found = [
        HeldOut(
            9 * np.exp(0.2 * random.standard_normal(FOLDS)),
            np.exp(0.2 * random.standard_normal(FOLDS)),
        )
        for _ in range(DRAWS)
    ]
    ratios, stated = np.array([(h.ratio, h.std) for h in found]).T
    assert ratios.mean() == pytest.approx(3, rel=0.02)
    # σ of a scatter over DRAWS: 1/√(2·DRAWS) = 3 %
    assert np.sqrt(np.mean(stated**2)) == pytest.approx(ratios.std(), rel=0.15)


def test_a_root_of_mean_squares_has_the_deviation_of_its_scatter():
    random = np.random.default_rng(2)
    squares = [random.gamma(20.0, 1 / 20.0, FOLDS) * 4.0 for _ in range(DRAWS)]
    rms, stated = np.array([_root(own) for own in squares]).T
    assert rms.mean() == pytest.approx(2, rel=0.02)
    assert np.sqrt(np.mean(stated**2)) == pytest.approx(rms.std(), rel=0.15)


@pytest.mark.parametrize(("runs", "kind", "count"), [(4, "runs", 4), (3, "time", 5)])
def test_folds_hold_every_row_once(runs, kind, count):
    """Four runs are left out one by one, fewer are cut at the same parts of their time."""
    rows = 50
    where = np.argwhere(np.ones((runs, rows, 4), bool))
    time = np.arange(runs)[:, None] + np.linspace(0, 10.0, rows)
    fit = SimpleNamespace(rows=where, series=SimpleNamespace(names=["r"] * runs, time_s=time))
    told, folds = choose_left_out_folds(fit)
    assert told == kind and len(folds) == count
    assert np.array_equal(np.sort(np.concatenate(folds)), np.arange(len(where)))
    for fold in folds:
        assert len(np.unique(where[fold, 0])) == (1 if kind == "runs" else runs)
