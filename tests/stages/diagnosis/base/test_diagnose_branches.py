"""The branch of a temperature cycle, step by step, against the sign of the slope on a fine grid."""

import numpy as np
import pytest

from hrg_cli.stages.diagnosis.base.branches import average_branch

FINE = np.linspace(0.0, 10.0, 400_001)


def hold_and_fall(t):
    return np.interp(t, [0.0, 2.13, 5.0, 6.37, 10.0], [20.0, 22.0, 22.0, 19.0, 19.0])


def triangle(t):
    return 20 + np.abs((t - 1.234) % 4 - 2)


COURSES = {
    "triangle": triangle,
    "sine": lambda t: 20 + np.sin(1.3 * t + 0.4),
    "hold and fall": hold_and_fall,
    "parabola": lambda t: 20 - 0.1 * (t - 4.321) ** 2,
}


def exact(course, t):
    """Means of the sign of the last change over the steps between the rows."""
    steps = np.diff(course(FINE))
    signs = np.where(np.abs(steps) > 1e-9, np.sign(steps), 0.0)
    signs = signs[np.maximum.accumulate(np.where(signs != 0, np.arange(len(signs)), 0))]
    area = np.concatenate([[0.0], np.cumsum(signs)]) * (FINE[1] - FINE[0])
    return np.diff(np.interp(t, FINE, area)) / np.diff(t)


@pytest.mark.parametrize("name", COURSES)
@pytest.mark.parametrize("rows", [97, 150, 301])
def test_a_turn_is_found_within_its_step(name, rows):
    t = np.linspace(0.0, 10.0, rows)
    found, true = average_branch(t, COURSES[name](t))[:-1], exact(COURSES[name], t)
    # ∫ of the branch, in steps: a sign a row would be off by up to two of them at every turn
    off = np.cumsum(found - true)
    assert np.abs(off).max() < (0.02 if name in ("parabola", "triangle", "hold and fall") else 0.1)


def test_a_constant_temperature_has_no_branch():
    t = np.arange(10.0)
    assert not average_branch(t, np.full(10, 25.0)).any()


def test_nothing_is_known_before_the_first_change():
    t = np.arange(20.0)
    warm = np.where(t < 8, 20.0, 20.0 + (t - 8))
    found = average_branch(t, warm)
    assert not found[:8].any() and np.all(found[8:] == 1)
