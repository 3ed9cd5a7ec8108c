"""`hrg calibrate` on a foreign table of dwells, through the command line."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from hrg_cli.cli import app


def hrg(*arguments):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    return result.exit_code, result.output


def calibrated(log, output, *flags):
    code, text = hrg("calibrate", log, "-o", output, "--json", *flags)
    assert code == 0, text
    return json.loads(text)


def written(folder, rate_title="rate_deg_s", factor=180 / np.pi):
    draw = np.random.default_rng(0)
    omega, degc = np.tile([-2.0, -1.0, 0.0, 1.0, 2.0], 80), np.repeat(np.linspace(10, 50, 20), 20)
    out = 1e5 * ((1 - 4e-4 * (degc - 30)) * omega + 1e-3 * (degc - 30)) + 5 * draw.normal(size=400)
    path = folder / "dwells.csv"
    rows = np.stack([omega * factor, out, degc], axis=1)
    np.savetxt(
        path, rows, delimiter=",", header=f"{rate_title},counts,temp_C", comments="", fmt="%.9g"
    )
    return path


def test_a_table_gives_the_scale_factor_and_its_coefficient(tmp_path):
    flags = (
        "--rate-column",
        "rate_deg_s",
        "--output-column",
        "counts",
        "--temperature-column",
        "temp_C",
    )
    report = calibrated(written(tmp_path), tmp_path / "cal.h5", *flags)
    assert report["scale_factor_coefficient_ppm_per_degc"] == pytest.approx(-400, abs=2)
    assert (
        report["drift_rms_rad_s"]["held_out"] == pytest.approx(5e-5, rel=0.2)
        and report["ladder"] == []
    )
    limits = tmp_path / "limits.toml"
    limits.write_text(
        "[calibration]\nscale_factor_coefficient_ppm_per_degc = { minimum = -450, maximum ="
        " -350 }\n"
    )
    assert hrg("check", tmp_path / "cal.h5", "--limits", limits)[0] == 0
    assert "scale factor coefficient" in hrg("info", tmp_path / "cal.h5")[1]
    assert hrg("report", tmp_path / "cal.h5", "-o", tmp_path / "cal.html")[0] == 0


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--output-column", "volts"), "no column 'volts'"),
        (("--rate-column", "rate_deg_s"), "--output-column"),
        (("--output-column", "counts", "--harmonics", "2"), "no wave angle"),
    ],
)
def test_a_wrong_use_of_a_table_is_said(tmp_path, flags, words):
    code, text = hrg("calibrate", written(tmp_path), "-o", tmp_path / "cal.h5", *flags)
    assert code in (1, 2) and words in text and not (tmp_path / "cal.h5").exists()


def measured(*parts):
    folder = os.environ.get("HRG_MEASURED_DATA")
    if not folder or not (Path(folder) / Path(*parts)).exists():
        pytest.skip("the measured data are not here (HRG_MEASURED_DATA)")
    return Path(folder) / Path(*parts)


def test_fibre_optic_gyro_by_command(tmp_path):
    log = measured("fog_rate_temperature", "fog_rate_temp_773pts.csv")
    flags = (
        "--rate-column",
        "rig_rate_rad_s",
        "--output-column",
        "gyro_raw_counts",
        "--temperature-column",
        "gyro_temp_C",
    )
    assert calibrated(log, tmp_path / "fog.h5", *flags)["drift_rms_rad_s"]["held_out"] < 4.2e-4


def test_cold_mems_gyro_by_command(tmp_path):
    log = measured("mems_gyro_cold", "TVCtest3_7_20.csv")
    scale = (
        "--set",
        "temperature_bits=16",
        "--set",
        "temperature_scale=0.00390625",
        "--set",
        "temperature_offset_degc=25",
    )
    report = calibrated(
        log,
        tmp_path / "mems.h5",
        "--output-column",
        "gyrox rad/s",
        "--temperature-column",
        "temp",
        *scale,
    )
    assert report["rejected"] > 0 and any("spikes" in reason for reason in report["status_reasons"])
