"""Loops that act late: the force of a board stands τ behind the wave, turns it by ντ of its own turn,
and driven runs show the scale factor K/(1 + ντ). What is told of K holds what a delay may have done."""

from dataclasses import replace

import numpy as np
import pytest

from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.closing.loop_delay import NAME, estimate_moves_of_delay
from hrg_cli.stages.diagnosis.closing.sized import Sized
from hrg_cli.stages.diagnosis.report.base_values import list_base_values
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import simulate

pytest.importorskip("numba")
SAMPLING_HZ, FREQUENCY_HZ, WINDOW, DAMPING_1_S, K = 21000.0, 5000.0, 16, 0.25, 0.55


def fitted(delay_periods, noise, duration_s, log_rate_hz):
    """The base fit of two runs, at +3 and −3 rad/s, of loops on a board."""
    rates = (-3.0, 3.0)
    config = {
        "device": {
            "frequency_hz": FREQUENCY_HZ, "damping_rate_1_s": DAMPING_1_S, "damping_split": 0.02, "damping_axis_rad": 0.3,
            "frequency_split_rad_s": 0.01, "stiffness_axis_rad": 0.8, "scale_factor": K,
        },
        "electronics": {"periods_per_update": WINDOW, "delay_periods": delay_periods, "phase_loop_hz": 1.0},
        "control": {"mode": "forced", "amplitude_gain_1_s": 5.0, "quadrature_loop": "finite", "quadrature_gain_1_s": 10.0},
        "readout": {"noise": noise},
        "recording": {"sample_rate_hz": SAMPLING_HZ, "duration_s": duration_s, "log_rate_hz": log_rate_hz},
        "run": [{"run_id": f"R{r:g}", "environment": {"rate_rad_s": r}} for r in rates],
    }  # fmt: skip
    recordings = [collect(simulate(config, run=f"R{r:g}", seed=1)) for r in rates]
    waves = [collect(estimate(collect(demodulate(r, periods_per_window=5)))) for r in recordings]
    return fit_base(waves, scale_factor=None, blocks=120, free_phase=False)


def shown(delay_periods):
    """K/(1 + ντ): half a window read, the delay, half a window held, in whole samples."""
    period = SAMPLING_HZ / FREQUENCY_HZ
    late_s = (round(WINDOW * period) + round(delay_periods * period)) / SAMPLING_HZ
    return K / (1 + DAMPING_1_S * late_s)


def sigmas(fit, delay_periods):
    """Of the scale factor beside what it should be; a power is largest twice a period, so that τ is
    known to 1/2ω only."""
    unsure = K * DAMPING_1_S / (4 * np.pi * FREQUENCY_HZ)
    std = np.hypot(fit.coordinate_std("scale_factor"), unsure)
    return (fit.coordinate("scale_factor") - shown(delay_periods)) / std


def told(fit):
    """The scale factor as the report has it."""
    rows = list_base_values(Sized(fit, fit, 1.0), None, estimate_moves_of_delay(fit), {})
    return next(row for row in rows if row["name"] == "scale_factor")


@pytest.fixture(scope="module")
def late():
    return fitted(20, 3e-3, 3.0, 3000.0)


def test_late_noisy_loops_leave_noise_and_show_their_own_scale_factor(late):
    fit = late
    assert abs(fit.chi2 / fit.dof - 1) < 5 * np.sqrt(2 / fit.dof)
    # the commands answer the noise that the fit leaves: no lateness of the log, which is a third of
    # a millisecond here, may be made of that
    assert abs(fit.series.drive_late_s) < 6e-3
    # ντ is 200 of the σ that this run states
    assert abs(sigmas(fit, 20)) < 4
    assert abs(fit.coordinate("scale_factor") - K) > 20 * fit.coordinate_std("scale_factor")


def test_what_is_told_of_the_scale_factor_holds_a_delay_that_nobody_logged(late):
    """Known by what follows the damping along the wave alone: some 1/δμ of the σ of the loops' K."""
    row = told(late)
    assert row["sum_with"] == [NAME]
    assert abs(row["value"] - K) < 3 * row["std"]
    assert row["std"] < 4 / 0.02 * late.coordinate_std("scale_factor")


def test_free_runs_tell_the_scale_factor_and_no_delay_moves_it(late):
    free = late.series.forced.copy()
    free[0] = 0.0
    beside = replace(late.prediction, series=replace(late.series, forced=free))
    assert estimate_moves_of_delay(replace(late, flow=replace(late.flow, prediction=beside))) == {}


@pytest.mark.slow
@pytest.mark.parametrize("delay_periods", [0, 17, 50])
@pytest.mark.parametrize("log_rate_hz", [100.0, 3000.0])
def test_whatever_the_delay_and_the_log(delay_periods, log_rate_hz):
    fit = fitted(delay_periods, 3e-3, 8.0, log_rate_hz)
    assert abs(fit.chi2 / fit.dof - 1) < 5 * np.sqrt(2 / fit.dof)
    assert abs(sigmas(fit, delay_periods)) < 4
