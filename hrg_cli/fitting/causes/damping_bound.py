"""The cone ν ≥ |νδμ| in which the damping of a resonator without a supply stays."""

from __future__ import annotations

import numpy as np

from .fit_point import Point
from .layout import FitColumns

Array = np.ndarray
DAMPING = ("damping", "damping_cos", "damping_sin")
"""Coordinates whose cone ν ≥ |νδμ| a passive resonator stays in."""


def passive_damping(p: Array) -> Array:
    """Coordinates whose damping is the nearest one that is nowhere negative: ν ≥ |νδμ|."""
    out, split = p.copy(), float(np.hypot(p[1], p[2]))
    if p[0] >= split:
        return out
    least = max(0.0, (float(p[0]) + split) / 2)
    out[0] = least
    out[1:3] *= least / split if split > 0 else 0.0
    return out


def wall_ahead(point: Point, layout: FitColumns, step: Array) -> tuple[Array, float] | None:
    """The damping's bound that a step would cross, as wall·step = distance; None where the step
    stays inside.

    Of the cone ν = |νδμ| the tangent at the direction of the split behind the step.
    """
    p = point.p.copy()
    p[list(layout.coordinates)] += step[: len(layout.coordinates)]
    split = float(np.hypot(p[1], p[2]))
    if p[0] >= split * (1 - 1e-12):
        return None
    normal = np.array([1.0, *(-p[1:3] / split if split > 0 else (0.0, 0.0))])
    wall = np.zeros(layout.count)
    for name, part in zip(DAMPING, normal, strict=True):
        if (column := layout.coordinate(name)) is not None:
            wall[column] = part
    return (wall, -float(normal @ point.p[:3])) if wall.any() else None
