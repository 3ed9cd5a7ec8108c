"""Exported tables: read back, and the C header compiled and compared with the series at a thousand
points."""

import csv
import io
import json
import shutil
import subprocess

import numpy as np
import pytest
from forced_runs import Truth, programme

from hrg_cli.errors import HrgError
from hrg_cli.exporting import export
from hrg_cli.fourier import evaluate
from hrg_cli.stages.calibrate import calibrate


@pytest.fixture(scope="module")
def tables():
    waves = programme(Truth(3), (-10, 15, 40), (-0.5, 0.5), duration=15, noise=1e-4)
    return calibrate(waves, harmonics=2, scale_factor_harmonics=2, bootstrap=0)


def test_csv_holds_the_tables(tables):
    rows = list(csv.DictReader(io.StringIO(export(tables, ".csv").text)))
    assert len(rows) == tables.drift_rad_s.size
    assert [float(r["drift_rad_s"]) for r in rows] == list(tables.drift_rad_s.ravel())
    assert [float(r["scale_factor_std"]) for r in rows] == list(tables.scale_factor_std.ravel())


def test_json_is_enough_to_apply_the_tables(tables):
    tree = json.loads(export(tables, ".json").text)
    x, theta = np.linspace(-10, 40, 11), np.linspace(0, 3, 11)
    found = evaluate(
        x,
        theta,
        np.array(tree["temperature_degc"]),
        np.array(tree["drift_harmonics"]),
        tree["mode_number"],
        tree["interpolation"],
    )
    assert found == pytest.approx(tables.values_at(x, theta)[0])
    assert tree["correction"] == tables.correction and tree["node_range"] == [-10.0, 40.0]


@pytest.mark.parametrize("bits", [0, 16, 32])
def test_header_compiles_and_agrees_within_its_stated_errors(tables, bits, tmp_path):
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler (cc) is installed")
    exported = export(tables, ".h", fixed_point_bits=bits)
    (tmp_path / "hrg_calibration.h").write_text(exported.text)
    (tmp_path / "try.c").write_text(
        '#include <stdio.h>\n#include "hrg_calibration.h"\nint main(void) { double x, a;\nwhile'
        ' (scanf("%lf %lf", &x, &a) == 2) printf("%.17g %.17g %.17g %d\\n", hrg_drift_rad_s(x, a),'
        " hrg_scale_factor(x, a), hrg_rate_rad_s(x, a, -0.1, 0.0), hrg_in_range(x));\nreturn 0; }\n"
    )
    subprocess.run(
        [compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "-o", "try", "try.c", "-lm"],
        cwd=tmp_path,
        check=True,
    )
    draw = np.random.default_rng(0)
    x, theta = draw.uniform(-10, 40, 1000), draw.uniform(-7, 7, 1000)
    given = "\n".join(f"{a:.17g} {b:.17g}" for a, b in zip(x, theta)) + "\n99 0.3\n"
    out = subprocess.run(
        ["./try"], cwd=tmp_path, input=given, capture_output=True, text=True, check=True
    ).stdout
    table = np.array([[float(v) for v in line.split()] for line in out.splitlines()])
    drift, scale = tables.values_at(x, theta)
    for column, truth, name in ((0, drift, "drift_rad_s"), (1, scale, "scale_factor")):
        stated = exported.errors[f"{name}_interpolation"] + exported.errors[f"{name}_rounding"]
        worst = np.abs(table[:-1, column] - truth).max()
        assert 0.05 * stated < worst <= 1.05 * stated
    assert table[:-1, 2] == pytest.approx((drift + 0.2) / scale, abs=1e-4)
    assert (table[:-1, 3] == 1).all() and table[-1, 3] == 0
    assert exported.errors["drift_rad_s_interpolation"] < np.median(tables.drift_rad_s_std)


def test_one_node_and_refusals(tables):
    single = calibrate(
        programme(Truth(3), (20,), (-0.5, 0.5), duration=15),
        harmonics=1,
        scale_factor_harmonics=0,
        bootstrap=0,
    )
    assert "#define HRG_NODES 1" in export(single, ".h", fixed_point_bits=16).text
    with pytest.raises(HrgError, match=r"\.xml"):
        export(tables, ".xml")
    with pytest.raises(HrgError, match=r"0 .float., 16 or 32"):
        export(tables, ".h", fixed_point_bits=8)
    with pytest.raises(HrgError, match="refused"):
        export(tables.replace(status="refused"), ".csv")
