"""Errors that assume less: one-step block bootstrap of the score, and profile likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...physics.resonator import OF_GENERATOR
from ..least_squares import measure_columns
from . import coordinates
from .likelihood import Fit, Freedom, fit
from .response import stack_reals

Array = np.ndarray
PAIRS = {
    1: coordinates.DAMPING_SPLIT,
    2: coordinates.DAMPING_SPLIT,
    3: coordinates.FREQUENCY_SPLIT,
    4: coordinates.FREQUENCY_SPLIT,
}
"""Places, in `OF_GENERATOR`, of the splits' sizes and axes, and the pair of coordinates of each;
the others are coordinates themselves, at the same place."""
SIZES = (1, 3)
TANGENTS = 3
"""Tangents after which a fit with a split's size held is on the circle."""
BLOCKS_A_RUN = 16
PROFILE_STEPS = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)


def bootstrap(best: Fit, draws: int, seed: int) -> Array:
    """Coordinates whose scatter is the fit's error, each run's residuals drawn again in 16 blocks.

    Each draw is one Gauss–Newton step from the optimum.

    Parameters
    ----------
    best
        The optimum.
    draws
        How many.
    seed
        Of the draws.

    Returns
    -------
    ndarray
        (draws, 7).

    Examples
    --------
    White noise of the stated σ scatters as the information says:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.resampling import bootstrap
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t, random = np.linspace(0.0, 10.0, 401), np.random.default_rng(1)
    >>> noise = 0.01 * random.standard_normal((401, 4)).view(complex)
    >>> u = np.outer(np.exp(-0.1 * t), [1, 0j]) + noise
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1)
    >>> space = free_coordinates(["damping"], np.zeros(7))
    >>> best = fit(make_batch([run]), space, np.array([0.1]), u[:1], np.zeros((1, 1)))
    >>> spread = np.std(bootstrap(best, 2000, 0)[:, 0])
    >>> bool(0.6 < spread / np.sqrt(best.compute_covariance_z()[0, 0]) < 1.6)
    True
    """
    rng = np.random.default_rng(seed)
    response, freedom = best.response, best.freedom
    shared = response.batch.whiten(freedom.project(response.find_coordinate_sensitivities()))
    own = response.batch.whiten(response.find_run_sensitivities())
    residual = response.compute_residual()
    k = own.shape[0]
    prior = np.where(np.isfinite(freedom.prior_std), freedom.prior_std, np.inf) ** -2.0
    information = np.tile(np.diag(prior), (draws, 1, 1))
    gradient = np.tile(prior * (freedom.prior_mean - best.z), (draws, 1))
    for run, record in enumerate(response.batch.runs):
        n = len(record)
        design = np.concatenate([own[:, run, :n], shared[:, run, :n]])
        scale = measure_columns(stack_reals(design))
        pieces = np.array_split(np.arange(n), min(BLOCKS_A_RUN, n))
        matrices, vectors = [], []
        for piece in pieces:
            block = stack_reals(design[:, piece]) / scale
            r = residual[run, piece].ravel()
            matrices.append(block.T @ block)
            vectors.append(block.T @ np.concatenate([r.real, r.imag]))
        picks = rng.integers(0, len(pieces), (draws, len(pieces)))
        counts = np.stack([np.bincount(p, minlength=len(pieces)) for p in picks])
        M = np.tensordot(counts, np.array(matrices), 1)
        v = np.tensordot(counts, np.array(vectors), 1)
        # the run's own k unknowns are eliminated in every draw: Schur's complement of their block
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
    """Profile-likelihood intervals of each fitted parameter.

    The others are fitted again with it held at ±1, 2, 3 standard deviations; the signed root of Δχ²
    is 1 and 1.96 at the intervals' ends.

    Parameters
    ----------
    best
        The optimum.
    mode_number
        m.
    std
        Of each parameter, by its name; one without, or without freedom, is left out.
    factor
        Variance of the noise over the stated one.

    Returns
    -------
    dict
        By name, "68" and "95": both ends.

    Examples
    --------
    A damping and K are linear enough that they are ±1 and ±1.96 σ:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.resampling import profile
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> u = np.stack([np.cos(0.3 * t), -np.sin(0.3 * t)], 1) * np.exp((0j - 0.1) * t)[:, None]
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, t, None, 5e3, 2, 0.1)
    >>> space = free_coordinates(["damping", "scale_factor"], np.zeros(7))
    >>> best = fit(make_batch([run]), space, np.array([0.1, 0.3]), u[:1], np.zeros((1, 1)))
    >>> std = float(np.sqrt(best.compute_covariance_z()[0, 0]))
    >>> ends = profile(best, 2, {"damping_rate_1_s": std}, 1.0)["damping_rate_1_s"]
    >>> [round((end - 0.1) / std, 2) for end in (*ends["68"], *ends["95"])]
    [-1.0, 1.0, -1.96, 1.96]
    """
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
        # the signed root of Δχ² is straight where the fit is linear, and no minimum lies between:
        # a value that falls is a fit that ended early
        x, y = np.array(steps)[order], np.maximum.accumulate(np.array(roots)[order])
        out[name] = {
            share: [float(values[row] + std[name] * _cross(y, x, sign * level)) for sign in (-1, 1)]
            for share, level in (("68", 1.0), ("95", 1.96))
        }
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
    places = np.arange(coordinates.COUNT)[PAIRS.get(row, slice(row, row + 1))]
    moved = int(np.sum(np.abs(freedom.directions[places]).sum(axis=0) > 0))
    return moved == len(places)


def _chi2_held(best: Fit, row: int, value: float, mode_number: int) -> float:
    """χ² (with priors) of the best fit with one physical parameter held.

    ν and K are coordinates themselves: held, they leave the space. A split and its axis are the
    size and direction of a pair of coordinates: an axis held leaves the ray along it, which is
    linear too; a size held leaves a circle, of which each turn takes the tangent and moves on.
    """
    is_size = row in SIZES
    state, p = best.response.state, best.p.copy()
    for _ in range(TANGENTS if is_size else 1):
        if row in PAIRS:
            pair = p[PAIRS[row]]
            axis = float(np.arctan2(pair[1], pair[0])) if is_size else value * 2 * mode_number
            space = _hold_pair(best.freedom, PAIRS[row], axis, value if is_size else None)
        else:
            space = _hold_coordinate(best.freedom, row, value)
        # begun at the best fit, then where the last turn ended
        z = space.locate(p)
        held = fit(best.response.batch, space, z, state.start, state.phase, max_iterations=6)
        p, state = held.p, held.response.state
        if is_size:
            size = float(np.hypot(*p[PAIRS[row]]))
            if abs(size - value) < 1e-3 * abs(value):
                break
    return held.chi2


def _hold_coordinate(freedom: Freedom, index: int, value: float) -> Freedom:
    """The space in which one coordinate has a value."""
    origin = freedom.origin.copy()
    origin[index] = value
    return replace(_drop_directions(freedom, [index]), origin=origin)


def _hold_pair(freedom: Freedom, pair: slice, axis: float, size: float | None) -> Freedom:
    """The space in which a pair of coordinates lies on the ray along an axis, or, with a size, on
    the tangent at that size of the circle about zero."""
    space = _drop_directions(freedom, [pair.start, pair.start + 1])
    radial = np.array([np.cos(axis), np.sin(axis)])
    origin, along = freedom.origin.copy(), np.zeros((coordinates.COUNT, 1))
    if size is None:
        along[pair, 0] = radial
    else:
        origin[pair] = size * radial
        along[pair, 0] = np.array([-np.sin(axis), np.cos(axis)])
    return Freedom(
        ("along", *space.names),
        origin,
        np.column_stack([along, space.directions]),
        np.append(0.0, space.prior_mean),
        np.append(np.inf, space.prior_std),
    )


def _drop_directions(freedom: Freedom, places: Sequence[int]) -> Freedom:
    """The space without the directions that move some coordinates; priors go with their
    directions."""
    moving = np.any(freedom.directions[list(places)], axis=0)
    keep = [i for i in range(freedom.directions.shape[1]) if not moving[i]]
    return Freedom(
        tuple(freedom.names[i] for i in keep),
        freedom.origin,
        freedom.directions[:, keep],
        freedom.prior_mean[keep],
        freedom.prior_std[keep],
    )
