"""Weak priors on the linear gyro's coordinates, for all that fit it or plan for it: they keep
finite what no run tells, and bend nothing that a run tells.

A standard deviation is a width, which has no unit, times the natural size of the coordinate: ν for
the damping and its split, the larger of δω and ν for the frequency split [rad/s]; K and the second
order's scale have none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .coordinates import DAMPING, FREQUENCY_SPLIT

Array = np.ndarray


@dataclass(frozen=True)
class PriorWidths:
    """Standard deviations of the priors over the natural sizes; inf: no prior."""

    damping: float
    damping_split: float
    frequency_split: float
    scale_factor: float
    second_order: float

    def scale_by(self, damping: float, split: float) -> Array:
        """(7,) in the order of `COORDINATES`, of natural sizes in rad/s."""
        return np.array(
            [
                self.damping * damping,
                *[self.damping_split * damping] * 2,
                *[self.frequency_split * split] * 2,
                self.scale_factor,
                self.second_order,
            ]
        )


FREQUENCY_SPLITS, SCALE_FACTORS = 30.0, 3.0
"""The same for all. A first guess of the split may be wrong by its size and costs a thousandth of
χ²; K of no resonator is above 1, so that its prior only keeps it finite."""

IDENTIFIED = PriorWidths(np.inf, 2.0, FREQUENCY_SPLITS, SCALE_FACTORS, 0.5)
"""`identify`: every run-down tells ν. No passive resonator has |νδμ| > ν, half of this σ, and where
one run tells ν and the split only together, the prior bounds what either may be. The second order's
scale is 0 or 1: mean and spread of the two."""

DIAGNOSED = PriorWidths(np.inf, 10.0, FREQUENCY_SPLITS, SCALE_FACTORS, 0.0)
"""`diagnose`: the residual is searched for causes, of which a bent split would be one. |νδμ| ≤ ν
costs 0.01 of χ² at most, a twenty-fifth of what it would above. K is held while the misfit is
gross, whatever its width, and the second order's scale always: free, it takes what causes do."""

PLANNED = PriorWidths(10.0, 10.0, FREQUENCY_SPLITS, SCALE_FACTORS, 1e-3)
"""`plan`: as the diagnosis that will judge the runs; ν as well, for a menu may hold forced runs
alone, which do not tell it."""

SHAPES = 0.1
"""Part of the nominal K by which the mode shapes of shells differ: its prior in a diagnosis whose
runs do not tell K."""


def find_natural_sizes(p: Array, span_s: float) -> tuple[float, float]:
    """Sizes of the damping and of the frequency split of a first estimate.

    Parameters
    ----------
    p
        The estimate, (7,), in the order of `COORDINATES`.
    span_s
        Length of the longest run: what no run can show is taken for no smaller than 1 over it, of
        the damping a hundredth of that.

    Returns
    -------
    tuple of float
        Both in rad/s.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.weak_priors import find_natural_sizes
    >>> find_natural_sizes(np.array([0.2, 0.0, 0.0, 0.3, 0.4, 0.55, 1.0]), 10.0)
    (0.2, 0.5)
    >>> find_natural_sizes(np.zeros(7), 10.0)
    (0.001, 0.1)
    """
    damping = max(abs(float(p[DAMPING])), 0.01 / span_s)
    return damping, max(float(np.hypot(*p[FREQUENCY_SPLIT])), damping, 1 / span_s)
