"""What a number of one run's own would take of χ²: its rate log's scale or offset, its damping, one
channel's gain or lateness.

To first order, from the sensitivities of the fit itself, so that asking costs next to nothing.
"""

from __future__ import annotations

import numpy as np

from ....fitting.causes import evidence
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.own_columns import OwnColumns
from ....fitting.causes.sensitivities import Propagation, find_base_sensitivities
from ....fitting.causes.wave_frame import to_reals
from ....fitting.causes.whitened_rows import flatten_rows
from ....fitting.envelopes.coordinates import COORDINATES
from ....records import Array
from .readings import DAMPING, SCALE_FACTOR

OWN = (COORDINATES.index(SCALE_FACTOR), COORDINATES.index(DAMPING))
"""Coordinates that one run may have for itself: K where its rate log is of another scale."""


def find_largest_gain(fit: ExtendedFit) -> float:
    """The largest fall of χ² that one such number of one run promises.

    Parameters
    ----------
    fit
        Of the runs as they are.

    Returns
    -------
    float
        Δχ²; 0 where no such number is seen.

    Examples
    --------
    Beside a run that logs its rate with the wrong sign, and beside none:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_wrong_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.own_numbers import find_largest_gain
    >>> fit = fit_waves(draw_wrong_waves())
    >>> bool(find_largest_gain(fit) > 1e5), bool(find_largest_gain(draw_fit()) < 9)
    (True, True)
    """
    shared, _ = find_base_sensitivities(fit.flow)
    own = shared[..., OWN], _predict_constant_rate(fit.flow), _predict_amplifiers(fit.flow)
    columns = OwnColumns.from_values(fit.series, np.concatenate(own, axis=-1))
    beside = columns.multiply_beside(fit.basis, fit.residual)
    # of unit columns, each judged alone; what is not there has no size, and gains nothing
    size = np.sqrt(np.where(beside.square > 0, beside.square, 1.0)).ravel()
    P, c = np.einsum("rkrk->rk", beside.A).ravel() / size**2, beside.b.ravel() / size
    gain, _ = evidence.compute_gains(P[:, None, None], c[:, None])
    return float(gain.max(initial=0.0))


def find_gain_of_lateness(fit: ExtendedFit) -> float:
    """The fall of χ² that one lateness of all rate logs promises: Ω(t + τ) is Ω + τΩ̇.

    Parameters
    ----------
    fit
        Of the runs as they are.

    Returns
    -------
    float
        Δχ²; 0 where no rate changes within a run.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_swing, draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.own_numbers import find_gain_of_lateness
    >>> fit = fit_waves([draw_waves()[0], draw_swing(late_s=0.05), draw_waves()[2]])
    >>> bool(find_gain_of_lateness(fit) > 0.9 * fit.chi2)
    True
    """
    series = fit.series
    slope = np.zeros(series.time_s.shape)
    for k, kept in enumerate(series.weight > 0):
        if np.count_nonzero(kept) > 2:
            slope[k, kept] = np.gradient(series.rate_rad_s[k, kept], series.time_s[k, kept])
    if not slope.any():
        return 0.0
    column = flatten_rows(series, _predict_rate(fit.flow, slope))
    (found,) = evidence.score_candidates(["late"], fit.residual, [column], fit.basis)
    return float(found.gain) if found.visible else 0.0


def _predict_amplifiers(flow: Propagation) -> Array:
    """What C read with one part more of S's gain, or a radian before S, does, over σ, (R, n, 4,
    2)."""
    apart = flow.prediction.seen * [0.5, -0.5]
    changes = np.stack([to_reals(apart), to_reals(1j * apart)], axis=-1)
    return np.asarray(flow.prediction.whiten_judged(changes))


def _predict_constant_rate(flow: Propagation) -> Array:
    """What one rad/s more does, over σ, (R, n, 4, 1)."""
    return _predict_rate(flow, np.ones(flow.prediction.motion.shape[:-1]))


def _predict_rate(flow: Propagation, rate: Array) -> Array:
    """What a further rate (R, n) does, over σ, (R, n, 4, 1): u' gains KΩ (u₂, −u₁)."""
    K = flow.prediction.point.p[COORDINATES.index(SCALE_FACTOR)]
    between = (rate[:, 1:] + rate[:, :-1]) / 2

    def turning(u: Array, by: Array) -> Array:
        turned = np.stack([u[..., 1], -u[..., 0]], axis=-1)
        return to_reals(K * by[..., None] * turned)[..., None]

    return flow.whiten_read_out(
        flow.propagate(turning(flow.prediction.motion, rate), turning(flow.middle, between))
    )
