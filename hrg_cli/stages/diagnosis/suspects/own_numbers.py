"""What a number of one run's own would take of χ²: its rate log's scale or offset, its damping.

To first order, from the sensitivities of the fit itself, so that asking costs next to nothing.
"""

from __future__ import annotations

import numpy as np

from ....fitting.causes import evidence
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.sensitivities import Propagation, find_base_sensitivities
from ....fitting.causes.wave_frame import to_reals
from ....fitting.causes.whitened_rows import flatten_rows
from ....fitting.envelopes.coordinates import COORDINATES
from ....records import Array
from .readings import DAMPING, SCALE_FACTOR

OWN = (COORDINATES.index(SCALE_FACTOR), COORDINATES.index(DAMPING))
"""Coordinates that one run may have for itself: K where its rate log is of another scale."""


def find_largest_gain(fit: ExtendedFit) -> float:
    """The largest fall of χ² that one such number of one run promises."""
    shared, _ = find_base_sensitivities(fit.flow)
    together = np.concatenate([shared[..., OWN], _predict_constant_rate(fit.flow)], axis=-1)
    columns = flatten_rows(fit.series, together)
    runs = fit.rows[:, 0]
    alone = [
        np.where(runs == k, column, 0.0)[:, None] for k in np.unique(runs) for column in columns.T
    ]
    names = [str(number) for number in range(len(alone))]
    found = evidence.score_candidates(names, fit.residual, alone, fit.basis)
    return max((one.gain for one in found if one.visible), default=0.0)


def _predict_constant_rate(flow: Propagation) -> Array:
    """What one rad/s more does, over σ, (R, n, 4, 1): u' gains K (u₂, −u₁)."""
    K = flow.prediction.point.p[COORDINATES.index(SCALE_FACTOR)]

    def turning(u: Array) -> Array:
        return to_reals(K * np.stack([u[..., 1], -u[..., 0]], axis=-1))[..., None]

    return flow.whiten_read_out(
        flow.propagate(turning(flow.prediction.motion), turning(flow.middle))
    )
