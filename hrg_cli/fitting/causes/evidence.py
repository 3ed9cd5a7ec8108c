"""Evidence for causes in a whitened residual: scores, what can be told apart, selection. Knows nothing of gyros.

Notation: r (N,) whitened residual of a base model with Jacobian J (N, k), S (N, m) a candidate's sensitivities, all over σ.
With Q an orthonormal basis of J: s⊥ = S − Q Qᵀ S, T = |P_{s⊥} r|² is the fall of χ² the candidate buys with `rank` parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

Array = np.ndarray
BLIND = 3e-4
"""Independence |s⊥|/|s| below which a candidate counts as invisible beside the base model."""
ONCE = 0.1
"""Independence above which one projection off the base model is exact enough."""
TOGETHER = 64
"""Columns of candidates taken off the base model in one matrix product."""


def orthonormal(J: Array, tolerance: float = 1e-10) -> Array:
    """Orthonormal basis (N, rank) of the columns of J, each scaled to unit length first."""
    size = np.linalg.norm(J, axis=0)
    J = J[:, size > 0] / size[size > 0]
    if J.shape[1] == 0:
        return J
    U, s, _ = np.linalg.svd(J, full_matrices=False)
    return U[:, s > tolerance * s[0]]


@dataclass(frozen=True)
class Score:
    """A candidate against the base model: fall of χ² `gain` for `rank` parameters, estimates with σ, independence, its space."""

    name: str
    gain: float
    rank: int
    z: float
    p_value: float
    estimate: Array
    std: Array
    independence: float
    space: Array = field(repr=False)

    @property
    def visible(self) -> bool:
        """Whether these data can show it at all."""
        return self.rank > 0


def score(name: str, residual: Array, sensitivity: Array, Q: Array) -> Score:
    """Score of one candidate's sensitivities (N, m) beside the basis Q (N, k)."""
    return scores([name], residual, [sensitivity], Q)[0]


def scores(names: Sequence[str], residual: Array, sensitivities: Sequence[Array], Q: Array) -> list[Score]:
    """Scores of many candidates: their columns (N, m) are taken off the basis Q (N, k) together, some `TOGETHER` at a time."""
    out: list[Score] = []
    start = 0
    while start < len(names):
        stop, width = start, 0
        while stop < len(names) and (stop == start or width + sensitivities[stop].shape[1] <= TOGETHER):
            width += sensitivities[stop].shape[1]
            stop += 1
        columns = np.concatenate(sensitivities[start:stop], axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            size = np.sqrt(np.einsum("ij,ij->j", columns, columns))
        usable = np.isfinite(size) & (size > 0)
        columns = np.where(usable, columns, 0.0) / np.where(usable, size, 1.0)
        columns -= Q @ (Q.T @ columns)
        weak = np.einsum("ij,ij->j", columns, columns) < ONCE**2  # what little is left holds the rounding of what was taken off
        if weak.any():
            columns[:, weak] -= Q @ (Q.T @ columns[:, weak])
        ends = np.cumsum([s.shape[1] for s in sensitivities[start:stop]])[:-1]
        parts = zip(names[start:stop], np.split(columns, ends, axis=1), np.split(size, ends), strict=True)
        out += [_judged(name, residual, part, own) for name, part, own in parts]
        start = stop
    return out


def _judged(name: str, residual: Array, perpendicular: Array, size: Array) -> Score:
    """Score of columns of unit length (N, m) of which the base's part is taken off; their lengths before, `size` (m,)."""
    m = perpendicular.shape[1]
    if not np.all(np.isfinite(size)) or not np.any(size > 0):
        return Score(name, 0.0, 0, 0.0, 1.0, np.full(m, np.nan), np.full(m, np.inf), 0.0, np.zeros((len(residual), 0)))
    power, vectors = np.linalg.eigh(perpendicular.T @ perpendicular)
    s, V = np.sqrt(np.maximum(power[::-1], 0.0)), vectors[:, ::-1]
    keep = s > BLIND
    rank = int(keep.sum())
    if rank == 0:
        return Score(name, 0.0, 0, 0.0, 1.0, np.full(m, np.nan), np.full(m, np.inf), 0.0, np.zeros((len(residual), 0)))
    directions = V[:, keep] / s[keep]
    space = perpendicular @ directions
    projected = space.T @ residual
    gain = float(projected @ projected)
    lost = np.sum(V[:, ~keep] ** 2, axis=1) > 0.5  # directions the data do not show
    safe = np.where(size > 0, size, 1.0)
    blind = lost | (size == 0)
    estimate = np.where(blind, np.nan, directions @ projected / safe)
    std = np.where(blind, np.inf, np.sqrt(np.sum(directions**2, axis=1)) / safe)
    z, p_value = significance(gain, rank)
    return Score(name, gain, rank, z, p_value, estimate, std, float(s[0]), space)


def significance(gain: float, rank: int) -> tuple[float, float]:
    """(equivalent |z| of one normal variable, p) of a fall of χ² by `gain` with `rank` parameters."""
    from scipy.special import chdtrc, ndtri

    p = float(chdtrc(rank, gain))
    if p > 1e-280:
        return float(max(0.0, -ndtri(p / 2))), p
    return float(np.sqrt(gain)), p


def corrected(p_value: float, tried: int) -> float:
    """p for the best of `tried` candidates (Šidák)."""
    return float(-np.expm1(tried * np.log1p(-min(p_value, 1 - 1e-16))))


def criterion(gain: float, rank: int, rows: int) -> float:
    """ΔBIC: fall of χ² less the price ln N a parameter; positive means worth having."""
    return gain - rank * float(np.log(rows))


def alike(a: Score, b: Score) -> float:
    """Largest canonical correlation of two candidates' spaces beside the base: 1 when one cannot be told from the other."""
    if a.rank == 0 or b.rank == 0:
        return 0.0
    return float(np.linalg.svd(a.space.T @ b.space, compute_uv=False)[0])


def correlations(scores: Sequence[Score]) -> Array:
    """`alike` of all pairs, (m, m)."""
    out = np.eye(len(scores))
    for i, a in enumerate(scores):
        for j in range(i):
            out[i, j] = out[j, i] = alike(a, scores[j])
    return out


def solve(J: Array, residual: Array, prior: Array | None = None, prior_residual: Array | None = None) -> tuple[Array, Array]:
    """Least-squares step (k,) and covariance (k, k) of a whitened problem with optional prior rows; blind directions stay put."""
    if prior is not None and prior_residual is not None:
        J, residual = np.concatenate([J, prior]), np.concatenate([residual, prior_residual])
    size = np.linalg.norm(J, axis=0)
    size[size == 0] = 1.0
    U, s, Vt = np.linalg.svd(J / size, full_matrices=False)
    keep = s > 1e-9 * s[0]
    inverse = Vt[keep].T / s[keep] / size[:, None]
    return inverse @ (U[:, keep].T @ residual), inverse @ inverse.T


@dataclass(frozen=True)
class HeldOut:
    """Prediction of data that were not fitted: mean squared whitened residual per held-out fold with and without the extension."""

    before: Array
    after: Array

    @property
    def ratio(self) -> float:
        """rms before over rms after."""
        return float(np.sqrt(self.before.mean() / max(self.after.mean(), 1e-300)))

    @property
    def std(self) -> float:
        """Standard deviation of the ratio, from the scatter over the folds."""
        logs = 0.5 * np.log(np.maximum(self.before, 1e-300) / np.maximum(self.after, 1e-300))
        return float(self.ratio * logs.std(ddof=1) / np.sqrt(len(logs))) if len(logs) > 1 else float("inf")


def predicted(residual: Array, shared: Array, own: Mapping[int, Array], folds: Sequence[Array], prior: Array | None = None) -> Array:
    """Residual (N,) of every fold when the shared columns are fitted on the other folds, linearised at the optimum.

    residual (N,) at the joint optimum; shared (N, k); own[f] (N_f, q) columns that belong to fold f alone (fitted on it in both
    cases); folds: index arrays. The joint optimum is moved to the optimum without the fold by one exact linear step.
    """
    out = residual.copy()
    bases = [orthonormal(own[f]) if own[f].shape[1] else np.zeros((len(rows), 0)) for f, rows in enumerate(folds)]
    parts = [shared[rows] - basis @ (basis.T @ shared[rows]) for rows, basis in zip(folds, bases, strict=True)]
    right = [residual[rows] - basis @ (basis.T @ residual[rows]) for rows, basis in zip(folds, bases, strict=True)]
    pull = [] if prior is None else [prior]
    for number, (fold, basis) in enumerate(zip(folds, bases, strict=True)):
        others = [k for k in range(len(folds)) if k != number]
        design = np.concatenate([parts[k] for k in others] + pull) if others or pull else np.zeros((0, shared.shape[1]))
        known = np.concatenate([right[k] for k in others] + [np.zeros(len(p)) for p in pull]) if others or pull else np.zeros(0)
        step = solve(design, known)[0] if others else np.zeros(shared.shape[1])
        left = residual[fold] - shared[fold] @ step
        out[fold] = left - basis @ (basis.T @ left)
    return out


def smooth_power(residual: Array, Q: Array, smooth: Array) -> tuple[float, int]:
    """χ² of a whitened residual along the columns of `smooth` (N, m) beside the basis Q, and its degrees of freedom: the omnibus test."""
    found = score("smooth", residual, smooth, Q)
    return found.gain, found.rank
