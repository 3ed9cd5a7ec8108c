"""Joint least squares of many runs: coefficients of D(T, θ), K(T, θ) and further factors,
alternating with each run's noise.

Every run is whitened once (`increments`); its independent rows are summed to normal matrices of a
few contiguous pieces of time (`normal_pieces`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..noise.increment_noise import AngleNoise, estimate_noise
from .bends import has_bends, settle_bends
from .common_walk import coarsen, estimate_common_walk
from .increments import AnglePath
from .normal_pieces import Pieces, TableSolution, accumulate, solve
from .table_design import predict_turn
from .table_layout import Model, TableLayout

Array = np.ndarray


@dataclass(frozen=True)
class Fitted:
    """Runs with their noise, whitened pieces and turns freed of jumps by half a turn of mθ."""

    paths: list[AnglePath]
    turns: list[Array]
    noises: list[AngleNoise]
    layout: TableLayout
    pieces: Pieces
    solution: TableSolution
    chi2_per_dof: float
    jumps: int


MOST_SWEEPS = 6
SETTLED = 0.05
"""Change of a random walk's density between two sweeps, over itself, at which it stands: a quarter
of what some thousand rows tell."""


def _walks_settled(before: Sequence[AngleNoise], now: Sequence[AngleNoise]) -> bool:
    """Whether no run's random walk moved since the weights of the last sweep."""
    return all(abs(n.walk - b.walk) <= SETTLED * max(n.walk, b.walk) for b, n in zip(before, now))


def _solve(
    paths: list[AnglePath],
    noises: list[AngleNoise],
    layout: TableLayout,
    turns: list[Array],
    model: Model,
    previous: Array | None,
    about: Array | None,
) -> tuple[Pieces, TableSolution, Array | None]:
    """The runs' whitened pieces, the model's coefficients, and those whose weights the pieces have
    (None: weights of their own are not needed)."""
    pieces = accumulate(paths, noises, layout, turns, previous, about)
    solution = solve(*pieces.sum()[:2], model)
    if not has_bends(layout):
        return pieces, solution, previous
    own = settle_bends(paths, noises, layout, turns, model, solution.coefficients)
    pieces = accumulate(paths, noises, layout, turns, own, own)
    return pieces, replace(solve(*pieces.sum()[:2], model), coefficients=own), own


def fit(
    paths: Sequence[AnglePath],
    layout: TableLayout,
    model: Model | None = None,
    start: Fitted | None = None,
) -> Fitted:
    """Joint fit of a model, alternating coefficients and each run's noise.

    White angle noise is each run's own; the angle random walk is the larger of the run's own and
    the one common to all runs. What a fit with other weights leaves shows too large a walk, so the
    sweeps go on until it settles.

    Parameters
    ----------
    paths
        The runs.
    layout
        Order of the coefficients.
    model
        What of them is free; by default all.
    start
        An earlier fit of the same runs, whose noise begins the sweeps.

    Returns
    -------
    Fitted
        Coefficients with covariance (drift in rad/s, scale factor without unit), beside what they
        were found from.

    Examples
    --------
    A drift of 1 mrad/s in a run at rest, whose angles scatter by 1 µrad:

    >>> from dataclasses import replace
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> still = draw_path(random=np.random.default_rng(0))
    >>> path = replace(still, angle_rad=still.angle_rad + 0.5e-3 * still.time_s)
    >>> found = fit([path], TableLayout(np.array([20.0]), "temperature", 2, 0, 0)).solution
    >>> bool(abs(found.coefficients[0] - 1e-3) < 3 * found.covariance[0, 0] ** 0.5 < 1e-7)
    True
    """
    model = Model("everything", np.eye(layout.size)) if model is None else model
    paths = list(paths) if start is None else list(start.paths)
    turns = [p.turn for p in paths]
    noises = (
        [AngleNoise(1.0, 1.0 / float(np.median(p.interval_s))) for p in paths]
        if start is None
        else list(start.noises)
    )
    previous: Array | None = None if start is None else start.solution.coefficients
    about: Array | None = None  # of this layout, which an earlier fit's need not be
    jumps = 0 if start is None else start.jumps
    settled = False
    for sweep in range(MOST_SWEEPS + 1):
        pieces, solution, linearised = _solve(paths, noises, layout, turns, model, previous, about)
        previous = about = solution.coefficients
        if settled or sweep == MOST_SWEEPS:
            break
        coarse, used = [], list(noises)
        for r, path in enumerate(paths):
            residual = turns[r] - predict_turn(path, layout, solution.coefficients, linearised)
            jump = np.round(residual / np.pi)
            if jump.any():
                # (mθ, φ) and (mθ + π, φ + π) are the same wave: a gap may hide half a turn of mθ
                jumps += int(np.count_nonzero(jump))
                path = paths[r] = path.remove_jumps(jump)
                turns[r] = path.turn
                residual = turns[r] - predict_turn(path, layout, solution.coefficients, linearised)
            lost = float(np.trace(solution.covariance @ pieces.information[r].sum(axis=0)))
            noises[r] = estimate_noise(path, residual, min(lost, len(residual) / 2))
            coarse.append(coarsen(path, noises[r], turns[r], layout, model, linearised))
        if sweep == 0 and start is None:
            # the first weights are a walk's: what such a fit leaves looks like a walk even where
            # there is none
            noises = [AngleNoise(n.white, 0.0) for n in noises]
            continue
        walk = estimate_common_walk(
            coarse, float(np.median([p.time_s[-1] - p.time_s[0] for p in paths]))
        )
        weights = [AngleNoise(n.white, max(n.walk, walk)) for n in noises]
        settled = sweep > 0 and _walks_settled(used, weights)
        noises = weights
    chi2 = pieces.compute_chi_square(solution.coefficients)
    chi2_per_dof = chi2 / max(pieces.count - solution.degrees, 1.0)
    return Fitted(list(paths), turns, noises, layout, pieces, solution, chi2_per_dof, jumps)
