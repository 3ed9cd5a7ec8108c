"""Where the tables have their nodes: at dwells though other runs sweep, evenly over sweeps."""

import numpy as np
import pytest

from hrg_cli.fitting.tables.drawn_path import draw_path
from hrg_cli.stages.calibration.programme import choose_nodes

DWELLS = (-10.0, 10.0, 25.0, 40.0, 60.0)


def dwell(degc, rate=0.1):
    return draw_path(rate, blocks=60, temperature_degc=degc)


def sweep(low, high, rate=0.1):
    return draw_path(rate, blocks=60, temperature_degc=np.linspace(low, high, 60))


def nodes_of(*paths):
    return choose_nodes(paths, "temperature", None)[0].tolist()


@pytest.mark.parametrize("ends", [(10.0, 25.0), (-10.0, 60.0), (60.0, -10.0), (0.0, 31.0)])
def test_a_run_that_sweeps_beside_dwells_leaves_their_nodes(ends):
    """It had nodes laid evenly from -10 to 60 °C, one at 46 where no run was: D 17 σ off."""
    assert nodes_of(*map(dwell, DWELLS), sweep(*ends)) == list(DWELLS)


def test_sweeps_beyond_the_dwells_or_far_between_them_have_nodes_of_their_own():
    rates = (0.1, -0.1, 0.0)
    across = nodes_of(dwell(0.0), dwell(60.0), *(sweep(0.0, 60.0, rate) for rate in rates))
    assert across == [0.0, 15.0, 30.0, 45.0, 60.0]
    beyond = nodes_of(dwell(20.0), dwell(40.0), *(sweep(20.0, 62.0, rate) for rate in rates))
    assert beyond[:2] == [20.0, 40.0] and beyond[-1] == pytest.approx(62.0, abs=1.0)
    # at one rate alone a sweep tells no drift from a scale factor
    assert nodes_of(dwell(0.0), dwell(60.0), sweep(0.0, 60.0)) == [0.0, 60.0]


def test_runs_that_all_sweep_have_even_nodes():
    whole = [sweep(-10.0, 60.0, rate) for rate in (0.1, -0.1, 0.0)]
    assert nodes_of(*whole) == pytest.approx(np.linspace(-10, 60, 6).tolist())
    # one after another, each as wide as the next: none of them dwells
    stairs = [sweep(low, low + 10.0) for low in (-10.0, 0.0, 10.0, 20.0, 30.0)]
    assert nodes_of(*stairs) == pytest.approx(np.linspace(-10, 40, 4).tolist())
    # nor do the narrower ones of three that follow each other
    parts = [sweep(0.0, 10.0), sweep(10.0, 29.0), sweep(29.0, 39.0)]
    assert nodes_of(*parts) == pytest.approx(np.linspace(0, 39, 4).tolist())
