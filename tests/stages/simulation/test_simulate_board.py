"""Loops on a board, feature by feature: the samples of `simulate` against the equation of motion and
a board that are written anew (`oracles.board`), no envelope and no engine."""

import numpy as np
import pytest
from oracles import board as oracle

from hrg_cli.records import collect
from hrg_cli.stages.simulate import simulate

pytest.importorskip("numba")
DEVICE = {
    "frequency_hz": 400.0, "damping_rate_1_s": 1.0, "damping_split_1_s": 0.06, "damping_axis_rad": 0.3,
    "frequency_split_rad_s": 0.5, "stiffness_axis_rad": 0.8, "scale_factor": 0.55,
}  # fmt: skip
LOOPS = {
    "mode": "forced", "amplitude": 1.05, "amplitude_gain_1_s": 8.0, "amplitude_integral_1_s2": 12.0,
    "quadrature_loop": "finite", "quadrature_gain_1_s": 15.0, "quadrature_integral_1_s2": 10.0,
}  # fmt: skip
BOARD = {"periods_per_update": 4, "phase_loop_hz": 3.0, "delay_periods": 5.0}
SPRING = {"quadrature_loop": "spring"}
RATE, ANGLE, PHASE, SAMPLE_RATE_HZ, SECONDS = 3.0, 0.2, 0.4, 6400.0, 0.8


def run_both(control, board, readout=None):
    """Displacements (2, n) of both, the commands (2, n) that both log, and the recording."""
    control, board, readout = LOOPS | control, BOARD | board, readout or {}
    config = {
        "device": DEVICE, "control": control, "electronics": board, "readout": readout,
        "start": {"wave_angle_rad": ANGLE, "phase_rad": PHASE}, "environment": {"rate_rad_s": RATE},
        "recording": {
            "sample_rate_hz": SAMPLE_RATE_HZ, "duration_s": SECONDS, "log_rate_hz": SAMPLE_RATE_HZ,
        },
    }  # fmt: skip
    record = collect(simulate(config, seed=1))
    converter = (readout.get("adc_bits", 0), readout.get("full_scale", 0.0))
    gyro = oracle.Gyro(DEVICE, control, board, RATE, converter)
    z, commands = oracle.samples(gyro, SAMPLE_RATE_HZ, SECONDS, ANGLE, PHASE)
    return np.stack([record.c, record.s]), z, commands, record


@pytest.mark.parametrize(
    ("control", "board", "within"),
    [
        ({}, {}, 2e-4),
        ({}, {"filter_hz": 4.0}, 2e-4),
        (SPRING, {}, 2e-4),
        (SPRING, {"spring_signal": "phase_product"}, 2e-4),
        ({}, {"drive_periods": 4}, 2e-3),
        ({"amplitude_gain_1_s": 40.0}, {"delay_periods": 0.0, "drive_full_scale": 1.1}, 2e-2),
        ({}, {"drive_bits": 7, "drive_full_scale": 4.0}, 2e-3),
    ],
    ids=["late", "filtered", "spring", "product", "multiplexed", "saturated", "coarse drive"],
)
def test_samples_are_those_of_the_equation_of_motion(control, board, within):
    """Of the amplitude, carrier phase included: a hundredth of a turn in it would be 6e-2. What a
    converter clips within a step neither of them resolves."""
    seen, z, _, _ = run_both(control, board)
    assert np.abs(seen - z).max() < within


def test_a_coarse_converter_reads_the_same_codes():
    """Nine bits: half a step is 3e-3, and the loops act on what was rounded."""
    bits, full = 9, 1.6
    seen, z, commands, record = run_both({}, {}, {"adc_bits": bits, "full_scale": full})
    step = 2 * full / 2**bits
    assert np.abs(seen * step - z).max() < 0.5 * step + 2e-4
    fine = run_both({}, {})[2]
    moved = np.abs(commands - fine)[:, -2000:].max()
    assert moved > 1e-4  # the rounding is in the commands
    found = np.stack([record.drive_main, record.drive_quadrature])
    assert np.sqrt(np.mean((found - commands)[:, -2000:] ** 2)) < 0.5 * moved
