"""Allan deviation of an evenly sampled rate."""

from __future__ import annotations

import numpy as np

from ...records import Array


def compute_allan_deviation(
    rate: Array, interval_s: float, points: int = 40
) -> tuple[Array, Array, Array]:
    """Overlapping Allan deviation of a rate.

    σ²(nτ₀) = ⟨(θ_{k+2n} − 2θ_{k+n} + θ_k)²⟩/2(nτ₀)², θ the integral of the rate (IEEE Std 952,
    annex C).

    Parameters
    ----------
    rate
        (n,) in any unit.
    interval_s
        Their spacing.
    points
        Averaging times at most, spread evenly in logarithm up to a third of the record.

    Returns
    -------
    tuple of ndarray
        Averaging times [s], deviations in the rate's unit, their relative standard errors
        1/√(2(N/n − 1)); empty for fewer than 9 values.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.allan import compute_allan_deviation
    >>> time_s, deviation, _ = compute_allan_deviation(
    ...     np.random.default_rng(0).standard_normal(10_000), 1.0
    ... )
    >>> float(time_s[0]), bool(abs(deviation[0] - 1) < 0.05)
    (1.0, True)
    """
    count = len(rate)
    if count < 9:
        return np.empty(0), np.empty(0), np.empty(0)
    angle = (
        np.concatenate([[0.0], np.cumsum(np.asarray(rate, dtype=float) - np.mean(rate))])
        * interval_s
    )
    size = np.unique(np.geomspace(1, count // 3, points).round().astype(int))
    deviation = np.array(
        [
            np.sqrt(np.mean((angle[2 * n :] - 2 * angle[n:-n] + angle[: -2 * n]) ** 2) / 2)
            / (n * interval_s)
            for n in size
        ]
    )
    return size * interval_s, deviation, 1 / np.sqrt(2 * np.maximum(count / size - 1, 1))
