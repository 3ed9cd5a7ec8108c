"""The stiffness axis from the turning points of a free wave's quadrature, against the equations of
seed A (13) integrated by a general integrator, and against the wave in the working mode."""

import json
from dataclasses import replace

import numpy as np
import pytest
from oracles.axes import slow_turned_axes
from scipy.integrate import solve_ivp

from hrg_cli.fitting.envelopes import axis_crossings
from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
from hrg_cli.physics import ellipse
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify
from hrg_cli.stages.simulate import simulate

GYRO = Mechanics(5000.0, 0.3, 0.05, 0.35, 0.06, 0.9, 0.55)


def free(rate, start, ratio=0.0, gyro=GYRO, seconds=6.0, rows=400):
    """A free run without noise by seed A (4) in the instrument axes, integrated by DOP853; rate: a
    function of time."""
    t = np.linspace(0.0, seconds, rows)

    def slope(s, y):
        change = slow_turned_axes(y[:2] + 1j * y[2:], gyro, rate_rad_s=float(rate(s)))
        return np.concatenate([change.real, change.imag])

    first = ellipse.compute_envelopes(1.0, ratio, start, 0.0, gyro.mode_number).astype(complex)
    out = solve_ivp(slope, (0, seconds), np.concatenate([first.real, first.imag]), "DOP853", t, rtol=1e-10, atol=1e-12)  # fmt: skip
    u = (out.y[:2] + 1j * out.y[2:]).T
    return EnvelopeRun("r", t, u, np.full(rows, 1e-9), 0 * t, None, 5000.0, gyro.mode_number, t[1])


def noisy(run, std, random):
    noise = random.standard_normal((len(run), 2)) + 1j * random.standard_normal((len(run), 2))
    return replace(run, envelope=run.envelope + std * noise, std=np.full(len(run), std))


def true(gyro=GYRO):
    alpha = 2 * gyro.mode_number * gyro.stiffness_axis_rad
    return gyro.frequency_split_rad_s * np.array([np.cos(alpha), np.sin(alpha)])


def off_axis(value, gyro=GYRO):
    period = np.pi / gyro.mode_number
    return np.mod(value - gyro.stiffness_axis_rad + period / 2, period) - period / 2


PROGRAMMES = {
    "turning": lambda: [free(lambda t: 3.0, 0.1), free(lambda t: -3.0, 0.6, 0.1)],
    "swinging": lambda: [free(lambda t: 2.0 * np.cos(2 * t), 0.4, 0.2)],
    "fast": lambda: [free(lambda t: 40.0, 0.1, 0.2, rows=2000)],
    "standing": lambda: [free(lambda t: 0.0, angle, 0.05) for angle in (0.1, 0.5, 1.1)],
    "three diameters": lambda: [free(lambda t: 2.0, 0.2, gyro=replace(GYRO, mode_number=3))],
}


@pytest.mark.parametrize("name", PROGRAMMES)
def test_the_split_is_exact_at_any_rate_and_its_errors_hold(name):
    """Without noise what is left is the rows' own length; with it the errors are as large as
    stated, in size and direction."""
    runs = PROGRAMMES[name]()
    gyro = replace(GYRO, mode_number=runs[0].mode_number)
    exact = axis_crossings.fit_crossings(runs).answer[:2]
    assert np.linalg.norm(exact - true(gyro)) < 2e-4 * gyro.frequency_split_rad_s
    random = np.random.default_rng(1)
    squares, chi2 = [], []
    for _ in range(40):
        found = axis_crossings.fit_crossings([noisy(run, 1e-3, random) for run in runs])
        error = found.answer[:2] - true(gyro)
        squares.append(error @ np.linalg.solve(found.covariance[:2, :2], error))
        chi2.append(found.chi2.sum() / found.freedom.sum())
    # 40 draws of χ² with two degrees of freedom: their mean scatters by a sixth
    assert 1.2 < np.mean(squares) < 2.9 and 0.95 < np.mean(chi2) < 1.05


def test_each_side_of_each_run_is_an_answer_of_its_own():
    """Rising and falling passages agree within their errors; the one answer is better than each."""
    random = np.random.default_rng(2)
    runs = [noisy(run, 1e-4, random) for run in PROGRAMMES["turning"]()]
    found = axis_crossings.fit_crossings(runs)
    several = axis_crossings.list_axes(found, runs)
    assert {(a["side"], a["passages"] > 0) for a in several} == {("stiff", True), ("soft", True)}
    assert len(several) == 4
    assert all(abs(off_axis(a["value"])) < 4 * a["std"] for a in several)
    whole = axis_crossings.combine_estimates(found, 2)
    assert abs(off_axis(whole["value"])) < 4 * whole["std"] < 4 * min(a["std"] for a in several)


def test_a_damping_split_is_not_taken_for_a_split_of_frequency():
    """A wide ellipse that stands is moved by the damping split alone: its share is taken off."""
    gyro = replace(GYRO, frequency_split_rad_s=0.0, damping_split_1_s=0.1)
    runs = [free(lambda t: 2.0, 0.1, 0.4, gyro), free(lambda t: -2.0, 0.7, -0.3, gyro)]
    assert np.linalg.norm(axis_crossings.fit_crossings(runs).answer[:2]) < 1e-5


def test_an_angle_with_noise_is_no_surer_than_it_is():
    """A split of many ν: what the angles' noise does to the sine adds up over a passage, several
    times what the rows' own noise does."""
    gyro = replace(GYRO, frequency_split_rad_s=8.0)
    clean = [free(lambda t, r=r: r, a, 0.0, gyro, 4.0, 800) for r, a in ((3.0, 0.1), (-3.0, 0.6))]
    random = np.random.default_rng(3)
    true_p = np.array([0.3, *[0.05 * f(4 * 0.35) for f in (np.cos, np.sin)], *true(gyro), 0.55, 0])
    squares, chi2 = [], []
    for _ in range(40):
        runs = [noisy(run, 1e-3, random) for run in clean]
        found = axis_crossings.fit_crossings(runs, clean, true_p)
        error = found.answer[:2] - true(gyro)
        squares.append(error @ np.linalg.solve(found.covariance[:2, :2], error))
        chi2.append(found.chi2.sum() / found.freedom.sum())
    assert 1.2 < np.mean(squares) < 2.9 and 0.85 < np.mean(chi2) < 1.15


DEVICE = {
    "frequency_hz": 1000.0,
    "time_constant_s": 2.5,
    "damping_split": 0.02,
    "damping_axis_rad": 0.2,
    "frequency_split_hz": 0.02,
    "stiffness_axis_rad": 1.1,
}


def seen(duration, rate, **tables):
    config = {
        "device": DEVICE,
        "readout": {"noise": 2e-4},
        "recording": {"sample_rate_hz": 10_000.0, "duration_s": duration},
        "environment": {"rate_rad_s": rate},
        **tables,
    }
    recording = collect(simulate(config, seed=3))
    return collect(estimate(collect(demodulate(recording, periods_per_window=10.0))))


def test_the_finder_is_a_method_of_identify():
    waves = [seen(4.0, rate, start={"wave_angle_rad": 0.4}) for rate in (0.8, -0.8)]
    record = identify(waves, method="axis-crossings")
    found = record.parameters()
    assert set(found) == {"frequency_hz", "frequency_split_rad_s", "stiffness_axis_rad"}
    assert record.status == "valid", record.status_reasons
    assert abs(found["frequency_split_rad_s"][0] - np.pi * 0.02) < 4 * found["frequency_split_rad_s"][1]  # fmt: skip
    assert abs(found["stiffness_axis_rad"][0] - 1.1) < 4 * found["stiffness_axis_rad"][1] < 0.02
    details = json.loads(record.details)
    assert details["stiffness_axes"] and details["stiffness_axis_of_crossings"]["crossings"] > 0
    best = identify(waves).parameters()["stiffness_axis_rad"]
    assert found["stiffness_axis_rad"][1] < 2 * best[1]


def test_one_axis_of_a_driven_wave_and_its_free_windows():
    """In the working mode the free windows' turning points are weighed with the driven wave's
    changes of sign."""
    control = {
        "mode": "forced",
        "drive": "parametric",
        "quadrature_loop": "off",
        "off_s": [[6.0, 9.0], [14.0, 17.0]],
    }
    wave = seen(20.0, 0.6, control=control)
    details = json.loads(identify([wave], method="working-mode").details)
    whole = details["stiffness_axis_of_crossings"]
    kinds = ["side" in axis for axis in details["stiffness_axes"]]
    assert any(kinds) and not all(kinds)
    assert abs(whole["value"] - 1.1) < 4 * whole["std"] < 0.03
