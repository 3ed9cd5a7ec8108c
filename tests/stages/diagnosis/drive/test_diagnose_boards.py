"""Diagnosis of gyros on a board: loops that read noisy windows, hold and delay what they command, and
follow the phase by a loop of 1 Hz.

Their frame stands beside the wave's, late and noisy, and what they command answers the very noise that
the residual is made of: nothing of that is a fault of the gyro. What is hidden beside it must be found.
"""

import json

import pytest
from board_gyros import configure_runs, draw_gyro

from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import simulate

pytest.importorskip("numba")
RATES = (-3.0, 3.0)


def diagnosed(seed, log_rate_hz, effects=None, noise=None):
    """What is said of two runs of a drawn gyro, its board and its Brownian noise; with a noise (of a
    sample) of that and nothing else."""
    device, board = draw_gyro([11, seed])
    if noise is not None:
        board = {k: v for k, v in board.items() if not k.startswith("drive_")}
    config = configure_runs(device, board, RATES, f"B{seed}", log_rate_hz=log_rate_hz)
    config["effects"] = effects or {}
    if noise is not None:
        config["readout"] = {"noise": noise}
        del config["noise"]
    recordings = [collect(simulate(config, run=f"R{r:g}", seed=seed)) for r in RATES]
    waves = [collect(estimate(collect(demodulate(r, periods_per_window=50)))) for r in recordings]
    record = diagnose(waves)
    return record, json.loads(record.report)


@pytest.mark.parametrize(
    ("seed", "log_rate_hz"),
    [(1, 100.0), (0, 100.0)]
    + [
        pytest.param(seed, hz, marks=pytest.mark.slow)
        for seed, hz in ((0, 21e3), *((seed, hz) for seed in range(2, 14) for hz in (21e3, 1e2)))
    ],
)
def test_a_board_is_no_fault(seed, log_rate_hz):
    """Clean on 0 of 6 before, by false mismatches of 5 to 8 σ: the fit was made blind to a lateness of
    the log along its noise too, which laid a lateness on what the commands do in 4θ. Board 12 had a
    gain by amplitude of 6 σ, as long as that followed a motion without the walk that loops take back;
    board 0 one of 5.8 σ by following that walk, which the residual itself had made likely."""
    record, said = diagnosed(seed, log_rate_hz)
    failed = [check["name"] for check in said["checks"] if not check["passed"]]
    assert record.verdict == "adequate" and record.status == "valid", (failed, said["effects"])


@pytest.mark.parametrize(
    ("name", "parameter", "size"),
    [
        ("gain_mismatch", "gain", 0.003),
        pytest.param("electrode_nonorthogonality", "angle_rad", 0.002, marks=pytest.mark.slow),
        pytest.param("phase_mismatch", "phase_rad", 0.003, marks=pytest.mark.slow),
        pytest.param("pickoff_nonlinearity", "cubic", 0.003, marks=pytest.mark.slow),
    ],
)
def test_what_hides_in_a_board_is_found(name, parameter, size):
    record, said = diagnosed(1, 21000.0, {name: {parameter: size}})
    assert record.verdict == "explained" and [e["name"] for e in said["effects"]] == [name]
    value = said["effects"][0]["parameters"][parameter]
    assert abs(value["value"] - size) < 4.5 * value["std"]


@pytest.mark.parametrize(
    ("seed", "log_rate_hz"),
    [(3, 100.0)]
    + [
        pytest.param(seed, hz, marks=pytest.mark.slow)
        for seed, hz in ((1, 21e3), (0, 21e3), (2, 21e3), (4, 1e2), (5, 1e2))
    ],
)
def test_how_a_board_finds_its_wave_is_no_fault(seed, log_rate_hz):
    """A hundredth of the noise: its phase loop has just begun, and leaves a frequency split's phase
    behind. "Unexplained" before, by steps of 75 to 260 at the start of either run."""
    record, said = diagnosed(seed, log_rate_hz, noise=3e-5)
    failed = [check["name"] for check in said["checks"] if not check["passed"]]
    assert record.verdict == "adequate" and record.status == "valid", (failed, said["effects"])


@pytest.mark.slow
@pytest.mark.parametrize("gain", [1e-4, 3e-4])
def test_what_hides_in_a_quiet_board_is_found(gain):
    """The larger one left χ² 238 and was "partly explained": once it was taken in, what the frame had
    done was gross enough to be laid on no frame."""
    record, said = diagnosed(3, 100.0, {"gain_mismatch": {"gain": gain}}, noise=3e-5)
    assert record.verdict == "explained" and [e["name"] for e in said["effects"]] == [
        "gain_mismatch"
    ]
    value = said["effects"][0]["parameters"]["gain"]
    assert abs(value["value"] - gain) < 4.5 * value["std"] and value["std"] < 3e-6


@pytest.mark.parametrize(
    "seed", [4, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 3, 6))]
)
def test_a_fault_of_the_drive_outlives_a_hold_out_that_knows_no_board(seed):
    """What a board may have answered is said of all runs together, and halves of them are fitted
    without it: that a mismatch of 46 to 89 σ predicts worse there says nothing of it. Three driven
    runs and three free ones; "unexplained" on these four gyros."""
    device, board = draw_gyro([11, seed])
    board = {k: v for k, v in board.items() if not k.startswith("drive_")}
    config = configure_runs(
        device, board, (-3.0, 3.0, 1.2), f"B{seed}", duration_s=5.0, log_rate_hz=100.0
    )
    config["readout"] = {"noise": 3e-4}
    config["effects"] = {"drive_gain_mismatch": {"gain": 4e-3}}
    del config["noise"]
    beside = {k: v for k, v in config.items() if k not in ("control", "electronics")}
    beside["run"] = [
        {
            "run_id": f"u{k}",
            "start": {"quadrature": 0.03, "wave_angle_rad": angle, "phase_rad": 1.0 + k},
            "environment": {"rate_rad_s": rate},
        }
        for k, (rate, angle) in enumerate(((2.0, 0.3), (-2.0, 0.9), (0.0, 1.4)))
    ]
    recordings = [
        collect(simulate(table, run=run["run_id"], seed=seed))
        for table in (config, beside)
        for run in table["run"]
    ]
    waves = [collect(estimate(collect(demodulate(r, periods_per_window=50)))) for r in recordings]
    record = diagnose(waves)
    (one,) = json.loads(record.report)["effects"]
    assert record.verdict == "explained" and one["name"] == "drive_gain_mismatch"
    gain = one["parameters"]["gain"]
    assert abs(gain["value"] - 4e-3) < 4.5 * gain["std"]
