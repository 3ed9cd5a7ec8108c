"""Boards whose loops find the wave's angle where their phase tracker believes the phase to be, and whose
trackers begin with the recording: the slow motion integrated beside its trackers, block by block, and
what is said of its rows and its drive's log."""

import numpy as np
import pytest

from hrg_cli.effects import find
from hrg_cli.fitting.causes import extended_fit
from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors
from hrg_cli.fitting.causes.fit_point import Point
from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
from hrg_cli.fitting.envelopes import coordinates
from hrg_cli.fitting.samples.course import average_over_windows, integrate_means
from hrg_cli.stages.diagnosis.base.joint_fit import fit_beside_answers
from hrg_cli.stages.diagnosis.drive.tracker_start import allow_starts
from hrg_cli.stages.diagnosis.fits.scoring import score_effects
from hrg_cli.stages.diagnosis.fits.variants import list_variants
from hrg_cli.stages.diagnosis.search.remainder import judge_adequacy

HZ, BLOCK_S, BLOCKS, ROWS, K = 5000.0, 2e-3, 20, 200, 0.554
P = np.array([0.8, 0.012, 0.01, 0.07, -0.06, K, 0.0])
RATES = np.array([0.4, 1.5, -2.0, -0.8])
STARTS = np.array([0.1, 0.9, 1.3, 0.5])
QUADRATURE_GAIN_1_S = 4.0


def find_axes(psi):
    return np.stack([np.cos(psi), np.sin(psi)], -1), np.stack([-np.sin(psi), np.cos(psi)], -1)


def stepped(u, L, *forces):
    """The envelopes a block later, under forces at its begin, middle and end."""

    def move(u, force):
        return np.einsum("rij,rj->ri", L, u) + force

    k1 = move(u, forces[0])
    k2 = move(u + BLOCK_S / 2 * k1, forces[1])
    k3 = move(u + BLOCK_S / 2 * k2, forces[1])
    return u + BLOCK_S / 6 * (k1 + 2 * k2 + 2 * k3 + move(u + BLOCK_S * k3, forces[2]))


def tracked(natural_rad_s, turned=0.0):
    """Envelopes in the middle of rows (R, n, 2) and the commands of every block (2, R, m) of a board whose
    trackers know the table's rate and the nominal frequency when they begin, on the wave; the force
    stands `turned` from their angle."""
    L = coordinates.build_generator(P, RATES, 1.0)
    psi, phi = 2 * STARTS, np.array([0.3, 1.1, 2.0, -0.7])
    psi_rate, phi_rate = -K * RATES, np.zeros(len(RATES))
    u = np.exp(1j * phi)[:, None] * find_axes(psi)[0]
    seen = np.zeros((len(RATES), ROWS, 2), complex)
    log = np.zeros((2, len(RATES), ROWS * BLOCKS))
    step, b = natural_rad_s * BLOCK_S, np.zeros(len(RATES))
    for k in range(log.shape[2]):
        log[:, :, k] = np.full(len(RATES), P[0]), -QUADRATURE_GAIN_1_S * b
        if k % BLOCKS == BLOCKS // 2:
            seen[:, k // BLOCKS] = u

        def force(after_s, psi=psi, phi=phi, rates=(psi_rate, phi_rate), b=b):
            e_A, e_B = find_axes(psi + turned + rates[0] * after_s)
            commanded = P[0] * e_A + 1j * QUADRATURE_GAIN_1_S * b[:, None] * e_B
            return np.exp(1j * (phi + rates[1] * after_s))[:, None] * commanded

        u = stepped(u, L, *(force(part * BLOCK_S) for part in (0.0, 0.5, 1.0)))
        psi, phi = psi + psi_rate * BLOCK_S, phi + phi_rate * BLOCK_S
        # what the board reads is read in its own phase, and along its own axes
        y_A, y_B = (np.exp(-1j * phi) * np.sum(e * u, axis=-1) for e in find_axes(psi))
        b = -y_B.imag
        psi, psi_rate = psi + 1.4 * step * y_B.real, psi_rate + step**2 * y_B.real / BLOCK_S
        phi, phi_rate = phi + 1.4 * step * y_A.imag, phi_rate + step**2 * y_A.imag / BLOCK_S
    return seen, log


def measured_beside_trackers(seen, log, sigma, seed):
    """The rows with noise, the means of the commands, and temperatures that move in each run."""
    length = BLOCKS * BLOCK_S
    t = (np.arange(ROWS) + 0.5) * length
    times = (np.arange(log.shape[2]) + 0.5) * BLOCK_S
    courses = [[integrate_means(times, one) for one in command] for command in log]
    main, quadrature = (
        np.stack([average_over_windows(one, t, length) for one in course]) for course in courses
    )
    areas = [np.stack([one.integrate_to(t) for one in course]) for course in courses]
    random, one = np.random.default_rng(seed), np.ones((len(RATES), ROWS))
    noise = random.normal(size=seen.shape) + 1j * random.normal(size=seen.shape)
    turns = (np.array([1.3, 1.7, 2.1, 2.5]) * 2 * np.pi / t[-1])[:, None]
    warm = 25 + 2 * (np.arange(4)[:, None] - 1.5) + 4 * np.sin(turns * t)
    return MeasuredRuns(
        names=tuple("abcd"), time_s=t * one, envelope=seen + sigma * noise, weight=one / sigma,
        rate_rad_s=RATES[:, None] * one, temperature_degc=warm,
        temperature_rate_degc_s=4 * turns * np.cos(turns * t), branch=one,
        table_angle_rad=RATES[:, None] * (t - t[0]), phase_rad=0 * one,
        main_drive=main, quadrature_drive=quadrature, main_impulse=areas[0],
        quadrature_impulse=areas[1], forced=one, held_amplitude=np.nan * one, held_slope=0 * one,
        turn_rad_s=np.zeros(len(RATES)), reference_frequency_hz=HZ, mode_number=2,
    )  # fmt: skip


def judged(series, *names):
    """The fit beside what loops may have done, and the scores of causes beside it."""
    std = np.array([np.inf, 3.0, 3.0, 9.0, 9.0, 3.0, 0.0])
    start = Point(np.append(P[:6], 1.0), series.envelope[:, 0].copy(), series.turn_rad_s.copy())
    plain = extended_fit.fit(series, start, CoordinatePriors(np.eye(7)[6], std))
    fit = fit_beside_answers(allow_starts(plain))
    scored = score_effects(fit, list_variants([find(name) for name in names], fit))
    return fit, [score for score, _ in scored]


def test_an_angle_that_is_read_where_the_phase_is_off_is_no_cubic():
    """The phase that a loop of 15 rad/s leaves of the split, times the quadrature that the split makes,
    turns the frame in 8θ: a "pick-off nonlinearity" of 4.3 σ before, and more than noise was left."""
    series = measured_beside_trackers(*tracked(15.0), 1e-6, seed=1)
    fit, scores = judged(series, "pickoff_nonlinearity", "converter_nonlinearity")
    assert max(score.gain for score in scores) < 3.5**2
    assert judge_adequacy(fit)[1] > 1e-3


@pytest.mark.parametrize("natural_rad_s", [25.0, 40.0])
def test_trackers_that_begin_with_the_recording_are_no_cause(natural_rad_s):
    """They learn what a split and the damping's axes do at the start of every run: a "cubic stiffness" of 8
    to 9 σ before, and a turned drive of 5 to 6 σ."""
    series = measured_beside_trackers(*tracked(natural_rad_s), 1e-6, seed=2)
    _, scores = judged(series, "thermal_frequency", "drive_rotation", "cubic_stiffness")
    assert max(score.gain for score in scores) < 3.5**2


def test_a_turned_drive_shows_beside_trackers_that_begin():
    series = measured_beside_trackers(*tracked(25.0, turned=1e-4), 1e-5, seed=3)
    _, (score,) = judged(series, "drive_rotation")
    assert score.gain > 9**2
    (found,) = score.estimate
    assert abs(found - 1e-4) < 3.5 * 1e-4 / np.sqrt(score.gain)
