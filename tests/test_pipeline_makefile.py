"""configs/pipeline.mk on simulated forced runs: tables, export, compensated runs and report;
refused tables still reach the report."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hrg_cli import store
from hrg_cli.records import Calibration
from hrg_cli.stages.simulate import simulate

ROOT = Path(__file__).parent.parent
HRG = f"{sys.executable} -m hrg_cli.cli"

pytestmark = pytest.mark.slow


def laboratory(folder, rates):
    """A folder as a laboratory keeps it: the pipeline, and its recordings."""
    pytest.importorskip("numba")
    if shutil.which("make") is None:
        pytest.skip("make is not here")
    (folder / "recordings").mkdir()
    shutil.copy(ROOT / "configs" / "pipeline.mk", folder)
    runs = [
        {"run_id": f"T{T:g}R{R:+g}", "environment": {"temperature_degc": T, "rate_rad_s": R}}
        for T in (0.0, 40.0)
        for R in rates
    ]
    config = {
        "device": {"frequency_hz": 5000.0, "time_constant_s": 4.0, "damping_split": 0.03, "damping_axis_rad": 0.5, "scale_factor": 0.55},
        "control": {"mode": "forced", "amplitude": 1.0, "quadrature_loop": "finite", "quadrature_gain_1_s": 10.0},
        "readout": {"noise": 2e-4}, "recording": {"sample_rate_hz": 20000.0, "duration_s": 5.0, "gyro_id": "S"}, "run": runs,
    }  # fmt: skip
    for run in runs:
        store.write(
            folder / "recordings" / f"forced-{run['run_id']}.h5",
            simulate(config, run=run["run_id"]),
        )
    done = subprocess.run(
        ["make", "-f", "pipeline.mk", f"HRG={HRG}"], cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return folder / "build"


def status_of(build):
    with store.open_record(build / "calibration.h5", Calibration) as record:
        return record.status, json.loads(record.details)


def test_forced_runs_become_tables_and_compensated_runs(tmp_path):
    build = laboratory(tmp_path, (3.0, -3.0))
    status, details = status_of(build)
    assert status == "valid" and details["scale_factor"] == pytest.approx(0.55, rel=1e-3)
    assert (
        len(list(build.glob("*.compensated.h5"))) == 4
        and (build / "calibration.csv").stat().st_size > 100
    )
    assert "compensated" in (build / "report.html").read_text()
    again = subprocess.run(
        ["make", "-f", "pipeline.mk", "-q", f"HRG={HRG}"], cwd=tmp_path, capture_output=True
    )
    assert again.returncode == 0, "nothing changed, nothing is made again"


def test_refused_tables_reach_the_report_and_nothing_else(tmp_path):
    build = laboratory(tmp_path, (3.0,))
    assert status_of(build)[0] == "refused" and (build / "report.html").exists()
    assert not list(build.glob("*.compensated.h5")) and not (build / "calibration.csv").exists()
