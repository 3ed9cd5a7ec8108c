"""Noise that comes out of physics: equipartition, angle random walk, 1/f corner, bias instability,
each against its formula."""

import numpy as np
import pytest
from oracles.noise_laws import flicker_bias

from hrg_cli.fitting.tables.allan import compute_allan_deviation
from hrg_cli.physics import ellipse, fast_engine
from hrg_cli.physics.electronics import Electronics
from hrg_cli.physics.noise import (
    BOLTZMANN_J_K,
    Flicker,
    Noise,
    compute_angle_random_walk,
    compute_thermal_velocity2,
)
from hrg_cli.physics.plant import Control, Environment, ThermalCourses, make_linear_plant
from hrg_cli.physics.resonator import Mechanics


def run(mechanics, noise, seconds, fs, control=None, amplitude=1.0, seed=1, every=1, **more):
    """(time, envelopes) of the fast engine with noise, every so many samples."""
    grid = np.array([0.0, 2 * seconds])
    world = Environment(grid, *[np.full(2, v) for v in (20.0, 0.0, 20.0, 0.0)])
    u0 = ellipse.compute_envelopes(amplitude, 0.0, 0.3, 0.0, 2)
    blocks = fast_engine.run(
        world, make_linear_plant(mechanics, ThermalCourses(), world), control or Control(), u0, 1 / fs, round(seconds * fs), 0.6,
        noise=noise, random=np.random.default_rng(seed), **more,
    )  # fmt: skip
    parts = [
        (b.samples.time_s[::every], b.envelopes(np.arange(0, len(b.samples.time_s), every)))
        for b in blocks
    ]
    return tuple(np.concatenate(p) for p in zip(*parts))


def test_thermal_velocity_is_that_of_a_body():
    assert compute_thermal_velocity2(300.0, 1e-3) == pytest.approx(BOLTZMANN_J_K * 300 / 1e-3)
    assert compute_thermal_velocity2(300.0, 1e-3, 1e-6) == pytest.approx(
        BOLTZMANN_J_K * 300 / 1e-3 * 1e12
    )


def test_brownian_force_keeps_half_kt_in_each_mode():
    """½M⟨v²⟩ = ½k_BT for every channel, also with a split of the damping: ⟨|u|²⟩ = 2(k_BT/M)/ω²."""
    mechanics = Mechanics(50.0, 20.0, 8.0, 0.2)
    noise = Noise(thermal_velocity2=1.0)
    _, u = run(mechanics, noise, 400.0, 400.0, amplitude=1e-6)
    energy = np.mean(np.abs(u[2000:]) ** 2, axis=0) * mechanics.omega_rad_s**2 / 2
    assert energy == pytest.approx(
        [1.0, 1.0], abs=4 / np.sqrt(400 * 12)
    )  # 400 s hold some 12 independent values a second


@pytest.mark.parametrize("source", ["brownian", "drive"])
def test_allan_deviation_of_a_driven_gyro_is_the_angle_random_walk(source):
    """N = √(2νk_BT/M)/(ωaK) and √(S_d/2)/(aK) from simulated samples, within the interval of the
    Allan deviation."""
    mechanics = Mechanics(50.0, 0.5, scale_factor=0.55)
    noise = Noise(thermal_velocity2=1e-4) if source == "brownian" else Noise(drive_density=3e-5)
    control = Control(
        forced=True, amplitude_gain_1_s=2.0, quadrature_loop="finite", quadrature_gain_1_s=5.0
    )
    t, u = run(mechanics, noise, 600.0, 400.0, control, every=40)
    angle, _ = ellipse.unwrap(*ellipse.find_wave(u, 2)[2:], 2)
    rate = -2 * np.diff(angle) / np.diff(t) / 0.55
    tau, deviation, relative = compute_allan_deviation(rate, t[1] - t[0], points=12)
    known = (tau > 0.4) & (tau < 40)
    walk = deviation[known] * np.sqrt(tau[known])
    expected = compute_angle_random_walk(mechanics, noise, 1.0)
    assert np.all(np.abs(walk / expected - 1) < 4 * relative[known])


def test_flicker_has_the_density_h_over_f():
    source = Flicker(np.array([1.0, 4.0]), 1.0, 1000.0, np.random.default_rng(2))
    step = source.choose_knot_s()
    x = source.draw(int(1000 / step), step)
    spectrum = np.abs(np.fft.rfft(x - x.mean(axis=0), axis=0)) ** 2 * 2 * step / len(x)
    f = np.fft.rfftfreq(len(x), step)
    for low, high in ((0.003, 0.01), (0.01, 0.1), (0.1, 1.0)):
        band = (f >= low) & (f < high)
        assert np.mean(spectrum[band] * f[band, None], axis=0) == pytest.approx(
            [1.0, 4.0], rel=5 / np.sqrt(band.sum()) + 0.1
        )


def test_allan_deviation_of_flicker_is_flat_at_the_bias_instability():
    """σ = B√(2 ln 2/π) over the decades where the law holds   (IEEE Std 952, annex C)."""
    h = 2.5
    level = []
    for seed in range(6):
        x = Flicker(np.array([h]), 1.0, 3000.0, np.random.default_rng(seed)).draw(30000, 0.1)[:, 0]
        tau, deviation, _ = compute_allan_deviation(x, 0.1, points=16)
        level.append(deviation[(tau > 3) & (tau < 100)])
    assert np.mean(level) == pytest.approx(
        flicker_bias(h) * np.sqrt(2 * np.log(2) / np.pi), rel=0.1
    )


def test_readout_flicker_becomes_a_bias_instability_through_the_loops():
    """The quadrature loop nulls what it reads, r = −n_B/a, so D = −2rδω cos ζ; the main force acts
    along the angle read, D = νn_θ.

    Both read-out noises have the density 2S₀f_c/f, S₀ = 2σ²/f_s: flicker of input rate ((2δω cos
    ζ)² + ν²)/(aK)² of it.
    """
    mechanics = Mechanics(
        100.0, 0.01, 0.0, 0.0, 0.03, 0.3, 0.55
    )  # the wave starts and stays at θ = 0.3, ζ = 0
    fs, sigma, corner = 400.0, 3e-3, 2.0
    control = Control(
        forced=True, amplitude_gain_1_s=4.0, quadrature_loop="finite", quadrature_gain_1_s=20.0
    )
    level = []
    for seed in range(2):
        noise = Noise(readout=sigma, readout_corner_hz=corner)
        t, u = run(
            mechanics,
            noise,
            400.0,
            fs,
            control,
            every=20,
            electronics=Electronics(2, phase_loop_hz=2.0),
            seed=seed,
        )
        a_A, _, angle, phase = ellipse.find_wave(u, 2)
        angle, _ = ellipse.unwrap(angle, phase, 2)
        rate = -2 * np.diff(angle) / np.diff(t) / 0.55
        tau, deviation, _ = compute_allan_deviation(rate, t[1] - t[0], points=20)
        level.append(deviation[(tau > 4) & (tau < 60)])
        assert np.abs(a_A - 1).max() < 0.05
    density = ((2 * 0.03) ** 2 + 0.01**2) / 0.55**2 * 2 * (2 * sigma**2 / fs) * corner
    assert np.median(level) == pytest.approx(
        flicker_bias(density) * np.sqrt(2 * np.log(2) / np.pi), rel=0.3
    )
