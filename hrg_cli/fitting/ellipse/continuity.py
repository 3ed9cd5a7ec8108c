"""Continuous angles along a run, and the slope of the phase.

The estimates know (mθ, φ, ψ) up to the shifts (π, π, 0), (0, 2π, 0) and (0, π, π), written here as x = (mθ, φ, ψ). From row to row
the nearest copy is taken; over a gap the copy nearest to what the slopes before and after it predict, where the two agree.
"""

import numpy as np

Array = np.ndarray
CONTEXT_ROWS = 64
"""Rows before and after a gap that tell the slope over it."""
FEWEST_ROWS = 8


def continued(time_s: Array, angle: Array, phase: Array, carrier_phase: Array, window_s: float) -> tuple[Array, Array, Array]:
    """Continuous (mθ, φ, ψ) of finite rows (n), the first row unchanged."""
    carrier = _unwrapped(time_s, carrier_phase, np.pi, window_s)
    phase = phase + np.pi * np.round((carrier - carrier_phase) / np.pi)
    electrical = _unwrapped(time_s, angle, np.pi, window_s)
    phase = phase + np.pi * np.round((electrical - angle) / np.pi)
    return electrical, _unwrapped(time_s, phase, 2 * np.pi, window_s), carrier


def nearest_copy(x: Array, expected: Array) -> Array:
    """The copies of x = (mθ, φ, ψ) (n, 3) nearest to the expected ones (n, 3): ψ first, then mθ, then φ."""
    electrical, phase, carrier = x.T
    carrier_turns, turns = np.round((expected[:, 2] - carrier) / np.pi), np.round((expected[:, 0] - electrical) / np.pi)
    phase = phase + np.pi * (carrier_turns + turns)
    phase = phase + 2 * np.pi * np.round((expected[:, 1] - phase) / (2 * np.pi))
    return np.stack([electrical + np.pi * turns, phase, carrier + np.pi * carrier_turns], axis=-1)


def _unwrapped(time_s: Array, values: Array, period: float, window_s: float) -> Array:
    """Values (n) plus multiples of the period, each step the one nearest to its prediction."""
    if len(values) < 2:
        return values.copy()
    steps, intervals = np.diff(values), np.diff(time_s)
    nearest = steps - period * np.round(steps / period)
    gaps = np.flatnonzero(intervals > 1.5 * max(window_s, float(np.median(intervals))))
    if len(gaps):
        predicted = _slopes(time_s, np.concatenate([[0.0], np.cumsum(nearest)]), gaps, intervals[gaps], period) * intervals[gaps]
        nearest[gaps] = steps[gaps] - period * np.round((steps[gaps] - predicted) / period)
    turns = np.round((np.concatenate([[0.0], np.cumsum(nearest)]) - (values - values[0])) / period)
    return values + period * turns


def _slopes(time_s: Array, path: Array, gaps: Array, length_s: Array, period: float) -> Array:
    """Slope over each gap from the rows beside it; 0 where too few rows, or two sides that differ by over a quarter period, tell it."""
    edges = np.concatenate([[-1], gaps, [len(path) - 1]])
    first = np.maximum(edges[:-2] + 1, gaps - CONTEXT_ROWS)
    last = np.minimum(edges[2:], gaps + 1 + CONTEXT_ROWS)
    with np.errstate(divide="ignore", invalid="ignore"):
        before = (path[gaps] - path[first]) / (time_s[gaps] - time_s[first])
        after = (path[last] - path[gaps + 1]) / (time_s[last] - time_s[gaps + 1])
    told_before, told_after = gaps - first >= FEWEST_ROWS, last - gaps - 1 >= FEWEST_ROWS
    agree = np.abs(before - after) * length_s < period / 4
    return np.where(told_before & told_after & agree, (before + after) / 2, np.where(told_before & ~told_after, before, 0.0))


def local_slope(time_s: Array, values: Array, weights: Array, half_width: int) -> Array:
    """Slope of a straight line through each row's 2·half_width + 1 neighbours (fewer at the ends), weighted; NaN where they are one.

    Sums are taken about each row's own time and value, so a long run loses no digits.
    """
    n = len(values)
    half_width = min(half_width, n - 1)
    sums = np.zeros((5, n))
    used = weights > 0
    anchor = np.where(used, values, 0.0)
    nearest = np.maximum.accumulate(np.where(used, np.arange(n), -1))
    anchor = np.where(nearest >= 0, anchor[nearest], values[np.argmax(used)] if used.any() else 0.0)
    safe = np.where(used, values, 0.0)
    for offset in range(-half_width, half_width + 1):
        here, there = slice(max(0, -offset), min(n, n - offset)), slice(max(0, offset), min(n, n + offset))
        w = weights[there]
        t, v = time_s[there] - time_s[here], safe[there] - anchor[here]
        for row, term in zip(sums[:, here], (w, w * t, w * v, w * t * t, w * t * v), strict=True):
            row += term
    w, t, v, tt, tv = sums
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (w * tv - t * v) / (w * tt - t * t)
    return np.where(np.isfinite(slope), slope, np.nan)
