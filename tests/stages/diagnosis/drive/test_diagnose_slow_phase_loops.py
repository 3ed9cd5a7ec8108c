"""Gyros whose phase loop is slow beside the wave's turn: a split moves the phase, the loop follows it
in part, and the commands' frame stands beside the wave by what it leaves."""

import pytest

from hrg_cli import collect, demodulate, estimate, simulate
from hrg_cli.stages.diagnose import diagnose, summarise

pytest.importorskip("numba")
RATES = (4.0, -3.0, 2.0)


@pytest.mark.parametrize(
    "phase_loop_hz",
    [2.0, *(pytest.param(hz, marks=pytest.mark.slow) for hz in (1.0, 1.4, 2.6, 3.5, 5.0))],
)
def test_whatever_its_bandwidth_a_phase_loop_is_no_fault(phase_loop_hz):
    """Allowed for by loops of every second bandwidth, one between two of them left an "angle that
    changes with wave angle"."""
    table = {
        "device": {
            "frequency_hz": 5000.0,
            "damping_rate_1_s": 0.5,
            "damping_split": 0.02,
            "damping_axis_rad": 0.9,
            "frequency_split_rad_s": 0.1,
            "stiffness_axis_rad": 0.7,
            "scale_factor": 0.554,
        },
        "electronics": {"periods_per_update": 16, "phase_loop_hz": phase_loop_hz},
        "control": {
            "mode": "forced",
            "amplitude_gain_1_s": 12.0,
            "quadrature_loop": "finite",
            "quadrature_gain_1_s": 15.0,
        },
        "readout": {"noise": 3e-4},
        "recording": {"sample_rate_hz": 21000.0, "duration_s": 6.0, "log_rate_hz": 3000.0},
        "run": [{"run_id": f"R{r:g}", "environment": {"rate_rad_s": r}} for r in RATES],
    }
    samples = [collect(simulate(table, run=run["run_id"], seed=1)) for run in table["run"]]
    waves = [collect(estimate(collect(demodulate(r, periods_per_window=20)))) for r in samples]
    out = summarise(diagnose(waves))
    assert (out["verdict"], out["effects"], out["remainder"]) == ("adequate", [], None)
