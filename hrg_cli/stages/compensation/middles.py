"""The angle in the middles of increments from the means over the blocks at their ends, by
interpolation: the mean of both ends is too far along a bend, by Ω̇Δt²/8."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...fitting.tables.increments import AnglePath

Array = np.ndarray
MOST, FIRST = 6, 4
"""Blocks about an increment that its middle is told from; and at an end or a gap, if there are as
many."""
UNEVEN = 2.0
"""Times the usual distance of blocks from which an increment is a gap: how the angle bends there
is not known."""
ALIKE = 1e-6
"""Difference of the distances, in parts of them, up to which increments share their weights."""


@dataclass(frozen=True)
class Middles:
    """What each increment's middle takes of the blocks about it: their numbers (n, `MOST`) and
    weights (n, `MOST`), 0 where there are fewer; and what the middle of the path's first block
    takes of its first ones (`FIRST`,).

    Of the polynomial whose means over the blocks are theirs; evenly spaced single windows: (3, −25,
    150, 150, −25, 3)/256.
    """

    blocks: Array
    weight: Array
    begin: Array

    @classmethod
    def from_path(cls, path: AnglePath, most: int = MOST) -> Middles:
        """Of the path's n increments, by `most` blocks, six or four."""
        step, n = path.interval_s, len(path)
        gap = step > UNEVEN * np.median(step)
        # first and last block of the stretch without a gap that each increment is in
        number = np.arange(n)
        low = np.maximum.accumulate(np.where(gap, number + 1, 0))
        high = np.minimum.accumulate(np.where(gap, number, n)[::-1])[::-1]
        middle_s = path.average_neighbours(path.time_s)
        blocks = np.repeat(number[:, None], MOST, axis=1)
        weight = np.zeros((n, MOST))
        weight[:, :2], blocks[:, 1] = 0.5, number + 1
        # four beside an end too, six in the midst alone
        inner = np.clip(number - 1, low, np.maximum(high - FIRST + 1, low))
        for count, first in ((FIRST, inner), (MOST, number - 2)):
            fits = np.flatnonzero((first >= low) & (first + count - 1 <= high) & ~gap)
            if count <= most and len(fits):
                near = first[fits, None] + np.arange(count)
                blocks[fits, :count] = near
                weight[fits, :count] = _find_weights(path, middle_s[fits], step[fits], near)
        begin = np.eye(1, FIRST)[0]
        if high[0] >= FIRST - 1:
            (begin,) = _find_weights(path, path.time_s[:1], step[:1], np.arange(FIRST)[None])
        return cls(blocks, weight, begin[: n + 1])

    def interpolate(self, values: Array) -> Array:
        """Values (b,) of the blocks in the middles (n,)."""
        return np.asarray(np.sum(self.weight * values[self.blocks], axis=1))

    def interpolate_begin(self, values: Array) -> float:
        """Values (b,) of the blocks in the middle of the first."""
        return float(self.begin @ values[: len(self.begin)])

    def compute_variance(self, variance: Array, of_begin: float | None) -> Array:
        """Variance (n,) of the angle in the middles over that of the run's begin, by those of all
        blocks (b,), which err independently.

        of_begin: of the middle of the first block, where it is in a piece before; None: the path's.
        """
        used = np.where(self.weight != 0, variance[self.blocks], 0.0)
        alone = np.sum(self.weight**2 * used, axis=1)
        if of_begin is not None:
            return np.asarray(alone + of_begin)
        begin = np.zeros(len(variance))
        begin[: len(self.begin)] = self.begin
        shared = np.sum(self.weight * begin[self.blocks] * used, axis=1)
        return np.asarray(alone + self.compute_begin_variance(variance) - 2 * shared)

    def compute_begin_variance(self, variance: Array) -> float:
        """Of the angle in the middle of the path's first block."""
        return float(self.begin**2 @ variance[: len(self.begin)])


def _find_weights(path: AnglePath, at_s: Array, size_s: Array, blocks: Array) -> Array:
    """Weights (k, m) of blocks (k, m) for the angle at some times (k,).

    The polynomial's means over the blocks, (x + b/2)^{j+1} − (x − b/2)^{j+1} over (j + 1)b for its
    j-th term, are solved for its value at x = 0; in units of a size (k,).
    """
    size = size_s[:, None]
    x = (path.time_s[blocks] - at_s[:, None]) / size
    half = path.blur_s[blocks] / size / 2
    kind = np.concatenate([x, half], axis=1)
    usual = np.median(kind, axis=0)
    alike = np.all(np.abs(kind - usual) < ALIKE, axis=1)
    out = np.tile(_solve_weights(*np.split(usual[None], 2, axis=1)), (len(x), 1))
    out[~alike] = _solve_weights(x[~alike], half[~alike])
    return out


def _solve_weights(x: Array, half: Array) -> Array:
    """Weights (k, m) of means over x ± half (k, m) for the value at 0."""
    power = np.arange(x.shape[1])[:, None]
    narrow = half[:, None, :] < 1e-9
    width = np.where(narrow, 1.0, half[:, None, :])
    upper, lower = x[:, None, :] + width, x[:, None, :] - width
    means = (upper ** (power + 1) - lower ** (power + 1)) / (2 * width * (power + 1))
    terms = np.where(narrow, x[:, None, :] ** power, means)
    unit = np.zeros((len(x), x.shape[1], 1))
    unit[:, 0] = 1.0
    return np.linalg.solve(terms, unit)[..., 0]
