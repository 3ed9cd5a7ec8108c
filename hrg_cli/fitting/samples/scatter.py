"""The noise of windows of few samples, whose residuals are their motion's: from the envelopes' own
scatter from window to window.

A window of five samples has two degrees of freedom beside the oscillation, and the envelope's slope
within it fills both. What is left of the sum of squares once that share is taken out is a difference
of nearly equal numbers: Σ(m + n)² − Σm² = 2 Σ m·n + Σn², of which the first part has no mean but, of m
some ten times n, ten times the scatter.
"""

from __future__ import annotations

from math import comb

import numpy as np

Array = np.ndarray
FEWEST = 16
"""Differences from which a scatter is a scatter."""
BENT = 0.05
"""Part of itself by which the motion's share is wrong where the envelope bends within the window."""
UNSURE = 0.5
"""Doubt about the variance, over the variance, from which the residual does not tell it."""
ORDER, GAIN = 4, 70.0
"""Order of the differences: three leave some of a motion that turns and decays by hundredths a window,
five none of what the windows' own bends do from row to row. Their variance over that of a value,
1 + 16 + 36 + 16 + 1."""


def estimate_scattered_variance(envelope: Array, own: Array, every: int = 1) -> float:
    """Variance a sample that the differences of envelopes (windows, tones) show, at one window of
    `every`, whose coefficients have `own` (windows or 1,) of it; NaN where there are too few.

    The median leaves jumps aside (|z|² of a complex normal number has the median ln 2).
    """
    count = max(0, len(envelope) - ORDER)
    terms = ((-1) ** k * comb(ORDER, k) * envelope[k : count + k : every] for k in range(ORDER + 1))
    differences = np.abs(sum(terms)) ** 2
    differences = differences[np.isfinite(differences)]
    if len(differences) < FEWEST:
        return float("nan")
    return float(np.median(differences) / np.log(2) / (2 * GAIN) / np.median(own))


def settle_by_scatter(pooled: Array, share: Array, freedom: Array, seen: float) -> Array:
    """The pooled variances (windows,), or the one that was seen from window to window where the
    motion's `share` (windows,) of each leaves them unsure."""
    if not seen > 0:
        return pooled
    share = np.where(np.isfinite(share), share, 0.0)
    held = max(1.0, float(np.sum(np.broadcast_to(freedom, share.shape))))
    mean = float(share.mean())
    doubt = 2 * np.sqrt(mean * seen / held) + BENT * mean
    return np.where(np.isfinite(pooled), seen, pooled) if doubt > UNSURE * seen else pooled
