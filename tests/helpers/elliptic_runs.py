"""Runs of the exact slow model with a quadrature of some percent, at any temperature: no formula of
the drift enters."""

from dataclasses import replace

import numpy as np
from forced_runs import wave_of

from hrg_cli.physics import ellipse
from hrg_cli.physics.resonator import Mechanics, build_generator, exponentiate
from hrg_cli.records import Resonator

DEVICE = Mechanics(5000.0, 0.02, 8e-4, 0.4, 4e-3, 0.15, 0.55)
NAMES = (
    "damping_split_1_s",
    "damping_axis_rad",
    "frequency_split_rad_s",
    "stiffness_axis_rad",
    "scale_factor",
)
UNITS = ("s-1", "rad", "rad s-1", "rad", "1")


def tempered(temperature, device=DEVICE):
    """The device at a temperature: damping split and frequency split, damping axis, scale factor
    and frequency move."""
    t = temperature - 20.0
    return replace(
        device,
        frequency_hz=device.frequency_hz + 0.4 * t,
        damping_split_1_s=device.damping_split_1_s * (1 + 0.006 * t + 5e-5 * t**2),
        damping_axis_rad=device.damping_axis_rad + 0.002 * t,
        frequency_split_rad_s=device.frequency_split_rad_s * (1 - 0.004 * t),
        scale_factor=device.scale_factor * (1 + 2e-5 * t),
    )


def elliptic_run(
    device,
    temperature,
    rate,
    start,
    ratio,
    run_id,
    duration=20.0,
    noise=1e-7,
    seed=0,
    mode="forced",
    dt=0.02,
):
    """u' = L u from a wave angle and a quadrature, sampled; the amplitude falls, which no drift
    formula looks at."""
    t = np.arange(int(duration / dt)) * dt
    L = build_generator(device, rate, reference_frequency_hz=device.frequency_hz, second_order=0)
    u = np.einsum(
        "nij,j->ni",
        exponentiate(np.broadcast_to(L, (len(t), 2, 2)), t),
        ellipse.compute_envelopes(1.0, ratio, start, 0.0),
    )
    a, b, theta, phase = ellipse.find_wave(u)
    theta, phase = ellipse.unwrap(theta, phase)
    draw = np.random.default_rng(seed)
    full = np.full(len(t), float(temperature))
    wave = wave_of(
        t,
        theta + noise * draw.normal(size=len(t)),
        full,
        np.full(len(t), rate),
        noise,
        run_id,
        ratio=b,
        mode=mode,
    )
    return wave.replace(
        main_amplitude=a, frequency_hz=device.frequency_hz + np.gradient(phase, t) / (2 * np.pi)
    )


def resonator_of(device, temperature, std=1e-6, seed=None):
    """A resonator file's record: the device's parameters, each with a relative standard deviation
    and, with a seed, its error."""
    value = np.array([getattr(device, name) for name in NAMES])
    size = std * np.where(np.array(UNITS) == "rad", 1.0, np.abs(value))
    if seed is not None:
        value = value + size * np.random.default_rng(seed).normal(size=5)
    return Resonator(
        name=np.array(NAMES), value=value, std=size, units=np.array(UNITS), covariance=np.diag(size**2), gyro_id="g1",
        temperature_degc=None if temperature is None else float(temperature),
    )  # fmt: skip
