"""Every effect: its fast and its slow terms, written separately, change the measured envelopes
alike; neutral values change nothing."""

from functools import cache

import numpy as np
import pytest

from hrg_cli import effects
from hrg_cli.effects import EFFECTS, nonlinear_damping
from hrg_cli.physics import ellipse
from hrg_cli.physics.environment import follow_levels, hold_value, make_environment
from hrg_cli.physics.plant import Environment, ThermalCourses, make_linear_plant
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import simulate

# sizes that change half a second of a 2 kHz device by about a thousandth
SIZES = {
    "clock_error": {"relative": 3e-7},
    "dropped_samples": {"lost_s": 3 / 17310, "time_s": 0.21},
    "mains_tone": {"frequency_hz": 2003.0, "c_cos": 1e-3, "s_sin": 5e-4},
    "thermal_frequency": {"relative_1_k": 1e-6, "reference_temperature_degc": 22.0},
    "thermal_frequency_curvature": {"relative_1_k2": 3e-7, "reference_temperature_degc": 22.0},
    "thermal_damping": {"relative_1_k": 2e-2, "reference_temperature_degc": 22.0},
    "split_temperature": {
        "cos_rad_s_k": 1e-2,
        "sin_rad_s_k": -2e-2,
        "reference_temperature_degc": 22.0,
    },
    "damping_split_temperature": {
        "cos_1_s_k": 1e-2,
        "sin_1_s_k": -2e-2,
        "reference_temperature_degc": 22.0,
    },
    "scale_factor_temperature": {"relative_1_k": 1e-3, "reference_temperature_degc": 22.0},
    "thermal_gradient": {"frequency_s_k": 1e-7, "split_cos_rad_k": 2e-3, "split_sin_rad_k": -1e-3},
    "thermal_hysteresis": {"relative": 3e-7},
    "centrifugal_stiffness": {"coefficient": 20.0},
    "damping_drift": {"slope_1_s2": 2e-2},
    "ageing": {"frequency_1_s": 1e-6, "split_cos_1_s2": 1e-2, "split_sin_1_s2": -1e-2},
    "saturation": {"inverse_level": 1.3},
    "coherent_offset": {"in_phase_c": 1e-3, "quadrature_s": 5e-4},
    "drive_feedthrough": {"displacement_c_s": 3e-3, "velocity_s_s": 2e-3},
    "parasitic_force": {"in_phase_s_1_s": 3e-3, "quadrature_c_1_s": 2e-3},
    "inertial_nonlinearity": {"inverse_length_squared": 1e-5},
    "finite_quadrature_gain": {"gain_1_s": 2.0},
    "dry_friction": {"slope_1_s": 2e-2},
    "momentum_kick": {
        "c_velocity_over_omega": 4e-3,
        "s_velocity_over_omega": -7e-3,
        "time_s": 0.21003,
        "phase_rad": 0.4,
    },
    "phase_drift": {"slope_rad_s": 1e-2},
    "gain_drift": {"curvature_1_s2": -2e-2},
    "gain_step": {"c_gain": 4e-3, "s_gain": -7e-3, "time_s": 0.21},
    "converter_nonlinearity": {"mid_scale": 1e-3, "step": 0.0},
}

# relative difference of the two terms' changes, at most about 1.4 times what was measured; most are
# the second order of a term
TOLERANCE = {
    "inertial_nonlinearity": 8e-4,
    "thermal_gradient": 1e-3,
    # harmonics that 8.7 samples a period fold onto the oscillation
    "pickoff_nonlinearity": 5e-3,
    "saturation": 4e-2,
    "converter_nonlinearity": 6e-2,
    # its branch jumps between grid rows
    "thermal_hysteresis": 4.5e-2,
}
USUAL = 5e-4
ENGINES = ("fast", "slow")
AT_AN_INSTANT = ("dropped_samples", "gain_step", "momentum_kick")


@cache
def plain(model, forced):
    """The wave of the run without any effect, which most effects are held against."""
    return wave(model, {}, forced)


def wave(model, given, forced):
    """The measured wave of one run by one engine; `given`: tables of effects."""
    control = {"mode": "forced"} if forced else {}
    if forced and "quadrature_drive_phase_error" in given:
        control |= {"quadrature_loop": "finite", "quadrature_gain_1_s": 5.0}
    config = {
        "device": {
            "frequency_hz": 2000.0, "damping_rate_1_s": 0.4, "damping_split_1_s": 0.02, "damping_axis_rad": 0.3,
            "frequency_split_rad_s": 0.3, "stiffness_axis_rad": 1.1,
        },
        "start": {"wave_angle_rad": 0.25, "quadrature": 0.15, "phase_rad": 0.4},
        "environment": {
            "temperature": {"kind": "cycle", "low_degc": 22.0, "high_degc": 23.0, "period_s": 0.3, "shape": "sine"},
            "rate": {"kind": "sine", "amplitude_rad_s": 2.0, "frequency_hz": 1.3},
        },
        "recording": {"sample_rate_hz": 17310.0, "duration_s": 0.5},
        "control": control,
        "effects": given,
    }  # fmt: skip
    return collect(
        estimate(
            collect(demodulate(collect(simulate(config, model=model)), periods_per_window=10.0))
        )
    )


def envelopes(*waves):
    """The waves' envelopes against 2 kHz, at the windows all have."""
    out = []
    rows = min(map(len, waves))
    for w in waves:
        turn = 2 * np.pi * (w.reference_frequency_hz - 2000.0) * w.time_s
        out.append(
            ellipse.compute_envelopes(
                w.main_amplitude, w.quadrature_amplitude, w.wave_angle_rad, w.phase_rad + turn, 2
            )[:rows]
        )
    return out


@pytest.mark.parametrize(
    "effect", [e for e in EFFECTS if e.name != "thermal_lag"], ids=lambda e: e.name
)
def test_fast_and_slow_agree(effect):
    forced = effect.family == "control" or effect.name == "drive_feedthrough"
    given = {effect.name: SIZES.get(effect.name) or {p.name: p.typical for p in effect.parameters}}
    without = {}
    if effect.name == "quadrature_drive_phase_error":
        without = {"quadrature_drive_phase_error": {"phase_rad": 0.0}}
    if effect.name == "finite_quadrature_gain":
        # the loop itself, for the slow engine, is the control's own; the effect's slow term is what
        # diagnosis uses
        from hrg_cli.physics.plant import Control

        control = Control(forced=True)
        effect.control(effect.values({"gain_1_s": 2.0}), control)
        assert (control.quadrature_loop, control.quadrature_gain_1_s) == ("finite", 2.0)
    beside = (wave(m, without, forced) if without else plain(m, forced) for m in ENGINES)
    fast, slow, plain_fast, plain_slow = envelopes(
        *(wave(m, given, forced) for m in ENGINES), *beside
    )
    changed_fast, changed_slow = fast - plain_fast, slow - plain_slow
    keep = np.ones(len(fast), bool)
    if effect.name in AT_AN_INSTANT:
        keep[abs(np.arange(len(fast)) - 42) < 8] = False  # windows that see both sides of the step
    size = np.sqrt(np.mean(np.abs(changed_fast[keep]) ** 2))
    assert size > 1e-5, "the effect must be visible in this run"
    assert (
        np.sqrt(np.mean(np.abs(changed_fast - changed_slow)[keep] ** 2))
        < TOLERANCE.get(effect.name, USUAL) * size
    )


def test_a_reference_that_leaks_pushes_in_a_free_run_alike_in_both_engines():
    """A force without a drive; and none where it is the drive's."""
    given = {"parasitic_force": SIZES["parasitic_force"] | {"in_free_runs": 1.0}}
    fast, slow, unpushed = envelopes(
        wave("fast", given, False), wave("slow", given, False), plain("fast", False)
    )
    size = np.sqrt(np.mean(np.abs(fast - unpushed) ** 2))
    assert size > 1e-4
    assert np.sqrt(np.mean(np.abs(fast - slow) ** 2)) < USUAL * size
    without = envelopes(wave("fast", {"parasitic_force": SIZES["parasitic_force"]}, False))[0]
    assert np.array_equal(without, unpushed)


@pytest.mark.parametrize("power", (1.0, 3.0, -1.0, -2.0))
def test_a_damping_of_another_power_is_the_same_in_both_engines(power):
    given = {"nonlinear_damping": {"damping_1_s": 0.2, "power": power}}
    fast, slow, plain_fast, plain_slow = envelopes(
        *(wave(m, given, False) for m in ENGINES), *(plain(m, False) for m in ENGINES)
    )
    changed_fast, changed_slow = fast - plain_fast, slow - plain_slow
    assert np.abs(changed_fast).max() > 1e-3
    assert np.abs(changed_fast - changed_slow).max() < 2e-3 * np.abs(changed_fast).max()


@pytest.mark.parametrize("power", (0.5, 1.0, 3.0))
def test_a_damping_of_another_power_is_its_mean_over_a_period(power):
    """Against 2jc⟨|z|^p v e^{−jτ}⟩ over many instants, for lines, slim ellipses and circles."""
    random = np.random.default_rng(5)
    quadrature = np.concatenate([[0.0, 1e-9, 1.0], random.uniform(-1, 1, 47) ** 5])
    angle, phase = random.uniform(0, 2 * np.pi, (2, 50))
    cos, sin = np.cos(angle), np.sin(angle)
    wave = np.stack([cos - 1j * quadrature * sin, sin + 1j * quadrature * cos], -1)
    u = np.exp(1j * phase)[:, None] * wave
    turn = np.exp(1j * np.pi * (np.arange(20000) + 0.5) / 20000)
    z, v = np.real(u[..., None] * turn), np.real(1j * u[..., None] * turn)
    size = np.sum(z**2, axis=-2, keepdims=True) ** (power / 2)
    averaged = (
        2j * np.mean(size * v * np.conj(turn), axis=-1) / nonlinear_damping.compute_mean(power)
    )
    slow = nonlinear_damping.slow({"damping_1_s": 1.0, "power": power}, u, None)
    assert np.abs(slow - averaged).max() < 1e-5


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.name)
def test_neutral_values_do_nothing(effect):
    from hrg_cli.physics.plant import SlowState
    from hrg_cli.physics.resonator import Mechanics

    random = np.random.default_rng(4)
    u = random.standard_normal((5, 2)) + 1j * random.standard_normal((5, 2))
    column = random.uniform(0.1, 1, 5)
    state = SlowState(
        Mechanics(5000.0, 0.3),
        column,
        column,
        column,
        np.sign(column),
        column,
        column,
        u,
        column,
        column,
        3e4,
    )
    p = effect.values()
    assert np.allclose(effect.slow_readout(p, u, effect.slow_environment(p, state)), u, rtol=1e-15)
    assert not np.any(effect.slow(p, u, state))


@pytest.mark.parametrize("order", [1, -1])
def test_parts_of_a_frequency_add_up(order):
    """f = f₀ (1 + αΔT + βΔT² + γt), in whatever order the effects come: no cross terms, which the
    sum of the slow terms has not."""
    warm, t, still = np.array([0.0, 45.0]), np.array([0.0, 1.0]), np.zeros(2)
    mechanics = Mechanics(5000.0, 0.1, frequency_split_rad_s=0.3)
    world = Environment(t, warm, still, warm, still)
    made = make_linear_plant(mechanics, ThermalCourses(), world)
    given = {
        "thermal_frequency": {"relative_1_k": 9e-5, "reference_temperature_degc": 22.0},
        "thermal_frequency_curvature": {
            "relative_1_k2": -4e-8,
            "reference_temperature_degc": 22.0,
        },
        "ageing": {"frequency_1_s": 1e-4},
    }
    for name, values in list(given.items())[::order]:
        effect = effects.find(name)
        effect.plant(effect.values(values), made, world)
    relative = np.sqrt(np.trace(made.stiffness, axis1=1, axis2=2) / 2) / mechanics.omega_rad_s
    sum_of_parts = 1 + 9e-5 * (warm - 22) - 4e-8 * (warm - 22) ** 2 + 1e-4 * t
    np.testing.assert_allclose(relative, sum_of_parts, rtol=1e-10)


def test_a_temperature_that_turns_corners_leaves_the_phase_of_its_whole_change():
    """The grid of a run is uneven at its corners; a slope weighed by the distances there, as is
    exact where nothing bends, missed a thousandth of the turn."""
    soak = follow_levels([20.0, 23.0, 21.0], dwell_s=1.0, transition_s=0.3)
    world = make_environment(soak, hold_value(0.0), 0.0, 4.0, 5e-5)
    assert len(np.unique(np.diff(world.time_s).round(12))) > 2
    mechanics = Mechanics(5000.0, 0.1)
    made = make_linear_plant(mechanics, ThermalCourses(), world)
    effects.find("thermal_gradient").plant(SIZES["thermal_gradient"], made, world)
    omega = np.sqrt(np.trace(made.stiffness, axis1=1, axis2=2) / 2)
    turned = np.concatenate(
        [[0.0], np.cumsum(np.diff(world.time_s) * (omega[1:] + omega[:-1]) / 2)]
    )
    turned -= mechanics.omega_rad_s * world.time_s
    level = (world.time_s > 1.35) & (world.time_s < 2.25) | (world.time_s > 2.65)
    whole = mechanics.omega_rad_s * SIZES["thermal_gradient"]["frequency_s_k"]
    due = whole * (world.temperature_degc[level] - 20.0)
    assert np.allclose(turned[level], due, rtol=1e-6)


def test_the_slow_lag_undoes_the_thermometers():
    """Fast: the log is the true temperature through the lag. Slow: the true temperature from the
    log and its slope."""
    import dataclasses

    from hrg_cli.effects import find
    from hrg_cli.physics.plant import Environment, SlowState
    from hrg_cli.physics.resonator import Mechanics

    effect, p = find("thermal_lag"), {"time_constant_s": 0.5}
    t = np.linspace(0, 10, 4001)
    true = 20 + np.sin(1.3 * t)
    world = Environment(t, true, 0 * t, true.copy(), 0 * t)
    effect.environment(p, world)
    assert np.abs(world.logged_temperature_degc - true).max() > 0.3
    state = SlowState(
        Mechanics(5000.0, 0.3),
        t,
        world.logged_temperature_degc,
        np.gradient(world.logged_temperature_degc, t),
        *[0 * t] * 6,
        3e4,
    )
    assert dataclasses.asdict(effect.slow_environment(p, state))["temperature_degc"][
        5:-5
    ] == pytest.approx(true[5:-5], abs=1e-3)


def test_pages_name_what_a_physicist_looks_for():
    for effect in EFFECTS:
        page = " ".join(effects.format_page(effect.name).split())
        for word in (
            "Physics:",
            "Equation:",
            "Size:",
            "Mistaken for:",
            "What separates it",
            "Next experiment:",
        ):
            assert word in page, f"{effect.name}: its page lacks {word}"


def test_airy_precession_of_the_inertial_nonlinearity():
    """PHYSICS §7: a spherical pendulum precesses by 3/8·ω·a_A·a_B/ℓ² and slows by ω(a_A² +
    a_B²)/16ℓ² (a_A, a_B small)."""
    from hrg_cli.effects import find
    from hrg_cli.physics.plant import SlowState
    from hrg_cli.physics.resonator import Mechanics

    effect, mechanics = (
        find("inertial_nonlinearity"),
        Mechanics(1 / 9, 0.0, scale_factor=1.0, mode_number=1),
    )
    a, b, curvature = 1.0, 1e-3, 1e-7
    u = ellipse.compute_envelopes(np.array(a), np.array(b), np.array(0.3), np.array(0.0), 1)
    zero = np.zeros(())
    du = effect.slow(
        {"inverse_length_squared": curvature},
        u,
        SlowState(mechanics, *[zero] * 6, u, zero, zero, mechanics.omega_rad_s),
    )
    e_A, e_B = np.array([np.cos(0.3), np.sin(0.3)]), np.array([-np.sin(0.3), np.cos(0.3)])
    omega = mechanics.omega_rad_s
    assert np.imag(e_A @ du) / a == pytest.approx(-omega * a**2 * curvature / 16, rel=1e-5)
    # e_B·u' = a θ̇ − j(ȧ_B + a_B jφ̇…): the turning is its real part less what the phase rate gives
    # to −j a_B
    turning = (np.real(e_B @ du) - b * np.imag(e_A @ du) / a) / a
    assert abs(turning) == pytest.approx(3 / 8 * omega * a * b * curvature, rel=1e-4)
