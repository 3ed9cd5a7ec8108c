"""A wave under a force at resonance: what demodulation shows of it is not what moves. Held against
the equation of motion itself, stepped by matrix exponentials with the loops closed on samples."""

import numpy as np
import pytest
from scipy.linalg import expm

from hrg_cli.fitting.causes import slow_equation, slow_prediction
from hrg_cli.fitting.causes.fit_point import Point
from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
from hrg_cli.fitting.envelopes import coordinates
from hrg_cli.physics.resonator import Mechanics

FREQUENCY_HZ, A_PERIOD, LENGTH_S, PERIODS = 300.0, 48, 0.8, 6
OMEGA = 2 * np.pi * FREQUENCY_HZ
DAMPING, LOSS, SPLIT, RATE, FACTOR = 2.0, (0.3, -0.2), (3.0, 2.0), 8.0, 0.5
J = np.array([[0.0, 1.0], [-1.0, 0.0]])


def mirror(c, s):
    return np.array([[c, s], [s, -c]])


N = DAMPING * np.eye(2) + mirror(*LOSS)
ROOT = OMEGA * np.eye(2) + mirror(*SPLIT)
SPRING, TURNING = ROOT @ ROOT, N - FACTOR * RATE * J


def free():
    """L of the free wave: (L + jω)² + 2Γ(L + jω) + W = 0."""
    L = -TURNING.astype(complex)
    for _ in range(60):
        rest = L @ L + 2 * TURNING @ L + 2j * OMEGA * TURNING + SPRING - OMEGA**2 * np.eye(2)
        L = -rest / (2j * OMEGA)
    return L


def axes(u, near):
    """(e_A, e_B, e^{jφ}, a_A, a_B) of an ellipse."""
    angle = np.arctan2(2 * np.real(u[0] * np.conj(u[1])), abs(u[0]) ** 2 - abs(u[1]) ** 2) / 2
    e_A = np.array([np.cos(angle), np.sin(angle)])
    e_A = e_A if e_A @ near > 0 else -e_A
    main = e_A @ u
    b = np.imag(u[0] * np.conj(u[1])) / abs(main)
    return e_A, np.array([-e_A[1], e_A[0]]), main / abs(main), abs(main), b


def driven(gain_1_s):
    """Displacement (n, 2), commands (n, 2), envelopes (n, 2) that the loops see, and the step."""
    h = 1 / FREQUENCY_HZ / A_PERIOD
    A = np.zeros((8, 8))  # state, velocity, and the force's envelope turning at ω
    A[:2, 2:4], A[2:4, :2], A[2:4, 2:4] = np.eye(2), -SPRING, -2 * TURNING
    A[2:4, 4:6], A[4:6, 6:], A[6:, 4:6] = np.eye(2), -OMEGA * np.eye(2), OMEGA * np.eye(2)
    step, L = expm(A * h), free()
    u = np.array([np.cos(0.3) + 0.05j * np.sin(0.3), np.sin(0.3) - 0.05j * np.cos(0.3)])
    x, velocity, force, near = u.real, ((1j * OMEGA * np.eye(2) + L) @ u).real, np.zeros(2), u.real
    n = int(LENGTH_S / h)
    shown, commands, seen = np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2), complex)
    for k in range(n):
        t = k * h
        turn = np.exp(1j * OMEGA * t)
        # a constant f moves x by Re[jf/2ω e^{jωt}], ẋ by Re[f/2 e^{jωt}] beside the free wave v
        rest = np.concatenate(
            [
                x - np.real(1j * force / (2 * OMEGA) * turn),
                velocity - np.real(force / 2 * turn),
            ]
        )
        M = np.zeros((4, 4))
        for column, e in enumerate(np.concatenate([np.eye(2), 1j * np.eye(2)])):
            M[:, column] = np.concatenate(
                [np.real(e * turn), np.real((1j * OMEGA * e + L @ e) * turn)]
            )
        v = np.linalg.solve(M, rest)
        v = v[:2] + 1j * v[2:]
        shown[k], seen[k] = x, v + 1j * force / (2 * OMEGA)
        middle = seen[k] + h / 2 * (L @ seen[k] + force)
        e_A, e_B, phase, a, b = axes(middle, near)
        near = e_A
        commands[k] = (
            DAMPING + gain_1_s * (1 - a) + 0.3 * np.sin(12 * t),
            -gain_1_s * b + 0.2 * np.cos(9 * t),
        )
        force = phase * (commands[k, 0] * e_A - 1j * commands[k, 1] * e_B)
        state = np.concatenate(
            [x, velocity, np.real(2j * OMEGA * force * turn), np.imag(2j * OMEGA * force * turn)]
        )
        x, velocity = np.split((step @ state)[:4], 2)
    return shown, commands, seen, h


def demodulated(x, h):
    """Envelopes (m, 2) at the middles of windows, by least squares with a cubic envelope."""
    size = PERIODS * A_PERIOD
    times, out = [], []
    for k in range(len(x) // size):
        t = np.arange(k * size, (k + 1) * size) * h
        s, turn = (t - t.mean()) / (size * h / 2), np.exp(1j * OMEGA * t)
        columns = [part for p in range(4) for part in (s**p * turn.real, -(s**p) * turn.imag)]
        found = np.linalg.lstsq(np.stack(columns, 1), x[k * size : (k + 1) * size], rcond=None)[0]
        times.append(t.mean())
        out.append(found[0] + 1j * found[1])
    return np.array(times), np.array(out)


@pytest.mark.parametrize("gain_1_s", [5.0, 50.0])
def test_the_model_shows_what_demodulation_shows_under_a_force(gain_1_s):
    x, commands, _, h = driven(gain_1_s)
    t, measured = demodulated(x, h)
    held = (np.arange(len(x)) + 0.5) * h  # the command of a step stands for its middle
    impulse = np.concatenate([np.zeros((1, 2)), np.cumsum(commands, axis=0) * h])
    at = np.stack([np.interp(t, held, c) for c in commands.T], -1)
    area = np.stack([np.interp(t, np.arange(len(x) + 1) * h, c) for c in impulse.T], -1)
    one = np.ones((1, len(t)))
    mechanics = Mechanics(
        FREQUENCY_HZ,
        DAMPING,
        float(np.hypot(*LOSS)),
        float(np.arctan2(LOSS[1], LOSS[0])) / 4,
        float(np.hypot(*SPLIT)),
        float(np.arctan2(SPLIT[1], SPLIT[0])) / 4,
        FACTOR,
        2,
    )
    phase = np.unwrap(np.angle(measured[:, 0] ** 2 + measured[:, 1] ** 2)) / 2
    series = MeasuredRuns(
        names=("a",), time_s=t[None], envelope=measured[None], weight=one, rate_rad_s=RATE * one, temperature_degc=25 * one,
        temperature_rate_degc_s=0 * one, branch=one, table_angle_rad=RATE * t[None], phase_rad=phase[None],
        main_drive=at[None, :, 0], quadrature_drive=at[None, :, 1], main_impulse=area[None, :, 0], quadrature_impulse=area[None, :, 1],
        forced=one, held_amplitude=np.nan * one, held_slope=0 * one, turn_rad_s=np.zeros(1),
        reference_frequency_hz=FREQUENCY_HZ, mode_number=2,
    )  # fmt: skip

    def missed(second_order):
        p = coordinates.from_mechanics(mechanics, second_order)
        start = measured[:1]
        for _ in range(3):  # the start whose shown envelope is the measured one
            at_start = slow_prediction.predict(series, Point(p, start, np.zeros(1))).seen[:, 0]
            start = start + measured[:1] - at_start
        point = Point(p, start, np.zeros(1))
        predicted = slow_prediction.predict(series, point)
        return predicted.seen[0] - measured, predicted.seen[0] - predicted.motion[0]

    off, lead = missed(1.0)
    size = DAMPING / (2 * OMEGA)  # of jf/2ω, f = ν a
    np.testing.assert_allclose(np.abs(lead).max(axis=1).mean(), size, rtol=0.5)
    # what is left is of third order: (gain/ω)² of the wave
    assert np.abs(off).max() < 0.06 * size
    assert np.abs(missed(0.0)[0]).max() > size


def test_the_drive_shows_at_once_and_moves_nothing_twice():
    """With its second order the model of a sudden force jumps by jf/2ω where it sets in."""
    split = np.array([0.0, 0, 0, *SPLIT, FACTOR, 1.0])
    felt = slow_equation.compute_second_order_force(split, FREQUENCY_HZ)
    np.testing.assert_allclose(felt, -mirror(*SPLIT) / OMEGA)
    assert slow_equation.compute_lead(FREQUENCY_HZ) == pytest.approx(1j / (2 * OMEGA))
