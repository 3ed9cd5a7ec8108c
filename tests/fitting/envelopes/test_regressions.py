"""Seed A's methods: each recovers the resonator within its errors and its known bias; the errata
show as they should."""

import numpy as np
import pytest
from synthetic_waves import GYRO, programme, run_down

from hrg_cli.fitting.envelopes import (
    coordinates,
    envelope_runs,
    free_windows,
    propagator,
    regressions,
    rotation_integrals,
    seed_a_methods,
    two_modes,
    working_mode,
)
from hrg_cli.fitting.envelopes.base_fit import fit_base_model, start_from_propagator
from hrg_cli.fitting.envelopes.base_freedom import Known, make_freedom
from hrg_cli.physics import ellipse, resonator
from hrg_cli.physics.resonator import Mechanics

TRUE = coordinates.from_mechanics(GYRO)
APPROXIMATE = ("moving-axes-small-quadrature", "fixed-axes-groups", "frozen-axes")
EXACT = [m for m in seed_a_methods.METHODS if m not in APPROXIMATE]


def thin(waves, blocks=300):
    runs = [envelope_runs.from_wave(w) for w in waves]
    p, offsets, _, space = start_from_propagator(runs, Known())
    return [
        envelope_runs.retune(r, o)
        for r, o in zip(propagator.thin_rows(runs, p, offsets, blocks), offsets)
    ], space


@pytest.fixture(scope="module")
def clean():
    return thin(programme(std=1e-7, ratio=0.1))


@pytest.fixture(scope="module")
def noisy():
    return thin(programme(std=1e-3, ratio=0.05, seed=3))


@pytest.mark.parametrize("method", EXACT)
def test_without_noise_only_the_differencing_is_left(method, clean):
    answer = regressions.solve(*clean, method)
    tolerance = 2e-6 if method in ("increments", "stokes") else 1e-4
    assert np.allclose(answer.p[:6], TRUE[:6], atol=tolerance)


@pytest.mark.parametrize("method", EXACT)
def test_with_noise_within_its_own_errors(method, noisy):
    answer = regressions.solve(*noisy, method)
    std = np.sqrt(np.diag(answer.covariance))[:6]
    assert np.all(np.abs(answer.p[:6] - TRUE[:6]) < 5 * std)


@pytest.mark.parametrize("method", EXACT)
def test_stated_errors_are_the_scatter(method):
    """Over draws of the noise (error/σ)² is χ², although neighbouring differences share their
    noise."""
    space = make_freedom(Known(), TRUE, 2, 4.0)
    squares = []
    for seed in range(8):
        waves = [
            run_down(a, w, std=1e-2, window=2e-2, ratio=0.1, seed=100 * seed + i, second_order=0.0)
            for i, (a, w) in enumerate([(0.1, 1.0), (0.5, -1.0)])
        ]
        answer = regressions.solve([envelope_runs.from_wave(w) for w in waves], space, method)
        squares.append((answer.p - TRUE)[:6] ** 2 / np.diag(answer.covariance)[:6])
    assert 0.35 < np.mean(squares) < 2.2  # χ² of 48 within 1e-5 of either side


def test_groups_without_a_row_are_refused():
    """A wave that is nowhere between the electrodes' axes, nor on one: both groups are empty."""
    wave = run_down(0.1, 0.0, ratio=0.6, std=1e-5)
    answer = regressions.solve(*thin([wave]), "fixed-axes-groups")
    assert "no row of these runs" in answer.refused and not np.isfinite(answer.p).any()


def test_increments_and_stokes_come_near_the_bound(noisy):
    """Integrated along the run they lose little against the likelihood."""
    runs, space = noisy
    bound = np.sqrt(np.diag(fit_base_model(runs, blocks=300).compute_covariance_z()))[:6]
    for method in ("increments", "stokes"):
        assert np.all(
            np.sqrt(np.diag(regressions.solve(runs, space, method).covariance))[:6] < 2 * bound
        )


def test_derivatives_cost_against_increments(noisy):
    by_derivatives = regressions.solve(*noisy, "moving-axes")
    by_increments = regressions.solve(*noisy, "increments")
    assert (
        np.median(
            np.sqrt(np.diag(by_derivatives.covariance)[:6] / np.diag(by_increments.covariance)[:6])
        )
        > 3
    )


def test_eliminating_the_rate_halves_the_damping_split():
    """Without a frequency split, at rest: seed A (17) with KΩ := −mθ' gives δμ/2 with the right
    axis."""
    gyro = Mechanics(5000.0, 0.3, 0.03, 0.35, 0.0, 0.0, 0.55)
    runs, space = thin(
        [
            run_down(a, mechanics=gyro, std=1e-7, ratio=0.0, seed=i)
            for i, a in enumerate(np.arange(4) * np.pi / 8)
        ]
    )
    wrong = regressions.solve(runs, space, "fixed-axes", eliminate_rate=True)
    right = regressions.solve(runs, space, "fixed-axes")
    for answer, size in ((right, 0.03), (wrong, 0.015)):
        assert np.hypot(*answer.p[1:3]) == pytest.approx(size, rel=1e-2)
        assert np.arctan2(answer.p[2], answer.p[1]) / 4 == pytest.approx(0.35, abs=1e-3)
    assert any("halved" in w for w in wrong.warnings)


def test_small_quadrature_is_biased_and_says_so():
    runs, space = thin(programme(std=1e-5, ratio=0.3))
    answer = regressions.solve(runs, space, "moving-axes-small-quadrature")
    assert np.abs(answer.p[0] - TRUE[0]) > 0.005 * TRUE[0]
    assert any("biased" in w for w in answer.warnings)


def test_frozen_axes_of_waves_that_hardly_turn():
    """Seed A, fourth remark after (17): right to the turn of mθ; said where the wave turns more."""
    gyro = Mechanics(5000.0, 0.3, 0.006, 0.35, 0.02, 0.9, 0.55)
    waves = [
        run_down(a, rate, mechanics=gyro, std=1e-6, ratio=0.0, seed=i)
        for i, (a, rate) in enumerate([(0.1, 0.01), (0.5, -0.01), (0.9, 0.0), (1.3, 0.0)])
    ]
    runs, space = thin(waves)
    answer = regressions.solve(runs, space, "frozen-axes")
    assert not any("frozen" in w for w in answer.warnings)
    true = coordinates.from_mechanics(gyro)
    assert answer.p[0] == pytest.approx(true[0], rel=1e-3)
    assert (
        np.hypot(*(answer.p[1:3] - true[1:3])) < 0.15 * 0.006
        and np.hypot(*(answer.p[3:5] - true[3:5])) < 0.15 * 0.02
    )
    assert any(
        "use moving-axes" in w
        for w in regressions.solve(*thin(programme(std=1e-5)), "frozen-axes").warnings
    )


def test_two_groups_of_data_see_the_splits_through_the_rounding():
    """Seed A, second remark after (17), with a small quadrature: ν, both splits and K to a
    tenth."""
    gyro = Mechanics(5000.0, 0.3, 0.03, 0.35, 0.05, 0.9, 0.55)
    waves = [
        run_down(a, rate, mechanics=gyro, std=1e-6, ratio=0.0, seed=i)
        for i, (a, rate) in enumerate([(0.1, 1.0), (0.5, -1.0), (0.9, 0.5)])
    ]
    answer = regressions.solve(*thin(waves), "fixed-axes-groups")
    true = coordinates.from_mechanics(gyro)
    assert answer.p[[0, 5]] == pytest.approx(true[[0, 5]], rel=0.02)
    assert (
        np.hypot(*(answer.p[1:3] - true[1:3])) < 0.15 * 0.03
        and np.hypot(*(answer.p[3:5] - true[3:5])) < 0.15 * 0.05
    )
    assert any("drops the smaller" in w for w in answer.warnings)


def test_a_wave_lost_in_noise_is_said():
    runs, space = thin(programme(std=0.1, window=2e-2), blocks=200)
    assert any(
        "below 10 standard deviations" in w
        for w in regressions.solve(runs, space, "products").warnings
    )
    runs, space = thin(programme(std=0.01, window=2e-2), blocks=200)
    assert not regressions.solve(runs, space, "products").warnings


def test_circular_orbits_leave_only_the_methods_without_axes():
    runs, space = thin(programme(std=1e-4, ratio=0.97))
    assert "elongated" in regressions.solve(runs, space, "moving-axes").refused
    answer = regressions.solve(runs, space, "stokes")
    assert np.all(np.abs(answer.p[:6] - TRUE[:6]) < 5 * np.sqrt(np.diag(answer.covariance))[:6])


def test_rotation_integrals_need_a_full_turn_and_then_recover():
    gyro = Mechanics(5000.0, 0.3, 0.03, 0.35, 0.11, 0.9, 0.55)
    refused = rotation_integrals.solve(thin([run_down(0.1, 0.2, mechanics=gyro, std=1e-4)])[0])
    assert "full period" in refused.refused
    runs, _ = thin(
        [
            run_down(0.1, rate, mechanics=gyro, std=1e-4, seconds=8.0, seed=i)
            for i, rate in enumerate((3.0, -3.0))
        ]
    )
    answer = rotation_integrals.solve(runs)
    true = coordinates.from_mechanics(gyro)
    assert np.all(
        np.abs(answer.p[:6] - true[:6]) < 5 * np.sqrt(np.diag(answer.covariance))[:6] + 5e-5
    )


def forced(kind, rate=0.1, seconds=300.0, std=1e-5, seed=0):
    """Envelopes of a slowly turning wave whose main amplitude is held by a force or by a ring
    electrode's pump (exact steps)."""
    gyro = Mechanics(5000.0, 0.3, 0.02, 0.35, 0.06, 0.9, 0.55)
    rng = np.random.default_rng(seed)
    n, dt = 6000, seconds / 6000
    step = resonator.exponentiate(resonator.build_generator(gyro, rate, second_order=0.0), dt / 2)
    u, out = (
        ellipse.compute_envelopes(1.0, 0.0, 0.1, 0.0).astype(complex),
        np.empty((n, 2), complex),
    )
    for k in range(n):
        u = step @ u
        a, b, theta, phi = (float(x) for x in ellipse.find_wave(u))
        target = 1.0
        b = (
            b * a / target if kind == "parametric" else b
        )  # a pump damps B as it feeds A; a force leaves it
        u = step @ ellipse.compute_envelopes(target, b, theta, phi)
        out[k] = u
    times = (np.arange(n) + 1) * dt
    noise = std * (rng.standard_normal((n, 2)) + 1j * rng.standard_normal((n, 2)))
    turn = rate * times
    return gyro, envelope_runs.EnvelopeRun(
        "f", times, out + noise, np.full(n, std), turn, None, 5000.0, 2, dt
    )


@pytest.mark.parametrize(("kind", "factor"), [("force", 1.0), ("parametric", 2.0)])
def test_working_mode_finds_the_frequency_split_and_the_kind_of_drive(kind, factor):
    gyro, run = forced(kind)
    found = working_mode.monitor([run])
    true = coordinates.from_mechanics(gyro)
    assert found.value[0] == pytest.approx(factor * 0.3, rel=0.06)
    assert np.allclose(
        found.value[1:3],
        true[3:5],
        atol=5 * np.sqrt(np.diag(found.covariance))[1:3].max() + 0.02 * 0.06,
    )
    assert found.trap_1_s_per_mhz == pytest.approx(2 * np.pi * 1e-3 / (2 * found.quadrature_rms))
    axes = working_mode.find_stiffness_axes([run], 2, found.value[0])
    assert len(axes) > 3 and all(
        min(abs(a - 0.9), abs(abs(a - 0.9) - np.pi / 2)) < 0.03 for a, _ in axes
    )


@pytest.mark.parametrize("kind", ["force", "parametric"])
@pytest.mark.parametrize("rate", [0.1, 0.4])
def test_one_axis_from_all_crossings_at_any_rate(rate, kind):
    """The lag of the quadrature, arctan(2mθ'/λ), is 20° and 55° of ζ (force); within it the axis is
    found."""
    gyro, run = forced(kind, rate, std=1e-4)
    decay = working_mode.monitor([run]).value[0]
    found = working_mode.combine_axes(working_mode.find_stiffness_axes([run], 2, decay), 2)
    assert found["crossings"] > 4
    off = np.mod(found["value"] - gyro.stiffness_axis_rad + np.pi / 4, np.pi / 2) - np.pi / 4
    assert abs(off) < 0.01 and abs(off) < 4 * found["std"]
    assert working_mode.combine_axes([], 2) is None


def test_phase_equation_gives_the_damping_split_where_quadrature_is_large():
    gyro, run = forced("force", std=1e-6)
    found = working_mode.monitor([run])
    error = found.value[3:] - coordinates.from_mechanics(gyro)[1:3]
    assert np.all(np.abs(error) < 5 * np.sqrt(np.diag(found.covariance))[3:] + 0.1 * 0.02)


def test_free_windows_from_the_drive_and_from_the_decay_itself():
    wave = run_down(
        0.3,
        std=1e-4,
        seconds=20.0,
        window=5e-3,
        mechanics=Mechanics(5000.0, 0.31, 0.012, 0.35, 0.11, 0.9, 0.55),
    )
    n = len(wave)
    drive = np.ones(n)
    drive[1000:2000] = drive[2600:3400] = 0.0
    windows = free_windows.cut_free_windows(wave.replace(mode="forced", drive_main=drive))
    assert [(w.time_s[0], w.time_s[-1]) for w in windows] == [
        (wave.time_s[a], wave.time_s[b]) for a, b in ((1003, 1996), (2603, 3396))
    ]
    held = np.ones(n)
    held[1000:2000] = np.exp(-0.31 * (wave.time_s[1000:2000] - wave.time_s[1000]))
    held += 1e-4 * np.random.default_rng(0).standard_normal(n)
    (window,) = free_windows.cut_free_windows(wave.replace(mode="forced", main_amplitude=held))
    assert 1000 <= np.searchsorted(wave.time_s, window.time_s[0]) < 1100
    assert 1900 < np.searchsorted(wave.time_s, window.time_s[-1]) <= 2000
    assert len(free_windows.cut_free_windows(wave)) == 1


def test_most_different_windows():
    runs = [
        envelope_runs.from_wave(run_down(a, w, std=1e-4, seconds=1.0, seed=i))
        for i, (a, w) in enumerate([(0.1, 0), (0.11, 0), (0.5, 0), (0.12, 0), (0.1, 2.0)])
    ]
    chosen = free_windows.choose_different(runs, 3)
    assert 2 in chosen and 4 in chosen and len(chosen) == 3


def test_two_modes_in_one_channel():
    rng = np.random.default_rng(4)
    t = np.arange(1000) * 5e-3
    signal = np.exp((-0.5 + 9j) * t) + 0.4 * np.exp((-0.8 - 8j) * t + 1j)
    noise = 1e-3 * (rng.standard_normal((1000, 2)) + 1j * rng.standard_normal((1000, 2)))
    run = envelope_runs.EnvelopeRun(
        "one",
        t,
        signal[:, None] * np.array([1.0, -0.3]) + noise,
        np.full(1000, 1e-3),
        0 * t,
        None,
        1000.0,
        2,
        5e-3,
    )
    u, _ = two_modes.merge_channels(run)
    modes, single = two_modes.identify(run, u, 2), two_modes.identify(run, u, 1)
    assert two_modes.are_resolved(modes, single)
    assert np.all(np.abs(modes.exponent - np.array([-0.5 + 9j, -0.8 - 8j])) < 5 * modes.std)
    assert modes.chi2_per_dof == pytest.approx(1, abs=0.15)
    two_signals = envelope_runs.from_wave(run_down(0.3, std=1e-4))
    assert two_modes.merge_channels(two_signals) is None
