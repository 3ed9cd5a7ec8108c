"""Errors beyond the curvature at the optimum: profile-likelihood intervals and a block bootstrap of
the same fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...fitting.envelopes import coordinates, inference, resampling
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...fitting.least_squares import invert_information
from .outcome import Verdict
from .splits import state_splits
from .verdict import ORDER

Array = np.ndarray


def profile_intervals(verdict: Verdict, runs: Sequence[EnvelopeRun]) -> dict[str, Any]:
    """Profile-likelihood intervals of the verdict's fit.

    Parameters
    ----------
    verdict
        Of a fit by likelihood.
    runs
        Those it was fitted to.

    Returns
    -------
    dict
        Parameter -> its bounds at "68" and "95" %, in its unit; infinite where the likelihood does
        not fall.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.by_likelihood import identify_by_likelihood
    >>> from hrg_cli.stages.identification.resampled_errors import profile_intervals
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> verdict = identify_by_likelihood(runs, Known(), 100)
    >>> low, high = profile_intervals(verdict, runs)["damping_rate_1_s"]["95"]
    >>> low < 0.1 < high
    True
    """
    assert verdict.fit is not None
    return resampling.profile(
        verdict.fit,
        runs[0].mode_number,
        {n: verdict.std[n] for n in verdict.values},
        verdict.details["variance_factor"],
    )


def resample_errors(verdict: Verdict, draws: int, seed: int) -> None:
    """Replace the errors by those of a block bootstrap and keep its 68 and 95 % intervals.

    Parameters
    ----------
    verdict
        Of a fit by likelihood; its covariance, errors and details are replaced.
    draws
        Of the bootstrap.
    seed
        Of its draws.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.by_likelihood import identify_by_likelihood
    >>> from hrg_cli.stages.identification.resampled_errors import resample_errors
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> verdict = identify_by_likelihood(runs, Known(), 100)
    >>> before = verdict.std["scale_factor"]
    >>> resample_errors(verdict, 100, 1)
    >>> bool(0.3 < verdict.std["scale_factor"] / before < 3), verdict.details["bootstrap"]["draws"]
    (True, 100)
    """
    assert verdict.fit is not None
    p = resampling.bootstrap(verdict.fit, draws, seed)
    mode = verdict.mode_number
    table = np.array([coordinates.to_parameters(row, mode)[0] for row in p])
    centre = coordinates.to_parameters(verdict.fit.p, mode)[0]
    period = np.pi / mode
    for axis in (2, 4):
        table[:, axis] = (
            centre[axis] + np.mod(table[:, axis] - centre[axis] + period / 2, period) - period / 2
        )
    covariance, own = np.cov(table.T), np.cov(p.T)
    inference.widen_axes(covariance, own, verdict.fit.p, mode)
    verdict.covariance = _carry_frequency(verdict.covariance, covariance)
    verdict.std["frequency_hz"] = float(np.sqrt(verdict.covariance[0, 0]))
    intervals = {}
    for row, name in enumerate(ORDER[1:]):
        if name in verdict.values:
            verdict.std[name] = float(np.sqrt(covariance[row, row]))
            intervals[name] = {
                "68": [float(v) for v in np.quantile(table[:, row], [0.16, 0.84])],
                "95": [float(v) for v in np.quantile(table[:, row], [0.025, 0.975])],
            }
    verdict.details |= state_splits(verdict.values, verdict.std, verdict.fit.p, own)
    verdict.details["bootstrap"] = {
        "draws": draws,
        "blocks_a_run": resampling.BLOCKS_A_RUN,
        "intervals": intervals,
    }


def _carry_frequency(before: Array, own: Array) -> Array:
    """The covariance (7, 7) with that of all but the frequency replaced by `own` (6, 6).

    No draw moves the runs' frequencies; how the mean frequency f follows the other parameters x is
    kept: f = b·x + rest, b = C_fx C_xx⁻¹, with the rest's own variance. So correlations stay
    within ±1 however few the draws.
    """
    follows = invert_information(before[1:, 1:], 1e-9) @ before[1:, 0]
    rest = max(0.0, float(before[0, 0] - follows @ before[1:, 0]))
    out = np.empty_like(before)
    out[1:, 1:] = own
    out[0, 1:] = out[1:, 0] = own @ follows
    out[0, 0] = follows @ own @ follows + rest
    return out
