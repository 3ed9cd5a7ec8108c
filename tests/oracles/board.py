"""A gyro whose loops run on a board, by the equation of motion itself: no envelope, no averaging.

    z'' + 2(N − KΩJ)z' + W z = Re[2jω F e^{jωt}],   z = (C, S)

is carried from one reading to the next by the exponential of its state matrix, the force by Gauss's
rule. The board is what a programmer would write of it: it keeps a window's readings, solves for the
two envelopes, and puts a command on its way.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

Array = np.ndarray
J = np.array([[0.0, 1.0], [-1.0, 0.0]])
GAUSS = 0.5 + np.array([-1, 0, 1]) * np.sqrt(0.15)
WEIGHT = np.array([5, 8, 5]) / 18


def mirror(angle: float) -> Array:
    return np.array([[np.cos(angle), np.sin(angle)], [np.sin(angle), -np.cos(angle)]])


def converter(value: Array, bits: int, full_scale: float) -> Array:
    """Nearest of 2^bits levels between ± full scale; 0: none of it."""
    if bits:
        step = 2 * full_scale / 2**bits
        value = np.round(value / step) * step
    return np.clip(value, -full_scale, full_scale) if full_scale else value


@dataclass
class Gyro:
    """Resonator, loops and board by the names of a simulation file."""

    device: dict
    control: dict
    board: dict
    rate: float
    adc: tuple[int, float] = (0, 0.0)

    def __post_init__(self) -> None:
        d = self.device
        self.omega = 2 * np.pi * d["frequency_hz"]
        split, half = d["frequency_split_rad_s"], 2 * d["stiffness_axis_rad"]
        axis = np.array([np.cos(half), np.sin(half)])
        along = np.outer(axis, axis)
        self.W = (self.omega + split) ** 2 * along + (self.omega - split) ** 2 * (np.eye(2) - along)
        self.N = d["damping_rate_1_s"] * np.eye(2) + d["damping_split_1_s"] * mirror(
            4 * d["damping_axis_rad"]
        )
        self.turning = d["scale_factor"] * self.rate

    def state_matrix(self, spring: float, axis: Array) -> Array:
        """d(z, z')/dt, beside an electric spring midway between the wave's axes, 2ωσR(2mθ + 90°)."""
        twice = 2 * np.arctan2(axis[1], axis[0])
        W = self.W + 2 * self.omega * spring * mirror(twice + np.pi / 2)
        A = np.zeros((4, 4))
        A[:2, 2:] = np.eye(2)
        A[2:, :2] = -W
        A[2:, 2:] = -2 * (self.N - self.turning * J)
        return A


class Board:
    """What the programmer knows: readings, an oscillator, and the commands not yet due."""

    def __init__(self, gyro: Gyro, h: float, angle: float, phase: float) -> None:
        b, c = gyro.board, gyro.control
        a_period = 1 / (gyro.device["frequency_hz"] * h)
        self.gyro, self.h = gyro, h
        self.reading = round(b["periods_per_update"] * a_period)
        self.driving = round(b.get("drive_periods", 0) * a_period)
        self.delay = round(b.get("delay_periods", 0) * a_period)
        self.every = (self.reading + self.driving) * h
        self.phase, self.frequency = phase, gyro.omega
        self.axis = np.array([np.cos(angle), np.sin(angle)])
        self.acting = {
            "main": gyro.device["damping_rate_1_s"] * c.get("amplitude", 1.0),
            "quadrature": 0.0,
            "spring": 0.0,
            "axis": self.axis,
        }
        self.waiting: deque = deque()
        self.rows: list = []
        self.idle, self.seen = 0, None
        self.integral = dict.fromkeys(("amplitude", "quadrature", "phase"), 0.0)

    def force(self, ahead: Array) -> Array:
        """Im F e^{jωt} at both electrodes (2, n), the oscillator `ahead` seconds on (n,)."""
        a, full = self.acting, self.gyro.board.get("drive_full_scale", 0.0)
        turn = np.exp(1j * (self.phase + self.frequency * ahead))
        e_A, e_B = a["axis"], np.array([-a["axis"][1], a["axis"][0]])
        F = np.outer(e_A, turn) * a["main"] - 1j * np.outer(e_B, turn) * a["quadrature"]
        if self.driving:
            F = F * (self.idle > 0) * (self.reading + self.driving) / self.driving
        return converter(F.imag, self.gyro.board.get("drive_bits", 0), full)

    def look(self, step: int, z: Array) -> None:
        """One reading, at `step`; the commands that are due act from here on."""
        while self.waiting and self.waiting[0][0] <= step:
            _, self.acting = self.waiting.popleft()
            self.frequency = self.gyro.omega + self.acting["pull"]
        if self.idle:
            self.idle -= 1
            return
        self.rows.append((np.cos(self.phase), -np.sin(self.phase), *converter(z, *self.gyro.adc)))
        if len(self.rows) == self.reading:
            rows, self.rows = np.array(self.rows), []
            found = np.linalg.lstsq(rows[:, :2], rows[:, 2:], rcond=None)[0]
            self.idle = self.driving
            self.act_on(found[0] + 1j * found[1], step)

    def act_on(self, fresh: Array, step: int) -> None:
        """The loops, on the envelopes (2,) against the oscillator."""
        b, c = self.gyro.board, self.gyro.control
        if self.seen is None or "filter_hz" not in b:
            self.seen = fresh
        else:
            keep = np.exp(-2 * np.pi * b["filter_hz"] * self.every)
            self.seen = keep * self.seen + (1 - keep) * fresh
        # axes of the ellipse that both channels draw: those of its mean square
        _, vectors = np.linalg.eigh(np.real(np.outer(self.seen, self.seen.conj())))
        e_A = vectors[:, 1] * (1 if vectors[:, 1] @ self.axis > 0 else -1)
        e_B = np.array([-e_A[1], e_A[0]])
        along = e_A @ self.seen
        a_A, a_B = abs(along), np.real(1j * (e_B @ self.seen) * np.exp(-1j * np.angle(along)))
        self.axis = e_A

        error = c.get("amplitude", 1.0) - a_A
        main = (
            self.gyro.device["damping_rate_1_s"] * c.get("amplitude", 1.0)
            + c["amplitude_gain_1_s"] * error
            + self.integral["amplitude"]
        )
        self.integral["amplitude"] += c["amplitude_integral_1_s2"] * error * self.every
        natural = 2 * np.pi * b["phase_loop_hz"]
        self.integral["phase"] += natural**2 * np.angle(along) * self.every
        command = {
            "main": main,
            "quadrature": 0.0,
            "spring": 0.0,
            "axis": e_A,
            "pull": np.sqrt(2) * natural * np.angle(along) + self.integral["phase"],
        }
        gain, kind = c.get("quadrature_gain_1_s", 0.0), c["quadrature_loop"]
        signal = a_B
        if kind == "spring":
            by_product = b.get("spring_signal") == "phase_product"
            signal = a_A * a_B / c.get("amplitude", 1.0) ** 2 if by_product else a_B / a_A
        held = gain * signal + self.integral["quadrature"]
        if kind == "finite":
            command["quadrature"] = -held
        elif kind == "spring":
            command["spring"] = held
        self.integral["quadrature"] += c.get("quadrature_integral_1_s2", 0.0) * signal * self.every
        self.waiting.append((step + 1 + self.delay, command))


def samples(
    gyro: Gyro, sample_rate_hz: float, seconds: float, angle: float, phase: float
) -> tuple[Array, Array]:
    """The displacements (2, n) of a wave that starts as a line of unit amplitude at θ = angle, and the
    commands along the wave and against its quadrature (2, n) that act."""
    h = 1 / sample_rate_hz
    board = Board(gyro, h, 2 * angle, phase)
    u = np.exp(1j * phase) * np.array([np.cos(2 * angle), np.sin(2 * angle)])
    slow = gyro.turning * J @ u
    state = np.concatenate([u.real, np.real(1j * gyro.omega * u + slow)])
    out, commands = np.empty((2, 2, round(seconds * sample_rate_hz)))
    made, steps = None, None
    for i in range(out.shape[1]):
        out[:, i] = state[:2]
        board.look(i, state[:2])
        now = board.acting
        commands[:, i] = now["main"], now["quadrature"]
        if made is None or (made is not now and now["spring"]):
            A = gyro.state_matrix(now["spring"], now["axis"])
            steps = [expm(A * h * part) for part in (1.0, *(1 - GAUSS))]
        made = now
        push = -2 * gyro.omega * board.force(GAUSS * h)
        state = steps[0] @ state
        for k in range(3):
            state = state + h * WEIGHT[k] * (steps[1 + k][:, 2:] @ push[:, k])
        board.phase += board.frequency * h
    return out, commands
