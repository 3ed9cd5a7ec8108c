"""The spaces that groups of a model's columns span, in the metric of the information matrix A: how much
of a group is its own, what is left of a model without it, and which groups share a direction.
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
    """Smallest part of the factor's columns that lies outside the span of the base model, 0…1; 0
    when they are empty."""
    A = fitted.pieces.sum()[0]
    own = np.diag(extra.T @ A @ extra)
    if extra.shape[1] == 0 or not (own > 0).all():
        return 0.0
    scale = np.sqrt(own)
    rest = extra.T @ A @ extra - extra.T @ A @ solve_columns(A, base, A @ extra)
    return float(np.sqrt(max(np.linalg.eigvalsh(rest / np.outer(scale, scale)).min(), 0.0)))


def solve_columns(A: Array, base: Array, targets: Array) -> Array:
    """base·(baseᵀ A base)⁺ baseᵀ·targets."""
    return np.stack(
        [solve(A, column, Model("", base)).coefficients for column in targets.T], axis=1
    )


def take_along_nodes(all_nodes: Array, common: Array) -> Array:
    """The part of a model's space that differs between nodes."""
    return _find_space(take_off_columns(all_nodes, common))


def leave_out(matrix: Array, columns: Array) -> Array:
    """The model's space with a group of directions taken out."""
    return _find_space(take_off_columns(matrix, columns))


def _find_space(columns: Array) -> Array:
    """Orthonormal basis of what columns span."""
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(u[:, s > 1e-9])


def find_correlated(joint: Fitted, groups: dict[str, tuple[Array, str]]) -> list[list[Any]]:
    """Pairs of groups whose columns share most of a direction: [name, name, largest canonical
    correlation]."""
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
