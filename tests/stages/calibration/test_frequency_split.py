"""What the frequency tells of the split: as well as its wandering lets it, and no better."""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from hrg_cli.fitting.tables.drawn_path import draw_path
from hrg_cli.fitting.tables.joint import fit
from hrg_cli.fitting.tables.table_layout import TableLayout
from hrg_cli.stages.calibration.factors import build_factors
from hrg_cli.stages.calibration.frequency_split import find_in_frequency

NODES = np.array([20.0])
SPLIT = np.array([4e-3, -7e-3])


def fitted_runs(random, wander_hz):
    """Four runs whose frequency holds the split, and wanders as a temperature does."""
    paths = []
    for rate in (-0.2, -0.1, 0.1, 0.2):
        path = draw_path(rate, random, blocks=300, ratio=0.01)
        slow = lfilter([1.0], [1.0, -0.95], random.normal(size=300))
        a = 4 * path.angle_rad
        moved = (SPLIT[0] * np.cos(a) + SPLIT[1] * np.sin(a)) / (2 * np.pi)
        paths.append(replace(path, frequency_hz=5000 + moved + wander_hz * slow))
    names = ["quadrature_course", "mean_frequency"]
    factors = build_factors(paths, NODES, "temperature", "linear", names)
    return fit(paths, TableLayout(NODES, "temperature", 2, 1, 0, "linear", *factors))


def test_the_split_is_known_as_well_as_the_frequency_wanders():
    random = np.random.default_rng(0)
    square = []
    for _ in range(30):
        found = find_in_frequency(fitted_runs(random, 1e-4))["quadrature_course"]
        off = found.values + 2 * SPLIT
        square += list(off**2 / np.diag(found.covariance))
    # sixty numbers, each held against an error that twenty pieces of time tell
    assert 0.5 < np.sqrt(np.mean(square)) < 1.3


def test_a_frequency_that_never_moves_was_not_measured():
    fitted = fitted_runs(np.random.default_rng(0), 0.0)
    still = [replace(path, frequency_hz=0 * path.frequency_hz + 5e3) for path in fitted.paths]
    assert find_in_frequency(replace(fitted, paths=still)) == {}
    assert set(find_in_frequency(fitted)) == {"quadrature_course", "mean_frequency"}
