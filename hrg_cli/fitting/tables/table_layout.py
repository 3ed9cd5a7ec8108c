"""Where each coefficient of the tables and their factors stands among all that are fitted, and what
of it a variant leaves free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .increments import AnglePath

Array = np.ndarray
Factor = Callable[[AnglePath], Array]
"""A further cause of drift: its columns (n, q) of the increments, as a rate (they are multiplied by
the interval)."""


@dataclass(frozen=True)
class TableLayout:
    """Order of the coefficients: node-major, a node's drift harmonics then its scale-factor
    harmonics; then the factors' columns."""

    nodes: Array
    axis: str
    mode_number: int
    drift_harmonics: int
    scale_harmonics: int
    interpolation: str = "linear"
    factors: dict[str, Factor] = field(default_factory=dict)
    factor_columns: dict[str, int] = field(default_factory=dict)

    @property
    def drift_size(self) -> int:
        """Drift coefficients per node."""
        return 1 + 2 * self.drift_harmonics

    @property
    def node_size(self) -> int:
        """Coefficients a node."""
        return self.drift_size + 1 + 2 * self.scale_harmonics

    @property
    def table_size(self) -> int:
        """Coefficients of the tables."""
        return len(self.nodes) * self.node_size

    @property
    def size(self) -> int:
        """All coefficients."""
        return self.table_size + sum(self.factor_columns.values())

    def drift(self, node: int) -> slice:
        """Drift coefficients of a node."""
        return slice(node * self.node_size, node * self.node_size + self.drift_size)

    def scale(self, node: int) -> slice:
        """Scale-factor coefficients of a node."""
        return slice(node * self.node_size + self.drift_size, (node + 1) * self.node_size)

    def factor(self, name: str) -> slice:
        """Columns of a factor."""
        start = self.table_size
        for key, width in self.factor_columns.items():
            if key == name:
                return slice(start, start + width)
            start += width
        raise KeyError(name)

    def split_tables(self, coefficients: Array) -> tuple[Array, Array]:
        """(drift (J, HD), scale factor (J, HK)) of the full coefficient vector."""
        table = coefficients[: self.table_size].reshape(len(self.nodes), self.node_size)
        return table[:, : self.drift_size], table[:, self.drift_size :]

    def compute_mean_scale_factor(self, coefficients: Array) -> float:
        """K over the nodes and the wave angle."""
        return float(np.mean(self.split_tables(coefficients)[1][:, 0]))

    def find_abscissa(self, path: AnglePath) -> Array:
        """Temperature or frequency of the increments (n,); zeros where there is one node only."""
        if len(self.nodes) == 1:
            return np.full(len(path), self.nodes[0])
        return path.average_neighbours(path.find_abscissa(self.axis))

    def build_part_map(
        self,
        kind: Literal["drift", "scale"],
        limit: int,
        *,
        one_node: bool = False,
        lowest: int = 0,
    ) -> Array:
        """Map (size, p) of the drift's or scale factor's harmonics `lowest`…`limit` (−1: none), the
        same at all nodes with `one_node`."""
        start, width = (
            (0, self.drift_size)
            if kind == "drift"
            else (self.drift_size, self.node_size - self.drift_size)
        )
        columns: list[Array] = []
        for h in range(max(2 * lowest - 1, 0), min(1 + 2 * limit, width)):
            places = start + h + self.node_size * np.arange(len(self.nodes))
            for group in [places] if one_node else places[:, None]:
                column = np.zeros(self.size)
                column[group] = 1.0
                columns.append(column)
        return np.array(columns).T if columns else np.zeros((self.size, 0))

    def build_factor_map(self, *names: str) -> Array:
        """Map (size, p) of whole factors."""
        return np.concatenate(
            [
                np.zeros((self.size, 0)),
                *(np.eye(self.size)[:, self.factor(name)] for name in names),
            ],
            axis=1,
        )


@dataclass(frozen=True)
class Model:
    """A linear model inside the full set of coefficients: c = start + matrix·p, p free."""

    name: str
    matrix: Array
    start: Array | None = None

    @property
    def free(self) -> int:
        """Number of free coefficients."""
        return int(self.matrix.shape[1])

    def find_columns(self, places: Array) -> Array:
        """Columns that are the coefficients at these places, in their shape."""
        return np.asarray(np.argmax(self.matrix[places], axis=-1))


def compute_roughness(layout: TableLayout) -> Array:
    """Penalty on the curvature of every harmonic along the nodes.

    (X³/J) ∫(d²c/dx²)² dx ≈ (X³/J) Σ (Δs)²/h over the inner nodes, for each harmonic c(x): Δs the
    change of its slope at a node, h half the distance of its two neighbours, X the range of the J
    nodes. It is c² times a number, whatever the unit of x.

    Parameters
    ----------
    layout
        Of the tables.

    Returns
    -------
    ndarray
        (size, size); zeros for the factors, and for fewer than three nodes.

    Examples
    --------
    A straight line costs nothing, a bend at the middle node does:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout, compute_roughness
    >>> layout = TableLayout(np.array([0.0, 10.0, 20.0]), "temperature", 2, 0, 0)
    >>> P = compute_roughness(layout)[::2, ::2]
    >>> [round(float(np.array(c) @ P @ c), 6) for c in ([1, 2, 3], [0, 1, 0])]
    [0.0, 10.666667]
    """
    J = len(layout.nodes)
    penalty = np.zeros((layout.size, layout.size))
    if J < 3:
        return penalty
    x = layout.nodes
    # rows f''√Δx: the difference of the slopes beside a node over Δx, times √Δx
    second = np.zeros((J - 2, J))
    for i in range(J - 2):
        left, right = x[i + 1] - x[i], x[i + 2] - x[i + 1]
        second[i, i : i + 3] = np.array([1 / left, -1 / left - 1 / right, 1 / right]) / np.sqrt(
            (left + right) / 2
        )
    # ∫ f''² dx times the span's cube has no unit of the axis
    one = second.T @ second * float(np.ptp(x)) ** 3 / J
    for h in range(layout.node_size):
        places = h + layout.node_size * np.arange(J)
        penalty[np.ix_(places, places)] = one
    return penalty
