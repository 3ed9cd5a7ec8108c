"""Linear equations of one run: the wave in moving axes with its derivatives, and rows of equations
or their increments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...physics import ellipse
from .envelope_runs import EnvelopeRun

Array = np.ndarray


WIDE_STEP = 3.0
"""Step over the median from which two rows are no neighbours: a gap."""


@dataclass(frozen=True)
class Equations:
    """Rows of one run: Σ columns·p + δ·offset = target; columns (N, 7), offset (N,) of the run's
    own frequency (0: not needed).

    Each row sees the run's rows from `first` (N,) on, 3 of them with derivatives. `levels`: None
    there; with increments from row to row the weights (N + 1 a quantity) of their running sums,
    whose first values are free.
    """

    columns: Array
    target: Array
    offset: Array
    weight: Array
    first: Array
    levels: tuple[Array, ...] | None = None

    @property
    def reach(self) -> int:
        """Rows of the run that an equation sees."""
        return 3 if self.levels is None else 4


@dataclass(frozen=True)
class Ellipse:
    """a_A, a_B, electrical angle mθ, phase φ and their derivatives on the rows of a run; `good` is
    False beside gaps."""

    run: EnvelopeRun
    a: Array
    b: Array
    angle: Array
    a_dot: Array
    b_dot: Array
    angle_dot: Array
    rate: Array
    good: Array


def differentiate(values: Array, time_s: Array) -> Array:
    """Central differences on uneven times."""
    return np.gradient(values, time_s, axis=0)


def beside_gap(time_s: Array) -> Array:
    """True on rows next to a step over three times the median, and on the first and last: no
    central difference there."""
    wide = np.diff(time_s) > WIDE_STEP * np.median(np.diff(time_s))
    return np.concatenate([[True], wide]) | np.concatenate([wide, [True]])


def table_rate(run: EnvelopeRun) -> Array:
    """Rate on the rows, rad/s."""
    return differentiate(run.turn_rad, run.time_s)


def ellipse_of(run: EnvelopeRun) -> Ellipse:
    """The wave in moving axes, continuous in sign and angle."""
    a, b, angle, phase = ellipse.wave(run.envelope, 1)
    angle, phase = ellipse.unwrap(angle, phase, 1)
    t = run.time_s
    return Ellipse(
        run,
        a,
        b,
        angle,
        differentiate(a, t),
        differentiate(b, t),
        differentiate(angle, t),
        table_rate(run),
        ~beside_gap(t),
    )


def make_equations(
    run: EnvelopeRun,
    columns: list[Array],
    target: Array,
    keep: Array,
    scale: Array | float = 1.0,
    offset: Array | None = None,
) -> Equations:
    """Σ columns·p + δ·offset = target of the rows to keep, weighted by step/σ over `scale`: what the
    noise of a central difference makes of them."""
    # A central difference of noise σ has the standard deviation σ/(√2·step): its weight is step/σ
    # but for a factor that all share.
    step = float(np.median(np.diff(run.time_s)))
    weight = np.broadcast_to(step / run.std / scale, target.shape)
    full = np.stack([np.broadcast_to(c, target.shape) for c in columns], axis=-1)
    off = np.zeros(len(target)) if offset is None else offset
    return Equations(full[keep], target[keep], off[keep], weight[keep], np.flatnonzero(keep) - 1)


def join_equations(parts: Sequence[Equations]) -> Equations:
    """Equations of one run, one kind after another."""
    columns, target, offset, weight, first = (
        np.concatenate([getattr(p, name) for p in parts])
        for name in ("columns", "target", "offset", "weight", "first")
    )
    return Equations(columns, target, offset, weight, first)


def integrate_equations(
    run: EnvelopeRun, equations: Sequence[tuple[list[Array], Array, Array]]
) -> Equations:
    """Increments of quantities from row to row against ∫columns dt, trapezium rule with its end
    correction; standard deviations a row."""
    t = run.time_s
    step = np.diff(t)[:, None]
    pieces, targets = [], []
    for columns, quantity, _ in equations:
        full = np.stack([np.broadcast_to(c, quantity.shape) for c in columns], axis=-1)
        slope = differentiate(full, t)
        # Trapezium with its end correction, −h²/12 [f']: right to h⁴ (Euler and Maclaurin).
        pieces.append((full[1:] + full[:-1]) / 2 * step - np.diff(slope, axis=0) * step**2 / 12)
        targets.append(np.diff(quantity))
    n = len(t) - 1
    first = np.tile(np.arange(n) - 1, len(equations))
    levels = tuple(1 / np.broadcast_to(std, t.shape) for _, _, std in equations)
    return Equations(
        np.concatenate(pieces),
        np.concatenate(targets),
        np.zeros(len(first)),
        np.ones(len(first)),
        first,
        levels,
    )
