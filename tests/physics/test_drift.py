"""The drift function against direct integration of the envelopes: signs, factors, limits and the
errata."""

import numpy as np
import pytest
from oracles import drift_forms
from scipy.integrate import solve_ivp

from hrg_cli.physics import drift, ellipse, resonator
from hrg_cli.physics.resonator import Mechanics


def gyro(mode_number=2, **change):
    values = dict(
        frequency_hz=5000.0,
        damping_rate_1_s=0.3,
        damping_split_1_s=0.03,
        damping_axis_rad=0.35,
        frequency_split_rad_s=0.2,
        stiffness_axis_rad=0.9,
    )
    return Mechanics(**{**values, **change}, mode_number=mode_number)


def measured_rates(mechanics, angle, ratio, force=lambda u: 0 * u, rate=0.0, h=1e-6):
    """(m dθ/dt, dφ/dt) by differencing the exact envelopes."""
    m = mechanics.mode_number
    u = ellipse.compute_envelopes(1.0, ratio, angle, 0.2, m)
    du = resonator.build_generator(mechanics, rate, second_order=0.0) @ u + force(u)
    before, after = ellipse.find_wave(u - h * du, m), ellipse.find_wave(u + h * du, m)
    return m * (after[2] - before[2]) / (2 * h), (after[3] - before[3]) / (2 * h)


@pytest.mark.parametrize("mode_number", [1, 2])
@pytest.mark.parametrize("ratio", [0.0, 0.05, -0.4, 0.8])
def test_exact_drift_and_phase_rate(ratio, mode_number):
    g = gyro(mode_number)
    for angle in (0.05, 0.3, 0.7):
        swing, phase = measured_rates(g, angle, ratio)
        assert swing == pytest.approx(drift.compute_drift(g, angle, ratio), abs=1e-8)
        assert phase == pytest.approx(drift_forms.phase_rate(g, angle, ratio), abs=1e-8)
        turned, _ = measured_rates(g, angle, ratio, rate=2.0)
        assert turned - swing == pytest.approx(-g.scale_factor * 2.0, abs=1e-7)


def test_control_terms_have_the_sign_of_the_force():
    g, ratio, angle = gyro(), 0.2, 0.3
    a_a, a_b, error_a, error_b = 0.3, 0.15, 0.02, -0.03

    def force(u):
        e_a, e_b = (
            np.array([np.cos(2 * angle), np.sin(2 * angle)]),
            np.array([-np.sin(2 * angle), np.cos(2 * angle)]),
        )
        A, B = np.exp(0.2j), -1j * np.exp(0.2j)
        return e_a * a_a * A * np.exp(-1j * error_a) + e_b * a_b * B * np.exp(-1j * error_b)

    swing, phase = measured_rates(g, angle, ratio, force)
    assert swing == pytest.approx(
        drift.compute_drift(g, angle, ratio, a_b * error_b, a_a * error_a), abs=3e-5
    )
    assert phase == pytest.approx(
        drift_forms.phase_rate(g, angle, ratio, a_b * error_b, a_a * error_a), abs=3e-5
    )


def test_small_quadrature_form_is_right_to_first_order():
    g = gyro()
    errors = [
        abs(float(drift.compute_drift(g, 0.0, r) - drift_forms.drift_small_quadrature(g, 0.0, r)))
        for r in (0.002, 0.001)
    ]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)
    r = 1e-3
    assert drift_forms.drift_from_phase(
        g, 0.3, r, drift_forms.phase_rate(g, 0.3, r)
    ) == pytest.approx(float(drift.compute_drift(g, 0.3, r)), abs=1e-6)


@pytest.mark.parametrize("drive", ["force", "parametric"])
def test_quasi_static_quadrature_by_integration(drive):
    """A wave held at an angle with its amplitude kept, the quadrature left alone: r and D settle to
    (9), half of it with a pump."""
    g = gyro(frequency_split_rad_s=0.01, damping_split_1_s=0.0)
    m, angle = 2, 0.63

    def rates(t, y):
        u = y[:2]
        A = np.cos(m * angle) * u[0] + np.sin(m * angle) * u[1]
        push = g.damping_rate_1_s * (
            u if drive == "parametric" else A * np.array([np.cos(m * angle), np.sin(m * angle)])
        )
        if drive == "parametric":
            push = g.damping_rate_1_s * np.exp(2j * np.angle(A)) * np.conj(u)
        swing = measured(u) / m
        hold = m * swing * np.array([u[1], -u[0]])  # turns the frame with the wave
        return resonator.build_generator(g, 0.0, second_order=0.0) @ u + push + hold

    def measured(u):
        r = ellipse.find_wave(u, m)[1] / ellipse.find_wave(u, m)[0]
        return float(drift.compute_drift(g, angle, r))

    end = solve_ivp(
        rates,
        (0, 60.0),
        ellipse.compute_envelopes(1.0, 0.0, angle, 0.0).astype(complex),
        rtol=1e-9,
        atol=1e-12,
    ).y[:, -1]
    a_A, a_B, _, _ = ellipse.find_wave(end, m)
    assert a_B / a_A == pytest.approx(
        float(drift.compute_quasi_static_quadrature(g, angle, drive)), rel=0.02
    )
    assert measured(end) == pytest.approx(
        float(drift.compute_quasi_static_drift(g, angle, drive)), rel=0.03
    )


def test_tangent_law_is_the_exact_motion_at_rest():
    g = gyro(frequency_split_rad_s=0.0)
    times = np.linspace(0, 60, 30)
    for start in (0.4, 1.0, 1.7, -0.6):
        u = resonator.exponentiate(
            resonator.build_generator(g, 0.0, second_order=0.0), times
        ) @ ellipse.compute_envelopes(1.0, 0.0, start, 0.0)
        angle, _ = ellipse.unwrap(*ellipse.find_wave(u, 2)[2:], 2)
        angle += np.round((start - angle[0]) / (np.pi / 2)) * np.pi / 2
        assert np.allclose(drift.follow_tangent_law(g, start, times), angle, atol=1e-9)


@pytest.mark.parametrize("start", [-7.0, 0.4, 5.0])
def test_the_tangent_law_keeps_whole_turns(start):
    g = gyro(frequency_split_rad_s=0.0)
    assert drift.follow_tangent_law(g, start, 0.0) == pytest.approx(start, abs=1e-12)
    assert abs(drift.follow_tangent_law(g, start, 1.0) - start) < 0.03


def test_adams_is_of_fourth_order_and_meets_the_tangent_law():
    g = gyro(frequency_split_rad_s=0.0)
    errors = []
    for steps in (50, 100):
        angle = drift.integrate_by_adams(
            lambda t, y: float(drift.compute_drift(g, y)) / 2, 0.4, 60 / steps, steps
        )
        errors.append(abs(angle[-1] - drift.follow_tangent_law(g, 0.4, 60.0)))
    assert errors[1] < 1e-6
    assert 10 < errors[0] / errors[1] < 30


@pytest.mark.parametrize("ratio", [0.0, 0.3, -0.6])
def test_free_quadrature_grows_as_the_envelopes_say(ratio):
    """dr/dt of the exact envelopes; where the wave lies along the strong damping r = a_B/a_A
    grows, since a_A falls faster."""
    g, h = gyro(damping_split_1_s=0.1), 1e-6
    for angle in (0.05, g.damping_axis_rad, 0.7):
        u = ellipse.compute_envelopes(1.0, ratio, angle, 0.2, g.mode_number)
        du = resonator.build_generator(g, 0.0, second_order=0.0) @ u
        before, after = (ellipse.find_wave(u + sign * h * du, g.mode_number) for sign in (-1, 1))
        seen = (after[1] / after[0] - before[1] / before[0]) / (2 * h)
        assert seen == pytest.approx(
            drift.compute_quadrature_rate(g, angle, ratio, "free"), abs=1e-8
        )


@pytest.mark.parametrize("drive", ["force", "parametric"])
def test_quadrature_settles_where_its_rate_vanishes(drive):
    g = gyro(damping_split_1_s=0.12)
    for angle in np.linspace(0.0, 1.5, 7):
        settled = drift.find_settled_quadrature(g, angle, drive)
        assert abs(drift.compute_quadrature_rate(g, angle, settled, drive)) < 1e-12


@pytest.mark.parametrize("damping_split", [0.05, -0.05])
def test_the_bound_is_reached_where_both_parts_peak_together(damping_split):
    """sin χ and −sin 2ζ are both ±1 at the angle π/8 for axes at 0 and −π/16: a bound, and no
    larger than it must be."""
    g = gyro(damping_split_1_s=damping_split, damping_axis_rad=0.0)
    angle = np.sign(damping_split) * np.pi / 8
    g = gyro(
        damping_split_1_s=damping_split,
        damping_axis_rad=0.0,
        stiffness_axis_rad=angle - 3 * np.pi / 16,
    )
    everywhere = np.abs(drift.compute_quasi_static_drift(g, np.linspace(0, np.pi / 2, 2001)))
    bound = drift.bound_drift(g)
    assert np.max(everywhere) == pytest.approx(bound, rel=1e-5) and np.max(everywhere) <= bound


def test_lock_in_bound():
    """Below K·Ω = νδμ the wave stands still; above, the mean rate is −√((KΩ)² − (νδμ)²)   (PHYSICS M1b)."""
    g = gyro(frequency_split_rad_s=0.0, damping_split_1_s=0.05)
    locked = drift.integrate_by_adams(
        lambda t, y: (float(drift.compute_drift(g, y)) - 0.04) / 2, 0.4, 0.5, 2000
    )
    assert abs(locked[-1] - locked[-100]) < 1e-9
    free = drift.integrate_by_adams(
        lambda t, y: (float(drift.compute_drift(g, y)) - 0.13) / 2, 0.4, 0.5, 4000
    )
    assert 2 * (free[-1] - free[0]) / 2000 == pytest.approx(-np.sqrt(0.13**2 - 0.05**2), rel=0.01)
