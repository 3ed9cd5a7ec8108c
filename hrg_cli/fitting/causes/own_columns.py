"""What single runs have for themselves: columns of each run alone, and their products beside a fit,
made from their own rows, so that the cost grows with the rows and not with rows times runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .designs import Basis, weigh_rows
from .measured_runs import MeasuredRuns
from .whitened_rows import flatten_own, split_rows

Array = np.ndarray


@dataclass(frozen=True)
class Products:
    """Normal equations of K columns of each of R runs beside a basis: A (R, K, R, K) = s⊥ᵀs⊥, b (R,
    K) = s⊥ᵀr, and the columns' squared lengths before (R, K)."""

    A: Array
    b: Array
    square: Array


@dataclass(frozen=True)
class OwnColumns:
    """Columns X of each of R runs alone, (n_r, K) on the rows of each and 0 on all others, less
    their part along what is `unknown` of several runs together, which takes something off in the
    others."""

    parts: tuple[tuple[slice, Array], ...]
    unknown: Basis | None = None

    @classmethod
    def from_values(cls, series: MeasuredRuns, values: Array) -> OwnColumns:
        """Of values (R, n, 4, K) over σ."""
        columns = flatten_own(series, values)
        return cls(tuple((rows, columns[rows]) for rows in split_rows(series)), series.unsettled)

    def multiply_beside(self, basis: Basis, residual: Array) -> Products:
        """Their products beside a basis, and with a residual (N,).

        With Y = X − U w UᵀX of orthonormal unknown directions U and their weights w, YᵀY = XᵀX −
        XᵀU (2w − w²) UᵀX, and beside a basis Q, YᵀY − BᵀB of B = QᵀX − QᵀU w UᵀX.
        """
        runs, count = len(self.parts), self.parts[0][1].shape[1]
        gram = np.zeros((runs * count, runs * count))
        for run, (_, X) in enumerate(self.parts):
            own = slice(run * count, (run + 1) * count)
            gram[own, own] = X.T @ X
        along = self._project(residual[:, None])[0]
        B = self._project_own(basis)
        if self.unknown is not None:
            U, w = self.unknown.shared, self.unknown.weight
            C = self._project(U)
            gram = gram - C.T @ weigh_rows(2 * w - w**2, C)
            along = along - weigh_rows(w, C).T @ (U.T @ residual)
            B = B - (basis.project(U) @ weigh_rows(w, C))
        B = basis.keep(B)
        A = (gram - B.T @ B).reshape(runs, count, runs, count)
        b = (along - B.T @ basis.project(residual)).reshape(runs, count)
        return Products(A, b, np.diag(gram).reshape(runs, count))

    def _project(self, S: Array) -> Array:
        """SᵀX of columns (N, s), (s, R·K)."""
        return np.concatenate([S[rows].T @ X for rows, X in self.parts], axis=1)

    def _project_own(self, basis: Basis) -> Array:
        """QᵀX, (k, R·K), each run's own part of the basis with the run's own columns alone."""
        count = self.parts[0][1].shape[1]
        own = [np.zeros((Q.shape[1], len(self.parts) * count)) for _, Q in basis.own]
        for run, ((rows, X), (same, Q)) in enumerate(zip(self.parts, basis.own, strict=True)):
            assert rows == same
            own[run][:, run * count : (run + 1) * count] = Q.T @ X
        return np.concatenate([*own, self._project(basis.shared)])
