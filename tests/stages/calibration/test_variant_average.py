"""What variants differ by that predict alike stands in the error of the one that is written."""

from types import SimpleNamespace

import numpy as np
import pytest

from hrg_cli.fitting.tables.normal_pieces import TableSolution
from hrg_cli.fitting.tables.table_layout import TableLayout
from hrg_cli.records import collect
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.calibration.choice import TriedVariant
from hrg_cli.stages.calibration.guards import VariantSolution
from hrg_cli.stages.calibration.variant_average import add_spread_of_variants
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import simulate

SCALE_FACTOR = 0.554
RATES = (2.0, -2.5, 3.3)


def programme(seed):
    """Raw samples of a gyro of low Q whose quadrature loop leaves 3·10⁻⁴: with the split's axis it
    moves K by half a ppm, three σ, and the drift by nothing that a variant's score sees."""
    pytest.importorskip("numba")
    draw = np.random.default_rng(seed)
    device = {
        "frequency_hz": 1700.0, "time_constant_s": 3.2, "damping_split": 0.02, "damping_axis_rad": draw.uniform(0, 1.5),
        "frequency_split_hz": 3e-3, "stiffness_axis_rad": draw.uniform(0, 1.5), "scale_factor": SCALE_FACTOR,
    }  # fmt: skip
    loops = {
        "mode": "forced", "amplitude": 1.0, "quadrature_loop": "finite", "quadrature_gain_1_s": 20.0,
    }  # fmt: skip
    runs = [
        {
            "run_id": f"r{k}",
            "control": loops,
            "environment": {"rate_rad_s": rate, "temperature_degc": 20.0},
        }
        for k, rate in enumerate(RATES)
    ]
    config = {
        "device": device, "readout": {"noise": 2e-4}, "run": runs,
        "recording": {"sample_rate_hz": 11000.0, "duration_s": 8.0, "gyro_id": "S"},
    }  # fmt: skip
    recordings = [collect(simulate(config, run=run["run_id"], seed=seed)) for run in runs]
    periods = [collect(demodulate(one, periods_per_window=20)) for one in recordings]
    return [collect(estimate(one)) for one in periods]


def test_the_scale_factor_holds_whichever_of_alike_variants_is_written():
    """`auto` was 2.2 σ off rms where it wrote a variant without the quadrature that predicts what
    is left out as well as those with it, `table` by its name as much; σ knew nothing of the others."""
    z = {"auto": [], "table": []}
    for seed in range(5):
        waves = programme(seed)
        for model, found in z.items():
            tables = calibrate(waves, model=model, bootstrap=0)
            error = tables.scale_factor_harmonics[0, 0] - SCALE_FACTOR
            found.append(error / tables.scale_factor_harmonics_std[0, 0])
            unit = np.sqrt(np.diag(tables.covariance))
            assert np.linalg.eigvalsh(tables.covariance / np.outer(unit, unit)).min() > 0
    assert all(np.sqrt(np.mean(np.square(found))) < 1.6 for found in z.values()), z


def variant(name, coefficients, covariance, chi2):
    solution = TableSolution(np.array(coefficients), covariance, 1.0)
    tried = VariantSolution(SimpleNamespace(), solution, ())
    return TriedVariant(name, tried, (0, 0), (0, 0), (), (), chi2)


def test_a_variant_that_is_clearly_best_keeps_its_own_error():
    """And the measured part of one variant gets nothing of the others' tables."""
    names = {"factors": {"quadrature_course": None}, "factor_columns": {"quadrature_course": 2}}
    layout = TableLayout(np.array([0.0]), "temperature", 2, 0, 0, **names)
    draw = np.random.default_rng(3)
    root = draw.normal(size=(4, 4))
    own = variant("combined", [0.0, 0.5, 1.0, 2.0], root @ root.T, 1000.0)
    table = np.zeros((4, 4))
    table[:2, :2] = 1e-6 * np.eye(2)
    for apart, same in ((100.0, True), (0.0, False)):
        other = variant("table", [3.0, 0.5, 0.0, 0.0], table, 1000.0 + apart)
        found = add_spread_of_variants(layout, own, [own, other]).tried.solution.covariance
        assert np.allclose(found, root @ root.T, rtol=1e-9) is same
        assert np.array_equal(found[2:, 2:], (root @ root.T)[2:, 2:])
        assert np.linalg.eigvalsh(found).min() > 0
    assert found[0, 0] == pytest.approx((root @ root.T)[0, 0] / 2 + 9 / 2, rel=1e-6)
