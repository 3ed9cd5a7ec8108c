"""Designs in parts and bases of them: least squares whose memory grows with the rows, not with rows
times runs.

A design J (N, k) is mostly blocks: what belongs to one run has rows of its own, and is taken off
there alone. Knows nothing of gyros.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..least_squares import solve

Array = np.ndarray
TOLERANCE = 1e-10
"""Part of the strongest direction, the columns at unit length, below which one is none."""
CLEAR_RANK = 1e-6
"""Ratio of a triangle's pivots above which the rank is full beyond doubt; below it singular values
decide."""

Block = tuple[slice, slice]
"""Rows and columns of a design that belong to one another alone: outside them the columns are
zero."""


@dataclass(frozen=True)
class Design:
    """A design J (N, k) kept in its parts: `shared` columns (N, s) at `places` (s,), and blocks
    (rows, columns, values) of one run each; all of them less their part along what is `unknown`.

    Memory grows with the rows, not with rows times runs. What is unknown may reach over all runs:
    a block less its part along it would be a block no more, so that part is taken off where the
    design is used, and all columns stand with it.
    """

    shared: Array
    places: Array
    own: tuple[tuple[slice, slice, Array], ...] = ()
    unknown: Basis | None = None
    """Its `shared` part is taken off here; what is unknown of one run alone is off the blocks
    already."""

    @classmethod
    def from_matrix(cls, J: Array, blocks: Sequence[Block] = ()) -> Design:
        """The parts of a whole matrix (N, k)."""
        alone = np.zeros(J.shape[1], bool)
        for _, columns in blocks:
            alone[columns] = True
        return cls(
            J[:, ~alone],
            np.flatnonzero(~alone),
            tuple((rows, columns, J[rows, columns]) for rows, columns in blocks),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """(N, k)."""
        return len(self.shared), len(self.places) + sum(
            values.shape[1] for _, _, values in self.own
        )

    def multiply(self, step: Array) -> Array:
        """J step, (N,)."""
        out = self.shared @ step[self.places]
        for rows, columns, values in self.own:
            out[rows] += values @ step[columns]
        return self._off(out)

    def multiply_transposed(self, S: Array) -> Array:
        """Jᵀ S of columns (N, …), (k, …)."""
        S = self._off(S)
        out = np.zeros((self.shape[1], *S.shape[1:]))
        out[self.places] = self.shared.T @ S
        for rows, columns, values in self.own:
            out[columns] = values.T @ S[rows]
        return out

    def to_matrix(self) -> Array:
        """J (N, k) as one matrix, where its size does not matter."""
        out = np.zeros(self.shape)
        out[:, self.places] = self.shared
        for rows, columns, values in self.own:
            out[rows, columns] = values
        return self._off(out)

    def compute_lengths(self) -> Array:
        """Lengths of the columns, (k,)."""
        out = np.zeros(self.shape[1])
        out[self.places] = self._squares(slice(0, len(self.shared)), self.shared)
        for rows, columns, values in self.own:
            out[columns] = self._squares(rows, values)
        return np.sqrt(np.maximum(out, 0.0))

    def _squares(self, rows: slice, values: Array) -> Array:
        """Squared lengths (c,) of columns that live on some rows alone."""
        whole = np.sum(values**2, axis=0)
        if self.unknown is None:
            return np.asarray(whole)
        # S → (1 − w)·S along a direction leaves (1 − w)² of its square
        lost = 1 - (1 - self.unknown.weight) ** 2
        return np.asarray(whole - lost @ (self.unknown.shared[rows].T @ values) ** 2)

    def _off(self, S: Array) -> Array:
        """Columns (N, …) less their part along what is unknown."""
        return S if self.unknown is None else self.unknown.project_out_shared(S)


@dataclass(frozen=True)
class Basis:
    """An orthonormal basis (N, k): parts that live on some rows alone, and `shared` ones (N, s)
    perpendicular to these, of known `variance` (s,) or, where that is infinite, of any size.

    What is known by its size takes a part of a column off, and the design's own columns with it: of
    (1 + Q Λ Qᵀ)^{−1/2} J the runs' columns live on their rows no more. The basis then holds Q too,
    and `beside` says which combinations of its columns J does not span.
    """

    own: tuple[tuple[slice, Array], ...]
    shared: Array
    variance: Array | None = None
    """None: infinite."""
    beside: Array | None = None
    """Orthonormal combinations (k, b) of the columns that stand here for the sake of their order
    alone and are no part of what is spanned; None: all are."""

    @property
    def shape(self) -> tuple[int, int]:
        """(N, k) of what is spanned."""
        count = self.shared.shape[1] + sum(Q.shape[1] for _, Q in self.own)
        return len(self.shared), count - (0 if self.beside is None else self.beside.shape[1])

    def project(self, S: Array) -> Array:
        """Components (k, …) of columns (N, …) in what is spanned."""
        own = [Q.T @ S[rows] for rows, Q in self.own]
        return self.keep(np.concatenate([*own, self.shared.T @ S]))

    def keep(self, components: Array) -> Array:
        """Components (k, …) less those that are no part of what is spanned."""
        if self.beside is None:
            return components
        return np.asarray(components - self.beside @ (self.beside.T @ components))

    def project_out(self, S: Array) -> Array:
        """Columns (N, …) less their part along what is spanned."""
        if self.beside is None:
            return self.project_out_shared(self.project_out_own(S))
        return np.asarray(S - self.expand(self.project(S)))

    def expand(self, components: Array) -> Array:
        """Columns (N, …) of components (k, …)."""
        place, out = 0, np.zeros((len(self.shared), *components.shape[1:]))
        for rows, Q in self.own:
            out[rows] += Q @ components[place : place + Q.shape[1]]
            place += Q.shape[1]
        return np.asarray(out + self.shared @ components[place:])

    def select_beside(self, run: int) -> Array:
        """Rows (k', b) of `beside` for the columns of one own part and the shared ones."""
        ends = np.cumsum([0, *(Q.shape[1] for _, Q in self.own)])
        if self.beside is None:
            return np.zeros((self.own[run][1].shape[1] + self.shared.shape[1], 0))
        return np.concatenate([self.beside[ends[run] : ends[run + 1]], self.beside[ends[-1] :]])

    @property
    def weight(self) -> Array:
        """1 − 1/√(1 + variance) of the shared ones (s,), by which (1 + Q Λ Qᵀ)^{−1/2} takes them
        off."""
        if self.variance is None:
            return np.ones(self.shared.shape[1])
        return 1 - 1 / np.sqrt(1 + self.variance)

    @property
    def unlimited(self) -> Array:
        """Which of the shared ones may have any size, (s,)."""
        if self.variance is None:
            return np.ones(self.shared.shape[1], bool)
        return ~np.isfinite(self.variance)

    @property
    def free(self) -> int:
        """How many of them may have any size."""
        return self.shape[1] - int(np.count_nonzero(~self.unlimited))

    def scale_noise(self, level: float) -> Basis:
        """The same where every σ is `level` times as large."""
        if self.variance is None:
            return self
        return Basis(self.own, self.shared, self.variance / level**2)

    def select_rows(self, kept: Array) -> Basis:
        """The parts that live on some rows alone, on those `kept` (N,) of these; without the shared
        ones."""
        place, own = np.cumsum([0, *kept]), []
        for rows, Q in self.own:
            if kept[rows].any():
                # Q has unit columns: what little of one is kept may be rounding, and no direction
                U, s, _ = np.linalg.svd(Q[kept[rows]], full_matrices=False)
                there = slice(int(place[rows.start]), int(place[rows.stop]))
                own.append((there, U[:, s > CLEAR_RANK]))
        return Basis(tuple(own), np.zeros((int(place[-1]), 0)))

    def project_out_own(self, S: Array) -> Array:
        """Columns (N, …) less their part along what lives on some rows alone."""
        out = S.copy()
        for rows, Q in self.own:
            out[rows] -= Q @ (Q.T @ S[rows])
        return out

    def project_out_shared(self, S: Array) -> Array:
        """Columns (N, …) less their part along what reaches over all rows."""
        return np.asarray(S - self.shared @ weigh_rows(self.weight, self.shared.T @ S))


@dataclass(frozen=True)
class Softened:
    """What may be off by a known covariance 1 + Q Λ Qᵀ, in parts that live on some rows alone:
    orthonormal Q (N, k) and variances λ (k,), each among rows that the parts before it whitened."""

    own: tuple[tuple[slice, Array, Array], ...]

    def whiten(self, S: Array) -> Array:
        """Columns (N, …) whitened, W S: (1 + Q Λ Qᵀ)^{−1/2} of one part after the other."""
        return self._one_after_the_other(S, self.own)

    def whiten_transposed(self, S: Array) -> Array:
        """Wᵀ S, so that of rows r the noise that is most likely in them is Wᵀ W r."""
        return self._one_after_the_other(S, self.own[::-1])

    @staticmethod
    def _one_after_the_other(S: Array, parts: Sequence[tuple[slice, Array, Array]]) -> Array:
        out = S.copy()
        for rows, Q, power in parts:
            along = Q.T @ out[rows]
            out[rows] -= Q @ (along.T * (1 - 1 / np.sqrt(1 + power))).T
        return out

    def scale_noise(self, level: float) -> Softened:
        """The same where every σ is `level` times as large."""
        return Softened(tuple((rows, Q, power / level**2) for rows, Q, power in self.own))


@dataclass(frozen=True)
class Factored:
    """A design J (N, k) = Q T: T (rank, k), in whose few rows all is solved that asks for J alone,
    and an orthonormal basis Q of J, whose columns hold those of what is unknown beside it."""

    basis: Basis
    triangle: Array

    def solve(
        self,
        residual: Array,
        prior: Array,
        prior_residual: Array,
        wall: Array | None = None,
        distance: float = 0.0,
    ) -> tuple[Array, Array]:
        """Least-squares step (k,) and covariance (k, k) with prior rows (m, k); blind directions
        stay put.

        wall (k,): the step is held to wall·step = `distance` (an equality, by elimination); the
        covariance is then that along the wall.
        """
        rows = np.concatenate([self.triangle, prior])
        right = np.concatenate([self.basis.project(residual), prior_residual])
        if wall is None:
            return solve(rows, right)
        first = wall * (distance / float(wall @ wall))
        along = np.linalg.qr(wall[:, None], mode="complete")[0][:, 1:]
        step, covariance = solve(rows @ along, right - rows @ first)
        return first + along @ step, along @ covariance @ along.T


def factor_design(design: Design, tolerance: float = TOLERANCE) -> Factored:
    """The design as basis times triangle, its blocks of rows and columns first.

    Parameters
    ----------
    design
        J (N, k) in its parts.
    tolerance
        Part of the strongest direction, the columns at unit length, below which one is none.

    Returns
    -------
    Factored
        Q and T (rank, k) with J = Q T.

    Examples
    --------
    A line fitted to two runs with a mean each and a common slope; of the second column of the last
    block nothing can be told:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import Design, factor_design
    >>> x = np.arange(6.0)
    >>> J = np.column_stack([x, x < 3, x >= 3, 0 * x])
    >>> blocks = [(slice(0, 3), slice(1, 2)), (slice(3, 6), slice(2, 4))]
    >>> factored = factor_design(Design.from_matrix(J, blocks))
    >>> bool(np.allclose(factored.triangle.T @ factored.triangle, J.T @ J))
    True
    >>> step, _ = factored.solve(2 * x + 5 * (x < 3), np.zeros((0, 4)), np.zeros(0))
    >>> step.round(9) + 0
    array([2., 5., 0., 0.])
    """
    size = design.compute_lengths()
    nothing = size == 0
    size[nothing] = 1.0
    count = design.shape[1]
    own, upper = [], []
    for rows, columns, values in design.own:
        Q, part = _split(values / size[columns], tolerance)
        own.append((rows, Q))
        upper.append(np.zeros((len(part), count)))
        upper[-1][:, columns] = part
    first = Basis(tuple(own), np.zeros((len(design.shared), 0)))
    unknown = np.zeros((len(design.shared), 0)) if design.unknown is None else design.unknown.shared
    # the blocks stand with their part along what is unknown, which therefore comes into the basis
    left = np.column_stack([unknown, design.shared / size[design.places]])
    beside = first.project(left)
    left = first.project_out(left)
    again = first.project(left)  # what little is left holds the rounding of what was taken off
    Q, part = _split(first.project_out(left), tolerance)
    reach = np.concatenate([beside + again, part])
    triangle = np.concatenate([*upper, np.zeros((len(part), count))])
    triangle[:, design.places] = reach[:, unknown.shape[1] :]
    off = reach[:, : unknown.shape[1]]
    outside = None
    if design.unknown is not None:
        triangle -= off @ weigh_rows(design.unknown.weight, off.T @ triangle)
        outside = _find_outside(np.column_stack([triangle, off[:, design.unknown.unlimited]]))
    # a column of nothing stays so: its rounding would be taken for a direction
    return Factored(Basis(tuple(own), Q, beside=outside), np.where(nothing, 0.0, triangle * size))


def _find_outside(T: Array) -> Array:
    """Orthonormal combinations (rank, b) of rows that no column of T (rank, k) has a part along."""
    U, s, _ = np.linalg.svd(T)
    there = int(np.count_nonzero(s > TOLERANCE * s.max(initial=0.0)))
    return np.asarray(U[:, there:])


def weigh_rows(weight: Array, values: Array) -> Array:
    """Rows of values times their weights.

    Parameters
    ----------
    weight
        (u,).
    values
        (u, …).

    Returns
    -------
    ndarray
        (u, …).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import weigh_rows
    >>> weigh_rows(np.array([1.0, 0.5]), np.array([[2.0, 4.0], [2.0, 4.0]])).tolist()
    [[2.0, 4.0], [1.0, 2.0]]
    """
    return np.asarray(weight.reshape(-1, *[1] * (values.ndim - 1)) * values)


def _split(J: Array, tolerance: float) -> tuple[Array, Array]:
    """Orthonormal (N, r) and (r, k) whose product is J; directions weaker than `tolerance` of the
    strongest are none."""
    if J.shape[1] == 0:
        return J, np.zeros((0, 0))
    Q, R = np.linalg.qr(J)
    pivots = np.abs(np.diag(R))
    if len(J) >= J.shape[1] and pivots.min() > CLEAR_RANK * pivots.max():
        return Q, R
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    keep = s > tolerance * s[0]
    return U[:, keep], s[keep, None] * Vt[keep]


def orthonormalise(J: Array, tolerance: float = 1e-10) -> Array:
    """Orthonormal basis of the columns of a matrix, each scaled to unit length first.

    Parameters
    ----------
    J
        (N, k); columns of nothing count for nothing.
    tolerance
        Part of the strongest direction below which one is none.

    Returns
    -------
    ndarray
        (N, rank).

    Examples
    --------
    Two columns of one direction, of very different length:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import orthonormalise
    >>> orthonormalise(np.array([[3.0, 3e-9], [4.0, 4e-9]])).shape
    (2, 1)
    """
    size = np.linalg.norm(J, axis=0)
    return _split(J[:, size > 0] / size[size > 0], tolerance)[0]
