"""Forced runs made from the output equation m·dθ/dt = −K(T,θ)Ω + D(T,θ) alone: fine integration,
then white noise on the angle."""

import numpy as np

from hrg_cli.records import Wave


class Truth:
    """Drift and scale factor known everywhere: quadratic in temperature, harmonics 0, 1, 2 of
    2mθ."""

    def __init__(self, seed=0, mode_number=2, drift=2e-4, scale_ripple=3e-4, curved=True):
        draw = np.random.default_rng(seed)
        self.m = mode_number
        self.d = (
            draw.normal(size=(3, 5)) * drift * np.array([1, 0.4, 0.15 if curved else 0])[:, None]
        )
        self.k = (
            draw.normal(size=(3, 5))
            * scale_ripple
            * np.array([1, 0.4, 0.15 if curved else 0])[:, None]
        )
        self.k[0, 0] = 0.55

    def basis(self, theta):
        a = 2 * self.m * theta
        return np.stack([np.ones_like(a), np.cos(a), np.sin(a), np.cos(2 * a), np.sin(2 * a)])

    def powers(self, temperature):
        x = (np.asarray(temperature, float) - 20) / 40
        return np.stack([np.ones_like(x), x, x**2])

    def drift(self, temperature, theta):
        return np.einsum("p...,ph,h...->...", self.powers(temperature), self.d, self.basis(theta))

    def scale(self, temperature, theta):
        return np.einsum("p...,ph,h...->...", self.powers(temperature), self.k, self.basis(theta))


def forced_run(
    truth,
    temperature,
    rate,
    duration,
    seed,
    dt=0.02,
    noise=1e-5,
    walk=0.0,
    start=None,
    run_id="",
    gyro_id="g1",
    start_time="",
    ratio=None,
    steps=1,
):
    """temperature, rate: numbers or functions of time; ratio: a_B/a_A likewise (it does not act
    unless the truth uses it)."""
    draw = np.random.default_rng(seed)
    t = np.arange(int(duration / dt)) * dt
    f = [
        (
            np.vectorize(v, otypes=[float])
            if callable(v)
            else (lambda x, v=v: np.full_like(np.asarray(x, float), v))
        )
        for v in (temperature, rate)
    ]
    theta = np.empty(len(t))
    theta[0] = draw.uniform(0, np.pi) if start is None else start
    h = dt / steps
    half = np.arange((len(t) - 1) * steps * 2 + 1) * h / 2
    T, R = f[0](half), f[1](half)
    kicks = draw.normal(size=len(t)) * np.sqrt(walk * dt)
    m, d, k = truth.m, truth.powers(T).T @ truth.d, truth.powers(T).T @ truth.k
    from math import cos, sin

    def slope(i, x):
        a = 2 * m * x
        c1, s1, c2, s2 = cos(a), sin(a), cos(2 * a), sin(2 * a)
        D, K = d[i], k[i]
        return (
            D[0]
            + D[1] * c1
            + D[2] * s1
            + D[3] * c2
            + D[4] * s2
            - R[i] * (K[0] + K[1] * c1 + K[2] * s1 + K[3] * c2 + K[4] * s2)
        ) / m

    x = float(theta[0])
    for i in range(1, len(t)):
        for j in range(steps):
            n = ((i - 1) * steps + j) * 2
            a = slope(n, x)
            b = slope(n + 1, x + h / 2 * a)
            c = slope(n + 1, x + h / 2 * b)
            e = slope(n + 2, x + h * c)
            x += h / 6 * (a + 2 * b + 2 * c + e)
        x += kicks[i] / m
        theta[i] = x
    return wave_of(
        t,
        theta + draw.normal(size=len(t)) * noise,
        f[0](t),
        f[1](t),
        noise,
        run_id or f"T{temperature}R{rate}",
        gyro_id,
        m,
        start_time,
        ratio,
    )


def wave_of(
    t,
    theta,
    temperature,
    rate,
    noise,
    run_id,
    gyro_id="g1",
    mode_number=2,
    start_time="",
    ratio=None,
    mode="forced",
    **more,
):
    n = len(t)
    dt = t[1] - t[0]
    small, warm = np.full(n, noise), np.zeros(n) + (0 if temperature is None else temperature)
    fields = {
        "time_s": t, "main_amplitude": np.ones(n), "quadrature_amplitude": np.zeros(n) if ratio is None else ratio, "wave_angle_rad": theta,
        "phase_rad": np.zeros(n), "carrier_phase_rad": np.zeros(n), "main_amplitude_std": small, "quadrature_amplitude_std": small,
        "wave_angle_rad_std": small, "phase_rad_std": small, "carrier_phase_rad_std": np.zeros(n), "residual_rms": np.zeros(n),
        "signal_std": small, "iterations": np.zeros(n, "i2"), "flags": np.zeros(n, "u1"), "temperature_degc": temperature,
        "rate_rad_s": rate, "frequency_hz": 5000 + 0.4 * (warm - 20), "reference_frequency_hz": 5000.0, "window_s": dt, "mode": mode,
        "mode_number": mode_number, "gyro_id": gyro_id, "run_id": run_id, "start_time": start_time,
    }  # fmt: skip
    return Wave(**(fields | more))


def programme(
    truth, temperatures=(-20, 5, 30, 55), rates=(-0.5, 0.02, 0.5), duration=40.0, seed=0, **more
):
    return [
        forced_run(truth, T, R, duration, 1000 * seed + 10 * i + j, run_id=f"T{T:g} R{R:g}", **more)
        for i, T in enumerate(temperatures)
        for j, R in enumerate(rates)
    ]
