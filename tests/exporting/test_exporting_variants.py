"""Every variant's measured part in the exports: the C header compiled and held against
`compensate`, CSV and JSON against the formulas."""

import csv
import io
import json
import shutil
import subprocess

import numpy as np
import pytest
from elliptic_runs import elliptic_run, tempered
from forced_runs import wave_of

from hrg_cli.exporting import export
from hrg_cli.fitting.tables.increments import build_path
from hrg_cli.records import collect
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.calibration.interpolation import compute_measured_drift, interpolate_measured
from hrg_cli.stages.compensate import compensate

VARIANTS = ("table", "parametric", "quadrature", "phase", "combined", "physical")


@pytest.fixture(scope="module")
def runs():
    plan = [
        (T, rate, start, ratio)
        for T in (0.0, 40.0)
        for rate, start, ratio in (
            (0.4, 0.1, 0.05),
            (-0.4, 0.9, -0.05),
            (0.4, 0.7, -0.04),
            (-0.4, 0.3, 0.06),
        )
    ]
    return [
        elliptic_run(tempered(T), T, rate, start, ratio, f"r{i}", seed=i)
        for i, (T, rate, start, ratio) in enumerate(plan)
    ]


@pytest.fixture(scope="module")
def calibrations(runs):
    from elliptic_runs import resonator_of

    resonators = [resonator_of(tempered(T), T) for T in (0.0, 40.0)]
    return {
        m: (
            calibrate(runs, resonators if m == "physical" else None, model=m, bootstrap=0).replace(
                status="valid"
            )
        )
        for m in VARIANTS
    }


def compiled(calibration, rows, tmp_path):
    """(drift with its measured part, measured part, rate) (n, 3) that the compiled header gives for
    rows (n, 5) of abscissa, angle, its speed, a_B/a_A and frequency; and what it states of itself."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler (cc) is installed")
    exported = export(calibration, ".h")
    (tmp_path / "hrg_calibration.h").write_text(exported.text)
    (tmp_path / "try.c").write_text(
        '#include <stdio.h>\n#include "hrg_calibration.h"\nint main(void) { double x, a, v, r,'
        ' f;\nwhile (scanf("%lf %lf %lf %lf %lf", &x, &a, &v, &r, &f) == 5) { double d ='
        ' hrg_measured_drift_rad_s(x, a, r, f);\nprintf("%.17g %.17g %.17g\\n", hrg_drift_rad_s(x,'
        " a) + d, d, hrg_rate_rad_s(x, a, v, d)); }\nreturn 0; }\n"
    )
    subprocess.run(
        [compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "-o", "try", "try.c", "-lm"],
        cwd=tmp_path,
        check=True,
    )
    given = "\n".join(" ".join(f"{v:.17g}" for v in row) for row in rows) + "\n"
    out = subprocess.run(
        ["./try"], cwd=tmp_path, input=given, capture_output=True, text=True, check=True
    ).stdout
    return np.array(
        [[float(v) for v in line.split()] for line in out.splitlines()]
    ), exported.errors


@pytest.mark.parametrize("model", VARIANTS)
def test_header_of_each_variant_computes_what_compensate_does(calibrations, model, tmp_path):
    calibration = calibrations[model]
    # a path of a thousand increments that go nowhere: the same points that the header is asked for
    draw = np.random.default_rng(1)
    count = 1001
    theta = 0.3 + np.cumsum(draw.normal(size=count)) * 1e-9 + np.linspace(0, 1e-6, count)
    wave = wave_of(
        np.arange(count) * 1.0,
        theta,
        draw.uniform(0, 40, count),
        np.zeros(count),
        1e-9,
        "p",
        ratio=draw.uniform(-0.1, 0.1, count),
    )
    path = build_path(
        wave.replace(frequency_hz=5000.0 + draw.normal(size=count) * 0.01), harmonics=0, per_block=1
    )
    x, angle = (
        path.average_neighbours(path.temperature_degc),
        path.average_neighbours(path.angle_rad),
    )
    ratio, frequency, speed = (
        path.average_neighbours(path.ratio),
        path.average_neighbours(path.frequency_hz),
        path.turn / path.interval_s / 2,
    )
    rows = np.column_stack([x, angle, speed, ratio, frequency])
    found, errors = compiled(calibration, rows, tmp_path)
    measured = compute_measured_drift(calibration, path)
    drift, scale = calibration.values_at(x, angle)
    stated = errors["drift_rad_s_interpolation"] + errors["drift_rad_s_rounding"]
    assert len(found) == 1000
    assert (model in ("table", "parametric")) == (np.abs(measured).max() == 0)
    assert np.abs(found[:, 1] - measured).max() <= 1e-9 * max(np.abs(measured).max(), 1e-12)
    assert (
        np.abs(found[:, 0] - drift - measured).max()
        <= 1.05 * stated + 1e-9 * np.abs(measured).max()
    )
    rate = (drift + measured - path.turn / path.interval_s) / scale
    of_scale = errors["scale_factor_interpolation"] + errors["scale_factor_rounding"]
    assert (
        np.abs(found[:, 2] - rate).max()
        <= 1.1 * (stated + of_scale * np.abs(rate).max()) / 0.5 + 1e-12
    )


@pytest.mark.parametrize("model", VARIANTS)
def test_a_thousand_increments_of_a_turning_wave_are_compensated_alike(
    calibrations, model, tmp_path
):
    """Firmware that feeds the header with middles and differences of the windows against `hrg
    compensate` of the same run; an increment turns 4θ by 0.016 rad, of which the mean of D keeps
    all but 1e-5."""
    count, dt = 1001, 0.02
    t = np.arange(count) * dt
    calibration, wave = (
        calibrations[model],
        wave_of(
            t,
            0.4 + 0.2 * t + 0.01 * np.sin(3 * t),
            20 + 15 * np.sin(0.7 * t),
            None,
            1e-9,
            "p",
            ratio=0.05 * np.sin(1.3 * t),
        ).replace(frequency_hz=5000.0 + 0.01 * np.cos(2 * t)),
    )

    def middle(values):
        return (values[1:] + values[:-1]) / 2

    columns = (
        wave.temperature_degc,
        wave.wave_angle_rad,
        wave.quadrature_amplitude,
        wave.frequency_hz,
    )
    x, angle, ratio, frequency = map(middle, columns)
    speed = np.diff(wave.wave_angle_rad) / dt
    found, errors = compiled(
        calibration, np.column_stack([x, angle, speed, ratio, frequency]), tmp_path
    )
    told = np.asarray(collect(compensate(wave, calibration)).rate_estimate_rad_s)
    assert len(found) == len(told) == 1000
    of_drift, of_scale = (
        sum(errors[f"{name}_{kind}"] for kind in ("interpolation", "rounding"))
        for name in ("drift_rad_s", "scale_factor")
    )
    # courses bend between windows: h²/8 of their second derivative
    bent = 1e-4 * np.abs(found[:, 0]).max()
    allowed = (of_drift + of_scale * np.abs(told).max() + bent) / 0.5
    assert np.abs(found[:, 2] - told).max() < allowed + 1e-12


@pytest.mark.parametrize("model", VARIANTS)
def test_csv_and_json_carry_the_measured_part(calibrations, model):
    calibration = calibrations[model]
    rows = list(csv.DictReader(io.StringIO(export(calibration, ".csv").text)))
    tree = json.loads(export(calibration, ".json").text)
    part = interpolate_measured(calibration, np.asarray(calibration.node))
    if part is None:
        assert (
            model in ("table", "parametric")
            and tree["measured"] is None
            and "mean_frequency_hz" not in rows[0]
        )
        return
    first = [row for row in rows if float(row["wave_angle_rad"]) == 0.0]
    assert tree["measured"]["exact"] and (
        "1 - r^2" in tree["measured"]["formula"] or "1 + r^2" in tree["measured"]["formula"]
    )
    assert [float(r["damping_sin_rad_s"]) for r in first] == pytest.approx(list(part.damping[:, 1]))
    if model == "phase":
        assert [float(r["mean_frequency_hz"]) for r in first] == pytest.approx(
            list(part.mean_frequency_hz)
        )
        assert tree["measured"]["mean_frequency_hz"] == pytest.approx(list(part.mean_frequency_hz))
    else:
        assert [float(r["quadrature_cos_rad_s"]) for r in first] == pytest.approx(
            list(part.quadrature[:, 0])
        )
        assert np.array(tree["measured"]["coefficients"]) == pytest.approx(part.quadrature)
