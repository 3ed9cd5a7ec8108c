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


TRY = """#include <stdio.h>
#include "hrg_calibration.h"
int main(void) { double x, a;
while (scanf("%lf %lf", &x, &a) == 2) printf("%.17g %.17g %.17g %d %.17g %.17g %.17g %.17g\\n",
  hrg_drift_rad_s(x, a), hrg_scale_factor(x, a), hrg_rate_rad_s(x, a, -0.1, 0.0), hrg_in_range(x),
  HRG_DRIFT_WORST_ERROR, HRG_SCALE_FACTOR_WORST_ERROR, hrg_drift_std_rad_s(x), hrg_scale_factor_std(x));
return 0; }
"""


def compiled(text, points, folder):
    """What the header computes at points (x, theta): drift, K, a rate, whether in range, and the
    worst errors it states."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler (cc) is installed")
    (folder / "hrg_calibration.h").write_text(text)
    (folder / "try.c").write_text(TRY)
    subprocess.run(
        [compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "-o", "try", "try.c", "-lm"],
        cwd=folder,
        check=True,
    )
    given = "\n".join(f"{x:.17g} {theta:.17g}" for x, theta in points)
    out = subprocess.run(
        ["./try"], cwd=folder, input=given, capture_output=True, text=True, check=True
    ).stdout
    return np.array([[float(v) for v in line.split()] for line in out.splitlines()])


@pytest.mark.parametrize("bits", [0, 16, 32])
def test_header_compiles_and_agrees_within_its_stated_errors(tables, bits, tmp_path):
    exported = export(tables, ".h", fixed_point_bits=bits)
    draw = np.random.default_rng(0)
    x, theta = draw.uniform(-10, 40, 1000), draw.uniform(-7, 7, 1000)
    table = compiled(exported.text, [*zip(x, theta), (99.0, 0.3)], tmp_path)
    drift, scale = tables.values_at(x, theta)
    for column, truth, name in ((0, drift, "drift_rad_s"), (1, scale, "scale_factor")):
        stated = exported.errors[f"{name}_interpolation"] + exported.errors[f"{name}_rounding"]
        worst = np.abs(table[:-1, column] - truth).max()
        assert 0.05 * stated < worst <= 1.05 * stated
    assert table[:-1, 2] == pytest.approx((drift + 0.2) / scale, abs=1e-4)
    assert (table[:-1, 3] == 1).all() and table[-1, 3] == 0
    assert exported.errors["drift_rad_s_interpolation"] < np.median(tables.drift_rad_s_std)


@pytest.mark.parametrize("bits", [0, 16])
def test_the_stated_worst_error_holds_where_rounding_is_all_of_it(tables, bits, tmp_path):
    """Tables that are straight over the temperature and the same at every angle: interpolation
    adds nothing, and the macros must hold what the stored numbers round."""
    flat = {}
    for name, first, rise in (("drift", 1e-3, 2e-3), ("scale_factor", 0.55, 0.03)):
        harmonics = np.zeros_like(getattr(tables, f"{name}_harmonics"))
        harmonics[:, 0] = first + rise * (tables.temperature_degc + 10) / 50 * np.pi / 3
        flat[f"{name}_harmonics"] = harmonics
    straight = tables.replace(**flat)
    exported = export(straight, ".h", fixed_point_bits=bits)
    draw = np.random.default_rng(1)
    x, theta = draw.uniform(-10, 40, 2000), draw.uniform(-7, 7, 2000)
    found = compiled(exported.text, list(zip(x, theta)), tmp_path)
    for column, truth, name in zip((0, 1), straight.values_at(x, theta), flat):
        worst, stated = np.abs(found[:, column] - truth).max(), found[0, 4 + column]
        grain = np.spacing(np.abs(truth).max())
        assert exported.errors[f"{name.removesuffix('_harmonics')}_interpolation".replace(
            "drift_", "drift_rad_s_")] < 100 * grain  # fmt: skip
        assert 100 * grain < worst <= 1.05 * stated, (name, worst, stated)


def test_exports_carry_what_is_not_known_between_the_nodes(tables, tmp_path):
    """By hand from the covariance at the nodes and the file's figure midway: with three nodes the
    splines' weights midway are those of the parabola, 3/8, 6/8 and −1/8."""
    doubt = 2e-5
    said = {"interpolation_std": {"drift_rad_s": doubt, "scale_factor": 1e-4}}
    tables = tables.replace(details=json.dumps(json.loads(tables.details) | said))
    angle, j = tables.wave_angle_rad[5], 5
    row = np.array([1, np.cos(4 * angle), np.sin(4 * angle), np.cos(8 * angle), np.sin(8 * angle)])
    width, parabola = 10, (3 / 8, 6 / 8, -1 / 8)
    along = np.concatenate([np.concatenate([w * row, np.zeros(5)]) for w in parabola])
    assert len(tables.covariance) == 3 * width
    midway = np.sqrt(along @ tables.covariance @ along + doubt**2)
    assert midway > 1.2 * np.sqrt(along @ tables.covariance @ along)

    rows = list(csv.DictReader(io.StringIO(export(tables, ".csv").text)))
    assert float(rows[j]["drift_rad_s_std_midway"]) == pytest.approx(midway, rel=1e-9)
    assert np.isfinite(float(rows[-1]["scale_factor_std_midway"]))
    tree = json.loads(export(tables, ".json").text)["interpolation_std"]
    assert tree["drift_rad_s"] == doubt and "4 u (1 - u)" in tree["formula"]

    places = np.array([-10.0, 2.5, 15.0, 27.5, 40.0, 60.0])
    text = export(tables, ".h").text
    found = compiled(text, [(x, 0.0) for x in places], tmp_path)[:, 6]
    own = tables.drift_rad_s_std.max(axis=1)
    assert found[[0, 2, 4, 5]] == pytest.approx(own[[0, 1, 2, 2]], rel=0.02)
    assert midway <= 1.02 * found[1] and found[1] < 2 * midway
    without = json.dumps(json.loads(tables.details) | {"interpolation_std": {}})
    plain = tables.replace(details=without)
    assert "std_midway" not in export(plain, ".csv").text
    assert json.loads(export(plain, ".json").text)["interpolation_std"] is None


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
