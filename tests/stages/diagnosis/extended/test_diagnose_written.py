"""The file that a diagnosis writes gives the measured runs back to their noise: courses of the rate
that bend between the windows, short windows, a drive that no loop of the file makes."""

import tomllib

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from wrong_runs import estimated, recordings, table_of

from hrg_cli.fitting.samples.course import build_course
from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.run_tables import fit_chords

FREQUENCY_HZ, SAMPLES_A_PERIOD, LENGTH_S = 401.0, 9.3, 0.6
OMEGA = 2 * np.pi * FREQUENCY_HZ
DAMPING, SPLIT_1_S, SPLIT_RAD_S, FACTOR = 1.7, 0.05, 1.3, 0.55
N = DAMPING * np.eye(2) + SPLIT_1_S * np.array([[0.3, 0.8], [0.8, -0.3]])
ROOT = OMEGA * np.eye(2) + SPLIT_RAD_S * np.array([[0.6, -0.8], [-0.8, -0.6]])
J = np.array([[0.0, 1.0], [-1.0, 0.0]])


def recording(run, rate, slope, start, noise, drive=None):
    """Samples of z'' + 2(N − KΩJ)z' + (W − KΩ'J)z = f by a Runge–Kutta rule of eighth order, with
    white noise; rate and its slope are functions of time."""
    W = ROOT @ ROOT

    def motion(t, state):
        z, v = state[:2], state[2:]
        turning = FACTOR * rate(t) * J
        force = 0.0 if drive is None else along(z, v, turning, drive(t))
        bend = force - 2 * (N - turning) @ v - (W - FACTOR * slope(t) * J) @ z
        return np.concatenate([v, bend])

    sampling = SAMPLES_A_PERIOD * FREQUENCY_HZ
    t = np.arange(int(LENGTH_S * sampling)) / sampling
    amplitude, angle = start
    begin = amplitude * np.array([np.cos(angle), np.sin(angle)])
    done = solve_ivp(
        motion,
        (0, t[-1]),
        np.concatenate([begin, np.zeros(2)]),
        "DOP853",
        t,
        rtol=1e-11,
        atol=1e-12,
        max_step=0.4 / FREQUENCY_HZ,
    )
    random = np.random.default_rng([run, 11])
    c, s = done.y[:2] + noise * random.standard_normal((2, len(t)))
    return t, Recording(
        c=c,
        s=s,
        sample_rate_hz=sampling,
        mode="free" if drive is None else "forced",
        readout="direct",
        mode_number=2,
        gyro_id="G",
        run_id=f"r{run}",
        auxiliary_time_s=t[::4],
        rate_rad_s=np.array([rate(x) for x in t[::4]]),
    )


def along(z, v, turning, level):
    """Acceleration of a drive a_ΦA along the main wave, Re[2jω a_ΦA e^{jφ} e_A], the wave's ellipse
    from z = Re q and v = Re[(jω + L) q], L = −N + jδωR + KΩJ."""
    q = z - 1j * np.linalg.solve(ROOT, v + N @ z - turning @ z)
    phase = np.angle(q @ q) / 2
    angle = np.arctan2(2 * np.real(q[0] * np.conj(q[1])), abs(q[0]) ** 2 - abs(q[1]) ** 2) / 2
    main = np.array([np.cos(angle), np.sin(angle)])
    turn = np.exp(1j * phase)
    if np.real(main @ q * np.conj(turn)) < 0:
        turn = -turn
    return np.real(2j * OMEGA * level * turn) * main


def wave_of(record, periods_per_window):
    return collect(estimate(collect(demodulate(record, periods_per_window=periods_per_window))))


def swinging(size, phase):
    """A sine of the rate with one and a half periods in the run, and its slope."""
    turn = 3 * np.pi / LENGTH_S
    return (
        lambda t: size * np.sin(turn * t + phase),
        lambda t: size * turn * np.cos(turn * t + phase),
    )


def runs(periods_per_window, noise):
    out = []
    for k, size in enumerate((9.0, -9.0, 5.0, -5.0)):
        _, record = recording(k, *swinging(size, 0.7 * k), (0.9 + 0.05 * k, 0.5 * k), noise)
        out.append(wave_of(record, periods_per_window))
    return out


@pytest.mark.parametrize("periods_per_window", (pytest.param(3.0, marks=pytest.mark.slow), 5.0))
def test_a_rate_that_bends_between_few_windows_is_given_back_at_low_noise(periods_per_window):
    diagnosis = diagnose(runs(periods_per_window, 2e-6))
    out = summarise(diagnosis)
    held = out["written_model"]
    assert held["rms_over_noise"] < 1.1 * held["fitted_rms_over_noise"]
    assert out["verdict"] == "adequate", out["checks"]


def test_lines_through_a_curve_keep_its_integral():
    t = np.linspace(0.004, 0.996, 80)
    log = build_course(t, np.sin(9 * t))
    corner, (value,) = fit_chords([log], 1.0)
    corner, value = np.array(corner), np.array(value)
    assert corner[0] == 0.0 and corner[-1] == 1.0
    turned = np.concatenate([[0.0], np.cumsum(np.diff(corner) * (value[1:] + value[:-1]) / 2)])
    inner = slice(2, -2)
    at = np.isin(t[inner], corner)
    assert at.sum() > 20
    kept = np.interp(t, corner, turned)[inner] - log.integrate()[inner]
    bare = np.cumsum(
        np.diff(corner) * (log.interpolate(corner[1:]) + log.interpolate(corner[:-1])) / 2
    )
    chord = np.interp(t, corner[1:], bare)[inner] - log.integrate()[inner]
    assert np.ptp(kept[at]) < np.ptp(chord[at]) / 10 and np.ptp(kept[at]) < 1e-6


@pytest.mark.slow
def test_lines_through_noise_and_jumps_are_the_rows_themselves():
    random = np.random.default_rng(3)
    t = np.linspace(0.0, 1.0, 50)
    y = random.standard_normal(50)
    corner, (value,) = fit_chords([build_course(t, y)], 1.0)
    np.testing.assert_allclose(np.interp(t, corner, value), y, atol=0.3)


def restless(t):
    """a_ΦA that no gains of the file's loops make from the wave."""
    return DAMPING * (1 + 0.3 * np.sin(15 * t) + 0.15 * np.sin(31 * t))


def test_a_drive_that_no_loop_of_the_file_makes_is_replayed():
    measured = []
    for k, size in enumerate((6.0, -6.0, 3.0)):
        t, record = recording(k, *swinging(size, 0.7 * k), (1.0, 0.5 * k), 1e-3, restless)
        record = record.replace(drive_main=restless(t[::4]), drive_quadrature=0 * t[::4])
        measured.append(wave_of(record, 5.0))
    diagnosis = diagnose(measured)
    out = summarise(diagnosis)
    model = tomllib.loads(diagnosis.extended_model)
    assert all("log" in run["control"] for run in model["run"])
    held = out["written_model"]
    assert held["rms_over_noise"] < 1.1 * held["fitted_rms_over_noise"], held
    assert out["verdict"] == "adequate", out["checks"]


def test_samples_lost_are_given_back_whole_at_the_sampling_of_the_file():
    """Losses of 3 and 7 of the measured samples are no whole numbers of others."""
    lost = {1: (3, 0.9), 2: (7, 1.1)}
    table = table_of(3, runs=4, duration_s=2.0)
    records = recordings(table, 3)
    for k, (count, at_s) in lost.items():
        keep = np.ones(len(records[k].c), bool)
        first = round(at_s * records[k].sample_rate_hz)
        keep[first : first + count] = False
        records[k] = records[k].replace(
            c=np.asarray(records[k].c)[keep], s=np.asarray(records[k].s)[keep]
        )
    diagnosis = diagnose(estimated(records))
    out = summarise(diagnosis)
    assert [e["name"] for e in out["effects"]] == ["dropped_samples"] * 2
    assert sorted(e["samples"] for e in out["effects"]) == [3, 7]
    for run in tomllib.loads(diagnosis.extended_model)["run"]:
        if "dropped_samples" in run.get("effects", {}):
            count = run["effects"]["dropped_samples"]["lost_s"] * run["recording"]["sample_rate_hz"]
            assert count == pytest.approx(round(count), abs=1e-6)
    held = out["written_model"]
    assert held["rms_over_noise"] < 1.1 * held["fitted_rms_over_noise"], held
    assert out["verdict"] == "explained", out["checks"]


def averaged_recording(run, rate, angle, frequency_hz=1000.3, noise=1e-4):
    """Samples of Re[u e^{jωt}], u the exponential of the generator averaged over a period."""
    t = np.arange(0, 40.0, 1 / 16_000.0)

    def reflect(alpha):
        return np.array([[np.cos(alpha), np.sin(alpha)], [np.sin(alpha), -np.cos(alpha)]])

    L = -0.05 * np.eye(2) - 0.0025 * reflect(1.2) + 0.02j * reflect(3.6) + 0.55 * rate * J
    values, vectors = np.linalg.eig(L)
    begin = np.linalg.solve(vectors, np.exp(0.4j * run) * np.array([np.cos(angle), np.sin(angle)]))
    u = (begin * np.exp(np.outer(t, values))) @ vectors.T
    samples = np.real(u * np.exp(2j * np.pi * frequency_hz * t)[:, None])
    samples = samples + noise * np.random.default_rng(run).standard_normal(samples.shape)
    log_s = np.arange(0, 40.0, 0.1)
    return Recording(
        c=samples[:, 0],
        s=samples[:, 1],
        sample_rate_hz=16_000.0,
        mode="free",
        gyro_id="G",
        run_id=f"r{run}",
        auxiliary_time_s=log_s,
        rate_rad_s=np.full_like(log_s, rate),
    )


def test_another_simulators_averaged_equation_is_written_as_such():
    """A resonator's file missed such runs by up to 2.6 σ of a row, and a clean gyro was "unexplained"."""
    plan = [(0.0, 0.3), (0.3, 0.9), (-0.3, 1.4), (0.0, 2.4)]
    waves = []
    for k, (rate, angle) in enumerate(plan):
        periods = demodulate(averaged_recording(k, rate, angle), periods_per_window=20.0)
        waves.append(collect(estimate(collect(periods))))
    record = diagnose(waves)
    told = summarise(record)
    assert (record.status, told["verdict"]) == ("valid", "adequate"), record.status_reasons
    assert tomllib.loads(record.extended_model)["device"]["equation"] == "averaged"
    held = told["written_model"]
    assert held["rms_over_noise"] < 1.02 * held["fitted_rms_over_noise"]
