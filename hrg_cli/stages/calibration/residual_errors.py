"""Residual drift and scale-factor error of a calibration, as rates in cells of run × temperature
node × angle; held out and with intervals.

A cell is what one run saw in a sixteenth of the wave angle's period near one node: residual
increments summed and divided by their time, every cell with the same weight, however long the gyro
dwelt there. Drift: cells at the lowest rates, rad/s. Scale factor: cells at high rates, residual
rate / rate, in ppm of K₀. Both contain the noise of the run; `floor` is what noise alone leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...fitting.noise.increment_noise import build_covariance_bands
from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import number_pieces, solve
from ...fitting.tables.table_design import build_design, split_stretches
from ...fitting.tables.table_layout import Model
from ...fourier import compute_node_weights

Array = np.ndarray
CELLS_A_PERIOD = 16


@dataclass(frozen=True)
class Cells:
    """Mean residual rate (c, models) of each cell, its noise variance, rate, run and whether it
    counts as low or high rate."""

    residual_rad_s: Array
    variance: Array
    rate_rad_s: Array
    run: Array
    low: Array
    high: Array


def predict_models(
    fitted: Fitted, models: Sequence[Model], folds: Array, penalty: Array | None = None
) -> tuple[Array, Array]:
    """Coefficients of models on all data, and with each fold left out.

    Parameters
    ----------
    fitted
        The runs.
    models
        What of the coefficients is free in each.
    folds
        Fold of each piece (R, S), from 0.
    penalty
        (size, size), added to the information; None: none.

    Returns
    -------
    tuple of ndarray
        (size, models) and (size, models, folds).

    Examples
    --------
    A mean of 1 and 3, and without each of them:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.normal_pieces import Pieces
    >>> from hrg_cli.fitting.tables.table_layout import Model
    >>> from hrg_cli.stages.calibration.residual_errors import predict_models
    >>> y, ones = np.array([[1.0, 3.0]]), np.ones((1, 2), int)
    >>> pieces = Pieces(np.zeros(1), np.ones((1, 2, 1, 1)), y[..., None], y**2, ones)
    >>> fitted = Told(pieces=pieces, layout=Told(size=1))
    >>> whole, held = predict_models(fitted, [Model("mean", np.eye(1))], np.array([[0, 1]]))
    >>> whole.ravel().tolist(), held.ravel().tolist()
    ([2.0], [3.0, 1.0])
    """
    count = int(folds.max()) + 1
    A, b, _ = fitted.pieces.sum()
    whole = np.empty((fitted.layout.size, len(models)))
    held = np.empty((fitted.layout.size, len(models), count))
    sums = [fitted.pieces.sum(folds == f)[:2] for f in range(count)]
    for i, model in enumerate(models):
        whole[:, i] = solve(A, b, model, penalty).coefficients
        for f, (A_f, b_f) in enumerate(sums):
            held[:, i, f] = solve(A - A_f, b - b_f, model, penalty).coefficients
    return whole, held


@dataclass(frozen=True)
class _RateLimits:
    """Which rates speak of the drift and which of the scale factor, by the programme's own."""

    fastest: float
    """Largest rate of all runs, rad/s."""
    slowest: float
    """Smallest mean rate of a run, rad/s."""

    @classmethod
    def from_paths(cls, paths: Sequence[AnglePath]) -> _RateLimits:
        return cls(
            max((float(np.abs(p.rate_rad_s).max()) for p in paths), default=0.0),
            min((float(np.abs(p.rate_rad_s).mean()) for p in paths), default=0.0),
        )

    @property
    def low(self) -> float:
        """Rate up to which an increment speaks of the drift, rad/s."""
        return max(0.1 * self.fastest, 1.05 * self.slowest)

    def classify(self, rate: Array) -> Array:
        """0 for the drift, 1 for the scale factor, 2 in between."""
        fast = np.where(np.abs(rate) >= 0.5 * self.fastest, 1, 2)
        return np.where(np.abs(rate) <= self.low, 0, fast)

    @property
    def leaves_between_out(self) -> bool:
        """Whether increments in between are left out; where all runs turn alike there are none."""
        return self.slowest < 0.5 * self.fastest


def _residuals(
    fitted: Fitted, r: int, whole: Array, held: Array, folds: Array
) -> tuple[Array, Array]:
    """m·Δθ (n, models) of run r less what the coefficients say: those of all data, and those of the
    other folds."""
    path = fitted.paths[r]
    used = np.repeat(fitted.turns[r][:, None], whole.shape[1], axis=1)
    unseen, piece = used.copy(), number_pieces(len(path))
    for rows in split_stretches(len(path)):
        X = build_design(path, fitted.layout, fitted.solution.coefficients, rows)
        used[rows] -= X @ whole
        for s in np.unique(piece[rows]):
            own = np.flatnonzero(piece[rows] == s)
            unseen[rows.start + own] -= X[own] @ held[:, :, folds[r, s]]
    return used, unseen


def _cell_of_increments(fitted: Fitted, path: AnglePath, kind: Array) -> Array:
    """A number (n,) for each increment's kind, node and sixteenth of the angle's period."""
    nodes, period = fitted.layout.nodes, np.pi / path.mode_number
    share = np.mod(_steady_angle(path), period) / period
    angle = (share * CELLS_A_PERIOD).astype(int) % CELLS_A_PERIOD
    node = np.argmax(compute_node_weights(fitted.layout.find_abscissa(path), nodes), axis=1)
    return np.asarray((kind * len(nodes) + node) * CELLS_A_PERIOD + angle)


def _cells_of_run(
    fitted: Fitted, r: int, residuals: tuple[Array, Array], limits: _RateLimits
) -> tuple[Array, ...]:
    """Of run r: mean residual rates used and unseen (c, models), their noise variance, rate,
    run."""
    path = fitted.paths[r]
    kind = limits.classify(path.rate_rad_s)
    keys, place = np.unique(_cell_of_increments(fitted, path, kind), return_inverse=True)
    time = np.bincount(place, path.interval_s)
    bands = build_covariance_bands(path, fitted.noises[r])
    together = place[1:] == place[:-1]
    # neighbours in one cell share the noise of the angle between them
    variance = np.bincount(place, bands[0]) + np.bincount(
        place[1:][together], 2 * bands[1, :-1][together], minlength=len(keys)
    )
    of_kind = keys // (len(fitted.layout.nodes) * CELLS_A_PERIOD)
    keep = time >= 0.2 * np.median(time)  # the rest of a turn is too short to count as a cell
    if limits.leaves_between_out:
        keep &= of_kind < 2
    sums = [
        np.stack([np.bincount(place, column) for column in table.T], axis=1)[keep]
        / time[keep, None]
        for table in residuals
    ]
    return (
        *sums,
        variance[keep] / time[keep] ** 2,
        (np.bincount(place, path.rotation) / time)[keep],
        np.full(int(keep.sum()), r),
    )


def gather_cells(
    fitted: Fitted, whole: Array, held: Array, folds: Array, runs: int | None = None
) -> tuple[Cells, Cells]:
    """What coefficients leave of runs, averaged in cells of run × node × wave angle.

    Parameters
    ----------
    fitted
        The runs.
    whole
        Coefficients (size, models) of all data.
    held
        With each fold left out (size, models, folds).
    folds
        Fold of each piece (R, S), from 0.
    runs
        How many of the first runs count, whose rates then tell low from high; None: all.

    Returns
    -------
    tuple of Cells
        Of the data used, and of data held out.

    Examples
    --------
    A scale factor of 0.55 leaves nothing, one of 0.56 leaves 0.01 Ω:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.residual_errors import gather_cells
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> whole = np.array([[0.0, 0.0, 0.0, 0.55], [0.0, 0.0, 0.0, 0.56]]).T
    >>> used, _ = gather_cells(fitted, whole, np.repeat(whole[:, :, None], 2, axis=2), folds)
    >>> error = used.residual_rad_s / used.rate_rad_s[:, None]
    >>> np.abs(error).mean(axis=0).round(4).tolist()
    [0.0, 0.01]
    """
    limits = _RateLimits.from_paths(fitted.paths[:runs])
    inside = [
        _cells_of_run(fitted, r, _residuals(fitted, r, whole, held, folds), limits)
        for r in range(len(fitted.paths[:runs]))
    ]
    used, unseen, variance, rate, run = (np.concatenate(part) for part in zip(*inside))
    low = np.abs(rate) <= 1.01 * limits.low
    high = (np.abs(rate) >= 0.45 * limits.fastest) & (rate != 0)
    common = {"variance": variance, "rate_rad_s": rate, "run": run, "low": low, "high": high}
    return Cells(used, **common), Cells(unseen, **common)


def _steady_angle(path: AnglePath) -> Array:
    """Wave angle of the increments, the mean of a stretch where it creeps: the noise of an
    increment must not choose its cell."""
    angle = path.average_neighbours(path.angle_rad)
    speed = abs(float(path.angle_rad[-1] - path.angle_rad[0])) / len(path)
    width = int(
        np.clip(
            np.pi / path.mode_number / CELLS_A_PERIOD / 4 / max(speed, 1e-300),
            1,
            max(len(path) // 8, 1),
        )
    )
    stretch = np.arange(len(path)) // width
    return np.asarray((np.bincount(stretch, angle) / np.bincount(stretch))[stretch])


@dataclass(frozen=True)
class HeldOutFigure:
    """Root mean square of each model with its 95 % bootstrap interval over runs, and the floor that
    noise leaves."""

    value: Array
    low: Array
    high: Array
    floor: float


def _compute_figure(
    found: Cells, kind: str, scale_factor: float, draws: int, seed: int
) -> HeldOutFigure:
    """`kind` "drift": rad/s over the low-rate cells; "scale": ppm over the high-rate cells."""
    chosen = found.low if kind == "drift" else found.high
    models = found.residual_rad_s.shape[1]
    if not chosen.any() or (kind == "scale" and scale_factor == 0):
        nothing = np.full(models, np.nan)
        return HeldOutFigure(nothing, nothing, nothing, float("nan"))
    unit = (
        np.ones(int(chosen.sum()))
        if kind == "drift"
        else 1e6 / (scale_factor * found.rate_rad_s[chosen])
    )
    square = (found.residual_rad_s[chosen] * unit[:, None]) ** 2
    noise = float(np.sqrt(np.mean(found.variance[chosen] * unit**2)))
    runs, place = np.unique(found.run[chosen], return_inverse=True)
    sums = np.stack([np.bincount(place, column) for column in square.T], axis=1)
    counts = np.bincount(place)
    generator = np.random.default_rng(seed)
    picks = generator.integers(0, len(runs), (max(draws, 1), len(runs)))
    drawn = np.sqrt(sums[picks].sum(axis=1) / counts[picks].sum(axis=1)[:, None])
    low, high = np.percentile(drawn, [2.5, 97.5], axis=0)
    return HeldOutFigure(np.sqrt(square.mean(axis=0)), low, high, noise)


def tabulate_model_figures(
    names: Sequence[str], used: Cells, unseen: Cells, scale_factor: float, draws: int, seed: int
) -> list[dict[str, Any]]:
    """Errors of models in drift and scale factor, on data used and on data held out.

    Parameters
    ----------
    names
        Of the models.
    used, unseen
        Their cells.
    scale_factor
        K₀, of which the scale-factor error is a part.
    draws
        Of the bootstrap over runs.
    seed
        Of its random numbers.

    Returns
    -------
    list of dict
        A row a model: rms in drift [rad/s] and scale factor [ppm] with its 95 % interval, and what
        noise alone leaves; None where no cell speaks of it.

    Examples
    --------
    K too large by 0.01 of 0.55 is an error of 18182 ppm:

    >>> from hrg_cli.stages.calibration.residual_errors import gather_cells
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.residual_errors import tabulate_model_figures
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> whole = np.array([[0.0, 0.0, 0.0, 0.56]]).T
    >>> cells = gather_cells(fitted, whole, np.repeat(whole[:, :, None], 2, axis=2), folds)
    >>> round(tabulate_model_figures(["0.56"], *cells, 0.55, 99, 0)[0]["scale"]["value"])
    18182
    """
    rows: list[dict[str, Any]] = [{"stage": name} for name in names]
    for kind in ("drift", "scale"):
        for key, found in ((kind, unseen), (kind + "_used", used)):
            f = _compute_figure(found, kind, scale_factor, draws, seed)
            for i, row in enumerate(rows):
                numbers = (
                    ("value", f.value[i]),
                    ("low", f.low[i]),
                    ("high", f.high[i]),
                    ("floor", f.floor),
                )
                row[key] = {name: float(v) if np.isfinite(v) else None for name, v in numbers}
    return rows
