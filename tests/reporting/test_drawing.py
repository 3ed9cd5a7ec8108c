"""What the figures draw of a run's rows."""

import numpy as np

from hrg_cli.reporting.figures.drawing import binned


def test_a_line_of_means_breaks_off_where_rows_are_missing():
    """Rows near a circle have no wave angle: no straight line stands in for them."""
    time = np.linspace(0, 10, 400)
    values = np.where((time > 4) & (time < 6), np.nan, time)
    at, mean, error = binned(time, values, 40)
    hole = np.flatnonzero(np.isnan(mean))
    assert len(hole) == 1 and np.isnan(at[hole]).all() and np.isnan(error[hole]).all()
    assert at[hole - 1] < 4 and at[hole + 1] > 6
    assert np.isfinite(binned(time, time, 40)[1]).all()
    assert np.isfinite(binned(np.arange(0, 10, 0.1), np.arange(0, 10, 0.1), 40)[1]).all()
