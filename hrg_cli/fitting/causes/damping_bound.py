"""The cone ν ≥ |νδμ| in which the damping of a resonator without a supply stays."""

from __future__ import annotations

import numpy as np

from ..envelopes.coordinates import DAMPING, DAMPING_SPLIT
from .design_columns import FitColumns
from .fit_point import Point

Array = np.ndarray
CONE = ("damping", "damping_cos", "damping_sin")
"""Coordinates whose cone ν ≥ |νδμ| a passive resonator stays in."""


def restrict_damping(p: Array) -> Array:
    """Coordinates whose damping is the nearest one that is nowhere negative: ν ≥ |νδμ|.

    A resonator without a supply loses energy in whatever direction it vibrates. Its damping along
    the direction of least loss is ν − |νδμ|.

    Parameters
    ----------
    p
        (7,), as `envelopes.coordinates` orders them.

    Returns
    -------
    ndarray
        (7,): p itself where it is inside the cone, else the foot of the perpendicular on it.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.damping_bound import restrict_damping
    >>> p = np.array([1.0, 3.0, 0.0, 0.0, 0.0, 1.0, 1.0])
    >>> restrict_damping(p)[:3].tolist()
    [2.0, 2.0, 0.0]
    """
    out, split = p.copy(), float(np.hypot(*p[DAMPING_SPLIT]))
    mean = float(p[DAMPING])
    if mean >= split:
        return out
    # foot of the perpendicular on the cone's side, which is inclined by 45°; beyond its tip the tip
    least = max(0.0, (mean + split) / 2)
    out[DAMPING] = least
    out[DAMPING_SPLIT] *= least / split if split > 0 else 0.0
    return out


def find_wall(point: Point, layout: FitColumns, step: Array) -> tuple[Array, float] | None:
    """The damping's bound that a step would cross.

    The cone ν = |νδμ| is replaced by its tangent at the direction of the split behind the step: a
    linear condition, as one step of a linear fit can hold it.

    Parameters
    ----------
    point
        Where the step begins.
    layout
        Which column is which coordinate.
    step
        (columns,): the step.

    Returns
    -------
    tuple or None
        Wall (columns,) and distance, the bound being wall·step = distance; None where the step
        stays inside.

    Examples
    --------
    A step to a split of three times the damping meets the wall ν − νδμ = 0, which is 1 away:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.damping_bound import CONE, find_wall
    >>> point = SimpleNamespace(p=np.array([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]))
    >>> layout = SimpleNamespace(coordinates=(0, 1, 2), count=3, coordinate=CONE.index)
    >>> wall, distance = find_wall(point, layout, np.array([0.0, 3.0, 0.0]))
    >>> (wall + 0).tolist(), distance
    ([1.0, -1.0, 0.0], -1.0)
    >>> find_wall(point, layout, np.array([0.0, 0.5, 0.0])) is None
    True
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
