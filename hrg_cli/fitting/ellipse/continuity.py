"""Continuous angles along a run, and the slope of the phase.

The estimates know (mθ, φ, ψ) up to the shifts (π, π, 0), (0, 2π, 0) and (0, π, π), written here as
x = (mθ, φ, ψ). From row to row the nearest copy is taken; over a gap the copy nearest to what the
slopes before and after it predict, where the two agree.
"""

import numpy as np

Array = np.ndarray
CONTEXT_ROWS = 64
"""Rows before and after a gap that tell the slope over it."""
FEWEST_ROWS = 8
SEGMENT = 128
"""Rows whose times and values are summed about the same ones."""


def continue_angles(
    time_s: Array, angle: Array, phase: Array, carrier_phase: Array, window_s: float
) -> tuple[Array, Array, Array]:
    """Angles along a run without the jumps of their copies, the first row unchanged.

    Parameters
    ----------
    time_s
        Of the rows (n,), increasing, s.
    angle
        mθ (n,), known up to π, rad.
    phase
        φ (n,), rad.
    carrier_phase
        ψ (n,), known up to π, rad.
    window_s
        From row to row; steps of more than 1.5 of it, and of their median, are gaps.

    Returns
    -------
    angle : ndarray
        mθ (n,), rad.
    phase : ndarray
        φ (n,), rad.
    carrier_phase : ndarray
        ψ (n,), rad.

    Examples
    --------
    A pattern that turns by 0.5 rad a row, each angle known up to a half turn that turns φ by π:

    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.continuity import continue_angles
    >>> t, none = np.arange(20.0), np.zeros(20)
    >>> turns = np.round(0.5 * t / np.pi)
    >>> angle, phase, _ = continue_angles(t, 0.5 * t - np.pi * turns, np.pi * turns, none, 1.0)
    >>> np.diff(angle).round(9).tolist()[:4], bool(np.ptp(phase) < 1e-9)
    ([0.5, 0.5, 0.5, 0.5], True)
    """
    intervals = np.diff(time_s)
    gaps = np.flatnonzero(intervals > 1.5 * window_s)
    if len(gaps):  # the median is not worth its sorting where nothing can be a gap
        gaps = np.flatnonzero(intervals > 1.5 * max(window_s, float(np.median(intervals))))
    # ψ first, then mθ: a half turn of either turns φ by π, so φ is unwrapped last and over 2π.
    carrier = _unwrap(time_s, carrier_phase, np.pi, gaps)
    phase = phase + np.pi * np.round((carrier - carrier_phase) / np.pi)
    electrical = _unwrap(time_s, angle, np.pi, gaps)
    phase = phase + np.pi * np.round((electrical - angle) / np.pi)
    return electrical, _unwrap(time_s, phase, 2 * np.pi, gaps), carrier


def find_nearest_copy(x: Array, expected: Array) -> Array:
    """The copies of some angles nearest to the expected ones: ψ first, then mθ, then φ.

    Parameters
    ----------
    x
        mθ, φ, ψ (n, 3), rad.
    expected
        The same (n, 3).

    Returns
    -------
    ndarray
        (n, 3), x shifted by (π, π, 0), (0, 2π, 0) and (0, π, π).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.continuity import find_nearest_copy
    >>> x = np.array([[0.1, 0.2, 0.3]])
    >>> ((find_nearest_copy(x, x + [3.0, 3.0, 0.0]) - x) / np.pi).round(9).tolist()
    [[1.0, 1.0, 0.0]]
    """
    electrical, phase, carrier = x.T
    carrier_turns, turns = (
        np.round((expected[:, 2] - carrier) / np.pi),
        np.round((expected[:, 0] - electrical) / np.pi),
    )
    phase = phase + np.pi * (carrier_turns + turns)
    phase = phase + 2 * np.pi * np.round((expected[:, 1] - phase) / (2 * np.pi))
    return np.stack([electrical + np.pi * turns, phase, carrier + np.pi * carrier_turns], axis=-1)


def _unwrap(time_s: Array, values: Array, period: float, gaps: Array) -> Array:
    """Values (n) plus multiples of the period, each step the one nearest to its prediction; `gaps`:
    rows before a gap."""
    if len(values) < 2:
        return values.copy()
    steps = np.diff(values)
    if not len(gaps):
        turns = np.round(steps / period)
        return (
            values - period * np.concatenate([[0.0], np.cumsum(turns)])
            if turns.any()
            else values.copy()
        )
    nearest = steps - period * np.round(steps / period)
    intervals = np.diff(time_s)
    predicted = (
        _estimate_gap_slopes(
            time_s, np.concatenate([[0.0], np.cumsum(nearest)]), gaps, intervals[gaps], period
        )
        * intervals[gaps]
    )
    nearest[gaps] = steps[gaps] - period * np.round((steps[gaps] - predicted) / period)
    turns = np.round((np.concatenate([[0.0], np.cumsum(nearest)]) - (values - values[0])) / period)
    return values + period * turns


def _estimate_gap_slopes(
    time_s: Array, path: Array, gaps: Array, length_s: Array, period: float
) -> Array:
    """Slope over each gap from the rows beside it; 0 where too few rows, or two sides that differ
    by over a quarter period, tell it."""
    edges = np.concatenate([[-1], gaps, [len(path) - 1]])
    first = np.maximum(edges[:-2] + 1, gaps - CONTEXT_ROWS)
    last = np.minimum(edges[2:], gaps + 1 + CONTEXT_ROWS)
    with np.errstate(divide="ignore", invalid="ignore"):
        before = (path[gaps] - path[first]) / (time_s[gaps] - time_s[first])
        after = (path[last] - path[gaps + 1]) / (time_s[last] - time_s[gaps + 1])
    told_before, told_after = gaps - first >= FEWEST_ROWS, last - gaps - 1 >= FEWEST_ROWS
    # Two slopes that predict ends a quarter period apart point to different copies.
    agree = np.abs(before - after) * length_s < period / 4
    return np.where(
        told_before & told_after & agree,
        (before + after) / 2,
        np.where(told_before & ~told_after, before, 0.0),
    )


def estimate_local_slope(time_s: Array, values: Array, weights: Array, half_width: int) -> Array:
    """Slope of a straight line through each row's neighbours, weighted.

    The sums of every `SEGMENT` rows are about the segment's own time and value, so a long run loses
    no digits.

    Parameters
    ----------
    time_s
        Of the rows (n,), s.
    values
        At the rows (n,).
    weights
        Of the rows (n,); a row of weight 0 is not used.
    half_width
        Neighbours on either side; fewer at the ends.

    Returns
    -------
    ndarray
        (n,), unit of the values per second; NaN where less than two neighbours are used.

    Examples
    --------
    A parabola has the slope 2t, and at its ends that of the neighbours' middle:

    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.continuity import estimate_local_slope
    >>> t = np.arange(6.0)
    >>> estimate_local_slope(t, t**2, np.ones(6), 1).round(9).tolist()
    [1.0, 2.0, 4.0, 6.0, 8.0, 9.0]
    """
    n = len(values)
    h = min(half_width, n - 1)
    used = weights > 0
    filled = values if used.all() else _fill_unused(values, used)
    segments = -(-n // SEGMENT)
    ends = (h, segments * SEGMENT + h - n)
    rows = np.lib.stride_tricks.sliding_window_view
    columns = (
        np.pad(np.where(np.isfinite(time_s), time_s, 0.0), ends, mode="edge"),
        np.pad(filled, ends, mode="edge"),
        np.pad(np.where(used, weights, 0.0), ends),
    )
    t, v, w = (rows(column, SEGMENT + 2 * h)[::SEGMENT] for column in columns)
    middle = h + SEGMENT // 2
    t, v = t - t[:, middle, None], v - v[:, middle, None]
    wt, wv = w * t, w * v
    w, wt, wv, wtt, wtv = (_sum_running(term, 2 * h + 1) for term in (w, wt, wv, wt * t, wt * v))
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = ((w * wtv - wt * wv) / (w * wtt - wt * wt)).ravel()[:n]
    return np.where(np.isfinite(slope), slope, np.nan)


def _fill_unused(values: Array, used: Array) -> Array:
    """Values with each unused row as the last used one before it, or the first used one behind."""
    nearest = np.maximum.accumulate(np.where(used, np.arange(len(values)), -1))
    nearest[nearest < 0] = np.argmax(used) if used.any() else 0
    return np.asarray(np.where(used, values, 0.0)[nearest])


def _sum_running(terms: Array, length: int) -> Array:
    """Sums of `length` neighbours along each row of terms (segments, columns), by those of 1, 2, 4,
    … neighbours: each is the sum of two of half its length."""
    columns = terms.shape[1] - length + 1
    out, summed, size = np.zeros((len(terms), columns)), 0, 1
    while True:
        if length & size:
            out += terms[:, summed : summed + columns]
            summed += size
        if 2 * size > length:
            return out
        terms = terms[:, :-size] + terms[:, size:]
        size *= 2
