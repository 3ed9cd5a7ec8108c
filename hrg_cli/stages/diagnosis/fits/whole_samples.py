"""Diagnosis, times that an evenly sampled run loses: whole numbers of samples, and never none."""

from __future__ import annotations

import numpy as np

from ..thresholds import WHOLE

Array = np.ndarray
AGREES = 4.0
"""Standard deviations within which a time is one of whole samples."""


def count_whole(time_s: Array, std_s: Array | float, step_s: float) -> tuple[Array, Array]:
    """The nearest numbers of samples to times (n,), and where the times agree with them."""
    samples = time_s / step_s
    whole = np.round(samples)
    return whole, (whole != 0) & (np.abs(samples - whole) < AGREES * std_s / step_s + WHOLE)
