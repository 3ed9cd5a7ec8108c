"""The exports against a motion that no drift formula made: the envelopes' equations integrated, and
the angle of the ellipse that they draw."""

import csv
import io
import json
import shutil
import subprocess

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from hrg_cli import Calibration
from hrg_cli.exporting import export

NU, SPLIT_NU, AXIS_NU, SPLIT, AXIS, K = 0.02, 4e-3, 0.4, 6e-3, 0.15, 0.55
MEAN_HZ = 5000.0
SECONDS, STEP = 1e-2, 5e-4
"""A stretch of motion about the instant that is looked at, and the step of the difference."""


def slope(rate):
    """u' = L u of the envelopes (C₀, S₀), from the mode equations with e^{+jωt}: losses ν and νδμ
    about their axis, springs ±δω about theirs, and the turn KΩ."""

    def mirror(axis):
        return np.array(
            [[np.cos(4 * axis), np.sin(4 * axis)], [np.sin(4 * axis), -np.cos(4 * axis)]]
        )

    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    L = -NU * np.eye(2) - SPLIT_NU * mirror(AXIS_NU) + 1j * SPLIT * mirror(AXIS) + K * rate * turn
    return lambda t, u: L @ u


def shape(u):
    """Wave angle and phase of the ellipse, from the Stokes vector of (C, S)."""
    c, s = u
    angle = np.unwrap(np.arctan2(2 * np.real(c * np.conj(s)), np.abs(c) ** 2 - np.abs(s) ** 2)) / 4
    along = np.cos(2 * angle) * c + np.sin(2 * angle) * s
    return angle, np.unwrap(np.angle(along))


def motion(angle, ratio, rate):
    """(dθ/dt, dφ/dt) of a wave at an angle with r = a_B/a_A, by central differences of the
    integrated motion."""
    a, b = 2 * angle, 1j * ratio
    start = np.array([np.cos(a) + b * np.sin(a), np.sin(a) - b * np.cos(a)])
    ahead, behind = (
        solve_ivp(
            slope(rate),
            (0, sign * SECONDS),
            start,
            "DOP853",
            sign * STEP * np.arange(3),
            rtol=1e-13,
            atol=1e-15,
        ).y
        for sign in (1, -1)
    )
    steps = np.stack(shape(np.concatenate([behind[:, :0:-1], ahead], axis=1)))
    return steps @ np.array([1, -8, 0, 8, -1]) / (12 * STEP)


def known(kind):
    """The gyro's own coefficients as a calibration that has no errors."""
    drift = SPLIT_NU * np.array([[0.0, -np.sin(4 * AXIS_NU), np.cos(4 * AXIS_NU)]])
    quadrature = -2 * SPLIT * np.array([[np.cos(4 * AXIS), np.sin(4 * AXIS)]])
    part = {"kind": kind, "exact": True} | (
        {"mean_frequency_hz": [MEAN_HZ]}
        if kind == "phase"
        else {"coefficients": quadrature.tolist()}
    )
    theta = np.arange(64) * np.pi / 2 / 64
    basis = np.stack([np.ones(64), np.cos(4 * theta), np.sin(4 * theta)])
    small = np.full((1, 64), 1e-9)
    return Calibration(
        temperature_degc=np.array([20.0]), node_min=15.0, node_max=25.0, rate_min_rad_s=-2.0, rate_max_rad_s=2.0,
        wave_angle_rad=theta, drift_rad_s=drift @ basis, drift_rad_s_std=small, scale_factor=0 * small + K, scale_factor_std=small,
        drift_harmonics=drift, drift_harmonics_std=np.full((1, 3), 1e-9), scale_factor_harmonics=np.array([[K]]),
        scale_factor_harmonics_std=np.array([[1e-9]]), covariance=np.eye(4) * 1e-18, details=json.dumps({"measured": part}),
    )  # fmt: skip


def elliptic_waves():
    """A hundred waves of their own, of r up to 0.3: angle, its speed, r, frequency, and the rate."""
    draw = np.random.default_rng(3)
    angle, ratio, rate = draw.uniform(0, 3, 100), draw.uniform(-0.3, 0.3, 100), draw.uniform(-1, 1, 100)  # fmt: skip
    speed, phase = np.array([motion(*at) for at in zip(angle, ratio, rate)]).T
    return angle, speed, ratio, MEAN_HZ + phase / (2 * np.pi), rate


@pytest.mark.parametrize("kind", ["quadrature", "phase"])
def test_the_header_gives_the_rate_of_an_elliptic_wave_that_was_integrated(kind, tmp_path):
    """Up to r = 0.3, where a formula of first order in r misses by a tenth of the drift."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler (cc) is installed")
    (tmp_path / "hrg_calibration.h").write_text(export(known(kind), ".h", precision=0.1).text)
    (tmp_path / "try.c").write_text(
        '#include <stdio.h>\n#include "hrg_calibration.h"\nint main(void) { double a, v, r, f;\n'
        'while (scanf("%lf %lf %lf %lf", &a, &v, &r, &f) == 4)\n'
        'printf("%.17g\\n", hrg_rate_rad_s(20.0, a, v, hrg_measured_drift_rad_s(20.0, a, r, f)));\n'
        "return 0; }\n"
    )
    subprocess.run([compiler, "-std=c99", "-O1", "-o", "try", "try.c", "-lm"], cwd=tmp_path, check=True)  # fmt: skip
    angle, speed, ratio, frequency, rate = elliptic_waves()
    given = "\n".join(" ".join(f"{v:.17g}" for v in row) for row in zip(angle, speed, ratio, frequency))  # fmt: skip
    done = subprocess.run(["./try"], cwd=tmp_path, input=given, capture_output=True, text=True, check=True)  # fmt: skip
    error = np.array([float(line) for line in done.stdout.split()]) - rate
    first_order = 2 * np.abs(ratio).max() ** 2 * SPLIT_NU / K
    assert len(error) == 100 and np.abs(error).max() < 1e-3 * first_order


def read_csv(text):
    """What a user's program takes of the CSV: D and K over the angle, and the measured part's
    numbers."""
    rows = list(csv.DictReader(io.StringIO(text)))
    numbers = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    at = np.append(numbers["wave_angle_rad"], np.pi / 2)

    def course(name):
        return CubicSpline(at, np.append(numbers[name], numbers[name][0]), bc_type="periodic")

    part = {name: values[0] for name, values in numbers.items()}
    measured = [part.get(f"quadrature_{n}_rad_s") for n in ("cos", "sin")]
    damping = [part[f"damping_{n}_rad_s"] for n in ("cos", "sin")]
    return course("drift_rad_s"), course("scale_factor"), damping, measured, part.get("mean_frequency_hz")  # fmt: skip


def read_json(text):
    """The same of the JSON, from its harmonics."""
    tree = json.loads(text)
    drift, (scale,) = tree["drift_harmonics"][0], tree["scale_factor_harmonics"][0]

    def course(theta):
        return drift[0] + drift[1] * np.cos(4 * theta) + drift[2] * np.sin(4 * theta)

    part = tree["measured"]
    assert tree["mode_number"] == 2 and part["exact"]
    coefficients = part.get("coefficients", [None])[0]
    frequency = part.get("mean_frequency_hz", [None])[0]
    return course, lambda theta: scale, drift[1:3], coefficients, frequency


@pytest.mark.parametrize("kind", ["quadrature", "phase"])
@pytest.mark.parametrize(("ending", "reader"), [(".csv", read_csv), (".json", read_json)])
def test_csv_and_json_give_the_rate_of_an_elliptic_wave_that_was_integrated(kind, ending, reader):
    """By the formulas that the JSON prints, (11) and (12) exact in r, in a reader of its own."""
    drift, scale, damping, quadrature, mean_hz = reader(export(known(kind), ending).text)
    angle, speed, r, frequency, rate = elliptic_waves()
    cos, sin = np.cos(4 * angle), np.sin(4 * angle)
    loss = damping[0] * cos + damping[1] * sin
    if kind == "quadrature":
        measured = (r * (quadrature[0] * cos + quadrature[1] * sin) + 2 * r**2 * loss) / (1 - r**2)
    else:
        turned = 2 * np.pi * (frequency - mean_hz)
        measured = -(2 * r * turned + 2 * r**2 * loss) / (1 + r**2)
    found = (drift(angle) + measured - 2 * speed) / scale(angle)
    first_order = 2 * np.abs(r).max() ** 2 * SPLIT_NU / K
    assert np.abs(found - rate).max() < 1e-3 * first_order
