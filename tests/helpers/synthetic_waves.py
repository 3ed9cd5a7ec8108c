"""Waves of free runs made from the exact slow model, for tests of what comes after `estimate`."""

import numpy as np

from hrg_cli.physics import ellipse, resonator
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.records import Wave

GYRO = Mechanics(4987.3, 0.31, 0.012, 0.35, 0.11, 0.9, 0.55)
PROGRAMME = ((0.0, 0.0), (0.2, 0.0), (0.4, 0.0), (0.6, 0.0), (0.1, 2.0), (0.5, -2.0))
NAMES = (
    "frequency_hz",
    "damping_rate_1_s",
    "damping_split_1_s",
    "damping_axis_rad",
    "frequency_split_rad_s",
    "stiffness_axis_rad",
    "scale_factor",
)


def envelope(mechanics, theta, rate, times, ratio=0.02, phase=0.0, second_order=1.0, amplitude=1.0):
    """Exact envelopes at times; `rate` a number or a function of time (then by fine midpoint
    steps)."""
    u0 = ellipse.compute_envelopes(
        amplitude, ratio * amplitude, theta, phase, mechanics.mode_number
    )
    if not callable(rate):
        return (
            resonator.exponentiate(
                resonator.build_generator(mechanics, rate, second_order=second_order), times
            )
            @ u0
        )
    fine = np.concatenate([[0.0], times])
    steps = resonator.exponentiate(
        resonator.build_generator(
            mechanics, rate((fine[1:] + fine[:-1]) / 2), second_order=second_order
        ),
        np.diff(fine),
    )
    out, u = np.empty((len(times), 2), complex), u0
    for k, step in enumerate(steps):
        u = step @ u
        out[k] = u
    return out


def as_wave(u, times, std, mechanics, rng, *, rate=None, run_id="run", flags=None, **more):
    """A Wave of envelopes with Gaussian noise of `std` a component."""
    u = u + std * (rng.standard_normal(u.shape) + 1j * rng.standard_normal(u.shape))
    m, n = mechanics.mode_number, len(times)
    a_A, a_B, theta, phi = ellipse.find_wave(u, m)
    theta, phi = ellipse.unwrap(theta, phi, m)
    fill = np.full(n, float(std))
    return Wave(
        time_s=times,
        main_amplitude=a_A,
        quadrature_amplitude=a_B,
        wave_angle_rad=theta,
        phase_rad=phi,
        carrier_phase_rad=0 * fill,
        main_amplitude_std=fill,
        quadrature_amplitude_std=fill,
        wave_angle_rad_std=fill,
        phase_rad_std=fill,
        carrier_phase_rad_std=0 * fill,
        residual_rms=0 * fill,
        signal_std=std * np.sqrt(rng.chisquare(6, n) / 6),
        iterations=np.zeros(n, "i2"),
        flags=np.zeros(n, "u1") if flags is None else flags,
        rate_rad_s=rate,
        frequency_hz=np.full(n, mechanics.frequency_hz),
        **{
            "reference_frequency_hz": mechanics.frequency_hz,
            "window_s": float(np.median(np.diff(times))),
            "mode": "free",
            "mode_number": m,
            "run_id": run_id,
            **more,
        },
    )


def run_down(
    theta, rate=0.0, *, mechanics=GYRO, std=1e-4, seconds=4.0, window=2e-3, seed=0, **more
):
    """One free run-down."""
    rng = np.random.default_rng(seed)
    times = (np.arange(int(seconds / window)) + 0.5) * window
    shape = {k: more.pop(k) for k in ("ratio", "second_order", "amplitude") if k in more}
    u = envelope(mechanics, theta, rate, times, phase=rng.uniform(-3, 3), **shape)
    rates = rate(times) if callable(rate) else np.full(len(times), float(rate))
    return as_wave(
        u, times, std, mechanics, rng, rate=rates, run_id=more.pop("run_id", f"run {seed}"), **more
    )


def programme(mechanics=GYRO, seed=0, runs=PROGRAMME, **more):
    """Several run-downs."""
    return [
        run_down(theta, rate, mechanics=mechanics, seed=1000 * seed + i, **more)
        for i, (theta, rate) in enumerate(runs)
    ]


def errors(resonator_record, mechanics=GYRO, names=NAMES):
    """(value − true)/σ of each parameter that is there, axes modulo their period."""
    out = {}
    for name, (value, std, _) in resonator_record.parameters().items():
        difference = value - getattr(mechanics, name)
        if name.endswith("axis_rad"):
            period = np.pi / mechanics.mode_number
            difference = (difference + period / 2) % period - period / 2
        if name in names and std > 0:  # a held axis has none
            out[name] = difference / std
    return out
