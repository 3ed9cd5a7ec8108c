"""`hrg diagnose --model FILE.toml`: the believed values are those at the runs' temperature; a wrong
one is named, a right one is not."""

import json

import pytest
from typer.testing import CliRunner

from hrg_cli.cli import app

GYRO = """
[device]
frequency_hz = 503.0
damping_rate_1_s = 0.4
damping_split_1_s = 0.03
damping_axis_rad = 0.3
frequency_split_rad_s = 0.5
stiffness_axis_rad = 0.8
scale_factor = 0.55

[device.temperature]
reference_degc = 20.0
frequency_per_degc = 85e-6
damping_rate_per_degc = 0.01

[readout]
noise = 3e-4

[environment]
temperature_degc = 31.0

[recording]
sample_rate_hz = 8000.0
duration_s = 2.0

[[run]]
run_id = "a"

[[run]]
run_id = "b"
start.wave_angle_rad = 0.5

[[run]]
run_id = "c"
environment.rate_rad_s = 2.0
start.wave_angle_rad = 0.2
"""


def hrg(*arguments):
    done = CliRunner().invoke(app, [*map(str, arguments), "-q"])
    assert done.exit_code == 0, done.output


@pytest.fixture(scope="module")
def waves(tmp_path_factory):
    """Three runs at 31 °C, simulated, demodulated and estimated."""
    folder = tmp_path_factory.mktemp("runs")
    (folder / "gyro.toml").write_text(GYRO)
    hrg("simulate", folder / "gyro.toml", "-o", folder / "g.h5", "--seed", 4)
    for run in "abc":
        hrg(
            "demodulate",
            folder / f"g-{run}.h5",
            "-o",
            folder / f"{run}.periods.h5",
            "--periods-per-window",
            8,
        )
        hrg("estimate", folder / f"{run}.periods.h5", "-o", folder / f"{run}.wave.h5")
    return [folder / f"{run}.wave.h5" for run in "abc"]


def wrong(waves, model, output):
    """Names of the values that moved, with their σ."""
    done = CliRunner().invoke(
        app, ["diagnose", *map(str, waves), "-o", str(output), "--model", str(model), "--json"]
    )
    assert done.exit_code == 0, done.output
    values = json.loads(done.stdout)["values"]
    assert all("believed" in v for v in values)
    return {v["name"]: v["sigma"] for v in values if v["wrong"]}


def test_the_file_that_made_the_runs_is_not_wrong_at_another_temperature(waves, tmp_path):
    assert wrong(waves, waves[0].parent / "gyro.toml", tmp_path / "d.h5") == {}


def test_a_wrong_value_alone_is_named(waves, tmp_path):
    (tmp_path / "wrong.toml").write_text(
        GYRO.replace("frequency_split_rad_s = 0.5", "frequency_split_rad_s = 0.48")
    )
    found = wrong(waves, tmp_path / "wrong.toml", tmp_path / "d.h5")
    assert set(found) == {"frequency_split_rad_s"} and found["frequency_split_rad_s"] > 5
