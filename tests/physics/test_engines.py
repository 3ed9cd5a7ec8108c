"""The engines against laws they do not contain: exact solutions, another integrator, and each
other."""

import numpy as np
import pytest

from hrg_cli.physics import ellipse, fast_engine, fast_loop, slow_engine, slow_motion
from hrg_cli.physics.coefficients import Coefficients, compute_state
from hrg_cli.physics.plant import Control, Environment, Plant, ThermalCourses, make_linear_plant
from hrg_cli.physics.resonator import J, Mechanics, make_reflection

PLAIN = ThermalCourses()


def world(rate=0.0, temperature=20.0, end=10.0, rows=2):
    t = np.linspace(0, end * 1.01, rows)
    w, T = (
        np.broadcast_to(v(t) if callable(v) else v, t.shape).astype(float)
        for v in (rate, temperature)
    )
    return Environment(t, T.copy(), w.copy(), T.copy(), w.copy())


def start(mode_number=2, amplitude=1.0, quadrature=0.0, angle=0.0, phase=0.0):
    return ellipse.compute_envelopes(
        *map(np.asarray, (amplitude, quadrature, angle, phase)), mode_number
    )


def fast(mechanics, environment, u0, fs, seconds, control=None, courses=PLAIN, change=None):
    """(time, z (2, n), envelopes (n, 2)) of the fast engine."""
    plant = make_linear_plant(mechanics, courses, environment)
    if change:
        change(plant)
    return _whole(
        fast_engine.run(environment, plant, control or Control(), u0, 1 / fs, round(seconds * fs))
    )


def slow(mechanics, environment, u0, fs, seconds, control=None, courses=PLAIN, averaged=False):
    blocks = slow_engine.run(
        environment,
        lambda e: make_linear_plant(mechanics, courses, e),
        control or Control(),
        slow_motion.SlowTerms(),
        u0,
        1 / fs,
        round(seconds * fs),
        averaged=averaged,
    )
    return _whole(blocks)


def _whole(blocks):
    parts = [
        (b.samples.time_s, b.samples.z, b.envelopes(np.arange(len(b.samples.time_s))))
        for b in blocks
    ]
    t, z, u = zip(*parts)
    return np.concatenate(t), np.concatenate(z, axis=1), np.concatenate(u)


def wave(u, mode_number=2):
    a_A, a_B, angle, phase = ellipse.find_wave(u, mode_number)
    return a_A, a_B, *ellipse.unwrap(angle, phase, mode_number)


@pytest.mark.parametrize("fs", [11_000.0, 40_000.0])
def test_energy_is_conserved_without_damping(fs):
    mechanics = Mechanics(4987.3, 0.0, frequency_split_rad_s=3.0, stiffness_axis_rad=0.4)
    _, _, u = fast(mechanics, world(), start(quadrature=0.2, angle=0.1), fs, 5.0)
    energy = np.sum(np.abs(u) ** 2, axis=1)
    assert np.ptp(energy) < 1e-10


def test_a_million_periods_keep_their_phase():
    mechanics = Mechanics(1000.0, 0.0)
    n = 4_000_000
    t, z = None, None
    environment = world(end=1000.0)
    for block in fast_engine.run(
        environment,
        make_linear_plant(mechanics, ThermalCourses(), environment),
        Control(),
        start(phase=0.3),
        1 / 4001.0,
        n,
    ):
        t, z = block.samples.time_s, block.samples.z
    np.testing.assert_allclose(
        z[0], np.cos(np.mod(2 * np.pi * 1000.0 * t, 2 * np.pi) + 0.3), atol=1e-8
    )


@pytest.mark.parametrize("mode_number", [1, 2, 3])
def test_wave_turns_by_k_over_m_of_the_table(mode_number):
    """θ = θ₀ − K/m ∫Ω exactly, whatever Ω(t) (PHYSICS M14): no quadrature, no loss."""
    mechanics = Mechanics(4987.3, 0.0, scale_factor=0.55, mode_number=mode_number)
    environment = world(lambda t: 8 * np.sin(7 * t) + 3, end=2.0, rows=4001)
    t, _, u = fast(mechanics, environment, start(mode_number, angle=0.2), 40_000.0, 2.0)
    a_A, a_B, angle, _ = wave(u, mode_number)
    grid, rate = environment.time_s, environment.rate_rad_s
    at_rows = np.concatenate([[0], np.cumsum(np.diff(grid) * (rate[1:] + rate[:-1]) / 2)])
    cell = np.searchsorted(grid, t, side="right") - 1
    turned = at_rows[cell] + (t - grid[cell]) * (rate[cell] + np.interp(t, grid, rate)) / 2
    np.testing.assert_allclose(angle, 0.2 - 0.55 / mode_number * turned, atol=1e-8)
    assert np.abs(a_A - 1).max() < 1e-7
    assert np.abs(a_B).max() < 1e-12


def test_centrifugal_frequency_of_rotation():
    """φ̇ = K²Ω²/2ω from rotation alone (PHYSICS M13)."""
    mechanics = Mechanics(500.0, 0.0, scale_factor=0.55)
    t, _, u = fast(mechanics, world(10.0), start(), 4000.0, 4.0)
    phase = wave(u)[3]
    assert phase[-1] / t[-1] == pytest.approx(5.5**2 / (2 * mechanics.omega_rad_s), rel=1e-4)


def test_run_down_and_growth_of_quadrature():
    """a_A decays by ν; r grows as δω t sin ζ, undamped (PHYSICS M2), its sign that of the split's
    axis."""
    mechanics = Mechanics(4987.3, 0.31, frequency_split_rad_s=0.02, stiffness_axis_rad=0.3)
    t, _, u = fast(mechanics, world(), start(angle=0.5), 40_000.0, 4.0)
    a_A, a_B, angle, phase = wave(u)
    zeta = 4 * (0.5 - 0.3)
    np.testing.assert_allclose(np.log(a_A**2 + a_B**2) / 2, -0.31 * t, atol=1e-6)
    np.testing.assert_allclose(a_B / a_A, 0.02 * np.sin(zeta) * t, atol=3e-4)
    np.testing.assert_allclose(phase, 0.02 * np.cos(zeta) * t, atol=3e-4)
    np.testing.assert_allclose(
        angle - 0.5, -(0.02**2) * t**2 / 4 * np.sin(2 * zeta), atol=3e-5
    )  # 2θ̇ = D = −δω² t sin 2ζ


def test_damping_anisotropy_moves_the_wave_and_locks_it():
    """2θ̇ = νδμ sin χ at rest; at a rate locked below νδμ = KΩ, above it the mean is √((KΩ)² −
    (νδμ)²) (PHYSICS M1, M1b)."""
    split, K = 0.2, 0.55
    mechanics = Mechanics(2000.0, 0.5, split, 0.3, scale_factor=K)
    t, _, u = fast(mechanics, world(), start(angle=0.5), 8000.0, 0.05)
    angle = wave(u)[2]
    assert 2 * np.polyfit(t, angle, 2)[1] == pytest.approx(split * np.sin(4 * 0.2), rel=1e-3)
    low = Mechanics(500.0, 0.5, split, 0.3, scale_factor=K)
    _, _, u = fast(low, world(0.6 * split / K, end=100.0), start(angle=0.5), 1500.0, 60.0)
    assert np.sin(4 * (wave(u[::100])[2][-1] - 0.3)) == pytest.approx(0.6, abs=1e-3)
    turn = np.pi / np.sqrt((1.5**2 - 1) * split**2)  # 4θ turns once while 2θ moves by π
    _, _, u = fast(low, world(1.5 * split / K, end=100.0), start(angle=0.5), 1500.0, 2 * turn)
    angle = wave(u[::100])[2]
    assert 2 * (angle[-1] - angle[0]) == pytest.approx(-2 * np.pi, rel=2e-3)


@pytest.mark.parametrize(("drive", "factor"), [("force", 1.0), ("parametric", 0.5)])
def test_second_order_of_the_split_in_a_forced_run(drive, factor):
    """Fixed wave: r = δω sin ζ/ν and D = −δω² sin 2ζ/ν with the force drive (M3), half of both with
    the parametric drive (M3p)."""
    mechanics = Mechanics(3000.0, 2.0, frequency_split_rad_s=0.05, stiffness_axis_rad=0.0)
    control = Control(
        forced=True, drive=drive, amplitude_gain_1_s=20.0, amplitude_integral_1_s2=100.0
    )
    t, _, u = fast(mechanics, world(end=5.0), start(angle=0.1), 13_000.0, 5.0, control)
    a_A, a_B, angle, _ = wave(u[::13])
    t = t[::13]
    late = t > 3.0
    zeta = 4 * angle[late].mean()
    assert a_A[late].mean() == pytest.approx(1.0, abs=1e-5)
    assert (a_B / a_A)[late].mean() == pytest.approx(factor * 0.05 * np.sin(zeta) / 2.0, rel=2e-3)
    own_second_order = 2.0 * 0.05 / (2 * 2 * np.pi * 3000)  # of the drive: νδω/2ω
    drift = 2 * np.polyfit(t[late], angle[late], 1)[0]
    assert drift == pytest.approx(-factor * 0.05**2 / 2.0 * np.sin(2 * zeta), abs=own_second_order)


def test_rotating_forced_wave_keeps_a_rate_error_of_the_split():
    """Mean D = −λδω²/(ν² + λ²), λ = 2KΩ (PHYSICS M3)."""
    nu, split, K = 2.0, 0.3, 0.55
    mechanics = Mechanics(3000.0, nu, frequency_split_rad_s=split, scale_factor=K)
    control = Control(forced=True, amplitude_gain_1_s=20.0, amplitude_integral_1_s2=100.0)
    rate = 2.0
    lam = 2 * K * rate
    period = np.pi / (K * rate)  # of 4θ … the pattern repeats each π/2 of θ
    seconds = 3.0 + 4 * period
    t, _, u = fast(mechanics, world(rate, end=40.0), start(), 13_000.0, seconds, control)
    angle = wave(u[::13])[2]
    t = t[::13]
    begin = np.searchsorted(t, 3.0)
    turned = 2 * (angle[-1] - angle[begin])
    stop_error = -K * rate * (t[-1] - t[begin])
    assert (turned - stop_error) / (t[-1] - t[begin]) == pytest.approx(
        -lam * split**2 / (nu**2 + lam**2), rel=0.05
    )


def test_loops_null_the_quadrature():
    """A finite gain leaves r = δω sin ζ/(ν + k) (C6); an integral or a spring nulls it; a_ΦB = −δω
    sin ζ a_A."""
    mechanics = Mechanics(3000.0, 1.0, frequency_split_rad_s=0.1, stiffness_axis_rad=0.0)
    zeta = 4 * 0.3
    common = {"forced": True, "amplitude_gain_1_s": 20.0, "amplitude_integral_1_s2": 100.0}
    finite = Control(**common, quadrature_loop="finite", quadrature_gain_1_s=30.0)
    _, _, u = fast(mechanics, world(end=1.0), start(angle=0.3), 13_000.0, 1.0, finite)
    assert (ellipse.find_wave(u[-500:])[1]).mean() == pytest.approx(
        0.1 * np.sin(zeta) / 31, rel=1e-2
    )
    spring = Control(
        **common, quadrature_loop="spring", quadrature_gain_1_s=30.0, quadrature_integral_1_s2=225.0
    )
    parts = list(
        fast_engine.run(
            world(end=2.0),
            make_linear_plant(mechanics, ThermalCourses(), world(end=2.0)),
            spring,
            start(angle=0.3),
            1 / 13_000,
            26_000,
        )
    )
    assert abs(ellipse.find_wave(parts[-1].envelopes(np.arange(25_000, 26_000)))[1].mean()) < 1e-5
    assert parts[-1].command[1, -1] == pytest.approx(-0.1 * np.sin(zeta), rel=1e-2)


def test_phase_error_of_the_quadrature_drive_moves_the_wave():
    """2θ̇ = +δω sin ζ Δφ_B (PHYSICS C1)."""
    mechanics = Mechanics(3000.0, 1.0, frequency_split_rad_s=0.1, stiffness_axis_rad=0.0)
    rates = []
    for error in (0.0, 0.02):
        control = Control(
            forced=True,
            quadrature_loop="finite",
            quadrature_gain_1_s=50.0,
            quadrature_integral_1_s2=600.0,
            quadrature_phase_error_rad=error,
        )
        t, _, u = fast(mechanics, world(end=3.0), start(angle=0.3), 13_000.0, 3.0, control)
        rates.append(2 * np.polyfit(t[26_000::13], wave(u[26_000::13])[2], 1)[0])
    assert rates[1] - rates[0] == pytest.approx(0.1 * np.sin(1.2) * 0.02, rel=0.02)


def random_case(seed):
    g = np.random.default_rng(seed)
    mechanics = Mechanics(
        g.uniform(400, 600),
        g.uniform(0.1, 1),
        g.uniform(0, 0.05),
        g.uniform(0, 1.5),
        g.uniform(0.5, 4),
        g.uniform(0, 1.5),
        0.55,
        int(g.integers(1, 4)),
    )
    speed = g.uniform(-10, 10)
    environment = world(
        lambda t: speed * np.sin(6 * t), lambda t: 20 + 20 * t**2, end=1.0, rows=301
    )
    courses = ThermalCourses(20.0, (9e-5,), (0.01, 1e-4), (0.02,), (0.01,), (1e-3,))
    return (
        mechanics,
        environment,
        courses,
        start(mechanics.mode_number, quadrature=0.1, angle=g.uniform(0, 1.5), phase=1.0),
    )


@pytest.mark.parametrize("seed", range(3))
def test_fast_engine_against_a_general_integrator(seed):
    """DOP853 on z'' + 2(N − KΩJ)z' + (W − (KΩ)'J)z = 0, everything moving at once: 1e-6 at seven
    samples a period."""
    from scipy.integrate import solve_ivp

    mechanics, environment, courses, u0 = random_case(seed)
    plant = make_linear_plant(mechanics, courses, environment)
    grid, K = environment.time_s, plant.scale_factor
    turn = K * environment.rate_rad_s

    def at(t, values):
        return np.array(
            [np.interp(t, grid, values[:, i, j]) for i in (0, 1) for j in (0, 1)]
        ).reshape(2, 2)

    def equation(t, state):
        z, v = state[:2], state[2:]
        k = np.interp(t, grid, K) * np.interp(t, grid, environment.rate_rad_s)
        cell = min(np.searchsorted(grid, t, side="right"), len(grid) - 1)
        k_dot = (turn[cell] - turn[cell - 1]) / (grid[cell] - grid[cell - 1])
        return np.concatenate(
            [v, -2 * (at(t, plant.damping) - k * J) @ v - (at(t, plant.stiffness) - k_dot * J) @ z]
        )

    _, z, _ = fast(mechanics, environment, u0, 3500.0, 0.15, courses=courses)
    t, n0 = np.arange(z.shape[1]) / 3500.0, plant.damping[0]
    table = Coefficients(environment, plant)
    z0, w0 = compute_state(table, np.zeros(1), u0[None], mechanics.omega_rad_s)
    v0 = table.omega(np.zeros(1))[0] * w0[0] - n0 @ z0[0] + turn[0] * J @ z0[0]
    exact = solve_ivp(
        equation, (0, t[-1]), np.concatenate([z0[0], v0]), "DOP853", t, rtol=1e-10, atol=1e-10
    )
    assert np.abs(exact.y[:2] - z).max() < 1e-6


def test_kicks_are_second_order_in_the_step():
    """Halving the step divides the error of a large cubic term by four."""
    mechanics = Mechanics(100.0, 0.5)

    def cubic(plant):
        plant.polynomial[0] = -8 * mechanics.omega_rad_s / 3 * 15.0

    z = {}
    for fs in (4000.0, 8000.0, 64_000.0):
        z[fs] = fast(mechanics, world(), start(angle=0.2, quadrature=0.3), fs, 1.0, change=cubic)[
            1
        ][:, :: round(fs / 4000)]
    coarse, fine = (np.abs(z[fs] - z[64_000.0]).max() for fs in (4000.0, 8000.0))
    assert coarse / fine == pytest.approx(4, rel=0.1)
    assert fine < 1e-2


def test_duffing_pull_and_precession():
    """φ̇ = 3κ(a_A² + a_B²)/8ω, 2θ̇ = −κ a_A a_B/4ω (PHYSICS M4)."""
    mechanics = Mechanics(3000.0, 0.0)
    kappa = 8 * mechanics.omega_rad_s / 3 * 0.5

    def cubic(plant):
        plant.polynomial[0] = -kappa

    t, _, u = fast(mechanics, world(), start(quadrature=0.3), 13_000.0, 1.0, change=cubic)
    _, _, angle, phase = wave(u)
    assert np.polyfit(t, phase, 1)[0] == pytest.approx(0.5 * 1.09, rel=1e-3)
    assert 2 * np.polyfit(t, angle, 1)[0] == pytest.approx(
        -kappa * 0.3 / (4 * mechanics.omega_rad_s), rel=1e-3
    )


def test_extra_acceleration_is_the_same_as_the_polynomial():
    mechanics = Mechanics(3000.0, 0.3)
    kappa = 8 * mechanics.omega_rad_s / 3 * 0.5

    def cubic(plant):
        plant.polynomial[0] = -kappa

    def own(plant):
        plant.extra = lambda t, x, y, vx, vy: (
            -kappa * (x * x + y * y) * x,
            -kappa * (x * x + y * y) * y,
        )

    a, b = (
        fast(mechanics, world(), start(quadrature=0.3), 40_000.0, 0.1, change=change)[1]
        for change in (cubic, own)
    )
    np.testing.assert_allclose(a, b, atol=1e-10)


def test_plain_python_is_the_same_function(monkeypatch):
    """Without numba the same loop runs, slower, with the same samples."""
    import sys

    mechanics, control = (
        Mechanics(3000.0, 1.0, 0.1, 0.2, 0.3, 0.4),
        Control(forced=True, quadrature_loop="finite", quadrature_gain_1_s=5.0),
    )
    compiled = fast(mechanics, world(1.0), start(quadrature=0.1), 13_000.0, 0.1, control)[1]
    monkeypatch.setitem(sys.modules, "numba", None)
    fast_loop.compile_loop.cache_clear()
    plain = fast(mechanics, world(1.0), start(quadrature=0.1), 13_000.0, 0.1, control)[1]
    fast_loop.compile_loop.cache_clear()
    np.testing.assert_allclose(plain, compiled, atol=1e-12)


FREE = [(0.0, 0.0), (3.0, 0.0), (0.0, 5.0), (3.0, 5.0)]


@pytest.mark.parametrize(("rate", "warming"), FREE)
def test_engines_agree_over_free_runs(rate, warming):
    """Second order and beyond: the difference falls as (L/ω)² at least, so 1e-6 at |L| = 6 1/s, ω =
    31 000 1/s."""
    mechanics = Mechanics(4987.3, 0.31, 0.05, 0.35, 1.0, 0.9)
    environment = world(
        lambda t: rate * np.cos(2 * t), lambda t: 20 + warming * t, end=2.0, rows=400
    )
    courses = ThermalCourses(20.0, (85e-6,), (0.01,), (), (0.02,), (1e-4,))
    u0 = start(quadrature=0.05, angle=0.2, phase=1.0)
    a, b = (
        engine(mechanics, environment, u0, 40_000.0, 2.0, courses=courses)
        for engine in (fast, slow)
    )
    assert np.abs(a[1] - b[1]).max() < 1e-6
    assert np.abs(a[2] - b[2]).max() < 1e-6


def test_the_averaged_equation_is_the_plain_generators():
    """L₀ written out (PHYSICS §0), without what is of second order; with it the angle is off."""
    mechanics = Mechanics(997.3, 0.31, 0.05, 0.35, 1.0, 0.9)
    u0, seconds = start(quadrature=0.05, angle=0.2, phase=1.0), 4.0
    L = (
        -0.31 * np.eye(2)
        - 0.05 * make_reflection(4 * 0.35)
        + 1.0j * make_reflection(4 * 0.9)
        + 0.7 * mechanics.scale_factor * J
    )
    missed = []
    for averaged in (True, False):
        t, _, u = slow(mechanics, world(0.7, end=seconds), u0, 2000.0, seconds, averaged=averaged)
        values, vectors = np.linalg.eig(L)
        exact = (np.linalg.solve(vectors, u0) * np.exp(np.outer(t, values))) @ vectors.T
        missed.append(float(np.abs(u - exact).max()))
    assert missed[0] < 1e-7 and missed[1] > 1e-5


@pytest.mark.parametrize("loop", ["off", "finite", "spring"])
@pytest.mark.parametrize("drive", ["force", "parametric"])
def test_engines_agree_over_forced_runs(drive, loop):
    """With the drive on the loops see instants, not periods: the difference is of first order in
    (gains, splits)/ω, and falls with it."""
    differences = []
    for frequency in (2000.0, 8000.0):
        mechanics = Mechanics(frequency, 0.31, 0.05, 0.35, 0.5, 0.9)
        control = Control(
            forced=True, drive=drive, quadrature_loop=loop, quadrature_gain_1_s=5.0, quadrature_integral_1_s2=2.0,
            amplitude_gain_1_s=5.0, amplitude_integral_1_s2=6.0, on_off=np.array([[1.0, 1.3]]),
        )  # fmt: skip
        u0 = start(quadrature=0.05, angle=0.2, phase=1.0)
        a, b = (
            engine(mechanics, world(2.0), u0, 8 * frequency, 2.0, control)
            for engine in (fast, slow)
        )
        away = (a[0] < 0.99) | (a[0] > 1.31)
        differences.append(np.abs(a[2] - b[2])[away].max())
    assert differences[1] < 5e-5
    assert differences[1] < 0.5 * differences[0]


def test_amplitude_follows_the_frequency():
    """A stiffening resonator keeps a²ω (adiabatic invariant): both engines."""
    mechanics = Mechanics(4987.3, 0.0)
    environment = world(0.0, lambda t: 20 + 10 * t, end=4.0, rows=400)
    courses = ThermalCourses(20.0, frequency=(1e-4,))
    for engine in (fast, slow):
        _, _, u = engine(mechanics, environment, start(), 40_000.0, 4.0, courses=courses)
        assert np.abs(u[-1, 0]) == pytest.approx((1 + 40e-4) ** -0.5, abs=1e-6)


def test_stiffness_axes_turn_with_the_mode_number():
    """δω R(2mθ_ω): a wave on the stiffness axis stays linear, for any mode number."""
    for mode_number in (1, 2, 5):
        mechanics = Mechanics(3000.0, 0.2, 0.0, 0.0, 0.5, 0.3, 0.55, mode_number)
        _, _, u = fast(mechanics, world(), start(mode_number, angle=0.3), 13_000.0, 0.5)
        assert np.abs(ellipse.find_wave(u, mode_number)[1]).max() < 1e-9
        assert make_reflection(0.0)[1, 1] == -1
    assert isinstance(make_linear_plant(mechanics, ThermalCourses(), world()), Plant)


def test_engines_agree_as_well_at_a_high_gain_of_the_amplitude_loop():
    """The loops act on the envelopes: what a split leaves at 2ω in p/ω does not go through the gain
    and come back as a force."""
    mechanics = Mechanics(
        2000.0, 0.3, frequency_split_rad_s=0.3, stiffness_axis_rad=0.2, scale_factor=0.7
    )
    apart = []
    for gain in (5.0, 50.0):
        control = Control(forced=True, amplitude_gain_1_s=gain)
        both = [
            run(mechanics, world(end=2.0), start(angle=0.1), 9_000.0, 2.0, control)[2]
            for run in (fast, slow)
        ]
        apart.append(float(np.abs(both[0] - both[1]).max()))
    # δω/4ω of the amplitude, 6e-6, times the loops' part of what happens would come in
    assert apart[1] == pytest.approx(apart[0], abs=1e-6)
