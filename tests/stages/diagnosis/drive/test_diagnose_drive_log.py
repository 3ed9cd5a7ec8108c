"""The time of a drive's log: commands that are held until the next row act half a step later than a
log of rows about their own times, and the fit takes that from the waves."""

from dataclasses import replace

import numpy as np
import pytest

from hrg_cli.fitting.causes import extended_fit, slow_prediction, whitened_rows
from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors
from hrg_cli.fitting.causes.fit_point import Point
from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
from hrg_cli.stages.diagnosis.drive import command_log as drive_log
from hrg_cli.stages.diagnosis.drive import scatter as drive_scatter

P = np.array([1.5, 0.1, 0.05, 0.9, -0.4, 0.55, 1.0])
NOISE, ROWS, LENGTH_S = 3e-5, 150, 1.5


def commands(t, run):
    """(a_ΦA, a_ΦB) and their integrals from 0."""
    w = 9.0 + run
    main = 1.5 + 0.4 * np.sin(w * t)
    quadrature = 0.8 * np.cos(1.3 * w * t)
    return (main, quadrature), (
        1.5 * t - 0.4 * np.cos(w * t) / w,
        0.8 * np.sin(1.3 * w * t) / 1.3 / w,
    )


def programme(late_s, seed=0):
    """Two driven runs whose commands acted `late_s` later than their log says, with white noise."""
    t = np.broadcast_to(np.linspace(0.005, LENGTH_S, ROWS), (2, ROWS)).copy()
    one, start = np.ones_like(t), np.array([[1.0, 0.1j], [0.6 + 0.05j, 0.8]])

    def series(shift):
        parts = [commands(t[k] - shift, k) for k in range(2)]
        main, quadrature = (np.stack([part[0][n] for part in parts]) for n in range(2))
        area, other = (np.stack([part[1][n] for part in parts]) for n in range(2))
        rate = np.array([3.0, -3.0])[:, None] * one
        return MeasuredRuns(
            names=("a", "b"), time_s=t, envelope=np.repeat(start[:, None], ROWS, axis=1), weight=one / NOISE, rate_rad_s=rate,
            temperature_degc=25 * one, temperature_rate_degc_s=0 * one, branch=one, table_angle_rad=rate * t, phase_rad=0 * one,
            main_drive=main, quadrature_drive=quadrature, main_impulse=area, quadrature_impulse=other, forced=one,
            held_amplitude=np.nan * one, held_slope=0 * one, turn_rad_s=np.zeros(2), reference_frequency_hz=900.0, mode_number=2,
        )  # fmt: skip

    true = slow_prediction.predict(series(late_s), Point(P, start, np.zeros(2))).seen
    random = np.random.default_rng(seed)
    noise = NOISE * (random.normal(size=true.shape) + 1j * random.normal(size=true.shape))
    return replace(series(0.0), envelope=true + noise), Point(P, start, np.zeros(2))


def fitted(series, point):
    std = np.array([np.inf, 3.0, 3.0, 9.0, 9.0, 3.0, 0.0])
    return extended_fit.fit(series, point, CoordinatePriors(np.append(np.zeros(6), 1.0), std))


def test_a_log_is_taken_as_late_as_the_waves_show_it():
    late = 1e-3
    series, point = programme(late)
    plain = fitted(series, point)
    assert plain.chi2 / plain.dof > 10
    timed = drive_log.fit_lateness(plain)
    assert abs(timed.series.drive_late_s / late - 1) < 0.02
    assert abs(timed.chi2 / timed.dof - 1) < 5 * np.sqrt(2 / timed.dof)
    # and what the fit says of the gyro is right again, in its own standard deviations
    off = (timed.point.p[:6] - P[:6]) / np.sqrt(np.diag(timed.coordinate_covariance())[:6])
    assert np.abs(off).max() < 4 < np.abs(plain.point.p[:6] - P[:6]).max() / 1e-5


def test_no_lateness_is_found_in_a_log_that_is_right():
    timed = drive_log.fit_lateness(fitted(*programme(0.0)))
    assert abs(timed.series.drive_late_s) < 2e-5
    beside = drive_scatter.allow(timed, drive_log.predict_lateness(timed))
    assert beside.dof == timed.dof  # its size beforehand is known
    column = whitened_rows.flatten_rows(beside.series, drive_log.differentiate_by_lateness(beside))
    before = whitened_rows.flatten_rows(timed.series, drive_log.differentiate_by_lateness(timed))
    # what the rows still say of a lateness is what was known of it beforehand
    usual = drive_log.REACH * drive_scatter.find_row_length_s(timed.series)
    assert np.linalg.norm(before) > 50 / usual
    assert np.linalg.norm(column) == pytest.approx(1 / usual, rel=0.02)
