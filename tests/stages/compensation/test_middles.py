"""The angle in the middles of increments, by what each takes of the blocks about it."""

from dataclasses import replace

import numpy as np
import pytest

from hrg_cli.fitting.tables.drawn_path import draw_path
from hrg_cli.stages.compensation.middles import FIRST, Middles


def uneven_path(blocks=20, width=0.0):
    """Blocks that are not quite evenly apart; single windows, or means over `width`."""
    path = draw_path(blocks=blocks)
    random = np.random.default_rng(3)
    time_s = np.cumsum(1 + 0.2 * random.uniform(-1, 1, blocks))
    return replace(path, time_s=time_s, width_s=np.full(blocks, np.hypot(width, 1)), row_s=1.0)


@pytest.mark.parametrize("width", [0.0, 0.7])
def test_a_cubic_is_met_everywhere_and_a_quintic_within(width):
    path = uneven_path(width=width)
    middles, t = Middles.from_path(path), path.time_s

    def mean(power):
        """Of t^n over each block."""
        if not width:
            return t**power
        upper, lower = ((t + sign * width / 2) ** (power + 1) for sign in (1, -1))
        return (upper - lower) / (power + 1) / width

    middle = (t[1:] + t[:-1]) / 2
    assert middles.interpolate(mean(3)) == pytest.approx(middle**3, rel=1e-9)
    assert middles.interpolate(mean(5))[2:-2] == pytest.approx(middle[2:-2] ** 5, rel=1e-9)


def test_beside_a_gap_the_bend_is_that_of_the_other_side():
    path = uneven_path()
    time_s = path.time_s + np.where(np.arange(20) > 9, 30.0, 0.0)
    middles = Middles.from_path(replace(path, time_s=time_s))
    used = [set(b[w != 0]) for b, w in zip(middles.blocks, middles.weight, strict=True)]
    assert used[9] == {9, 10} and max(used[8]) == 9 and min(used[10]) == 10


@pytest.mark.parametrize("width", [0.0, 0.7])
def test_the_variance_is_that_over_the_run_s_begin(width):
    """σ² from draws of the blocks' errors, of a run and of a piece of it that begins later."""
    path = uneven_path(blocks=8, width=width)
    middles, random = Middles.from_path(path), np.random.default_rng(5)
    std = np.linspace(1, 2, 8)
    off = std * random.standard_normal((20_000, 8))
    begun = [middles.interpolate(one) - middles.interpolate_begin(one) for one in off]
    drawn = np.var(begun, axis=0)
    assert middles.compute_variance(std**2, None) == pytest.approx(drawn, rel=0.05)
    alone = np.var([middles.interpolate(one) for one in off], axis=0)
    assert middles.compute_variance(std**2, 4.0) == pytest.approx(alone + 4.0, rel=0.05)


def test_four_blocks_say_otherwise_where_the_angle_bends_much():
    path = uneven_path()
    middles, four, t = Middles.from_path(path), Middles.from_path(path, FIRST), path.time_s

    def compute_truncation(values):
        return middles.interpolate(values) - four.interpolate(values)

    assert np.abs(compute_truncation(t**3)).max() < 1e-9 * t[-1] ** 3
    assert np.all(np.abs(compute_truncation(np.sin(2 * t))[2:-2]) > 0)
    off = middles.interpolate(np.sin(t)) - np.sin((t[1:] + t[:-1]) / 2)
    assert np.abs(off[2:-2]).max() < np.abs(compute_truncation(np.sin(t))[2:-2]).max()
