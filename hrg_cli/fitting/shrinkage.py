"""Harmonics whose size is in doubt: averaged over how large each may be instead of kept or dropped.

A harmonic that held-out data cannot prove may still be larger than the stated error of what is kept. Each harmonic g of 2mθ gets a
Gaussian prior c_g ~ N(0, τ_g² R) with an unknown scale τ_g; the mean and covariance over τ_g (Gibbs sampling on a grid, each step's
mixture summed exactly) are the table's. A clear harmonic is left as it is, an absent one is put to nearly zero, one in doubt keeps its
doubt in the covariance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .joint import Layout, Solution

Array = np.ndarray
COMMON_SHARE = 0.75
"""Share of a harmonic's prior variance that is the same at all nodes."""
SCALES = (0.05, 1.0, 4.0, 16.0, 64.0)
"""τ of the grid in standard deviations of the harmonic when all else is known (the first: absent); the largest is at least the
harmonic's own size."""
ABSENT_BEFORE = 2.0
"""Absent harmonics counted before the data, against one that is there; the harmonics of a table tell one another how many are absent."""
SWEEPS, BURN_IN = 16, 4


def groups_of(layout: Layout, kinds: Sequence[str]) -> list[Array]:
    """Places (J, 2) in the coefficients of each harmonic k ≥ 1 of the given kinds ("drift", "scale")."""
    out = []
    for kind in kinds:
        limit, part = (layout.drift_harmonics, layout.drift) if kind == "drift" else (layout.scale_harmonics, layout.scale)
        for k in range(1, limit + 1):
            out.append(np.array([part(j).start + np.array([2 * k - 1, 2 * k]) for j in range(len(layout.nodes))]))
    return out


def averaged(information: Array, vector: Array, seen: Array, groups: Sequence[Array], seed: int) -> Solution:
    """Posterior mean and covariance of the coefficients with the groups' prior scales integrated out.

    information, vector: normal equations with unit noise; seen (size, p): the model's map, whose other directions stay at zero.
    """
    generator = np.random.default_rng(seed)
    active = np.flatnonzero(np.abs(seen).sum(axis=1) > 0)
    place = {int(full): i for i, full in enumerate(active)}
    groups = [np.vectorize(place.__getitem__)(g) for g in groups]
    A, b = information[np.ix_(active, active)], vector[active]
    diagonal = np.diag(A)
    # directions that no data see keep a finite, very wide variance
    A = A + np.diag(1e-10 * np.maximum(diagonal, 1e-12 * diagonal.max()))
    flat = np.linalg.solve(A, b)
    grids, scale = [], []
    for g in groups:
        common = float(np.mean([A[np.ix_(g[:, a], g[:, a])].sum() for a in (0, 1)]))
        sizes = np.array(SCALES) / np.sqrt(common)
        sizes[-1] = max(sizes[-1], float(np.sqrt(np.mean(flat[g] ** 2))))
        grids.append(sizes**2)
        scale.append(len(SCALES) - 1)
    nodes = len(groups[0]) if groups else 1
    one = COMMON_SHARE * np.ones((nodes, nodes)) + (1 - COMMON_SHARE) * np.eye(nodes)
    prior = np.kron(one, np.eye(2))
    inverse_prior = np.linalg.inv(prior)
    precision = A.copy()
    for g, grid, i in zip(groups, grids, scale):
        precision[np.ix_(g.ravel(), g.ravel())] += inverse_prior / grid[i]
    first, second, count = np.zeros(len(b)), np.zeros_like(A), 0
    for sweep in range(SWEEPS):
        for n in generator.permutation(len(groups)):
            own = groups[n].ravel()
            precision[np.ix_(own, own)] -= inverse_prior / grids[n][scale[n]]
            covariance = np.linalg.inv(precision)
            mean, gain = covariance @ b, covariance[:, own]
            logs, steps = [], []
            for variance in grids[n]:
                factor = np.linalg.cholesky(gain[own] + variance * prior)
                whitened = np.linalg.solve(factor, np.column_stack([mean[own], gain.T]))
                logs.append(-0.5 * float(whitened[:, 0] @ whitened[:, 0]) - float(np.log(np.diag(factor)).sum()))
                steps.append(whitened)
            absent = sum(i == 0 for j, i in enumerate(scale) if j != n)
            share = (ABSENT_BEFORE + absent) / (ABSENT_BEFORE + 1 + len(groups) - 1)
            before = np.full(len(SCALES), (1 - share) / (len(SCALES) - 1))
            before[0] = share
            weights = before * np.exp(np.array(logs) - max(logs))
            weights /= weights.sum()
            if sweep >= BURN_IN:
                for weight, whitened in zip(weights, steps):
                    if weight < 1e-9:
                        continue
                    away = mean - whitened[:, 1:].T @ whitened[:, 0] - flat
                    first += weight * away
                    second += weight * (covariance - whitened[:, 1:].T @ whitened[:, 1:] + np.outer(away, away))
                count += 1
            scale[n] = int(generator.choice(len(weights), p=weights))
            precision[np.ix_(own, own)] += inverse_prior / grids[n][scale[n]]
    away, spread = first / count, second / count
    coefficients, covariance = np.zeros(len(vector)), np.zeros_like(information)
    coefficients[active] = flat + away
    covariance[np.ix_(active, active)] = spread - np.outer(away, away)
    return Solution(coefficients, covariance, float(np.trace((spread - np.outer(away, away)) @ A)))
