"""Errors that assume less: one-step block bootstrap of the score, and profile likelihood."""

from __future__ import annotations

import numpy as np

from ...physics.resonator import OF_GENERATOR
from . import coordinates
from .likelihood import Fit, Freedom, fit
from .response import real
from .scaled_columns import measure_columns

Array = np.ndarray
BLOCKS_A_RUN = 16
PROFILE_STEPS = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)


def bootstrap(best: Fit, draws: int, seed: int) -> Array:
    """Coordinates (draws, 7): a run's residuals are drawn again in 16 blocks, each draw one
    Gauss–Newton step from the optimum."""
    rng = np.random.default_rng(seed)
    response, freedom = best.response, best.freedom
    shared = response.batch.over_noise(freedom.along(response.coordinate_sensitivities()))
    own = response.batch.over_noise(response.run_sensitivities())
    residual = response.residual()
    k = own.shape[0]
    prior = np.where(np.isfinite(freedom.prior_std), freedom.prior_std, np.inf) ** -2.0
    information = np.tile(np.diag(prior), (draws, 1, 1))
    gradient = np.tile(prior * (freedom.prior_mean - best.z), (draws, 1))
    for run, record in enumerate(response.batch.runs):
        n = len(record)
        design = np.concatenate([own[:, run, :n], shared[:, run, :n]])
        scale = measure_columns(real(design))
        pieces = np.array_split(np.arange(n), min(BLOCKS_A_RUN, n))
        matrices, vectors = [], []
        for piece in pieces:
            block = real(design[:, piece]) / scale
            r = residual[run, piece].ravel()
            matrices.append(block.T @ block)
            vectors.append(block.T @ np.concatenate([r.real, r.imag]))
        picks = rng.integers(0, len(pieces), (draws, len(pieces)))
        counts = np.stack([np.bincount(p, minlength=len(pieces)) for p in picks])
        M, v = (
            np.tensordot(counts, np.array(matrices), 1),
            np.tensordot(counts, np.array(vectors), 1),
        )
        through = np.swapaxes(M[:, :k, k:], 1, 2) @ np.linalg.pinv(
            M[:, :k, :k], rcond=1e-12, hermitian=True
        )
        information += (M[:, k:, k:] - through @ M[:, :k, k:]) * np.outer(scale[k:], scale[k:])
        gradient += (v[:, k:] - (through @ v[:, :k, None])[..., 0]) * scale[k:]
    step = np.linalg.solve(information, gradient[..., None])[..., 0]
    return freedom.origin + (best.z + step) @ freedom.directions.T


def profile(
    best: Fit, mode_number: int, std: dict[str, float], factor: float
) -> dict[str, dict[str, list[float]]]:
    """Profile-likelihood intervals (68 and 95 %) of each fitted parameter: the others fitted again
    at ±1, 2, 3 standard deviations."""
    values, _ = coordinates.to_parameters(best.p, mode_number)
    out = {}
    for row, name in enumerate(OF_GENERATOR):
        if name not in std or not std[name] > 0 or not _moves(best.freedom, row):
            continue
        steps, roots = [0.0], [0.0]
        for size in PROFILE_STEPS:
            chi2 = _chi2_held(best, row, float(values[row]) + size * std[name], mode_number)
            steps.append(size)
            roots.append(float(np.sign(size) * np.sqrt(max(0.0, chi2 - best.chi2) / factor)))
        order = np.argsort(steps)
        x, y = np.array(steps)[order], np.maximum.accumulate(np.array(roots)[order])
        reach = {
            share: [float(values[row] + std[name] * _cross(y, x, sign * level)) for sign in (-1, 1)]
            for share, level in (("68", 1.0), ("95", 1.96))
        }
        out[name] = reach
    return out


def _cross(root: Array, step: Array, level: float) -> float:
    """Step at which the root reaches a level; beyond ±3 by the last slope, infinite where it no
    longer rises."""
    if root[0] <= level <= root[-1]:
        return float(np.interp(level, root, step))
    edge, inner = (-1, -2) if level > 0 else (0, 1)
    slope = (root[edge] - root[inner]) / (step[edge] - step[inner])
    return (
        float(step[edge] + (level - root[edge]) / slope)
        if slope > 1e-3
        else float(np.sign(level) * np.inf)
    )


def _moves(freedom: Freedom, row: int) -> bool:
    index = {0: [0], 1: [1, 2], 2: [1, 2], 3: [3, 4], 4: [3, 4], 5: [5]}[row]
    moved = int(np.sum(np.abs(freedom.directions[index]).sum(axis=0) > 0))
    return moved == len(index)


def _chi2_held(best: Fit, row: int, value: float, mode_number: int) -> float:
    """χ² (with priors) of the best fit with one physical parameter held."""
    response, freedom = best.response, best.freedom
    state, p = response.state, best.p.copy()
    # ν and K are coordinates themselves: held, they leave the space. A split and its axis are the
    # size and direction of a pair of coordinates: an axis held leaves the ray along it, which is
    # linear too; a size held leaves a circle, of which each turn takes the tangent and moves on
    for _ in range(3 if row in (1, 3) else 1):
        origin, directions, names = (
            freedom.origin.copy(),
            freedom.directions.copy(),
            list(freedom.names),
        )
        if row in (0, 5):
            index = 0 if row == 0 else 5
            drop = [index]
            origin[index] = value
        else:
            first = 1 if row in (1, 2) else 3
            drop = [first, first + 1]
            axis = (
                value * 2 * mode_number
                if row in (2, 4)
                else float(np.arctan2(p[first + 1], p[first]))
            )
            radial, tangent = (
                np.array([np.cos(axis), np.sin(axis)]),
                np.array([-np.sin(axis), np.cos(axis)]),
            )
            if row in (1, 3):
                origin[first : first + 2] = value * radial
            extra = np.zeros((coordinates.COUNT, 1))
            extra[first : first + 2, 0] = radial if row in (2, 4) else tangent

        # what moved the held pair gives way to the ray or tangent; priors go with their directions
        keep = [i for i in range(directions.shape[1]) if not np.any(directions[drop, i])]
        directions = directions[:, keep]
        mean, std = freedom.prior_mean[keep], freedom.prior_std[keep]
        names = [names[i] for i in keep]
        if row not in (0, 5):
            directions = np.column_stack([extra, directions])
            mean, std, names = np.append(0.0, mean), np.append(np.inf, std), ["along", *names]
        space = Freedom(tuple(names), origin, directions, mean, std)

        # begun at the best fit, then where the last turn ended
        z = np.linalg.pinv(directions) @ (p - origin)
        result = fit(response.batch, space, z, state.start, state.phase, max_iterations=6)
        p, state = result.p, result.response.state
        if row in (1, 3):
            first = 1 if row == 1 else 3
            result_size = float(np.hypot(p[first], p[first + 1]))
            if abs(result_size - value) < 1e-3 * abs(value):
                break
    return result.chi2
