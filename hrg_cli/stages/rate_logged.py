"""What a logged rate tells of the nodes that an estimate needs: how far it swings between them."""

from __future__ import annotations

import numpy as np

from ..fitting.envelopes.rate_estimate import RateEstimate
from ..fitting.samples.rate_log import find_stretches
from ..records import Wave

SURE = 5.0
"""Standard deviations of a log's noise from which its neighbouring values move together."""
FEWEST = 3
"""Logged windows a node at least: of fewer a spline leaves nothing to look at."""


def measure_bends_of_log(wave: Wave, found: RateEstimate) -> float | None:
    """Variance of what the logged rate does beside a spline on an estimate's nodes, over that of
    the nodes' error.

    Of r, the log less the spline nearest to it, the mean product of neighbours r_k r_{k+1} is that
    of what moves from window to window: a log's own noise is none of it.

    Parameters
    ----------
    wave
        With the log, its mean in every window.
    found
        The rate on its nodes.

    Returns
    -------
    float or None
        0 where the log follows such a spline but for its noise; None without a log, or where it
        holds too little.

    Examples
    --------
    A log of constant rate; then one that swings five times a second, which nodes 0.25 s apart do
    not follow:

    >>> from dataclasses import MISSING, fields
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.stages.rate_logged import measure_bends_of_log
    >>> t = np.arange(200) * 0.01
    >>> wave = Wave(**{f.name: t for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, rate_rad_s=0 * t, flags=np.zeros(200, "u1"),
    ...     iterations=np.zeros(200, "i2"), window_s=0.01, reference_frequency_hz=5e3,
    ... ))
    >>> nodes = SimpleNamespace(time_s=np.linspace(0.0, 2.0, 9), rate_rad_s_std=np.full(9, 1e-3))
    >>> measure_bends_of_log(wave, nodes)
    0.0
    >>> swings = wave.replace(rate_rad_s=0.1 * np.sin(10 * np.pi * t))
    >>> measure_bends_of_log(swings, nodes) > 1000
    True
    """
    from scipy.interpolate import make_lsq_spline

    if wave.rate_rad_s is None:
        return None
    nodes, logged = found.time_s, np.asarray(wave.rate_rad_s, float)
    at = np.asarray(wave.time_s, float)
    known = np.isfinite(logged) & (find_stretches(wave) > 0)
    known &= (at >= nodes[0]) & (at <= nodes[-1])
    at, logged = at[known], logged[known]
    if len(at) < FEWEST * len(nodes):
        return None
    knots = np.concatenate([[nodes[0]] * 3, nodes, [nodes[-1]] * 3])
    try:
        left = logged - make_lsq_spline(at, logged, knots)(at)
    except (ValueError, np.linalg.LinAlgError):  # a gap of the log holds nothing between two nodes
        return None
    together = float(np.mean(left[1:] * left[:-1]))
    if together <= SURE * float(np.mean(left**2)) / np.sqrt(len(left)):
        return 0.0
    return together / float(np.mean(np.square(found.rate_rad_s_std)))
