"""What is held out when the models of tables are chosen."""

import numpy as np
import pytest

from hrg_cli.fitting.tables.drawn_path import draw_path
from hrg_cli.fitting.tables.joint import fit
from hrg_cli.fitting.tables.table_layout import TableLayout
from hrg_cli.stages.calibration.folds import choose_folds


@pytest.mark.parametrize("scale_harmonics, held_out", [(0, "runs"), (1, "time")])
def test_whole_runs_are_held_out_where_the_others_tell_k_from_d(scale_harmonics, held_out):
    """Slow runs pass 19° of 90°: enough for a scale factor that is the same at every angle."""
    random = np.random.default_rng(1)
    layout = TableLayout(np.array([20.0]), "temperature", 2, 1, scale_harmonics)
    paths = [draw_path(rate, random) for rate in 3 * (0.2, -0.002)]
    assert choose_folds(fit(paths, layout), 1)[1] == held_out
