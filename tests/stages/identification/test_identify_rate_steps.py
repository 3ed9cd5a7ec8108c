"""Runs whose logged rate steps: the log does not tell how far the table turned meanwhile."""

import numpy as np
import pytest
from synthetic_waves import errors, run_down

from hrg_cli.fitting.samples.rate_steps import find_steps
from hrg_cli.stages.identify import identify


def turn_round(t):
    """0.5 rad/s, and the other way round from 2.003 s on."""
    return np.where(np.asarray(t) < 2.003, 0.5, -0.5)


def logged(wave, every_s=0.01):
    """With the rate as a log of 100 Hz has it."""
    grid = np.arange(0, 4.0 + every_s, every_s)
    return wave.replace(rate_rad_s=np.interp(wave.time_s, grid, turn_round(grid)))


def runs(window):
    made = {"std": 1e-4, "window": window}
    turned = logged(run_down(0.9, turn_round, seed=3, run_id="turned", **made))
    return [run_down(0.1 + 0.4 * k, (0.0, 1.0, -1.0)[k], seed=k, **made) for k in range(3)], turned


@pytest.mark.parametrize("window", [1e-3, 2e-3, 0.02])
def test_a_step_between_two_rows_of_the_log_takes_no_trust_away(window):
    """The run "disagreed with the rest", χ² was 20 and every error 90 times what it is."""
    others, turned = runs(window)
    record = identify([*others, turned])
    assert record.status == "valid"
    assert any("run turned: its logged rate steps" in said for said in record.status_reasons)
    found = errors(record)
    assert max(map(abs, found.values())) < 4
    alone = identify(others)
    assert (record.std <= 1.05 * alone.std).all()


def test_a_rate_that_moves_all_the_time_is_not_cut():
    others, _ = runs(2e-3)
    swinging = run_down(0.9, lambda t: 0.5 * np.sin(3 * np.asarray(t)), seed=4, std=1e-4)
    record = identify([*others, swinging])
    assert record.status == "valid" and not record.status_reasons


def test_a_step_that_turns_less_than_the_noise_is_none():
    rate = np.where(np.arange(100) < 50, 0.5, -0.5)
    good = np.ones(100, bool)
    assert find_steps(rate, good, np.full(99, 0.2)) == []
    assert find_steps(rate, good, np.full(99, 0.4)) == [(49, 49)]
