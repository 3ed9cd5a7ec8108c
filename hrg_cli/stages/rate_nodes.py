"""As many nodes as a rate asks for before its curvature between them shows: what half as many nodes
leave foretells what these leave."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..fitting.envelopes.rate_estimate import RateEstimate
from ..fitting.envelopes.rate_from_model import FEWEST_NODES

FORETOLD = 1e-3
"""Variance of a node's error by interpolation, in its own, over the fall of χ² that twice as many
nodes bring to half of these, a node. A cubic spline misses by h⁴, so half the distance leaves 1/256 of
the square; on sinusoids of 1 to 3 periods over 20 nodes the figure is 0.4 to 1.4 of this one, for E
from 0.07 to 3.6."""
NEGLIGIBLE = 0.1
"""Such a variance that a node's standard deviation need not hold: 5 % of it."""
DOUBTFUL = 0.5
"""Such a variance from which the standard deviations are too small by more than a fifth."""


def foretell(found: RateEstimate, fit: Callable[[int], RateEstimate]) -> float:
    """Variance of the nodes' error by interpolation over that of noise, E ≈ 10⁻³ Δχ²/k, where Δχ² is
    what k nodes gain on half as many: seen long before the k nodes' own misfit is."""
    count = len(found.time_s)
    half = (count + 1) // 2
    if half < FEWEST_NODES or not found.converged:
        return 0.0
    coarse = fit(half)
    if not coarse.converged:
        return 0.0
    gained = coarse.finer_z * float(np.sqrt(2 * (half - 1)))
    return FORETOLD * max(0.0, gained) / count


def follow(
    found: RateEstimate, fit: Callable[[int], RateEstimate], may_grow: bool
) -> tuple[RateEstimate, float]:
    """The rate on as many nodes as leave its curvature within the noise, as far as the run carries
    them, and what these are foretold to leave; `may_grow`: nobody has asked for a number."""
    left = foretell(found, fit)
    while may_grow and left > NEGLIGIBLE:
        count = 2 * len(found.time_s) - 1
        if count > found.most_nodes:
            break
        finer = fit(count)
        if not finer.converged:
            break
        found, left = finer, foretell(finer, fit)
    return found, left
