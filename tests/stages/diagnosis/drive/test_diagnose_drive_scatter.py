"""The scatter of a drive's log: loops on noisy envelopes, integrated tick by tick with their exact
propagator, whose commands are logged as means or as single values.

Single values of a noisy command miss what the drive did between them, and the wave walks beside
its prediction: errors must then be those that the fit states, and stay so for a log of means.
"""

from dataclasses import replace

import numpy as np
import pytest

from hrg_cli.effects.effect import find_frame
from hrg_cli.fitting.causes import extended_fit
from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors
from hrg_cli.fitting.causes.designs import Softened
from hrg_cli.fitting.causes.extended_fit import compute_unsettled_part
from hrg_cli.fitting.causes.fit_point import Point
from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
from hrg_cli.fitting.causes.sensitivities import find_base_sensitivities
from hrg_cli.fitting.envelopes import coordinates
from hrg_cli.fitting.samples.course import average_over_windows, estimate_means, integrate_means
from hrg_cli.physics.resonator import exponentiate
from hrg_cli.stages.diagnosis.closing import closing_checks as closing
from hrg_cli.stages.diagnosis.drive import scatter as drive_scatter
from hrg_cli.stages.diagnosis.drive.scatter import Scatter
from hrg_cli.stages.diagnosis.extended.run_changes import find_change
from hrg_cli.stages.diagnosis.samples import tone_search

P = np.array([1.5, 0.1, 0.05, 0.9, -0.4, 0.55, 0.0])
RATES = np.array([3.0, -3.0, 1.5])
RUNS, ROWS, TICKS, LENGTH_S, NOISE = len(RATES), 100, 16, 1.5, 3e-5
TICK_S, ROW_S = LENGTH_S / ROWS / TICKS, LENGTH_S / ROWS
GAINS_1_S = (20.0, 30.0)
MEANS, VALUES = np.arange(TICKS), np.array([3, 12])


def loops(draws, loop_noise, seed):
    """Envelopes at the rows' middles (D, R, n, 2), and the commands of every tick (D, R, n, ticks,
    2): amplitude held by one loop, quadrature by another, both on noisy amplitudes."""
    random = np.random.default_rng(seed)
    half = exponentiate(coordinates.build_generator(P, RATES, 1.0), TICK_S / 2)
    angle, near = np.array([0.1, 0.7, 1.3]), np.zeros((draws, RUNS))
    u = np.stack([np.cos(angle), np.sin(angle)], -1) * np.ones((draws, RUNS, 2), complex)
    seen = np.zeros((draws, RUNS, ROWS, 2), complex)
    commands = np.zeros((draws, RUNS, ROWS, TICKS, 2))

    def force(u, main, quadrature):
        turn, e_A, e_B, _ = find_frame(u, near)
        return turn[..., None] * (main[..., None] * e_A - 1j * quadrature[..., None] * e_B)

    def moved(u):
        return np.einsum("rij,drj->dri", half, u)

    for row in range(ROWS):
        for tick in range(TICKS):
            if tick == TICKS // 2:
                seen[:, :, row] = u
            turn, _, e_B, a_A = find_frame(u, near)
            a_B = -np.imag(np.sum(u * e_B, -1) * np.conj(turn))
            noise = loop_noise * random.normal(size=(2, draws, RUNS))
            main = P[0] + GAINS_1_S[0] * (1 - a_A - noise[0])
            quadrature = -GAINS_1_S[1] * (a_B + noise[1])
            commands[:, :, row, tick] = np.stack([main, quadrature], -1)
            u = moved(moved(u + TICK_S / 2 * force(u, main, quadrature)))
            u = u + TICK_S / 2 * force(u, main, quadrature)
    return seen, commands


def measured(seen, commands, logged, seed):
    """One programme (R, n): its rows with noise, the commands as a log of some of the ticks tells
    them."""
    t = (np.arange(ROWS) + 0.5) * ROW_S
    log_time = ((np.arange(ROWS)[:, None] * TICKS + logged + 0.5) * TICK_S).ravel()
    mean, area = np.zeros((2, 2, RUNS, ROWS))
    for run in range(RUNS):
        for n in range(2):
            values = estimate_means(log_time, commands[run][:, logged, n].ravel())
            course = integrate_means(log_time, values)
            mean[n, run], area[n, run] = (
                average_over_windows(course, t, ROW_S),
                course.integrate_to(t),
            )
    random = np.random.default_rng(seed)
    envelope = seen + NOISE * (random.normal(size=seen.shape) + 1j * random.normal(size=seen.shape))
    one = np.ones((RUNS, ROWS))
    return MeasuredRuns(
        names=("a", "b", "c"), time_s=t * one, envelope=envelope, weight=one / NOISE, rate_rad_s=RATES[:, None] * one,
        temperature_degc=25 * one, temperature_rate_degc_s=0 * one, branch=one, table_angle_rad=RATES[:, None] * t,
        phase_rad=0 * one, main_drive=mean[0], quadrature_drive=mean[1], main_impulse=area[0], quadrature_impulse=area[1],
        forced=one, held_amplitude=np.nan * one, held_slope=0 * one, turn_rad_s=np.zeros(RUNS),
        reference_frequency_hz=900.0, mode_number=2,
    )  # fmt: skip


def fitted(series):
    std = np.array([np.inf, 3.0, 3.0, 9.0, 9.0, 3.0, 0.0])
    start = Point(P, series.envelope[:, 0].copy(), np.zeros(RUNS))
    return extended_fit.fit(series, start, CoordinatePriors(np.zeros(7), std))


def errors(fit):
    return (fit.point.p[:6] - P[:6]) / np.sqrt(np.diag(fit.coordinate_covariance())[:6])


def judged(draws, loop_noise, logged):
    """Of many draws: errors over σ before and after, χ² after, the greatest walk."""
    seen, commands = loops(draws, loop_noise, seed=3)
    before, after, left, walk = [], [], [], 0.0
    for draw in range(draws):
        plain = fitted(measured(seen[draw], commands[draw], logged, 1000 + draw))
        beside = drive_scatter.allow_scatter(plain)
        before.append(errors(plain))
        after.append(errors(beside))
        left.append(beside.chi2 / beside.dof)
        walk = max(walk, float(Scatter.from_commands(plain.series).walk.max()))
    return rms(before), rms(after), float(np.mean(left)), walk


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_single_values_of_noisy_commands_leave_errors_as_stated():
    before, after, left, walk = judged(6, 3e-5, VALUES)
    assert 2 < walk < 8 and before > 2.5
    # 36 values, of which those of a draw go together: one in a thousand beyond
    assert 0.7 < after < 1.4 and 0.9 < left < 1.1


def test_a_log_of_means_is_believed():
    """It scatters as much, and the waves follow it: what is allowed for is little."""
    before, after, left, walk = judged(4, 3e-4, MEANS)
    assert walk > 10
    assert 0.6 < after < 1.3 and 0.5 < after / before <= 1 and 0.9 < left < 1.1


def test_a_written_start_is_moved_as_the_fit_judges_beside_a_scattered_log():
    """Measured rows beside a walk that is allowed for: a simulation from another start is brought to
    the fit in one step, and rows that were not compared say nothing."""
    seen, commands = loops(1, 3e-4, seed=3)
    fit = drive_scatter.allow_scatter(fitted(measured(seen[0], commands[0], VALUES, 5)))
    assert fit.series.scatter is not None
    own = find_base_sensitivities(fit.flow)[1]
    off = 1e-4 * np.random.default_rng(6).normal(size=(RUNS, own.shape[-1]))
    compared = np.ones((RUNS, ROWS), bool)
    compared[:, :7] = False
    difference = np.einsum("rnik,rk->rni", own, off) * compared[..., None]
    each = list(range(RUNS))
    np.testing.assert_allclose(find_change(fit, difference, compared, each), off, rtol=1e-6)
    compared[1] = False
    assert not find_change(fit, difference * compared[..., None], compared, each)[1].any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("loop_noise", "logged"),
    [(1e-5, VALUES), (3e-5, VALUES), (1e-4, VALUES), (3e-4, VALUES), (3e-5, MEANS), (3e-4, MEANS)],
)
def test_errors_are_as_stated_whatever_the_scatter(loop_noise, logged):
    """Too weak to be seen, of the noise's size, and far beyond it; conservative beside a log of
    means, which cannot be told from one of values where it does little."""
    before, after, _, _ = judged(30, loop_noise, logged)
    assert 0.65 < after < (1.25 if logged is VALUES else 1.1)
    assert logged is MEANS or after < before / 1.5


def test_a_log_that_scatters_is_told():
    seen, commands = loops(1, 3e-5, seed=5)
    rough = fitted(measured(seen[0], commands[0], VALUES, 1))
    told = drive_scatter.describe_scatter(drive_scatter.allow_scatter(rough))
    assert "scatters by 0.000" in told and "is in every standard deviation" in told
    seen, commands = loops(1, 0.0, seed=5)
    smooth = fitted(measured(seen[0], commands[0], VALUES, 1))
    assert drive_scatter.describe_scatter(smooth) == ""
    assert not Scatter.from_commands(smooth.series).find_moved_runs(smooth.series).any()


def test_the_walk_of_a_scatter_is_that_of_independent_commands():
    """s·h·√n over the noise, against the end points of drawn sums of white commands."""
    seen, commands = loops(1, 0.0, seed=5)
    series = measured(seen[0], commands[0], MEANS, 1)
    random, size = np.random.default_rng(6), 0.05
    noise = size * random.normal(size=series.time_s.shape)
    done = series.main_impulse + np.cumsum(noise * ROW_S, axis=1)
    scatter = Scatter.from_commands(replace(series, main_impulse=done))
    ends = (size * ROW_S * random.normal(size=(4000, ROWS))).sum(axis=1).std() / NOISE
    assert abs(scatter.size[scatter.worst].max() / size - 1) < 0.3
    assert abs(scatter.walk.max() / ends - 1) < 0.3


def test_a_line_must_stand_out_of_the_walk_and_a_cause_of_what_is_not_allowed_for():
    """The walk is as strong as the noise at s/2πσ beside the resonance; σ that a cause stands off
    zero are taken beside it where the fit knows nothing of it."""
    seen, commands = loops(1, 3e-4, seed=5)
    plain = fitted(measured(seen[0], commands[0], VALUES, 1))
    beside = drive_scatter.allow_scatter(plain)
    size = Scatter.from_commands(plain.series).size.max()
    assert drive_scatter.find_corner_hz(plain) == 0.0
    assert abs(drive_scatter.find_corner_hz(beside) / (size / NOISE / 2 / np.pi) - 1) < 1e-6
    assert closing.estimate_unknown_walk(beside) == 0.0
    walk = closing.estimate_unknown_walk(plain)
    assert walk > 10

    def named(sigma, walk):
        return [one.passed for one in closing.check_beside_drive_log("gain_mismatch", sigma, walk)]

    assert named(4.0, walk) == [False] and named(5 * walk, walk) == [True] and named(4.0, 0.0) == []


def test_what_may_be_off_is_whitened_and_scales_with_the_noise():
    """(1 + QΛQᵀ)^{−1/2} against the matrix itself, and over other σ."""
    random = np.random.default_rng(8)
    Q = np.linalg.qr(random.normal(size=(9, 3)))[0]
    power = np.array([0.3, 2.0, 40.0])
    soft, S = Softened(((slice(2, 11), Q, power),)), random.normal(size=(12, 4))
    for level in (1.0, 2.0):
        C = np.eye(12)
        C[2:11, 2:11] += Q @ np.diag(power / level**2) @ Q.T
        white = soft.scale_noise(level).whiten(S)
        assert np.allclose(white.T @ white, S.T @ np.linalg.solve(C, S), rtol=1e-12)


def slow_part(series, beside):
    """Rms over σ of sums of eight rows of what is measured beside an envelope."""
    left = (series.envelope - beside) * series.weight[..., None]
    blocks = left[:, : ROWS // 8 * 8].reshape(RUNS, -1, 8, 2).sum(axis=2) / np.sqrt(8)
    return rms([blocks.real, blocks.imag])


def test_the_likely_walk_is_on_the_motion_and_not_in_the_residual():
    """Beside the commands' log alone the waves walk by many σ, beside motion and what may have
    scattered by noise; what follows the motion then follows the wave, and χ² is what it was."""
    seen, commands = loops(1, 3e-4, seed=5)
    plain = drive_scatter.allow_scatter(fitted(measured(seen[0], commands[0], VALUES, 1)))
    fit = drive_scatter.follow_walk(plain)
    assert slow_part(fit.series, fit.prediction.by_log) > 5
    assert slow_part(fit.series, fit.prediction.seen) < 1.2
    assert slow_part(fit.series, fit.prediction.by_log + compute_unsettled_part(fit)) < 1.2
    assert fit.chi2 == pytest.approx(plain.chi2, rel=1e-2)


def test_noise_that_is_most_likely_in_rows_is_that_of_their_whole_covariance():
    """C = C₁ᐟ² C₂ C₁ᐟ² of two parts one after the other, each (1 + QΛQᵀ) of its rows: Wᵀ W = C⁻¹."""
    random, roots, parts = np.random.default_rng(8), [], []
    for rows in (slice(0, 6), slice(2, 9)):
        Q = np.linalg.qr(random.normal(size=(rows.stop - rows.start, 2)))[0]
        power = random.uniform(0.5, 20, 2)
        one = np.eye(9)
        one[rows, rows] += Q @ np.diag(np.sqrt(1 + power) - 1) @ Q.T
        roots.append(one)
        parts.append((rows, Q, power))
    soft, r = Softened(tuple(parts)), random.normal(size=9)
    covariance = roots[0] @ roots[1] @ roots[1] @ roots[0]
    np.testing.assert_allclose(
        soft.whiten_transposed(soft.whiten(r)), np.linalg.solve(covariance, r), rtol=1e-9
    )


def test_a_row_of_two_windows_leaves_none_out():
    """Where one row in ten holds two windows none was left out; missing, these gave every slow
    misfit images, which were taken for tones."""
    windows = 0.03 * np.arange(44)
    rows = [windows[11 * k + np.arange(10)] for k in range(4)]
    pairs = [windows[11 * k + 9 : 11 * k + 11].mean() for k in range(4)]
    at = np.concatenate([np.append(row[:9], pair) for row, pair in zip(rows, pairs, strict=True)])
    assert tone_search._find_consecutive(windows, at).all()
    lost = np.delete(at, slice(13, 15))
    assert not tone_search._find_consecutive(windows, lost).all()
