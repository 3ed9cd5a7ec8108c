"""Joint least squares of many runs: the design of D(T, θ), K(T, θ) and further factors, and its
normal equations in pieces.

Every run is whitened once (`increments`); its independent rows are summed to normal matrices of a
few contiguous pieces of time. Models, held-out fits and groups of runs are then small linear
algebra: a model is a matrix that maps its own coefficients to the full set, a fold or a group is a
sum of pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...fourier import monotone_weights, node_weights
from .increment_noise import AngleNoise, Whitener, covariance_bands, estimate_noise, whiten
from .increments import AnglePath
from .table_layout import Model, TableLayout

Array = np.ndarray
ROWS_AT_ONCE = 1 << 12
"""Increments of a run whose design is held at once."""
PIECES = 5
"""Pieces of time a run is cut into."""


def design(run: AnglePath, layout: TableLayout, previous: Array | None, rows: slice) -> Array:
    """Columns (n, size) of m·Δθ for the increments `rows` of a run. `previous` coefficients
    linearise the monotone interpolation."""
    path = run.part(rows)
    x = layout.abscissa(path)
    basis = path.angle_basis(max(layout.drift_harmonics, layout.scale_harmonics))
    columns = np.empty((len(path), layout.size))
    weights = node_weights(
        x, layout.nodes, "linear" if layout.interpolation in ("linear", "monotone") else "cubic"
    )
    table = columns[:, : layout.table_size].reshape(len(path), len(layout.nodes), layout.node_size)
    tables = (
        layout.tables(previous)
        if previous is not None and layout.interpolation == "monotone"
        else None
    )
    # m·Δθ = ∫(D − KΩ)dt: drift columns by the time, scale-factor columns by −∫Ω dt.
    time = (path.interval_s, -path.rotation)
    for kind, (start, width) in enumerate(
        ((0, layout.drift_size), (layout.drift_size, layout.node_size - layout.drift_size))
    ):
        for h in range(width):
            psi = (
                weights if tables is None else monotone_weights(x, layout.nodes, tables[kind][:, h])
            )
            table[:, :, start + h] = psi * (time[kind] * basis[:, h])[:, None]
    for name, factor in layout.factors.items():
        # of the whole run: a factor may look at its neighbours in time
        columns[:, layout.factor(name)] = factor(run)[rows] * path.interval_s[:, None]
    return columns


@dataclass
class Pieces:
    """Normal equations of R runs × S pieces: information (R, S, P, P), vector (R, S, P), square (R,
    S), rows (R, S), fold (R, S)."""

    information: Array
    vector: Array
    square: Array
    rows: Array

    def sum(self, where: Array | None = None) -> tuple[Array, Array, float, int]:
        """(A, b, y², n) of the chosen pieces (R, S) bool or weights; all by default."""
        if where is None:
            where = np.ones(self.square.shape)
        w = np.asarray(where, float)
        return (
            np.tensordot(w, self.information, axes=2),
            np.tensordot(w, self.vector, axes=2),
            float((w * self.square).sum()),
            int((w * self.rows).sum()),
        )


def piece_of(length: int) -> Array:
    """Piece of each increment (n,), contiguous in time."""
    return np.arange(length) * PIECES // max(length, 1)


def accumulate(
    paths: Sequence[AnglePath],
    noises: Sequence[AngleNoise],
    layout: TableLayout,
    turns: Sequence[Array],
    previous: Array | None = None,
) -> Pieces:
    """Whitened normal equations of all runs. turns: m·Δθ of each run."""
    shape = (len(paths), PIECES)
    pieces = Pieces(
        np.zeros((*shape, layout.size, layout.size)),
        np.zeros((*shape, layout.size)),
        np.zeros(shape),
        np.zeros(shape, int),
    )
    for r, (path, noise, turn) in enumerate(zip(paths, noises, turns)):
        piece = piece_of(len(path))
        whitener = Whitener(covariance_bands(path, noise))
        for rows in stretches(len(path)):
            white = whitener.next(
                np.column_stack([design(path, layout, previous, rows), turn[rows]])
            )
            for s in np.unique(piece[rows]):
                own = white[piece[rows] == s]
                X, y = own[:, :-1], own[:, -1]
                pieces.information[r, s] += X.T @ X
                pieces.vector[r, s] += X.T @ y
                pieces.square[r, s] += y @ y
                pieces.rows[r, s] += len(y)
    return pieces


def stretches(length: int) -> list[slice]:
    """Increments a run is worked through at once, so that memory holds one stretch of the
    design."""
    return [
        slice(first, min(first + ROWS_AT_ONCE, length)) for first in range(0, length, ROWS_AT_ONCE)
    ]


def predict_turn(
    path: AnglePath, layout: TableLayout, coefficients: Array, previous: Array | None = None
) -> Array:
    """m·Δθ (n, …) of given coefficients (size, …), a stretch at a time."""
    return np.concatenate(
        [design(path, layout, previous, rows) @ coefficients for rows in stretches(len(path))]
    )


@dataclass(frozen=True)
class TableSolution:
    """Coefficients in the full set, their covariance and the effective number of coefficients."""

    coefficients: Array
    covariance: Array
    degrees: float


def solve(
    information: Array, vector: Array, model: Model, penalty: Array | None = None
) -> TableSolution:
    """Least squares in a model's space; directions the data do not see (scaled eigenvalue <
    `LEAST_SEEN`) stay at zero."""
    M = model.matrix
    start = np.zeros(len(vector)) if model.start is None else model.start
    A, b = M.T @ information @ M, M.T @ (vector - information @ start)
    data = A
    if penalty is not None:
        A = A + M.T @ penalty @ M
        b = b - M.T @ penalty @ start
    # D in rad/s and K without unit: a rank is judged on a matrix with a diagonal of ones.
    scale = np.sqrt(np.maximum(np.diag(A), 0))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(A / np.outer(scale, scale))
    seen = values > LEAST_SEEN
    inverse = np.where(seen, 1 / np.where(seen, values, 1.0), 0.0)
    covariance = (vectors * inverse) @ vectors.T / np.outer(scale, scale)
    return TableSolution(
        start + M @ (covariance @ b), M @ covariance @ M.T, float(np.trace(covariance @ data))
    )


def chi_square(information: Array, vector: Array, square: float, coefficients: Array) -> float:
    """Σ of whitened residuals squared for given coefficients."""
    return float(square - 2 * vector @ coefficients + coefficients @ information @ coefficients)


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


def held_out_chi_square(
    pieces: Pieces, folds: Array, model: Model, penalty: Array | None = None
) -> float:
    """Σ over folds of the whitened residuals squared, each fold predicted from the others."""
    A, b, _, _ = pieces.sum()
    total = 0.0
    for f in range(int(folds.max()) + 1):
        A_f, b_f, square, _ = pieces.sum(folds == f)
        total += chi_square(A_f, b_f, square, solve(A - A_f, b - b_f, model, penalty).coefficients)
    return total


COARSE_BLOCKS = 64
NEEDED_GAIN = 2.0
"""Fall of −2 ln L that a common random walk must bring: half of all gyros without one would
otherwise show one."""


LEAST_SEEN = 1e-10
"""Eigenvalue of the scaled normal matrix below which the data do not see a direction."""


@dataclass(frozen=True)
class Coarse:
    """A run's columns (design, turn) between averages of many blocks."""

    columns: Array
    white: float
    interval_s: Array
    width_s: float

    def bands(self, q: float) -> Array:
        """Covariance (2, n) of neighbouring increments for a random walk of density q: diagonal and
        first off-diagonal."""
        bands = np.zeros((2, len(self.interval_s)))
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
    """The run's model columns and turn, averaged to some sixty blocks, a stretch at a time."""
    many = max(1, (len(path) + 1) // COARSE_BLOCKS)
    count = (len(path) + 1) // many
    means, angle = np.zeros((count, model.free + 1)), np.zeros(model.free + 1)
    for rows in stretches(len(path)):
        X = design(path, layout, previous, rows)
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


def common_walk(coarse: Sequence[Coarse], length_s: float) -> float:
    """Angle random walk q common to all runs, rad²/s of mθ, by restricted likelihood at the runs'
    white noise.

    A slow random walk hides in what the tables absorb, so a run's own residuals understate it:
    minimised is −2 ln L = Σ ln|V| + χ² + ln|XᵀV⁻¹X|, on blocks averaged to some sixty a run, where
    a walk that is hard to see acts. X spans the same directions at every q, those that are seen
    without a walk: one that came or went with q would change the determinant by more than any walk.
    """
    from scipy.optimize import minimize_scalar

    unit = float(np.median([c.white for c in coarse])) / length_s
    size = coarse[0].columns.shape[1] - 1

    def normal(q: float) -> tuple[Array, Array, float]:
        """XᵀV⁻¹X, XᵀV⁻¹y, and Σ ln|V| + yᵀV⁻¹y."""
        total = 0.0
        A, b = np.zeros((size, size)), np.zeros(size)
        for run in coarse:
            rows, determinant = whiten(run.bands(q), run.columns)
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


MOST_SWEEPS = 6
SETTLED = 0.05
"""Change of a random walk's density between two sweeps, over itself, at which it stands: a quarter of what
some thousand rows tell."""


def _walks_settled(before: Sequence[AngleNoise], now: Sequence[AngleNoise]) -> bool:
    """Whether no run's random walk moved since the weights of the last sweep."""
    return all(abs(n.walk - b.walk) <= SETTLED * max(n.walk, b.walk) for b, n in zip(before, now))


def fit(
    paths: Sequence[AnglePath],
    layout: TableLayout,
    model: Model | None = None,
    start: Fitted | None = None,
) -> Fitted:
    """Joint fit of a model (by default the full layout), alternating coefficients and each run's
    noise.

    White angle noise is each run's own; the angle random walk is the larger of the run's own and
    the one common to all runs. What a fit with other weights leaves shows too large a walk, so the
    sweeps go on until it settles. start: an earlier fit of the same runs, whose noise begins the
    sweeps.
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
    jumps = 0 if start is None else start.jumps
    settled = False
    for sweep in range(MOST_SWEEPS + 1):
        pieces = accumulate(paths, noises, layout, turns, previous)
        A, b, square, rows = pieces.sum()
        solution = solve(A, b, model)
        linearised, previous = previous, solution.coefficients
        if settled or sweep == MOST_SWEEPS:
            break
        coarse, used = [], list(noises)
        for r, path in enumerate(paths):
            residual = turns[r] - predict_turn(path, layout, solution.coefficients, linearised)
            jump = np.round(residual / np.pi)
            if jump.any():
                # (mθ, φ) and (mθ + π, φ + π) are the same wave: a gap may hide half a turn of mθ
                jumps += int(np.count_nonzero(jump))
                path = paths[r] = path.without_jumps(jump)
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
        walk = common_walk(coarse, float(np.median([p.time_s[-1] - p.time_s[0] for p in paths])))
        weights = [AngleNoise(n.white, max(n.walk, walk)) for n in noises]
        settled = sweep > 0 and _walks_settled(used, weights)
        noises = weights
    chi2 = chi_square(A, b, square, solution.coefficients) / max(rows - solution.degrees, 1.0)
    return Fitted(list(paths), turns, noises, layout, pieces, solution, float(chi2), jumps)
