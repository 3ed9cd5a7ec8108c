"""Rows that are means of many windows stand for their middles, whatever the wave does within them."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_waves import GYRO, run_down

from hrg_cli import collect, demodulate, estimate, simulate
from hrg_cli.effects import find
from hrg_cli.fitting.causes import extended_fit, fit_point
from hrg_cli.stages.diagnosis.base.base_priors import choose_freedom
from hrg_cli.stages.diagnosis.base.data import is_averaged_well, prepare
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base

SPLIT_RAD_S = 0.19
DRIVEN = {
    "device": {
        "frequency_hz": 2000.0,
        "damping_rate_1_s": 0.25,
        "frequency_split_rad_s": SPLIT_RAD_S,
        "stiffness_axis_rad": 0.2,
        "scale_factor": 0.55,
    },
    "control": {"mode": "forced"},
    "readout": {"noise": 1e-5},
    "recording": {"sample_rate_hz": 13000.0, "duration_s": 4.0, "log_rate_hz": 400.0},
}
ROWS = 250
RATES_RAD_S = (2.0, 4.0, -4.0)


def driven_waves():
    """Three driven runs with a split that the loops null, at rates that turn the wave far in a row."""
    waves = []
    for k, rate in enumerate(RATES_RAD_S):
        run = DRIVEN | {"environment": {"rate_rad_s": rate}}
        samples = collect(simulate(run, seed=k))
        wave = collect(estimate(collect(demodulate(samples, periods_per_window=10))))
        waves.append(wave.replace(run_id=f"r{k}", rate_rad_s=np.full(len(wave), rate)))
    return waves


def test_driven_rows_know_the_split_that_turns_under_them():
    """The first guess of driven runs has no split. What that leaves in the rows' means, h²[Δ, L]u/24,
    is many σ at this noise, and looked like a split that changes with the square of the rate."""
    fit = fit_base(driven_waves(), scale_factor=None, blocks=120, free_phase=False)
    assert fit.chi2 / fit.dof < 1.5
    split = np.hypot(*fit.point.p[3:5])
    assert split == pytest.approx(SPLIT_RAD_S, rel=3e-5)


def test_an_average_that_knows_less_than_the_fit_is_noticed():
    waves = driven_waves()
    blind, _, _ = prepare(waves, None, ROWS)
    fit = fit_base(waves, scale_factor=None, blocks=ROWS, free_phase=False)
    again, _, _ = prepare(waves, None, ROWS, along=fit.point)
    moved = np.linalg.norm((blind.envelope - again.envelope) * again.weight[..., None])
    assert moved > 1 and not is_averaged_well(blind, fit.point)
    assert is_averaged_well(again, fit.point)


CORNERS = np.array([0.0, 1.0, 1.3, 2.3, 2.6, 4.0])
SOAK_DEGC = np.array([20.0, 20.0, 23.0, 23.0, 21.0, 21.0])
FOLLOWS_1_K = 2e-6


def soaked(theta_rad, window_s=8e-3, fine=50):
    """A run-down whose frequency follows the levels of an oven, with the means of its windows; its
    amplitude goes along."""
    wave = run_down(
        theta_rad, std=1e-6, seconds=CORNERS[-1], window=window_s, seed=int(9 * theta_rad)
    )
    t = (np.arange(len(wave) * fine) + 0.5) * window_s / fine
    warm = np.interp(t, CORNERS, SOAK_DEGC)
    warmer = np.cumsum(warm - 25.0) * window_s / fine
    turned = 2 * np.pi * GYRO.frequency_hz * FOLLOWS_1_K * warmer
    warm_rows = warm.reshape(-1, fine).mean(axis=1)
    # a spring that moves leaves aω^½ as it is
    smaller = 1 - FOLLOWS_1_K * (warm_rows - SOAK_DEGC[0]) / 2
    return wave.replace(
        temperature_degc=warm_rows,
        main_amplitude=wave.main_amplitude * smaller,
        quadrature_amplitude=wave.quadrature_amplitude * smaller,
        phase_rad=wave.phase_rad + np.interp(wave.time_s, t + window_s / fine / 2, turned),
    )


def test_rows_know_where_in_them_the_temperature_turned_a_corner():
    """A row's phase is the mean over the row of what its temperature turns it by: trapezoids from
    row to row, h²/12 of every change of slope beside that, passed for a knock at 9 σ."""
    series, point, _ = prepare([soaked(theta) for theta in (0.1, 0.4, 0.7)], GYRO.scale_factor, 120)
    assert np.median(series.step_s) > 3 * 8e-3
    known = find("thermal_frequency")
    held = replace(known, parameters=tuple(replace(p, fitted=False) for p in known.parameters))
    point = fit_point.add_effect(point, held, known.values({"relative_1_k": FOLLOWS_1_K}))
    fit = extended_fit.fit(series, point, choose_freedom(series, point, GYRO.scale_factor))
    assert fit.chi2 / fit.dof < 2
