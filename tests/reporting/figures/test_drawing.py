"""What the figures draw of a run's rows."""

import numpy as np
import pytest

from hrg_cli.reporting.figures.drawing import average_bins, draw_dots, make_panels


def test_a_line_of_means_breaks_off_where_rows_are_missing():
    """Rows near a circle have no wave angle: no straight line stands in for them."""
    time = np.linspace(0, 10, 400)
    values = np.where((time > 4) & (time < 6), np.nan, time)
    at, mean, error = average_bins(time, values, 40)
    hole = np.flatnonzero(np.isnan(mean))
    assert len(hole) == 1 and np.isnan(at[hole]).all() and np.isnan(error[hole]).all()
    assert at[hole - 1] < 4 and at[hole + 1] > 6
    assert np.isfinite(average_bins(time, time, 40)[1]).all()
    assert np.isfinite(average_bins(np.arange(0, 10, 0.1), np.arange(0, 10, 0.1), 40)[1]).all()


@pytest.mark.parametrize("x", [1.8e-3, 0.0, -4e5])
def test_one_dot_is_a_dot_and_no_bar(x):
    """A lot's one outlier, a thousandth off: its dash was a thousandth of one long."""
    _, axes = make_panels(1, 1)
    ax = axes[0, 0]
    ax.plot(x + np.array([0.0, 1e-3]), [0, 1])
    draw_dots(ax, np.array([x]), np.array([1.0]))
    outline = ax.patches[-1].get_path().vertices[:, 0]
    assert np.ptp(outline) < 0.01 * 1e-3
    _, axes = make_panels(1, 1)
    draw_dots(axes[0, 0], np.array([x]), np.array([1.0]))  # with nothing beside it
    assert np.ptp(axes[0, 0].patches[-1].get_path().vertices[:, 0]) <= 1e-9 * max(abs(x), 1)
