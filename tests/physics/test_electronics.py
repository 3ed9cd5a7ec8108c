"""A board's loops against the theory of sampled loops: steady state, delay margin, phase noise,
saturation, multiplexing, spring."""

import numpy as np
import pytest
from scipy.optimize import curve_fit, root

from hrg_cli.physics import ellipse, fast_engine
from hrg_cli.physics.board_reading import round_to_step
from hrg_cli.physics.electronics import Electronics
from hrg_cli.physics.noise import Noise
from hrg_cli.physics.plant import Control, Environment, ThermalCourses, make_linear_plant
from hrg_cli.physics.resonator import Mechanics


def run(
    mechanics,
    control,
    electronics,
    seconds=4.0,
    fs=8000.0,
    rate=0.0,
    start=1.0,
    quadrature=0.0,
    angle=0.3,
    noise=None,
    seed=1,
):
    grid = np.array([0.0, 2 * seconds])
    world = Environment(grid, *[np.full(2, v) for v in (20.0, rate, 20.0, rate)])
    u0 = ellipse.compute_envelopes(start, quadrature, angle, 0.4, 2)
    blocks = list(
        fast_engine.run(
            world, make_linear_plant(mechanics, ThermalCourses(), world), control, u0, 1 / fs, round(seconds * fs), 2 * angle,
            electronics=electronics, noise=noise, random=np.random.default_rng(seed),
        )
    )  # fmt: skip
    u = np.concatenate([b.envelopes(np.arange(len(b.samples.time_s))) for b in blocks])
    drive = np.concatenate([b.samples.drive for b in blocks], axis=1)
    t = np.concatenate([b.samples.time_s for b in blocks])
    command = np.concatenate([b.command for b in blocks], axis=1)
    a_A, a_B, th, ph = ellipse.find_wave(u, 2)
    return t, a_A, a_B, *ellipse.unwrap(th, ph, 2), command, drive


GYRO = Mechanics(1000.0, 0.5, 0.02, 0.3, 0.4, 0.8, 0.55)
CONTROL = Control(
    forced=True,
    amplitude_gain_1_s=5.0,
    amplitude_integral_1_s2=6.0,
    quadrature_loop="finite",
    quadrature_gain_1_s=10.0,
)


@pytest.mark.parametrize("drive", ["force", "parametric"])
@pytest.mark.parametrize("loop", ["finite", "spring"])
def test_a_quick_board_does_what_ideal_loops_do(drive, loop):
    control = Control(**{**vars(CONTROL), "drive": drive, "quadrature_loop": loop})
    ideal, board = run(GYRO, control, None), run(GYRO, control, Electronics(2, phase_loop_hz=20.0))
    for one, other, scale in zip(ideal[1:5], board[1:5], (1.0, 1.0, 1.0, 1.0)):
        assert np.abs(one - other).max() < 2e-3 * scale
    slower = run(GYRO, control, Electronics(20, delay_periods=20, phase_loop_hz=5.0))
    assert np.abs(slower[3] - ideal[3]).max() > np.abs(board[3] - ideal[3]).max()


@pytest.mark.parametrize(("margin", "stable"), [(1.0, True), (2.2, False)])
def test_a_late_amplitude_loop_is_unstable_beyond_pi_half(margin, stable):
    """ȧ = −g·a(t − τ) oscillates and grows from gτ = π/2; τ: the delay, half a window of averaging
    and half of holding."""
    e = Electronics(10, delay_periods=90, phase_loop_hz=1.0)
    control = Control(forced=True, amplitude_gain_1_s=margin / 0.1)
    _, a_A, *_ = run(Mechanics(1000.0, 0.05), control, e, seconds=6.0, start=1.02)
    late = np.abs(a_A[len(a_A) // 2 :] - 1).max()
    assert (late < 0.02) == stable
    if not stable:
        assert late > 0.2


@pytest.mark.parametrize(("gain", "corner_hz", "delay"), [(25.0, 1.0, 0), (12.0, 2.0, 40)])
def test_filter_and_delay_make_the_amplitude_ring_as_their_poles_say(gain, corner_hz, delay):
    """s + ν + g e^{−sτ}/(1 + s/2πf_c) = 0, τ: delay and half of reading and of holding, the low pass
    that of the board; the amplitude returns from 2 % off along its slowest pole."""
    nu, periods = 0.05, 4
    e = Electronics(periods, delay_periods=delay, filter_hz=corner_hz, phase_loop_hz=1.0)
    control = Control(forced=True, amplitude_gain_1_s=gain, amplitude_integral_1_s2=0.0)
    t, a_A, *_ = run(Mechanics(1000.0, nu), control, e, seconds=2.0, start=1.02)
    late = (delay + periods) / 1000.0

    def closed(s):
        return s + nu + gain * np.exp(-s * late) / (1 + s / (2 * np.pi * corner_hz))

    pole = root(
        lambda x: (lambda v: [v.real, v.imag])(closed(x[0] + 1j * x[1])),
        [-np.pi * corner_hz, np.sqrt(2 * np.pi * corner_hz * gain)],
        tol=1e-12,
    ).x
    later = t > 0.15

    def ring(time, level, x, y, decay, turns):
        return level + np.exp(decay * time) * (x * np.cos(turns * time) + y * np.sin(turns * time))

    found = curve_fit(ring, t[later], a_A[later], p0=[a_A[-1], 0.02, 0.0, *pole])[0][3:]
    assert found == pytest.approx(pole, abs=0.03 * np.hypot(*pole))


def test_phase_loop_has_the_noise_of_its_bandwidth():
    """σ² = S·B, S = 4σ_y²/f_s a² the one-sided density of the phase, B = ω_n(ζ + 1/4ζ)/2 Hz."""
    natural, sigma, fs = 3.0, 5e-3, 8000.0
    t, _, _, angle, phase, _, drive = run(
        Mechanics(1000.0, 0.5),
        Control(forced=True),
        Electronics(4, phase_loop_hz=natural),
        20.0,
        fs,
        noise=Noise(readout=sigma),
    )
    e_A = np.stack([np.cos(2 * angle), np.sin(2 * angle)])
    along = np.sum(e_A * drive, axis=0) * np.exp(-1j * (2 * np.pi * 1000.0 * t + phase))
    error = np.angle(along[4000:] / np.mean(along[4000:]))
    zeta = 1 / np.sqrt(2)
    expected = np.sqrt(4 * sigma**2 / fs * 2 * np.pi * natural * (zeta + 1 / (4 * zeta)) / 2)
    independent = 20.0 * 2 * np.pi * natural
    assert np.std(error) == pytest.approx(expected, rel=5 / np.sqrt(2 * independent))


def test_a_saturated_drive_holds_what_its_force_can():
    """A command far beyond the limit makes a square wave of that height: between its peak and 4/π
    of it, over ν."""
    control = Control(forced=True, amplitude_gain_1_s=50.0, amplitude_integral_1_s2=500.0)
    _, a_A, *_ = run(
        Mechanics(1000.0, 2.0), control, Electronics(4, drive_limit=0.8), 6.0, 40000.0, angle=0.0
    )
    assert 0.4 * 0.98 < a_A[-1] < 0.4 * 4 / np.pi * 1.02


def test_multiplexed_drive_gives_the_same_mean_force():
    both, turns = (
        run(GYRO, CONTROL, Electronics(8)),
        run(GYRO, CONTROL, Electronics(8, drive_periods=8)),
    )
    half = len(both[0]) // 2
    assert np.mean(turns[1][half:]) == pytest.approx(np.mean(both[1][half:]), abs=1e-3)
    assert np.std(turns[1][half:]) < 0.5 * 8e-3  # ripple of the loss over half a cycle


def test_converter():
    assert round_to_step(0.26, 0.1, 0.0) == pytest.approx(0.3)
    assert round_to_step(-7.0, 0.0, 2.0) == -2.0
    coarse = run(GYRO, CONTROL, Electronics(8, adc_step=0.05, adc_limit=2.0))
    fine = run(GYRO, CONTROL, Electronics(8))
    assert 1e-6 < np.abs(coarse[1] - fine[1])[8000:].max() < 0.02


def test_spring_by_quadrature_and_by_phase_product_null_alike():
    """a_C a_S sin(φ_C − φ_S) = a_A a_B: at the set amplitude both signals are r."""
    control = Control(**{**vars(CONTROL), "quadrature_loop": "spring"})
    one = run(GYRO, control, Electronics(4))
    other = run(GYRO, control, Electronics(4, phase_product=True))
    assert np.abs(one[2] - other[2]).max() < 1e-3
    off = run(GYRO, Control(**{**vars(control), "quadrature_loop": "off"}), Electronics(4))
    assert np.abs(one[2][-8000:]).max() < 0.2 * np.abs(off[2][-8000:]).max()


def test_a_spring_that_follows_the_wave_fights_at_high_rates_and_a_constant_one_does_not():
    """Late by τ the spring stands 2KΩτ behind the wave: ṙ = δω_s − k_q cos(2KΩτ) r. Beyond a
    quarter turn it feeds what it should null."""
    e = Electronics(8, delay_periods=40, phase_loop_hz=1.0)
    tau = (8 + 40) / 1000.0
    follow = Control(
        forced=True, amplitude_gain_1_s=5.0, quadrature_loop="spring", quadrature_gain_1_s=10.0
    )
    none = Control(forced=True, amplitude_gain_1_s=5.0)
    for turned, better in ((0.1, True), (0.6 * np.pi, False)):
        rate = turned / (2 * 0.55 * tau)
        loop, off = (
            np.abs(run(GYRO, c, e, 6.0, rate=rate)[2][-16000:]).max() for c in (follow, none)
        )
        assert (loop < off) == better
    round_one = Mechanics(
        1000.0, 0.5, 0.02, 0.3, 0.0, 0.0, 0.55
    )  # what the constant spring along the stiffest axis leaves
    assert np.abs(run(round_one, none, e, 6.0, rate=rate)[2][-16000:]).max() < 0.5 * off
