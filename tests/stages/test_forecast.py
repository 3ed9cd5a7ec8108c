"""The forecast of a resonator's drift against the envelopes integrated directly, against draws of
its covariance, and as a command."""

import csv
import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.fitting.envelopes.resonator_spread import (
    compute_vector_covariance,
    find_deviation,
    from_vector,
    make_mechanics,
    make_vector,
    spread_points,
)
from hrg_cli.physics import drift, ellipse, resonator
from hrg_cli.physics.resonator import PARAMETERS
from hrg_cli.records import Resonator
from hrg_cli.reporting.quantities import round_with_std
from hrg_cli.stages.forecast import forecast, summarise


def made(nu=0.02, split=0.004, spread=0.02, mode_number=2, **change):
    values = dict(
        frequency_hz=5000.0, damping_rate_1_s=nu, damping_split_1_s=0.01 * nu, damping_axis_rad=0.35
    )
    values |= dict(frequency_split_rad_s=split, stiffness_axis_rad=0.9, scale_factor=0.55) | change
    value = np.array([values[name] for name, _ in PARAMETERS])
    std = np.abs(value) * np.array([1e-9, 1e-3, spread, spread, spread, spread, 1e-6])
    units = np.array([unit for _, unit in PARAMETERS])
    names = np.array([name for name, _ in PARAMETERS])
    return Resonator(
        name=names,
        value=value,
        std=std,
        units=units,
        covariance=np.diag(std**2),
        gyro_id="A",
        mode_number=mode_number,
    )


def envelopes_of(g, drive, gain, rate, start, ratio, times):
    """(θ, r) of the driven envelopes u' = L u + force by scipy, the force computed from u alone."""
    m = g.mode_number
    L = resonator.build_generator(g, rate, second_order=0.0)

    def slope(_, u):
        s0, s1, s2, s3 = ellipse.compute_stokes(u)
        a_A = np.sqrt((s0 + np.hypot(s1, s2)) / 2)
        a_B = s3 / (2 * a_A)
        half = np.arctan2(s2, s1) / 2
        e_A, e_B = np.array([np.cos(half), np.sin(half)]), np.array([-np.sin(half), np.cos(half)])
        turn = (e_A @ u) / a_A
        free = L @ u
        falls = np.real(np.conj(turn) * (e_A @ free))  # what the amplitude loop must give back
        if drive == "free":
            return free
        if drive == "parametric":
            return free - falls / a_A * turn**2 * np.conj(u)
        return free - falls * turn * e_A + 1j * turn * gain * a_B * e_B

    u0 = ellipse.compute_envelopes(1.0, ratio, start, 0.3, m)
    u = solve_ivp(slope, (0, times[-1]), u0, t_eval=times, rtol=1e-10, atol=1e-13).y.T
    a_A, a_B, angle, phase = ellipse.find_wave(u, m)
    angle, _ = ellipse.unwrap(angle, phase, m)
    return angle + np.round((start - angle[0]) * m / np.pi) * np.pi / m, a_B / a_A


@pytest.mark.parametrize(
    ("drive", "gain", "rate", "mode_number"),
    [
        ("free", 0.0, 0.0, 2), ("free", 0.0, 0.01, 1), ("force", 0.0, 0.0, 2),
        ("force", 0.5, 0.03, 2), ("force", 8.0, 0.03, 2), ("parametric", 0.0, 0.02, 2),
        ("force", 8.0, 0.5, 2), ("force", 50.0, 0.3, 1), ("parametric", 0.0, 0.4, 2),
    ],
)  # fmt: skip
def test_the_way_of_the_wave_is_that_of_the_driven_envelopes(drive, gain, rate, mode_number):
    record = made(mode_number=mode_number)
    found = forecast(
        record,
        drive=drive,
        wave_angle_rad=0.7,
        rate_rad_s=rate,
        duration_s=120.0,
        quadrature_gain_1_s=gain,
    )
    t, g = found.table["time_s"], make_mechanics(record)
    r0 = 0.0 if drive == "free" else float(drift.find_settled_quadrature(g, 0.7, drive, gain))
    dense = np.union1d(np.linspace(0.0, 120.0, 1201), t)
    angle, _ = envelopes_of(g, drive, gain, rate, 0.7, r0, dense)
    angle = angle[np.searchsorted(dense, t)]
    moved_by = np.abs(angle - 0.7).max()
    np.testing.assert_allclose(found.table["wave_angle_rad"], angle, atol=2e-5 * moved_by + 1e-9)
    error = -(mode_number * (angle - 0.7) / 0.55 + rate * t)
    np.testing.assert_allclose(found.table["error_rad"], error, atol=4e-5 * moved_by + 1e-8)


@pytest.mark.parametrize("drive", ["force", "parametric"])
def test_the_map_is_the_drift_of_a_settled_wave_whatever_the_split(drive):
    """r settles where the envelopes do, far beyond δω ≪ ν, where seed A's sum errs."""
    record = made(split=0.012)
    g = make_mechanics(record)
    angles = np.array([0.2, 0.63, 1.1])
    slope = drift.make_motion(g, 0.0, drive)
    held = drift.integrate_by_adams(
        lambda t, r: slope(t, np.stack([angles, r]))[1], np.zeros(3), 0.5, 3000
    )[-1]
    assert held == pytest.approx(drift.find_settled_quadrature(g, angles, drive), rel=1e-6)
    found = forecast(record, drive=drive)
    assert found.status == ("suspect" if drive == "force" else "valid")


def test_deviations_are_those_of_draws_also_where_the_split_is_lost_in_noise():
    rng = np.random.default_rng(3)
    for split, spread in ((0.004, 0.05), (1e-5, 20.0)):
        record = made(split=split, spread=spread, damping_axis_rad=1e-4, stiffness_axis_rad=1e-3)
        g = make_mechanics(record)
        x, covariance = make_vector(g), compute_vector_covariance(record)
        angle = np.linspace(0.1, 1.4, 7)
        std = find_deviation(
            drift.compute_quasi_static_drift(from_vector(spread_points(x, covariance), g), angle)
        )
        draws = from_vector(rng.multivariate_normal(x, covariance, 20000), g)
        assert std == pytest.approx(
            np.std(drift.compute_quasi_static_drift(draws, angle), axis=0), rel=0.1
        )


def test_forecast_figures_are_the_papers():
    """D_max = νδμ + δω²/ν; the 8θ part is half with a parametric drive (M3p) and falls with a
    quadrature loop (C6)."""
    record = made()
    for drive, gain, decay in (
        ("force", 0.0, 0.02),
        ("parametric", 0.0, 0.04),
        ("force", 0.18, 0.2),
        ("free", 0.0, 0.02),
    ):
        f = forecast(record, drive=drive, quadrature_gain_1_s=gain, duration_s=20.0).figures
        assert f["sin_8_theta_part_rad_s"]["value"] == pytest.approx(0.004**2 / decay)
        assert f["drift_bound_rad_s"]["value"] == pytest.approx(0.0002 + 0.004**2 / decay)
        assert f["drift_largest_rad_s"]["value"] <= f["drift_bound_rad_s"]["value"] * 1.1
    f = forecast(record, rate_rad_s=0.05, duration_s=20.0).figures
    turning = 2 * 0.55 * 0.05
    assert f["mean_drift_while_turning_rad_s"]["value"] == pytest.approx(
        -turning * 0.004**2 / (0.02**2 + turning**2)
    )
    run_down = forecast(record, drive="free", rate_rad_s=0.05, duration_s=20.0).figures
    assert "mean_drift_while_turning_rad_s" not in run_down, "r settles at no mean in a run-down"


@pytest.mark.parametrize("axis", [0.1, 0.35, 0.712])
@pytest.mark.parametrize("drive", ["force", "parametric", "free"])
def test_without_a_frequency_split_the_largest_drift_is_the_damping_split(axis, drive):
    """Wherever its axis lies between the map's angles."""
    record = made(split=1e-9, damping_axis_rad=axis)
    largest = forecast(record, drive=drive, duration_s=20.0).figures["drift_largest_rad_s"]
    assert largest["value"] == pytest.approx(2e-4, rel=1e-5)
    assert largest["std"] == pytest.approx(0.02 * 2e-4, rel=0.02)


def test_a_course_ends_by_itself_and_not_with_those_of_other_starts():
    """A run-down along the stiffness axis keeps its wave; those from between the axes become
    circles: their columns end, the course that was asked for does not, and it is scipy's."""
    resonator_ = made(nu=0.02, split=0.6, spread=1e-4, stiffness_axis_rad=0.05)
    found = forecast(resonator_, drive="free", wave_angle_rad=0.05, duration_s=20.0)
    table = found.table
    assert table["time_s"][-1] == 20.0 and np.isfinite(table["error_rad"]).all()
    lost = np.isnan(table["error_worst_rad"])
    assert lost[-1] and not lost[0] and np.all(np.diff(lost.astype(int)) >= 0)
    assert np.array_equal(lost, np.isnan(table["error_rms_rad"]))
    assert any("another start angle" in s for s in found.status_reasons)
    assert not any("the forecast ends" in s for s in found.status_reasons)
    assert {c.name: c.passed for c in found.checks}["integration"]
    ended = forecast(resonator_, drive="free", wave_angle_rad=0.05 + np.pi / 8, duration_s=20.0)
    assert any("the forecast ends" in s for s in ended.status_reasons)
    g = make_mechanics(resonator_)
    L = resonator.build_generator(g, 0.0, second_order=0.0)
    start = np.array([np.cos(2 * 0.05), np.sin(2 * 0.05)], complex)
    u = solve_ivp(
        lambda _, y: L @ y, (0, 20), start, t_eval=table["time_s"], rtol=1e-9, atol=1e-12
    ).y.T
    angle = ellipse.find_wave(u, 2)[2]
    assert table["wave_angle_rad"] == pytest.approx(angle, abs=1e-4)


def test_the_trim_leaves_a_round_resonator():
    """The spring's −2ωs(I + R(2mα)) added to W leaves equal frequencies, lower by s."""
    record = made(split=0.3, spread=1e-3)
    trim = forecast(record, drive="free", duration_s=2.0).trim
    g = make_mechanics(record)
    soft = (
        2
        * g.omega_rad_s
        * trim.size_rad_s
        * (np.eye(2) + resonator.make_reflection(4 * trim.axis_rad))
    )
    roots = np.sqrt(np.linalg.eigvalsh(g.build_stiffness_matrix() - soft)) / (2 * np.pi)
    assert np.ptp(roots) * 2 * np.pi < 1e-4 * 0.3
    assert roots.mean() == pytest.approx(5000 + trim.frequency_shift_hz, abs=1e-5)
    trimmed = forecast(record, trim=True)
    assert trimmed.status == "valid"
    assert trimmed.figures["sin_8_theta_part_rad_s"]["value"] < 1e-12
    with pytest.raises(HrgError, match="identify the frequency split better"):
        forecast(made(split=0.3), trim=True)
    coarse = forecast(record, trim=True, trim_step_rad_s=0.01)
    assert 0 < coarse.trim.left_rad_s <= 0.01 / np.sqrt(2)


def test_refusals_name_what_to_do():
    with pytest.raises(HrgError, match=r"becomes a circle.*add --quadrature-gain-1-s"):
        forecast(made(split=0.1))
    with pytest.raises(HrgError, match="--scale-factor"):
        forecast(made(scale_factor=0.0))
    with pytest.raises(HrgError, match="no positive damping_rate"):
        forecast(made(nu=0.0))
    gone = forecast(made(split=0.004), drive="free", duration_s=3600.0)
    assert gone.status == "suspect"
    assert gone.table["time_s"][-1] < 300
    assert any("faded" in reason for reason in gone.status_reasons)


@pytest.mark.parametrize("rate", [1e6, 1e19, 1e300])
def test_a_forecast_of_too_many_steps_is_refused_whatever_their_number(rate):
    with pytest.raises(HrgError, match=r"steps of .*shorten it"):
        forecast(made(), rate_rad_s=rate, duration_s=3600.0)


def test_what_a_forecast_does_not_know_is_an_empty_cell(tmp_path, hrg):
    """The tangent law is one of a gyro at rest."""
    store.write(tmp_path / "r.h5", made())
    for rate, known in ((0.0, True), (0.1, False)):
        output = tmp_path / f"{rate}.csv"
        told = hrg("forecast", tmp_path / "r.h5", "-o", output, "--rate-rad-s", rate)
        assert told.status == 0, told
        rows = list(csv.DictReader(output.open()))
        assert all(bool(row["tangent_law_rad"]) == known for row in rows)
        assert "nan" not in output.read_text()


def test_forecast_command(tmp_path, hrg):
    path = tmp_path / "resonator.h5"
    store.write(path, made())
    done = hrg("forecast", path, "--duration-s", "100", "-o", tmp_path / "f.csv")
    assert done.status == 0, done.err
    rows = list(csv.DictReader((tmp_path / "f.csv").open()))
    answer = json.loads(hrg("forecast", path, "--duration-s", "100", "--json").out)
    assert answer["kind"] == "forecast" and answer["status"] == "valid"
    assert [float(r["time_s"]) for r in rows] == [r["time_s"] for r in answer["table"]]
    assert float(rows[-1]["error_worst_rad"]) == pytest.approx(
        answer["table"][-1]["error_worst_rad"], rel=1e-6
    )
    assert hrg("forecast", path, "-o", tmp_path / "f.svg", "-q").status == 0
    assert "<svg" in (tmp_path / "f.svg").read_text()
    assert hrg("forecast", path, "-o", tmp_path / "f.h5").status == 2
    shown = hrg("forecast", path, "--duration-s", "100").out
    f = answer["figures"]["drift_bound_rad_s"]
    hour = np.pi / 180 / 3600
    assert round_with_std(f["value"] / hour, f["std"] / hour) in shown
    assert "e-0" not in shown and "rad_s" not in shown
    assert hrg("forecast", path, "--drive", "free").status == 0
    assert hrg("forecast", path, "--drive", "free", "--strict").status == 3


def test_summary_is_plain():
    json.dumps(summarise(forecast(made(), duration_s=20.0)), allow_nan=False)


def test_a_wave_that_passes_a_circle_between_two_rows_has_ended():
    """Quick beating makes the wave nearly a circle for a tenth of a second at a time, which the
    table's rows miss: held against the exact envelopes at every moment, start by start."""
    record = made(nu=0.02, split=0.45, spread=1e-6, stiffness_axis_rad=0.05, damping_axis_rad=0.05)
    L = resonator.build_generator(make_mechanics(record), 0.0, second_order=0.0)
    moments = np.linspace(0, 20, 40001)
    passed = 0
    for off in (0.3, 0.35, 0.36, 0.37, 0.372, 0.375):
        angle = 0.05 + off
        start = np.array([np.cos(2 * angle), np.sin(2 * angle)], complex)
        a, b, _, _ = ellipse.find_wave(resonator.exponentiate(L, moments) @ start, 2)
        circle = np.abs(b / a) > 0.9
        found = forecast(record, drive="free", wave_angle_rad=angle, duration_s=20.0)
        if circle.any():
            passed += 1
            assert found.table["time_s"][-1] <= moments[np.argmax(circle)]
            assert any("the forecast ends" in s for s in found.status_reasons)
        else:
            assert found.table["time_s"][-1] == 20.0
    assert passed == 3
