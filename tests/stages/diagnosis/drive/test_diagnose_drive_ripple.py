"""Loops that look at the oscillation itself: a driven gyro integrated with its ripple at 2ω, the drive
along the instant state, and what the fit of the slow model makes of its rows and its drive's log.
"""

import sys

import numpy as np
import pytest
from scipy.linalg import expm

from hrg_cli.effects import EFFECTS, find
from hrg_cli.effects.effect import find_frame
from hrg_cli.fitting.causes import extended_fit
from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors
from hrg_cli.fitting.causes.fit_point import Point
from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
from hrg_cli.fitting.envelopes import coordinates
from hrg_cli.fitting.samples.course import average_over_windows, integrate_means
from hrg_cli.physics.ellipse import find_wave
from hrg_cli.physics.resonator import OF_GENERATOR
from hrg_cli.stages.diagnosis.base.joint_fit import fit_beside_answers
from hrg_cli.stages.diagnosis.closing.sized import Sized
from hrg_cli.stages.diagnosis.closing.summed import estimate_moves_of_summed
from hrg_cli.stages.diagnosis.drive import scatter as drive_scatter
from hrg_cli.stages.diagnosis.drive.ripple import Ripple
from hrg_cli.stages.diagnosis.fits.refits import adopt
from hrg_cli.stages.diagnosis.fits.scoring import is_gross, score_effects
from hrg_cli.stages.diagnosis.fits.variants import list_variants
from hrg_cli.stages.diagnosis.report.base_values import list_base_values
from hrg_cli.stages.diagnosis.search.inquiry import Inquiry
from hrg_cli.stages.diagnosis.search.search_case import Case
from hrg_cli.stages.diagnosis.search.selection import Search

HZ, STEPS = 250.0, 24
P = np.array([1.5, 0.1, 0.05, 0.9, -0.4, 0.55, 0.0])
RATES = np.array([3.0, -3.0, 1.5])
PERIODS, ROWS = 4, 90
NOISE = 2e-5
OMEGA = 2 * np.pi * HZ


def recorded(
    gain_1_s,
    amplitude_gain_1_s=0.0,
    apart_rad_s=(0.0, 0.0, 0.0),
    mismatch=0.0,
    free_beside=False,
    in_blocks=False,
):
    """Envelopes that demodulation shows (R, n, 2) of u̇ = G − G* e^{−2jωt}, which z'' = −2Nz' + 2KΩJz' −
    2ωδωRz − ω²z + drive is in u = (z − jz'/ω) e^{−jωt}, and both loops' commands of every step (2, R, m).

    The drive holds the amplitude by what it loses and with a gain, and nulls the quadrature with
    another, along the state of the instant, the commands held over a step; each run's frequency is
    so far from the ω that the loops know. The forcers differ by a mismatch. Free runs beside them
    turn the same way. In blocks of a fixed reference the direction is off by what these miss.
    """
    rates = np.tile(RATES, 1 + free_beside)
    driven = np.arange(len(rates)) < len(RATES)
    apart = 1j * np.resize(apart_rad_s, len(rates))[:, None, None] * np.eye(2)
    L = coordinates.build_generator(P, rates, 1.0) + apart
    angle, near = np.resize([0.1, 0.7, 1.3], len(rates)), np.zeros(len(rates))
    u = np.stack([np.cos(angle), np.sin(angle)], -1).astype(complex)
    seen = np.zeros((len(rates), ROWS, 2), complex)
    log = np.zeros((2, len(rates), ROWS * PERIODS * STEPS))
    t, h = 0.0, 1 / HZ / STEPS

    def slow(u, commands, in_blocks=in_blocks):
        missed = 1j / (2 * OMEGA) * np.conj(slow(u, commands, False)) if in_blocks else 0.0
        turn, e_A, e_B, _ = find_frame(u + missed, near)
        main, quadrature = commands[..., None]
        force = turn[:, None] * (main * e_A - 1j * quadrature * e_B)
        force = force * np.array([1 + mismatch / 2, 1 - mismatch / 2])
        return np.einsum("rij,rj->ri", L, u) + force

    def rate(t, u, commands):
        G = slow(u, commands)
        return G - np.conj(G) * np.exp(-2j * OMEGA * t)

    for k in range(log.shape[2]):
        a_A, a_B, *_ = find_wave(u, 1)
        commands = np.array([P[0] + amplitude_gain_1_s * (1 - a_A), -gain_1_s * a_B]) * driven
        log[:, :, k] = commands
        row, place = divmod(k, PERIODS * STEPS)
        if place == PERIODS * STEPS // 2:
            v = u
            for _ in range(3):  # less its own ripple
                ripple = -1j / (2 * OMEGA) * np.conj(slow(v, commands)) * np.exp(-2j * OMEGA * t)
                v = u - ripple
            seen[:, row] = v + 1j / (2 * OMEGA) * slow(v, commands)
        k1 = rate(t, u, commands)
        k2 = rate(t + h / 2, u + h / 2 * k1, commands)
        k3 = rate(t + h / 2, u + h / 2 * k2, commands)
        k4 = rate(t + h, u + h * k3, commands)
        u, t = u + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), t + h
    return seen, log


def measured(seen, log, seed, turn_rad_s=(0.0, 0.0, 0.0), sigma=NOISE):
    """The rows with noise and the means of the commands."""
    length, h = PERIODS / HZ, 1 / HZ / STEPS
    t = (np.arange(ROWS) + 0.5) * length
    times = (np.arange(log.shape[2]) + 0.5) * h
    courses = [[integrate_means(times, one) for one in command] for command in log]
    main, quadrature = (
        np.stack([average_over_windows(one, t, length) for one in course]) for course in courses
    )
    areas = [np.stack([one.integrate_to(t) for one in course]) for course in courses]
    rates, turn = np.resize(RATES, len(seen)), np.resize(turn_rad_s, len(seen))
    random = np.random.default_rng(seed)
    noise = random.normal(size=seen.shape) + 1j * random.normal(size=seen.shape)
    one, forced = np.ones((len(rates), ROWS)), main.any(axis=1, keepdims=True)
    return MeasuredRuns(
        names=tuple("abcdef"[: len(rates)]), time_s=t * one, envelope=seen + sigma * noise, weight=one / sigma,
        rate_rad_s=rates[:, None] * one, temperature_degc=25 * one, temperature_rate_degc_s=0 * one,
        branch=one, table_angle_rad=rates[:, None] * t, phase_rad=turn[:, None] * t,
        main_drive=main, quadrature_drive=quadrature, main_impulse=areas[0],
        quadrature_impulse=areas[1], forced=forced * one, held_amplitude=np.nan * one, held_slope=0 * one,
        turn_rad_s=turn,
        reference_frequency_hz=HZ, mode_number=2,
    )  # fmt: skip


def fitted(series):
    std = np.array([np.inf, 3.0, 3.0, 9.0, 9.0, 3.0, 0.0])
    start = Point(np.append(P[:6], 1.0), series.envelope[:, 0].copy(), series.turn_rad_s.copy())
    return extended_fit.fit(series, start, CoordinatePriors(np.eye(7)[6], std))


def errors(fit):
    return (fit.point.p[:6] - P[:6]) / np.sqrt(np.diag(fit.coordinate_covariance())[:6])


def test_a_drive_along_the_instant_state_makes_the_force_that_averaging_gives():
    fit = fitted(measured(*recorded(0.0), seed=1))
    column = fit.basis.project_out(Ripple.from_fit(fit).doings[:, 0])
    size = float(column @ column)
    # four σ, and what is of third order in the rates over ω
    assert abs(float(column @ fit.residual) / size - 1) < 4 * size**-0.5 + 0.01


def test_blocks_of_a_fixed_reference_miss_what_moves_within_them():
    """Means over whole periods of 2z e^{−jωt}, z the oscillation of a wave that turns."""
    L = coordinates.build_generator(P, np.array([3.0]), 1.0)[0]
    v, count, periods = np.array([np.cos(0.7), np.sin(0.7)]) * np.exp(0.4j), 4000, 4
    t = (np.arange(count) + 0.5) * periods / HZ / count
    moved = np.stack([expm(L * one) @ v for one in t])
    G = moved @ L.T
    u = moved - 1j / (2 * OMEGA) * np.conj(G) * np.exp(-2j * OMEGA * t)[:, None]
    z = np.real(u * np.exp(1j * OMEGA * t)[:, None])
    seen = np.mean(2 * z * np.exp(-1j * OMEGA * t)[:, None], axis=0)
    middle = expm(L * periods / HZ / 2) @ v
    of_middle = L @ middle
    missed = seen - middle - 1j / (2 * OMEGA) * of_middle
    # what bends within the block is of second order
    bent = L @ of_middle * (periods / HZ) ** 2 / 24
    assert (
        np.abs(missed - bent - 1j / (2 * OMEGA) * np.conj(of_middle)).max()
        < 0.05 * np.abs(missed - bent).max()
    )


def test_what_blocks_of_a_fixed_reference_make_of_the_direction_is_allowed_for():
    """Clean driven gyros on such a board had a drive rotation of 3e-6 rad, 7 σ, "explained"."""
    fit = fitted(measured(*recorded(0.0, in_blocks=True), seed=1))
    columns = fit.basis.project_out(Ripple.from_fit(fit).doings[:, [0, 8, 9]])
    found, covariance = (
        np.linalg.lstsq(columns, fit.residual)[0],
        np.linalg.inv(columns.T @ columns),
    )
    std = np.sqrt(np.diag(covariance))
    assert std[1:].max() < 0.2
    assert np.all(np.abs(found - [1.0, 0.0, 1.0]) < 4 * std + 0.02)


def test_what_loops_answer_to_the_ripple_is_in_every_standard_deviation():
    seen, log = recorded(15.0)
    before, after, left, std = [], [], [], []
    for seed in range(8):
        plain = fitted(measured(seen, log, seed))
        beside = drive_scatter.allow(plain, Ripple.from_fit(plain).spread)
        before.append(errors(plain))
        after.append(errors(beside))
        left.append(beside.chi2 / beside.dof)
        std.append(beside.coordinate_std("scale_factor") / P[5])
    assert (
        np.abs(np.array(before)[:, 5]).min() > 50
    )  # K, of which the loop's answer looks as a part
    assert np.abs(after).max() < 4 and 0.9 < np.mean(left) < 1.1
    # what a loop of that gain can do to K at most, k/4ω, is the size of what is not known of it
    assert max(std) < 15.0 / (4 * OMEGA)


@pytest.mark.parametrize(
    ("amplitude_gain", "apart"),
    [(20.0, (0.3, 0.3, 0.3)), (20.0, (0.1, 0.1, 0.1)), (0.0, (0.1, 0.1, 0.1))],
)
def test_loops_that_know_another_frequency_than_the_wave_s_leave_the_damping_open(
    amplitude_gain, apart
):
    seen, log = recorded(15.0, amplitude_gain, apart)
    without, after, left = [], [], []
    for seed in range(4):
        plain = fitted(measured(seen, log, seed, apart))
        spread = Ripple.from_fit(plain).spread
        beside = drive_scatter.allow(plain, spread)
        without.append(errors(drive_scatter.allow(plain, spread[:, :5])))
        after.append(errors(beside))
        left.append(beside.chi2 / beside.dof)
    assert np.abs(without).max() > 12
    # not the frequency split, which is one of ω² here: δω ω/ω'
    assert np.abs(np.array(after)[:, [0, 1, 2, 5]]).max() < 4 and 0.9 < np.mean(left) < 1.1


def test_the_cause_of_a_gross_misfit_is_found_beside_what_loops_answer():
    mismatch = 0.02
    seen, log = recorded(15.0, amplitude_gain_1_s=20.0, mismatch=mismatch, free_beside=True)
    plain = fitted(measured(seen, log, seed=5))
    beside = drive_scatter.allow(plain, Ripple.from_fit(plain).spread)
    assert is_gross(beside)
    variants = list_variants([e for e in EFFECTS if e.seen_in == "dynamics"], beside)
    score, variant = score_effects(beside, variants)[0]
    assert score.name == "drive_gain_mismatch"
    found = adopt(beside, score, variant)
    (value,) = found.point.active[0][1].values()
    assert 0.9 < found.chi2 / found.dof < 1.1
    assert abs(value - mismatch) < 4 * found.parameter_std("drive_gain_mismatch", "gain")
    # without the answers it is not enough, and wrong
    alone = adopt(plain, *score_effects(plain, variants)[0])
    assert is_gross(alone)


@pytest.mark.parametrize("free_beside", [False, True])
def test_answers_of_thousands_of_sigma_are_followed(free_beside):
    """Columns about a motion without them miss as large a part of what they do as that is off."""
    seen, log = recorded(15.0, 20.0, (0.1, 0.1, 0.1), free_beside=free_beside)
    plain = fitted(measured(seen, log, 7, (0.1, 0.1, 0.1), sigma=1e-6))
    about = drive_scatter.allow(plain, Ripple.from_fit(plain).spread)
    along = fit_beside_answers(plain)
    # not the frequency split, which is one of ω²
    known = [0, 1, 2, 5]
    assert np.abs(errors(about)[known]).max() > 3.5 and about.chi2 / about.dof > 1.1
    assert np.abs(errors(along)[known]).max() < 4.5 and 0.9 < along.chi2 / along.dof < 1.07


def test_a_small_excess_of_all_forces_is_in_the_sigma_of_quiet_runs(monkeypatch):
    """It would be named at its typical size, of one percent; of a tenth of that these runs know no
    more than its sum with the damping and with the frequency split."""
    excess, little = 1e-3, P * np.array([0.1, 0.1, 0.1, 0.02, 0.02, 1.0, 1.0])
    monkeypatch.setattr(sys.modules[__name__], "P", little)
    seen, log = recorded(15.0, 20.0)
    fit = fit_beside_answers(fitted(measured(seen, log / (1 + excess), 7, sigma=1e-6)))
    candidates = tuple(list_variants([find("drive_gain")], fit))
    last = tuple(score for score, _ in score_effects(fit, candidates))
    case = Case(Inquiry(candidates, 1), Search(fit, fit, (), last, last), None)
    true = dict(zip(OF_GENERATOR, coordinates.to_parameters(little, 2)[0], strict=True))
    told, alone = (
        {row["name"]: row for row in list_base_values(Sized(fit, fit, 1.0), None, moves, {})[1:]}
        for moves in (estimate_moves_of_summed(case), {})
    )
    off = {name: row["value"] - true[name] for name, row in told.items()}
    assert max(abs(off[name]) / row["std"] for name, row in alone.items()) > 20
    assert max(abs(off[name]) / row["std"] for name, row in told.items()) < 4
    for name in ("damping_rate_1_s", "frequency_split_rad_s"):
        assert told[name]["sum_with"] == ["drive_gain"]


def test_how_large_an_answer_may_be_is_judged_once():
    seen, log = recorded(15.0)
    plain = fitted(measured(seen, log, seed=3))
    alone = Ripple.from_fit(plain)
    sizes = (alone.amplitude_1_s, alone.quadrature_1_s)
    again = Ripple.from_fit(drive_scatter.allow(plain, alone.spread, sizes))
    assert (again.amplitude_1_s, again.quadrature_1_s) == sizes


def test_without_a_quadrature_loop_no_answer_is_allowed_for():
    ripple = Ripple.from_fit(fitted(measured(*recorded(0.0), seed=2)))
    assert ripple.quadrature_1_s == 0.0 and not ripple.spread[:, 1:7].any()
