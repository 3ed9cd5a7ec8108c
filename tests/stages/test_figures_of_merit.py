"""Figures of the trade: known coefficients, and allantools beside."""

import json

import numpy as np
import pytest
import records_by_hand
from elliptic_runs import elliptic_run, tempered
from forced_runs import Truth, forced_run, programme

from hrg_cli.errors import HrgError
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.figures_of_merit import (
    compute_allan_figures,
    compute_calibration_figures,
    compute_scale_factor_figures,
)


def test_allan_deviation_agrees_with_allantools_and_its_coefficients_with_the_truth():
    allantools = pytest.importorskip("allantools")
    draw = np.random.default_rng(0)
    interval, walk = 0.5, 3e-6
    rate = (
        walk / np.sqrt(interval) * draw.normal(size=40_000)
        + np.cumsum(draw.normal(size=40_000)) * 2e-8
    )
    found = compute_allan_figures(rate, interval)
    # allantools leaves out multiples that differ only by rounding, so it is asked for our own
    _, expected, _, _ = allantools.oadev(
        rate, rate=1 / interval, data_type="freq", taus=found.time_s
    )
    assert found.deviation_rad_s[: len(expected)] == pytest.approx(expected, rel=1e-9)
    assert found.angle_random_walk_rad_sqrt_s == pytest.approx(walk, rel=0.03)
    assert found.rate_random_walk_rad_s_sqrt_s == pytest.approx(2e-8 / np.sqrt(interval), rel=0.5)
    with pytest.raises(HrgError, match="at least 30"):
        compute_allan_figures(rate[:10], interval)


def test_scale_factor_asymmetry_and_nonlinearity():
    truth = Truth(1, drift=1e-5, scale_ripple=1e-6, curved=False)
    runs = [
        forced_run(truth, 20.0, rate, 30, i, noise=1e-6)
        for i, rate in enumerate((-0.8, -0.4, 0.4, 0.8))
    ]
    plain = compute_scale_factor_figures(runs)
    assert plain.scale_factor == pytest.approx(0.55, rel=1e-4)
    assert abs(plain.asymmetry_ppm) < 60
    # positive rates read 300 ppm more
    skew = [
        r.replace(wave_angle_rad=r.wave_angle_rad * (1 + 3e-4 * (r.rate_rad_s[0] > 0)))
        for r in runs
    ]
    assert compute_scale_factor_figures(skew).asymmetry_ppm - plain.asymmetry_ppm == pytest.approx(
        300, rel=0.1
    )
    assert np.isnan(compute_scale_factor_figures(runs[1:3]).nonlinearity_ppm), (
        "two rates are on a line"
    )
    with pytest.raises(HrgError, match="one rate only"):
        compute_scale_factor_figures(runs[:1])


def test_the_scale_factor_s_figures_are_half_its_range():
    """K(T, θ) = K₀[1 + p(T) + a cos 4θ]: a in ppm over the angle, half the range of p over T."""
    record = records_by_hand.calibration()
    angle = np.asarray(record.wave_angle_rad)
    over_t = 40e-6 * np.linspace(-1, 1, len(record.node))[:, None]
    record = record.replace(scale_factor=0.277 * (1 + over_t + 25e-6 * np.cos(4 * angle)))
    figures = compute_calibration_figures(record)
    assert figures["scale_factor_angle_ppm"] == pytest.approx(25, rel=1e-3)
    assert figures["scale_factor_temperature_ppm"] == pytest.approx(40, rel=1e-3)


def test_figures_of_a_calibration_are_those_of_its_truth():
    truth = Truth(5)
    waves = programme(truth, (0, 20, 40), (-0.5, 0.5), duration=20)
    record = calibrate(waves, harmonics=2, scale_factor_harmonics=2, bootstrap=0)
    figures = compute_calibration_figures(record)
    theta = record.wave_angle_rad
    bias = np.stack(
        [truth.drift(T + 0 * theta, theta) / truth.scale(T + 0 * theta, theta) for T in (0, 20, 40)]
    )
    assert figures["bias_rad_s"] == pytest.approx(bias.mean(), rel=0.01, abs=1e-6)
    assert figures["angle_dependent_bias_rad_s"] == pytest.approx(
        np.ptp(bias, axis=1).max() / 2, rel=0.02
    )
    corrected = compute_scale_factor_figures(waves, record)
    assert abs(corrected.error_ppm) < 5 and max(np.abs(corrected.residual_ppm)) < 20


def test_a_scale_factor_that_follows_temperature_is_not_called_a_nonlinearity():
    """K moves by ±200 ppm over the programme and not with the rate; noise leaves a few ppm."""
    truth = Truth(1, drift=1e-5, scale_ripple=0, curved=False)
    truth.k[1, 0] = 0.55 * 4e-4
    waves = programme(truth, (0, 20, 40), (-0.8, -0.4, 0.4, 0.8), duration=20)
    record = calibrate(waves, harmonics=1, scale_factor_harmonics=0, model="table", bootstrap=0)
    trade = json.loads(record.details)["trade"]
    assert trade["scale_factor_temperature_ppm"] == pytest.approx(200, rel=0.02)
    assert abs(trade["scale_factor_nonlinearity_ppm"]) < 20
    assert abs(trade["scale_factor_asymmetry_ppm"]) < 20


def test_the_scale_factor_s_error_is_that_of_the_whole_correction_with_its_measured_part():
    """Runs with a quadrature of three percent: without −2rδω cos ζ their rate is hundreds of ppm
    off."""
    waves = [
        elliptic_run(
            tempered(T), T, rate, 0.1 + rate, 0.03, f"T{T:g} {rate:+}", duration=20.0, seed=i
        )
        for i, (T, rate) in enumerate((T, rate) for T in (0.0, 40.0) for rate in (-0.8, 0.8))
    ]
    record = calibrate(
        waves, harmonics=1, scale_factor_harmonics=0, model="quadrature", bootstrap=0
    )
    assert record.status == "valid", record.status_reasons
    trade = json.loads(record.details)["trade"]
    assert abs(trade["scale_factor_error_ppm"]) < 3
    assert trade["bias_rad_s"] == 0.0  # the model has no constant term
