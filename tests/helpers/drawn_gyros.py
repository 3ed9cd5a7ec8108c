"""Forced gyros drawn at random: what their drift holds, how firm their quadrature loop is, noise,
temperatures, rates.

m·dθ/dt = −K(T,θ)Ω + D(T,θ,r): tables with or without higher harmonics, the exact (8) of the ellipse
where the loop lets a quadrature through. The truth is known at every (T, θ, r).
"""

import numpy as np
from forced_runs import wave_of

M = 2


class Drawn:
    """One gyro: harmonics 0…2 of drift and K over temperature, frequency split, quadrature."""

    KINDS = ("anisotropy", "whole", "faint", "elliptic", "elliptic and whole")

    def __init__(self, seed):
        draw = np.random.default_rng(seed)
        self.kind = self.KINDS[seed % len(self.KINDS)]
        self.noise = 10 ** draw.uniform(-6, -4.5)
        self.temperatures = (0.0, 20.0, 40.0) if draw.random() < 0.7 else (10.0, 40.0)
        self.rates = (-0.5, 0.5) if draw.random() < 0.5 else (-0.5, -0.2, 0.2, 0.5)
        self.drift = draw.normal(size=(2, 5)) * 2e-4 * np.array([1, 0.3])[:, None]
        self.drift[:, 0] = 0
        self.scale = np.zeros((2, 5))
        self.scale[:, 0] = 0.55, 1e-5 * draw.normal()
        self.split, self.axis, self.quadrature = 0.0, 0.0, 0.0
        if "whole" in self.kind:
            self.drift[:, 0] = draw.normal(size=2) * (1e-4, 3e-5)
            self.scale[0, 1:] = draw.normal(size=4) * 3e-4
        elif self.kind == "faint":
            # a harmonic between invisible and plain, in units of what a programme of this noise
            # knows it to
            self.drift[0, 3:] = draw.normal(size=2) * self.noise * 10 ** draw.uniform(-2.5, 0)
            self.drift[1, 3:] = 0
        if "whole" not in self.kind and self.kind != "faint":
            self.drift[:, 3:] = 0
        if "elliptic" in self.kind:
            self.split, self.axis = 10 ** draw.uniform(-3, -2), draw.uniform(0, np.pi / 2)
            self.quadrature = 10 ** draw.uniform(-2.5, -1.2)
        self.draw = draw

    def at(self, table, temperature):
        return table[0] + table[1] * (np.asarray(temperature, float)[..., None] - 20) / 20

    def tables(self, temperature, theta):
        """(D, K) of the tables at (T, θ), without a quadrature."""
        a = 2 * M * np.asarray(theta)
        basis = np.stack(
            [np.ones_like(a), np.cos(a), np.sin(a), np.cos(2 * a), np.sin(2 * a)], axis=-1
        )
        return (self.at(self.drift, temperature) * basis).sum(-1), (
            self.at(self.scale, temperature) * basis
        ).sum(-1)

    def whole_drift(self, temperature, theta, ratio):
        """D(T, θ, r): the damping's anisotropy in an ellipse, (1 + r²)/(1 − r²), and the frequency
        split's part."""
        a = 2 * M * np.asarray(theta)
        d = self.at(self.drift, temperature)
        first = d[..., 1] * np.cos(a) + d[..., 2] * np.sin(a)
        square = np.asarray(ratio) ** 2
        seen = 2 * square / (1 - square) * first - 2 * ratio * self.split * np.cos(
            a - 2 * M * self.axis
        ) / (1 - square)
        return self.tables(temperature, theta)[0] + seen

    def frequency(self, temperature, theta, ratio):
        """Oscillation frequency, Hz: the mean one and dφ/dt = [δω_c(1 + r²) − 2rΔν]/(1 − r²)."""
        a = 2 * M * np.asarray(theta)
        d = self.at(self.drift, temperature)
        first = d[..., 1] * np.cos(a) + d[..., 2] * np.sin(a)
        square = np.asarray(ratio) ** 2
        speed = (self.split * np.cos(a - 2 * M * self.axis) * (1 + square) - 2 * ratio * first) / (
            1 - square
        )
        return 5000 + 0.4 * (np.asarray(temperature) - 20) + speed / (2 * np.pi)

    def run(self, temperature, rate, number, duration=15.0, dt=0.025):
        """A forced run: θ by Runge–Kutta, the quadrature a slow oscillation that keeps no step with
        the wave angle."""
        draw = np.random.default_rng([number, int(1e6 * self.noise * 1e3) % 2**31])
        count = int(duration / dt)
        t = np.arange(count) * dt
        pace, start, first = draw.uniform(0.2, 0.6), draw.uniform(0, 6), draw.uniform(0, np.pi)

        def ratio(s):
            return self.quadrature * np.sin(pace * s + start)

        T = np.float64(temperature)

        def speed(s, theta):
            return (self.whole_drift(T, theta, ratio(s)) - self.tables(T, theta)[1] * rate) / M

        theta = np.empty(count)
        theta[0] = first
        for i in range(count - 1):
            k1 = speed(t[i], theta[i])
            k2 = speed(t[i] + dt / 2, theta[i] + dt / 2 * k1)
            k3 = speed(t[i] + dt / 2, theta[i] + dt / 2 * k2)
            k4 = speed(t[i] + dt, theta[i] + dt * k3)
            theta[i + 1] = theta[i] + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        r = ratio(t)
        wave = wave_of(
            t, theta + self.noise * draw.normal(size=count), np.full(count, temperature), np.full(count, rate), self.noise,
            f"n{number}", ratio=r,
        )  # fmt: skip
        return wave.replace(frequency_hz=self.frequency(T, theta, r))

    def programme(self):
        return [
            self.run(T, R, 100 * i + j)
            for i, T in enumerate(self.temperatures)
            for j, R in enumerate(self.rates)
        ]
