"""Rows that are means of many windows stand for their middles, whatever the wave does within them."""

import numpy as np
import pytest

from hrg_cli import collect, demodulate, estimate, simulate
from hrg_cli.stages.diagnosis.base_fit import fit_base
from hrg_cli.stages.diagnosis.data import is_averaged_well, prepare

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
    blind, guess, _ = prepare(waves, None, ROWS)
    fit = fit_base(waves, scale_factor=None, blocks=ROWS, free_phase=False)
    again, _, _ = prepare(waves, None, ROWS, along=fit.point)
    moved = np.linalg.norm((blind.envelope - again.envelope) * again.weight[..., None])
    assert moved > 1 and not is_averaged_well(blind, guess, fit.point)
    assert is_averaged_well(again, fit.point, fit.point)
