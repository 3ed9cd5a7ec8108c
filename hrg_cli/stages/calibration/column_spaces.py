"""The spaces that groups of a model's columns span, in the metric of the information matrix A: how
much of a group is its own, what is left of a model without it, and which groups share a direction.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...fitting.least_squares import take_off_columns
from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import solve
from ...fitting.tables.table_layout import Model

Array = np.ndarray


def measure_independence(fitted: Fitted, base: Array, extra: Array) -> float:
    """The part of a factor's columns that lies outside the span of a base model, in the metric of
    the data.

    √λ_min of the information about the factor that is left beside the base, each column scaled to
    1.

    Parameters
    ----------
    fitted
        The runs.
    base
        Directions (size, p) of the model.
    extra
        Directions (size, q) of the factor.

    Returns
    -------
    float
        From 0 (the base holds it already) to 1 (nothing of it); 0 of no columns.

    Examples
    --------
    A column that shares 0.8 with the base's keeps √(1 − 0.8²):

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.column_spaces import measure_independence
    >>> A = np.array([[1.0, 0.8], [0.8, 1.0]])
    >>> fitted = Told(pieces=Told(sum=lambda: (A, None, 0)))
    >>> round(measure_independence(fitted, np.eye(2)[:, :1], np.eye(2)[:, 1:]), 9)
    0.6
    """
    A = fitted.pieces.sum()[0]
    own = np.diag(extra.T @ A @ extra)
    if extra.shape[1] == 0 or not (own > 0).all():
        return 0.0
    scale = np.sqrt(own)
    rest = extra.T @ A @ extra - extra.T @ A @ solve_columns(A, base, A @ extra)
    return float(np.sqrt(max(np.linalg.eigvalsh(rest / np.outer(scale, scale)).min(), 0.0)))


def solve_columns(A: Array, base: Array, targets: Array) -> Array:
    """Projection of directions onto a model, in the metric of the information matrix A.

    base·(baseᵀA base)⁺baseᵀ·targets.

    Parameters
    ----------
    A
        (size, size).
    base
        Directions (size, p) of the model.
    targets
        Vectors (size, q): A times what is projected.

    Returns
    -------
    ndarray
        (size, q), within the model.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.column_spaces import solve_columns
    >>> A = np.diag([4.0, 1.0])
    >>> solve_columns(A, np.eye(2)[:, :1], A @ np.array([[3.0], [2.0]])).tolist()
    [[3.0], [0.0]]
    """
    return np.stack(
        [solve(A, column, Model("", base)).coefficients for column in targets.T], axis=1
    )


def take_along_nodes(all_nodes: Array, common: Array) -> Array:
    """The part of a model's space that differs between nodes.

    Parameters
    ----------
    all_nodes
        Directions (size, p), each node free.
    common
        Directions (size, q), the same at all nodes.

    Returns
    -------
    ndarray
        (size, p − q), orthonormal.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.column_spaces import take_along_nodes
    >>> np.abs(take_along_nodes(np.eye(2), np.ones((2, 1)))).round(4).tolist()
    [[0.7071], [0.7071]]
    """
    return _find_space(take_off_columns(all_nodes, common))


def leave_out(matrix: Array, columns: Array) -> Array:
    """A model's space without a group of directions.

    Parameters
    ----------
    matrix
        Directions (size, p) of the model.
    columns
        Directions (size, q) that are taken out.

    Returns
    -------
    ndarray
        Orthonormal, as many columns as directions are left.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.column_spaces import leave_out
    >>> np.abs(leave_out(np.eye(3), np.eye(3)[:, :2])).tolist()
    [[0.0], [0.0], [1.0]]
    """
    return _find_space(take_off_columns(matrix, columns))


def _find_space(columns: Array) -> Array:
    """Orthonormal basis of what columns span."""
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(u[:, s > 1e-9])


def find_correlated(joint: Fitted, groups: dict[str, tuple[Array, str]]) -> list[list[Any]]:
    """Pairs of groups whose columns share most of a direction.

    Parameters
    ----------
    joint
        The runs.
    groups
        Name -> directions (size, p) and kind.

    Returns
    -------
    list of list
        Two names and their largest canonical correlation, of those above 0.9; parts of one table
        share coefficients by construction and are not told.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.column_spaces import find_correlated
    >>> A = np.array([[1.0, 0.95], [0.95, 1.0]])
    >>> groups = {
    ...     "drive": (np.eye(2)[:, :1], "drive"),
    ...     "quadrature": (np.eye(2)[:, 1:], "quadrature"),
    ... }
    >>> find_correlated(Told(pieces=Told(sum=lambda: (A, None, 0))), groups)
    [['drive', 'quadrature', 0.95]]
    """
    A = joint.pieces.sum()[0]
    half: dict[str, Array] = {}
    for name, (columns, _) in groups.items():
        G = columns.T @ A @ columns
        values, vectors = np.linalg.eigh(G / max(np.trace(G), 1e-300))
        keep = values > 1e-10
        half[name] = columns @ (vectors[:, keep] / np.sqrt(values[keep] * max(np.trace(G), 1e-300)))
    names = list(groups)
    pairs = []
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            if one.split(" over ")[0] == other.split(" over ")[0]:
                continue  # parts of one table share coefficients by construction
            value = (
                float(np.linalg.norm(half[one].T @ A @ half[other], 2))
                if half[one].size and half[other].size
                else 0.0
            )
            if value > 0.9:
                pairs.append([one, other, round(min(value, 1.0), 4)])
    return pairs
