"""Allan deviation of an evenly sampled rate."""

from __future__ import annotations

import numpy as np

from ...records import Array


def allan_deviation(rate: Array, interval_s: float, points: int = 40) -> tuple[Array, Array, Array]:
    """Overlapping Allan deviation: σ²(nτ₀) = ⟨(θ_{k+2n} − 2θ_{k+n} + θ_k)²⟩ / 2(nτ₀)², θ the
    integral of the rate (IEEE Std 952, annex C).

    rate (n,) in any unit, interval_s the spacing; averaging times spread evenly in logarithm up to
    a third of the record. Returns averaging times [s], deviations in the rate's unit, and their
    relative standard errors 1/√(2(N/n − 1)). Fewer than 9 values: empty.
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
