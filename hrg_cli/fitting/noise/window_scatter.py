"""The noise of windows of few samples, whose residuals are their motion's: from the envelopes' own
scatter from window to window.

A window of five samples has two degrees of freedom beside the oscillation, and the envelope's slope
within it fills both. What is left of the sum of squares once that share is taken out is a
difference of nearly equal numbers: Σ(m + n)² − Σm² = 2 Σ m·n + Σn², of which the first part has no
mean but, of m some ten times n, ten times the scatter.
"""

from __future__ import annotations

from math import comb

import numpy as np

from ..medians import find_median

Array = np.ndarray
FEWEST = 16
"""Differences from which a scatter is a scatter."""
BENT = 0.05
"""Part of itself by which the motion's share is wrong where the envelope bends within the
window."""
UNSURE = 0.5
"""Doubt about the variance, over the variance, from which the residual does not tell it."""
ORDER, GAIN = 4, 70.0
"""Order of the differences: three leave some of a motion that turns and decays by hundredths a
window, five none of what the windows' own bends do from row to row. Their variance over that of a
value, 1 + 16 + 36 + 16 + 1."""


def estimate_scattered_variance(envelope: Array, own: Array, every: int = 1) -> float:
    """Variance a sample that the differences of envelopes from window to window show.

    The median leaves jumps aside (|z|² of a complex normal number has the median ln 2 of its mean).

    Parameters
    ----------
    envelope
        (windows, tones).
    own
        Variance of the coefficients in that of one sample (windows or 1,).
    every
        One difference of so many is taken.

    Returns
    -------
    float
        Unit of the samples squared; NaN where there are fewer than `FEWEST` differences.

    Examples
    --------
    Envelopes that turn and decay, whose parts have a tenth of a sample's variance of 4:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.window_scatter import estimate_scattered_variance
    >>> noise = np.random.default_rng(0).standard_normal((2, 20_000, 1)) * np.sqrt(0.1 * 4)
    >>> motion = 1000 * np.exp((0.02j - 1e-4) * np.arange(20_000))[:, None]
    >>> round(estimate_scattered_variance(motion + noise[0] + 1j * noise[1], np.array([0.1])), 1)
    4.0
    """
    count = max(0, len(envelope) - ORDER)
    terms = ((-1) ** k * comb(ORDER, k) * envelope[k : count + k : every] for k in range(ORDER + 1))
    differences = np.abs(sum(terms)) ** 2
    differences = differences[np.isfinite(differences)]
    if len(differences) < FEWEST:
        return float("nan")
    return float(find_median(differences) / np.log(2) / (2 * GAIN) / find_median(own))


def settle_by_scatter(pooled: Array, share: Array, freedom: Array, seen: float) -> Array:
    """Pooled variances, or the one that was seen from window to window where the motion's share
    leaves them unsure.

    Parameters
    ----------
    pooled
        Of the residuals (windows,), without the share.
    share
        The motion's part of each, per degree of freedom (windows,).
    freedom
        Degrees of freedom, one number or (windows,).
    seen
        From window to window; NaN where it is not known.

    Returns
    -------
    ndarray
        (windows,).

    Examples
    --------
    A motion's share of 1 and of 1e6 times the noise:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.window_scatter import settle_by_scatter
    >>> for share in (1.0, 1e6):
    ...     print(
    ...         settle_by_scatter(np.full(2, 1.2), np.full(2, share), np.array(200), 1.0).tolist()
    ...     )
    [1.2, 1.2]
    [1.0, 1.0]
    """
    if not seen > 0:
        return pooled
    share = np.where(np.isfinite(share), share, 0.0)
    held = max(1.0, float(np.sum(np.broadcast_to(freedom, share.shape))))
    mean = float(share.mean())
    doubt = 2 * np.sqrt(mean * seen / held) + BENT * mean
    return np.where(np.isfinite(pooled), seen, pooled) if doubt > UNSURE * seen else pooled
