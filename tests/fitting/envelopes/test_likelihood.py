"""The likelihood's propagation against direct exponentials and integration, its Jacobian against
differences, and its statistics."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from synthetic_waves import GYRO, programme, run_down

from hrg_cli.fitting.envelopes import coordinates, envelope_runs, phase_course, propagator
from hrg_cli.fitting.envelopes.base_fit import fit_base_model, start_from_propagator
from hrg_cli.fitting.envelopes.base_freedom import Known
from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
from hrg_cli.fitting.envelopes.matrices import chain
from hrg_cli.fitting.envelopes.resampling import profile
from hrg_cli.fitting.envelopes.response import State, make_batch, respond
from hrg_cli.physics import resonator
from hrg_cli.physics.resonator import Mechanics


def runs_of(waves):
    return [envelope_runs.from_wave(w) for w in waves]


def test_coordinates_are_the_generator_of_the_resonator():
    p = coordinates.from_mechanics(GYRO)
    for rate in (0.0, 3.0, -7.0):
        want = resonator.build_generator(GYRO, rate)
        assert np.allclose(
            coordinates.build_generator(p, np.array(rate), GYRO.omega_rad_s), want, atol=3e-9
        )
        plain = resonator.build_generator(GYRO, rate, second_order=0.0)
        assert np.allclose(
            coordinates.build_generator(np.append(p[:6], 0.0), np.array(rate), GYRO.omega_rad_s),
            plain,
            atol=1e-12,
        )
    values, slopes = coordinates.to_parameters(p, 2)
    assert np.allclose(values, [0.31, 0.012, 0.35, 0.11, 0.9, 0.55])
    for k in range(6):
        q = p.copy()
        q[k] += 1e-7
        assert np.allclose(
            (coordinates.to_parameters(q, 2)[0] - values) / 1e-7, slopes[:, k], atol=1e-4
        )


def test_the_axis_of_a_split_lost_in_noise_is_as_uncertain_as_its_components():
    rng = np.random.default_rng(3)
    for components, stds in (
        ([2.0, 1.0], [0.01, 0.02]),
        ([0.2, 1.0], [0.05, 1.0]),
        ([2.0, -2.2], [1.0, 1.0]),
    ):
        covariance = np.diag(np.square(stds))
        draws = np.array(components) + np.array(stds) * rng.standard_normal((200_000, 2))
        turned = np.angle((draws[:, 0] + 1j * draws[:, 1]) * complex(components[0], -components[1]))
        want = min(np.sqrt(np.mean(turned**2)) / 4, np.pi / 2 / np.sqrt(12))
        assert coordinates.compute_axis_spread(
            np.array(components), covariance, 2
        ) == pytest.approx(want, rel=0.05)


def test_chain_is_the_running_product():
    rng = np.random.default_rng(0)
    steps = rng.standard_normal((3, 17, 2, 2)) + 1j * rng.standard_normal((3, 17, 2, 2))
    got = np.stack(chain(tuple(steps[..., i, k] for i in (0, 1) for k in (0, 1))), axis=-1).reshape(
        3, 18, 2, 2
    )
    for run in range(3):
        product = np.eye(2)
        for k in range(17):
            assert np.allclose(got[run, k], product, rtol=1e-10)
            product = steps[run, k] @ product


@pytest.mark.parametrize("rate", [0.0, 2.0, lambda t: 6 * np.sin(3 * t) + 1])
def test_model_against_integration(rate):
    """An independent integrator of u' = L(t) u, uneven rows and two runs of different lengths in
    one batch."""
    rng = np.random.default_rng(2)
    wave = run_down(0.3, rate, std=1e-12, seconds=2.0)
    keep = np.sort(rng.choice(len(wave), 600, replace=False))
    runs = [
        runs_of([wave])[0].select_rows(keep),
        runs_of([run_down(0.7, rate, std=1e-12, seconds=1.0)])[0],
    ]
    data = make_batch(runs)
    response = respond(
        data,
        State(coordinates.from_mechanics(GYRO), data.envelope[:, 0], np.array([[0.3], [-0.2]])),
    )

    def L(t):
        return resonator.build_generator(GYRO, rate(t) if callable(rate) else rate)

    for number, run in enumerate(runs):
        t0 = run.time_s[0]
        answer = solve_ivp(
            lambda t, u: L(t) @ u,
            (t0, run.time_s[-1]),
            run.envelope[0],
            t_eval=run.time_s,
            rtol=1e-10,
            atol=1e-12,
            method="DOP853",
        ).y.T
        x = (run.time_s - t0) / (run.time_s[-1] - t0)
        want = answer * np.exp(1j * (0.3 if number == 0 else -0.2) * x)[:, None]
        assert np.allclose(
            response.model[number, : len(run)], want, atol=3e-5 if callable(rate) else 2e-6
        )  # the rate between rows is interpolated
    if rate == 0.0:
        step = runs[0].time_s[100] - runs[0].time_s[0]
        assert np.allclose(
            response.model[0, 100],
            np.exp(0.3j * step / runs[0].duration_s) * expm(L(0) * step) @ runs[0].envelope[0],
            atol=1e-10,
        )


def test_jacobian_against_differences():
    data = make_batch(
        propagator.thin_rows(
            runs_of(
                [run_down(0.3, lambda t: 2 * np.sin(3 * t) + 1), run_down(0.7, 0.0, seconds=2.0)]
            ),
            np.zeros(7),
            np.zeros(2),
            150,
        )
    )
    p = coordinates.from_mechanics(GYRO)
    state = State(p, data.envelope[:, 0], np.array([[0.1, 0.2], [0.3, 0.0]]))
    response = respond(data, state)
    got = response.find_coordinate_sensitivities()
    for k in range(7):
        size = 1e-4 if k < 6 else 1.0
        up, down = (
            respond(data, State(p + s * size * np.eye(7)[k], state.start, state.phase)).model
            for s in (1, -1)
        )
        want = (up - down) / (2 * size)
        assert np.abs(got[k] - want).max() < 2e-3 * np.abs(want).max() + 1e-9, (
            coordinates.COORDINATES[k]
        )
    own = response.find_run_sensitivities()
    moved = state.phase.copy()
    moved[:, 1] += 1e-6
    assert np.allclose(
        (respond(data, State(p, state.start, moved)).model - response.model) / 1e-6,
        own[5],
        atol=1e-5,
    )


def test_a_changed_rate_against_differences():
    run = runs_of([run_down(0.3, 1.0)])[0]
    data = make_batch(propagator.thin_rows([run], np.zeros(7), np.zeros(1), 400))
    p = coordinates.from_mechanics(GYRO)
    state = State(p, data.envelope[:, 0], np.zeros((1, 1)))
    t = data.time_s[0]
    shape = [np.sin(2 * x)[None, None] for x in (t[:-1], (t[:-1] + t[1:]) / 2, t[1:])]
    got = respond(data, state).find_turning_sensitivity(*(p[5] * h for h in shape))[0]
    turned = [
        dataclasses.replace(
            data.runs[0], turn_rad=data.runs[0].turn_rad + sign * 1e-4 * (1 - np.cos(2 * t)) / 2
        )
        for sign in (1, -1)
    ]
    up, down = (respond(make_batch([r]), state).model for r in turned)
    assert np.allclose((up - down) / 2e-4, got, atol=2e-4 * np.abs(got).max())


def test_steady_runs_take_the_short_way_to_the_same_place():
    """A rate a whisker from constant goes step by step and must arrive where the closed form
    does."""
    runs = runs_of([run_down(0.3, 2.0, seconds=2.0), run_down(0.7, 0.0, seconds=1.0)])
    wobble = [dataclasses.replace(r, turn_rad=r.turn_rad + 1e-8 * np.sin(r.time_s)) for r in runs]
    p = coordinates.from_mechanics(GYRO)
    steady, stepped = make_batch(runs), make_batch(wobble)
    assert steady.steady_rate is not None and stepped.steady_rate is None
    state = State(p, steady.envelope[:, 0], np.zeros((2, 1)))
    short, long = respond(steady, state), respond(stepped, state)
    assert np.allclose(short.model, long.model, atol=1e-7)
    assert np.allclose(
        short.find_coordinate_sensitivities(), long.find_coordinate_sensitivities(), atol=1e-6
    )


def test_averaging_along_the_motion_keeps_the_model_and_the_noise():
    run = runs_of([run_down(0.3, 3.0, std=1e-9, window=5e-4, second_order=0.0)])[0]
    p = coordinates.from_mechanics(GYRO)
    thin = envelope_runs.average_rows(run, 60, propagator.make_propagator(p, 0.0))
    L = resonator.build_generator(GYRO, 3.0, second_order=0.0)
    want = resonator.exponentiate(L, thin.time_s - run.time_s[0]) @ run.envelope[0]
    assert len(thin) <= 60 and np.allclose(thin.envelope, want, atol=2e-5)
    noisy = runs_of([run_down(0.3, 3.0, std=1e-2, window=5e-4, seed=5, second_order=0.0)])[0]
    averaged = envelope_runs.average_rows(noisy, 60, propagator.make_propagator(p, 0.0))
    clean = resonator.exponentiate(L, averaged.time_s - run.time_s[0]) @ run.envelope[0]
    phase = np.vdot(clean, averaged.envelope) / np.vdot(clean, clean)
    chi2 = np.mean(np.abs((averaged.envelope - clean * phase) / averaged.std[:, None]) ** 2) / 2
    assert chi2 == pytest.approx(1.0, abs=4 * np.sqrt(2 / 240))


def test_averaged_rows_hold_the_table_where_a_swinging_rate_has_turned_it_to():
    """Rows of one window and of two: a straight line between two windows misses the turn in their
    middle by Ω'h²/8, 6e-5 rad here."""
    run = runs_of([run_down(0.3, 0.0, seconds=1.0, window=6e-3)])[0]
    t, swing, pace = run.time_s, 2.0, 9.0
    run = dataclasses.replace(run, turn_rad=swing / pace * (np.cos(pace * t[0]) - np.cos(pace * t)))
    thin = envelope_runs.average_rows(run, 120, propagator.make_propagator(np.zeros(7), 0.0))
    assert len(thin) <= 120 < len(run)
    want = swing / pace * (np.cos(pace * t[0]) - np.cos(pace * thin.time_s))
    assert np.abs(thin.turn_rad - want).max() < 1e-6


def test_gaps_and_flagged_windows_change_nothing_but_the_errors():
    waves = programme(std=1e-4)
    rng = np.random.default_rng(3)
    holed = []
    for wave in waves:
        flags = np.zeros(len(wave), "u1")
        flags[500:900] = 2
        flags[rng.choice(len(wave), 200)] = 1
        broken = wave.main_amplitude.copy()
        broken[flags > 0] = np.nan
        holed.append(wave.replace(flags=flags, main_amplitude=broken))
    whole, cut = fit_base_model(runs_of(waves)), fit_base_model(runs_of(holed))
    std = np.sqrt(np.diag(cut.compute_covariance_z()))
    assert cut.converged and cut.chi2 / cut.dof == pytest.approx(1, abs=0.1)
    assert np.all(np.abs(cut.z - whole.z) < 4 * std)


@pytest.mark.parametrize("second_order", [0.0, 1.0])
def test_second_order_nuisance_serves_both_kinds_of_data(second_order):
    fit = fit_base_model(runs_of(programme(std=5e-5, second_order=second_order)))
    true = coordinates.from_mechanics(GYRO)
    std = np.sqrt(np.diag(fit.compute_covariance_z()))
    assert np.all(np.abs(fit.p - np.append(true[:6], second_order))[:6] < 4.5 * std[:6])
    assert fit.chi2 / fit.dof == pytest.approx(1, abs=0.08)


def test_known_axes_leave_the_sizes_free():
    fit = fit_base_model(
        runs_of(programme(std=1e-3)), Known(damping_axis_rad=0.35, stiffness_axis_rad=0.9)
    )
    values, _ = coordinates.to_parameters(fit.p, 2)
    assert values[2] == pytest.approx(0.35) and values[4] == pytest.approx(0.9)
    assert fit.freedom.names == (
        "damping",
        "damping_cos",
        "split_cos",
        "scale_factor",
        "second_order",
    )
    assert abs(values[1] - 0.012) < 5 * np.sqrt(fit.compute_covariance_z()[1, 1])


def test_frequency_drift_is_followed():
    waves = []
    for wave in programme(std=1e-4):
        x = wave.time_s / 4
        waves.append(wave.replace(phase_rad=wave.phase_rad + 3 * x**2 - 1.5 * x**3))
    fit = fit_base_model(runs_of(waves))
    assert fit.response.state.phase.shape[1] >= 3 and fit.chi2 / fit.dof < 1.1
    std = np.sqrt(np.diag(fit.compute_covariance_z()))
    assert np.all(np.abs(fit.p - coordinates.from_mechanics(GYRO))[:6] < 4.5 * std[:6])


def test_propagator_alone_is_close_and_needs_no_start():
    gyro = Mechanics(1000.0, 0.05, 0.004, 0.3, 4.0, 1.0, 0.277)
    runs = runs_of(programme(gyro, std=1e-3, seconds=8.0, window=4e-3))
    p, offsets, _, _ = start_from_propagator(runs, Known())
    assert np.allclose(p[[0, 5]], [0.05, 0.277], rtol=0.02)
    assert np.hypot(p[3], p[4]) == pytest.approx(4.0, rel=0.01)
    assert np.all(np.abs(offsets) < 0.01)


def beating(half_split_turns, noise=1e-3, rows=25_000, seconds=5000.0):
    """A run at rest near one of its stiffness axes, its two frequencies apart by some beats a run."""
    rng = np.random.default_rng(int(half_split_turns))
    time = np.arange(rows) * seconds / rows
    split, start, axis = half_split_turns / seconds, rng.uniform(0, 1.5), 1.1
    along = np.array([[np.cos(axis / 2), -np.sin(axis / 2)], [np.sin(axis / 2), np.cos(axis / 2)]])
    modes = along.T @ (0.9 * np.array([np.cos(2 * start), np.sin(2 * start)]))
    turning = np.exp(np.outer(time, [-1 / seconds + 1j * split, -1 / seconds - 1j * split]))
    envelope = (modes * turning) @ along.T * np.exp(0.3j * split * time)[:, None]
    envelope += noise * (rng.standard_normal((rows, 2)) + 1j * rng.standard_normal((rows, 2)))
    std, at_rest = np.full(rows, noise), np.zeros(rows)
    return EnvelopeRun("beats", time, envelope, std, at_rest, None, 5e3, 2, seconds / rows), split


@pytest.mark.parametrize("turns", [3, 100, 550, 1000, 1500, 2500])
def test_runs_that_beat_some_hundred_times_are_followed(turns):
    """A first guess that knows no split averaged the beats away, or took 2 rad of it for none: a run
    of 550 rad could not be fitted."""
    run, split = beating(turns)
    fit = fit_base_model([run], Known(scale_factor=0.55))
    assert 0.9 < fit.chi2 / fit.dof < 1.1
    std = np.sqrt(np.diag(fit.compute_covariance_z()))
    assert abs(fit.p[0] - 1 / run.duration_s) < 4.5 * std[0]
    assert abs(np.hypot(*fit.p[3:5]) - split) < 4.5 * np.max(std[3:5])


def test_modes_that_decay_unequally_need_no_course_taken_off(monkeypatch):
    """Over eight decay times the frequency goes from between the modes to the lasting one, 9 rad of
    phase: taken off as a course it left χ² of 3e5 at every start, and a tenfold time to mend that."""
    gyro = Mechanics(5003.7, 0.05, 0.004, 0.35, 0.11, 0.9, 0.55)
    (wave,) = programme(gyro, runs=((0.3, 0.0),), std=1.5e-4, seconds=160.0, window=4e-3)
    runs = runs_of([wave])
    monkeypatch.setattr(
        phase_course, "straighten_phases", lambda *_: pytest.fail("a course was taken off")
    )
    assert phase_course.find_bends(runs, 0.0) is not None
    fit = fit_base_model(runs, Known(scale_factor=0.55))
    assert fit.chi2 / fit.dof < 1.2
    std = np.sqrt(np.diag(fit.compute_covariance_z()))
    want = coordinates.from_mechanics(gyro)
    assert np.all(np.abs(fit.p[:5] - want[:5]) < 4.5 * std[:5])


def test_a_single_free_number_has_a_profile():
    """Held, it leaves nothing free; of a linear fit the ends are ±1 and ±1.96 σ."""
    t = np.linspace(0.0, 10.0, 101)
    u = np.outer(np.exp(-0.1 * t), [1, 0j])
    run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1)
    space = free_coordinates(["damping"], np.zeros(7))
    best = fit(make_batch([run]), space, np.array([0.1]), u[:1], np.zeros((1, 1)))
    std = float(np.sqrt(best.compute_covariance_z()[0, 0]))
    ends = profile(best, 2, {"damping_rate_1_s": std}, 1.0)["damping_rate_1_s"]
    found = (np.array([*ends["68"], *ends["95"]]) - 0.1) / std
    assert found == pytest.approx([-1, 1, -1.96, 1.96], abs=0.02)


@pytest.mark.parametrize("step_rad", [0.0, 0.2, 1.4])
def test_the_first_guess_of_the_scale_factor_does_not_hang_on_the_phase(step_rad):
    """Rows apart by a phase of δ made K low by cos δ."""
    t = np.arange(0.0, 20.0, 0.1)
    u = (
        np.stack([np.cos(0.03 * t), -np.sin(0.03 * t)], axis=1)
        * np.exp(10j * step_rad * t)[:, None]
    )
    run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0.1 * t, None, 5e3, 2, 0.1)
    assert propagator.estimate_scale_factor([run]) == pytest.approx(0.3, rel=1e-4)
