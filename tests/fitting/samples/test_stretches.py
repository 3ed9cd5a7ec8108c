"""The longest stretch of a series does not depend on the pieces in which it comes."""

import itertools

import numpy as np
import pytest

from hrg_cli.fitting.samples.stretches import Stretches


def by_hand(series):
    """(start, stop) of every True stretch."""
    runs = [(value, len(list(run))) for value, run in itertools.groupby(series)]
    stops = np.cumsum([length for _, length in runs])
    return [
        (stop - length, stop) for (value, length), stop in zip(runs, stops, strict=True) if value
    ]


@pytest.mark.parametrize("seed", range(30))
def test_pieces_change_nothing(seed):
    rng = np.random.default_rng(seed)
    series = rng.random(rng.integers(1, 60)) < rng.choice([0.0, 0.2, 0.8, 1.0])
    whole, pieces = Stretches(), Stretches()
    whole.add(series)
    for piece in np.split(series, np.sort(rng.integers(0, len(series) + 1, 7))):
        pieces.add(piece)
    assert pieces == whole
    found = by_hand(series.tolist())
    assert whole.count == len(series) and whole.true == np.count_nonzero(series)
    assert whole.begun == sum(start > 0 for start, _ in found)
    longest = max(found, key=lambda one: one[1] - one[0], default=(0, 0))
    assert whole.longest == longest
