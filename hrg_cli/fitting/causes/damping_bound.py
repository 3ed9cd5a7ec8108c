"""The cone ν ≥ |νδμ| in which the damping of a resonator without a supply stays."""

from __future__ import annotations

import numpy as np

from ..envelopes.coordinates import DAMPING, DAMPING_SPLIT
from .fit_point import Point
from .layout import FitColumns

Array = np.ndarray
CONE = ("damping", "damping_cos", "damping_sin")
"""Coordinates whose cone ν ≥ |νδμ| a passive resonator stays in."""


def passive_damping(p: Array) -> Array:
    """Coordinates whose damping is the nearest one that is nowhere negative: ν ≥ |νδμ|."""
    out, split = p.copy(), float(np.hypot(*p[DAMPING_SPLIT]))
    mean = float(p[DAMPING])
    if mean >= split:
        return out
    # foot of the perpendicular on the cone's side, which is inclined by 45°; beyond its tip the tip
    least = max(0.0, (mean + split) / 2)
    out[DAMPING] = least
    out[DAMPING_SPLIT] *= least / split if split > 0 else 0.0
    return out


def wall_ahead(point: Point, layout: FitColumns, step: Array) -> tuple[Array, float] | None:
    """The damping's bound that a step would cross, as wall·step = distance; None where the step
    stays inside.

    Of the cone ν = |νδμ| the tangent at the direction of the split behind the step.
    """
    p = point.p.copy()
    p[list(layout.coordinates)] += step[: len(layout.coordinates)]
    split = float(np.hypot(*p[DAMPING_SPLIT]))
    # a point on the cone itself is inside, but for rounding
    if p[DAMPING] >= split * (1 - 1e-12):
        return None
    normal = np.array([1.0, *(-p[DAMPING_SPLIT] / split if split > 0 else (0.0, 0.0))])
    wall = np.zeros(layout.count)
    for name, part in zip(CONE, normal, strict=True):
        if (column := layout.coordinate(name)) is not None:
            wall[column] = part
    return (wall, -float(normal @ point.p[:3])) if wall.any() else None
