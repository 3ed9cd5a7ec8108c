"""Angles stay continuous over many turns, gaps and changes of copy; the slope of a phase is that of
a straight line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hrg_cli.fitting.ellipse.continuity import (
    continue_angles,
    estimate_local_slope,
    find_nearest_copy,
)

TIME = np.arange(600) * 0.01


def copies(angle, phase, carrier, generator):
    """Each row replaced by a random one of its equivalent copies."""
    a, b, c = generator.integers(-5, 6, (3, len(angle)))
    return angle + np.pi * a, phase + np.pi * a + 2 * np.pi * b + np.pi * c, carrier + np.pi * c


@settings(max_examples=40)
@given(st.floats(-120, 120), st.floats(-250, 250), st.floats(-120, 120), st.integers(0, 2**32 - 1))
def test_continuous_paths_come_back_from_any_copies(angle_rate, phase_rate, carrier_rate, seed):
    truth = angle_rate * TIME + 0.3 * np.sin(5 * TIME), phase_rate * TIME, carrier_rate * TIME
    found = continue_angles(TIME, *copies(*truth, np.random.default_rng(seed)), window_s=0.01)
    shifts = [(f - t) / np.pi for f, t in zip(found, truth, strict=True)]
    for shift in shifts:
        np.testing.assert_allclose(shift, shift[0], atol=1e-9)
    total = shifts[0][0] + shifts[1][0] + shifts[2][0]
    assert total / 2 == pytest.approx(round(total / 2), abs=1e-9)


def test_the_slope_carries_over_a_gap():
    """Three turns of the phase within a gap are counted, because the slope on both sides tells
    them."""
    generator = np.random.default_rng(1)
    kept = (TIME < 2) | (TIME > 3.3)
    time_s = TIME[kept]
    angle, phase = 3 * time_s, 15 * time_s + 0.01 * generator.standard_normal(len(time_s))
    found = continue_angles(time_s, *copies(angle, phase, 0 * time_s, generator), window_s=0.01)
    np.testing.assert_allclose(found[0] - found[0][0], angle - angle[0], atol=1e-9)
    np.testing.assert_allclose(found[1] - found[1][0], phase - phase[0], atol=1e-9)


def test_where_the_sides_disagree_the_nearest_copy_is_taken():
    time_s = np.concatenate([TIME[:100], TIME[300:400]])
    phase = np.where(time_s < 2, 9 * time_s, -9 * time_s)
    found = continue_angles(time_s, 0 * time_s, phase, 0 * time_s, window_s=0.01)[1]
    assert abs(found[100] - found[99]) <= np.pi


def test_slope_of_a_line_with_uneven_times_and_missing_rows():
    generator = np.random.default_rng(2)
    time_s = 1e4 + np.cumsum(generator.uniform(0.5, 1.5, 500))
    values = 1e6 + 3.7 * time_s
    weights = np.ones(500)
    weights[[0, 1, 40, 41, 42, 499]] = 0
    values[weights == 0] = np.nan
    np.testing.assert_allclose(estimate_local_slope(time_s, values, weights, 5), 3.7, rtol=1e-7)


def test_slope_is_unknown_where_nothing_is_known():
    assert np.isnan(estimate_local_slope(np.arange(5.0), np.arange(5.0), np.zeros(5), 2)).all()
    assert np.isnan(estimate_local_slope(np.arange(1.0), np.arange(1.0), np.ones(1), 2)).all()


def test_the_nearest_copy_describes_the_same_wave():
    """Whatever copy comes in, out comes the one beside what was expected, for odd half turns of
    angle and carrier, too."""
    generator = np.random.default_rng(5)
    expected = generator.uniform(-20, 20, (500, 3))
    near = expected + generator.uniform(-0.5, 0.5, (500, 3))
    np.testing.assert_allclose(
        find_nearest_copy(np.stack(copies(*near.T, generator), axis=-1), expected), near, atol=1e-9
    )


def test_an_angle_alone_is_counted_over_a_gap():
    """The predicted step over a gap decides, not the smallest: two half turns of the angle lie
    within it."""
    kept = (TIME < 2) | (TIME > 3.5)
    time_s = TIME[kept]
    angle = 4.5 * time_s
    found = continue_angles(time_s, np.mod(angle, np.pi), 0 * time_s, 0 * time_s, window_s=0.01)[0]
    np.testing.assert_allclose(found - found[0], angle - angle[0], atol=1e-9)
