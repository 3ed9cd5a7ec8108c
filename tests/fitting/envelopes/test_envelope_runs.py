"""Rows averaged from windows stand where the wave stood at their time, however the rate bends."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from synthetic_waves import GYRO, as_wave, envelope

from hrg_cli.fitting.envelopes import envelope_runs, propagator
from hrg_cli.fitting.envelopes.coordinates import from_mechanics

STEP_S, ROWS = 0.005, 300


def angle_turned(t):
    """∫Ω dt of a rate that changes over by 4 rad/s within some windows, and that rate."""
    width = 0.04
    x = (t - 0.7) / width
    return 3.0 * t + 2.0 * width * np.log(np.cosh(x)), 3.0 + 2.0 * np.tanh(x)


@pytest.mark.parametrize("rows", (120, 220, 299))
def test_averaged_rows_have_the_turn_and_the_envelope_of_their_own_time(rows):
    fine = np.linspace(0, STEP_S * ROWS, 20 * ROWS + 1)[1:]
    exact = envelope(GYRO, 0.3, lambda x: angle_turned(x)[1], fine)
    windows = slice(9, None, 20)
    wave = as_wave(exact[windows], fine[windows], 1e-9, GYRO, np.random.default_rng(0))
    run = envelope_runs.from_wave(wave.replace(rate_rad_s=angle_turned(fine[windows])[1]))
    carry = propagator.make_propagator(from_mechanics(GYRO), 0.0)
    row = envelope_runs.average_rows(run, rows, carry)
    assert len(row) < ROWS
    inner = slice(3, -3)
    # a line between two windows is 2e-4 rad off
    assert np.ptp((row.turn_rad - angle_turned(row.time_s)[0])[inner]) < 1e-5
    missed = np.abs(row.envelope - CubicSpline(fine, exact)(row.time_s))[inner]
    assert missed.max() < 1e-5
