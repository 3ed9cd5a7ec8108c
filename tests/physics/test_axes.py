"""Models (1)–(7) of seed A describe one motion: fast in three frames, slow in fixed and moving
axes, complex and polar."""

import numpy as np
import pytest
from oracles import axes
from scipy.integrate import solve_ivp

from hrg_cli.physics import ellipse, resonator
from hrg_cli.physics.resonator import Mechanics

GYRO = Mechanics(200.0, 0.6, 0.1, 0.35, 0.9, 1.1, 0.55)
RATE = 1.3


def integrate(f, start, seconds, points=40, rtol=1e-11):
    times = np.linspace(0, seconds, points)
    return times, solve_ivp(
        f, (0, seconds), start, t_eval=times, method="DOP853", rtol=rtol, atol=1e-13
    ).y


@pytest.mark.parametrize("mode_number", [1, 2, 3])
def test_fast_models_agree_in_resonance_instrument_and_turned_axes(mode_number):
    gyro = Mechanics(200.0, 0.6, 0.1, 0.35, 0.9, 1.1, 0.55, mode_number)
    rng = np.random.default_rng(1)
    start = rng.normal(size=4) * [1, 1, gyro.omega_rad_s, gyro.omega_rad_s]
    rate, slope = (lambda t: 2.0 + 3.0 * t), 3.0
    _, instrument = integrate(
        lambda t, z: axes.turned_axes(z, gyro, 0.0, rate(t), slope), start, 0.2
    )
    _, resonance = integrate(
        lambda t, z: axes.resonance_axes(z, gyro, rate(t), slope),
        axes.turn(start, gyro.stiffness_axis_rad, mode_number),
        0.2,
    )
    _, turned = integrate(
        lambda t, z: axes.turned_axes(z, gyro, 0.7, rate(t), slope),
        axes.turn(start, 0.7, mode_number),
        0.2,
    )
    scale = np.abs(instrument).max(axis=1)
    assert np.allclose(
        axes.turn(instrument.T, gyro.stiffness_axis_rad, mode_number).T / scale[:, None],
        resonance / scale[:, None],
        atol=1e-7,
    )
    assert np.allclose(
        axes.turn(instrument.T, 0.7, mode_number).T / scale[:, None],
        turned / scale[:, None],
        atol=1e-7,
    )


def test_fast_instrument_axes_are_the_matrices_of_the_resonator():
    z, v = np.array([0.3, -1.1]), np.array([70.0, 200.0])
    got = axes.turned_axes(np.concatenate([z, v]), GYRO, 0.0, RATE, 0.4)[2:]
    turning = GYRO.scale_factor * resonator.J
    want = (
        -2 * (GYRO.build_damping_matrix() - RATE * turning) @ v
        - (GYRO.build_stiffness_matrix() - 0.4 * turning) @ z
    )
    assert np.allclose(got, want, rtol=1e-12)


def test_slow_models_agree_with_the_generator_and_each_other():
    u0 = ellipse.compute_envelopes(1.0, 0.2, 0.4, 0.3)
    seconds = 1.5
    times, polar = integrate(
        lambda t, s: axes.slow_moving_axes_polar(s, GYRO, RATE), [1.0, 0.2, 0.4, 0.3], seconds
    )
    exact = (
        resonator.exponentiate(resonator.build_generator(GYRO, RATE, second_order=0.0), times) @ u0
    )
    a_A, a_B, angle, phase = polar
    assert np.allclose(ellipse.compute_envelopes(a_A, a_B, angle, phase), exact, atol=1e-8)
    _, fixed = integrate(lambda t, u: axes.slow_turned_axes(u, GYRO, 0.0, RATE), u0, seconds)
    assert np.allclose(fixed.T, exact, atol=1e-9)
    _, turned = integrate(
        lambda t, u: axes.slow_turned_axes(u, GYRO, 0.8, RATE), axes.turn(u0, 0.8), seconds
    )
    assert np.allclose(turned.T, axes.turn(exact, 0.8), atol=1e-9)
    x0 = axes.turn(u0, 0.8)
    _, amplitude = integrate(
        lambda t, s: axes.slow_turned_axes_polar(s, GYRO, 0.8, RATE),
        [*np.abs(x0), *np.angle(x0)],
        0.5,
    )
    times_half = np.linspace(0, 0.5, 40)
    exact_half = axes.turn(
        resonator.exponentiate(resonator.build_generator(GYRO, RATE, second_order=0.0), times_half)
        @ u0,
        0.8,
    )
    assert np.allclose(amplitude[:2] * np.exp(1j * amplitude[2:]), exact_half.T, atol=1e-8)
    start = np.array([np.exp(0.3j), -0.2j * np.exp(0.3j), 0.4], complex)
    _, moving = integrate(lambda t, s: axes.slow_moving_axes(s, GYRO, RATE), start, seconds)
    assert np.allclose(np.abs(moving[0]), a_A, atol=1e-8)
    assert np.allclose(np.real(1j * moving[1] / moving[0]) * a_A, a_B, atol=1e-8)
    assert np.allclose(moving[2].real, angle, atol=1e-8)


def test_slow_models_follow_the_fast_ones_to_first_order_in_their_smallness():
    gyro = Mechanics(400.0, 0.6, 0.1, 0.35, 0.9, 1.1, 0.55)
    u0 = ellipse.compute_envelopes(1.0, 0.1, 0.4, 0.0)
    L = resonator.build_generator(gyro, RATE)
    velocity = np.real(1j * gyro.omega_rad_s * u0 + L @ u0)
    times, fast = integrate(
        lambda t, z: axes.turned_axes(z, gyro, 0.0, RATE),
        np.concatenate([u0.real, velocity]),
        1.0,
        400,
        1e-12,
    )
    slow = resonator.exponentiate(L, times) @ u0
    assert np.allclose(
        fast[:2].T, np.real(slow * np.exp(1j * gyro.omega_rad_s * times)[:, None]), atol=2e-6
    )
    averaged = (
        resonator.exponentiate(resonator.build_generator(gyro, RATE, second_order=0.0), times) @ u0
    )
    error = np.abs(
        fast[:2].T - np.real(averaged * np.exp(1j * gyro.omega_rad_s * times)[:, None])
    ).max()
    assert 1e-6 < error < 1e-2
