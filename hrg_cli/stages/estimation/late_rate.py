"""A rate log on a clock beside that of the samples, set right in time."""

from __future__ import annotations

import numpy as np

from ...errors import HrgError
from ...records import Array, Periods

FEWEST = 4
"""Known values that a spline takes."""


def read_rate_in_time(periods: Periods, late_s: float) -> Array:
    """The rate at every window: Ω(t) = Ω_log(t + τ) of a log that comes τ late.

    Parameters
    ----------
    periods
        Windows (n,) with their logged rate [rad/s]; they may be open on disk.
    late_s
        By how much the log comes late [s]; negative: early, as it does beside signals that a filter
        delays.

    Returns
    -------
    ndarray
        (n,) [rad/s]; NaN where the log holds nothing of that time.

    Raises
    ------
    HrgError
        No rate is logged, or the log is moved beyond the run.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect, demodulate
    >>> from hrg_cli.stages.estimation.late_rate import read_rate_in_time
    >>> t = np.arange(8000) / 8000
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal((2, 8000))
    >>> c, s = np.cos(2 * np.pi * 1000 * t) + noise
    >>> run = Recording(
    ...     c=c, s=s, sample_rate_hz=8000.0, mode="free", auxiliary_time_s=t, rate_rad_s=t
    ... )
    >>> periods = collect(demodulate(run, periods_per_window=20))
    >>> read_rate_in_time(periods, 0.1)[[0, 20, -1]].round(2).tolist()
    [0.11, 0.51, nan]
    """
    run = periods.run_id or "this run"
    if periods.rate_rad_s is None:
        raise HrgError(
            f"{run}: rate_late_s = {late_s:g} s was given, but no rate is logged; leave it out, or"
            " import the run with its rate"
        )
    time, rate = np.asarray(periods.time_s[:], float), np.asarray(periods.rate_rad_s[:], float)
    lasts = float(time[-1] - time[0])
    if abs(late_s) >= lasts or np.count_nonzero(np.isfinite(rate)) < FEWEST:
        raise HrgError(
            f"{run}: rate_late_s = {late_s:g} s moves the rate log out of a run of {lasts:.4g} s;"
            " give the time in seconds, or leave it out"
        )
    return read_log_later(time, rate, late_s)


def read_log_later(time_s: Array, values: Array, late_s: float) -> Array:
    """A log's values at t + τ.

    A spline of means over windows: straight lines between them would be off by h²Ω̈/8, some 1e-4 of
    a rate that swings by 1 Hz in windows of 8 ms.

    Parameters
    ----------
    time_s, values
        (n,) [s] and [any]; NaN where nothing is known.
    late_s
        τ [s].

    Returns
    -------
    ndarray
        (n,); NaN beyond the log, and where a neighbour in time is not known.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.estimation.late_rate import read_log_later
    >>> t = np.arange(6.0)
    >>> read_log_later(t, t**2, 0.5).round(9).tolist()
    [0.25, 2.25, 6.25, 12.25, 20.25, nan]
    """
    from scipy.interpolate import CubicSpline

    known = np.isfinite(values)
    at = time_s + late_s
    # of two neighbours both are known where the line between their flags is at one
    between = np.interp(at, time_s, known.astype(float), left=0.0, right=0.0)
    spline = CubicSpline(time_s[known], values[known])
    return np.where(between == 1.0, spline(at), np.nan)
