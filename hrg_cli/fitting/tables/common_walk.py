"""The angle random walk that all runs of a gyro share, by restricted likelihood on coarse blocks.

A slow random walk hides in what the tables absorb, so a run's own residuals understate it; the
restricted likelihood (Patterson and Thompson 1971) counts what the coefficients have taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..noise.increment_noise import AngleNoise, whiten
from .increments import AnglePath
from .normal_pieces import LEAST_SEEN
from .table_design import build_design, split_stretches
from .table_layout import Model, TableLayout

Array = np.ndarray
COARSE_BLOCKS = 64
NEEDED_GAIN = 2.0
"""Fall of −2 ln L that a common random walk must bring: half of all gyros without one would
otherwise show one."""


@dataclass(frozen=True)
class Coarse:
    """A run's columns (design, turn) between averages of many blocks."""

    columns: Array
    white: float
    interval_s: Array
    width_s: float

    def build_bands(self, q: float) -> Array:
        """Covariance (2, n) of neighbouring increments for a random walk of density q: diagonal and
        first off-diagonal."""
        bands = np.zeros((2, len(self.interval_s)))
        # between averages over a width w the walk has lost w/3 of its interval, and neighbouring
        # increments share w/6 of it
        bands[0] = 2 * self.white + q * (self.interval_s - self.width_s / 3)
        bands[1, :-1] = -self.white + q * self.width_s / 6
        return bands


def coarsen(
    path: AnglePath,
    noise: AngleNoise,
    turn: Array,
    layout: TableLayout,
    model: Model,
    previous: Array | None,
) -> Coarse:
    """The run's model columns and turn, averaged to some sixty blocks.

    Parameters
    ----------
    path
        The run, worked through a stretch at a time.
    noise
        Its noise; the white part falls with the rows a block.
    turn
        m·Δθ [rad] (n,).
    layout
        Order of the coefficients.
    model
        What of them is free.
    previous
        Coefficients (size,) whose slopes give a monotone interpolation its weights; None: linear
        ones.

    Returns
    -------
    Coarse
        Differences between blocks: columns of the model, then the turn.

    Examples
    --------
    Blocks of three rows lie 3 s apart: a drift is seen for 3 s, with a third of the white variance.

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.common_walk import coarsen
    >>> from hrg_cli.fitting.noise.increment_noise import AngleNoise
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> path = draw_path(blocks=200, angle_variance=1.0)
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 0, 0)
    >>> model = Model("drift", np.eye(2)[:, :1])
    >>> coarse = coarsen(path, AngleNoise(0.3, 0.0), np.zeros(199), layout, model, None)
    >>> coarse.columns[0].round(9).tolist(), round(coarse.white, 9)
    ([3.0, 0.0], 0.1)
    """
    many = max(1, (len(path) + 1) // COARSE_BLOCKS)
    count = (len(path) + 1) // many
    means, angle = np.zeros((count, model.free + 1)), np.zeros(model.free + 1)
    for rows in split_stretches(len(path)):
        X = build_design(path, layout, previous, rows)
        rest = turn[rows] - (0.0 if model.start is None else X @ model.start)
        summed = angle + np.cumsum(np.column_stack([X @ model.matrix, rest]), axis=0)
        angle = summed[-1].copy()
        block = np.arange(rows.start + 1, rows.stop + 1) // many
        summed, block = summed[block < count], block[block < count]
        if len(block):
            own, first = np.unique(block, return_index=True)
            means[own] += np.add.reduceat(summed, first, axis=0) / many
    time = path.time_s[: count * many].reshape(count, many).mean(axis=1)
    return Coarse(
        np.diff(means, axis=0),
        noise.white / many,
        np.diff(time),
        many * float(np.median(path.width_s)),
    )


def estimate_common_walk(coarse: Sequence[Coarse], length_s: float) -> float:
    """Angle random walk q common to all runs, by restricted likelihood at the runs' white noise.

    A slow random walk hides in what the tables absorb, so a run's own residuals understate it:
    minimised is −2 ln L = Σ ln|V| + χ² + ln|XᵀV⁻¹X| (Patterson and Thompson 1971), on blocks
    averaged to some sixty a run, where a walk that is hard to see acts. X spans the same directions
    at every q, those that are seen without a walk: one that came or went with q would change the
    determinant by more than any walk.

    Parameters
    ----------
    coarse
        The runs, averaged by `coarsen`.
    length_s
        Length of a run, from which sizes are looked through.

    Returns
    -------
    float
        rad²/s of mθ; 0 where no walk is likelier by `NEEDED_GAIN`.

    Examples
    --------
    Angles with white noise of 1 rad², and a walk of 1 rad²/s or none:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.common_walk import Coarse, estimate_common_walk
    >>> draw, one = np.random.default_rng(0).standard_normal, np.ones(2000)
    >>> white = np.diff(draw(2001))
    >>> turns = (white, white + draw(2000))
    >>> runs = [Coarse(np.column_stack([one, turn]), 1.0, one, 0.0) for turn in turns]
    >>> [bool(abs(estimate_common_walk([run], 100.0) - q) < 0.2) for run, q in zip(runs, (0, 1))]
    [True, True]
    """
    from scipy.optimize import minimize_scalar

    unit = float(np.median([c.white for c in coarse])) / length_s
    size = coarse[0].columns.shape[1] - 1

    def normal(q: float) -> tuple[Array, Array, float]:
        """XᵀV⁻¹X, XᵀV⁻¹y, and Σ ln|V| + yᵀV⁻¹y."""
        total = 0.0
        A, b = np.zeros((size, size)), np.zeros(size)
        for run in coarse:
            rows, determinant = whiten(run.build_bands(q), run.columns)
            A += rows[:, :-1].T @ rows[:, :-1]
            b += rows[:, :-1].T @ rows[:, -1]
            total += determinant + float(rows[:, -1] @ rows[:, -1])
        return A, b, total

    still = normal(0.0)[0]
    scale = np.sqrt(np.where(np.diag(still) > 0, np.diag(still), 1.0))
    values, vectors = np.linalg.eigh(still / np.outer(scale, scale))
    kept = values > LEAST_SEEN
    seen = vectors[:, kept] / scale[:, None] / np.sqrt(values[kept])

    def cost(q: float) -> float:
        # ln|V| and the least χ² beside the columns, and ln|A| of what these have taken up
        A, b, total = normal(q)
        A, b = seen.T @ A @ seen, seen.T @ b
        return total - float(b @ np.linalg.solve(A, b)) + float(np.linalg.slogdet(A)[1])

    # The likelihood is flat far off on either side: a coarse look over all sizes before the search.
    powers = np.arange(-4.0, 5.1, 1.0)
    costs = [cost(unit * 10.0**x) for x in powers]
    best = powers[int(np.argmin(costs))]
    found = minimize_scalar(
        lambda x: cost(unit * 10.0**x),
        bounds=(best - 1, best + 1),
        method="bounded",
        options={"xatol": 0.05},
    )
    return 0.0 if cost(0.0) <= float(found.fun) + NEEDED_GAIN else float(unit * 10.0**found.x)
