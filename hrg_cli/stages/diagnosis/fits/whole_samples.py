"""Diagnosis, times that an evenly sampled run loses: whole numbers of samples, and never none."""

from __future__ import annotations

import numpy as np

from ..thresholds import WHOLE, WHOLE_SIGMA

Array = np.ndarray


def count_whole(time_s: Array, std_s: Array | float, step_s: float) -> tuple[Array, Array]:
    """The nearest numbers of samples to times, and where the times agree with them.

    Parameters
    ----------
    time_s
        [s], (n,).
    std_s
        Their standard deviations [s], (n,) or one.
    step_s
        Of the samples [s].

    Returns
    -------
    tuple of ndarray
        (n,) each; no time agrees with none.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.fits.whole_samples import count_whole
    >>> samples, agree = count_whole(np.array([3.001e-3, 4.5e-3, 0.0]), 1e-6, 1e-3)
    >>> samples.tolist(), agree.tolist()
    ([3.0, 4.0, 0.0], [True, False, False])
    """
    samples = time_s / step_s
    whole = np.round(samples)
    return whole, (whole != 0) & (np.abs(samples - whole) < WHOLE_SIGMA * std_s / step_s + WHOLE)
