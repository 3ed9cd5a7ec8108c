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
    """Central differences on uneven times.

    Parameters
    ----------
    values
        (n, …).
    time_s
        (n,), increasing [s].

    Returns
    -------
    ndarray
        (n, …): exact of a parabola inside, one-sided at both ends.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.equations import differentiate
    >>> t = np.array([0.0, 1.0, 3.0, 4.0])
    >>> differentiate(t**2, t)[1:-1].round(9).tolist()
    [2.0, 6.0]
    """
    return np.gradient(values, time_s, axis=0)


def find_gap_rows(time_s: Array) -> Array:
    """Which rows have no central difference: those beside a gap, the first and the last.

    Parameters
    ----------
    time_s
        (n,), increasing [s].

    Returns
    -------
    ndarray
        (n,), True on rows next to a step over `WIDE_STEP` times the median.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.equations import find_gap_rows
    >>> np.flatnonzero(find_gap_rows(np.array([0.0, 1.0, 2.0, 9.0, 10.0, 11.0]))).tolist()
    [0, 2, 3, 5]
    """
    wide = np.diff(time_s) > WIDE_STEP * np.median(np.diff(time_s))
    return np.concatenate([[True], wide]) | np.concatenate([wide, [True]])


def find_table_rate(run: EnvelopeRun) -> Array:
    """The table's rate on the rows, by central differences of its angle.

    Parameters
    ----------
    run
        With the angle turned since its beginning.

    Returns
    -------
    ndarray
        (n,) [rad/s].

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.equations import find_table_rate
    >>> t = np.array([0.0, 1.0, 2.0])
    >>> find_table_rate(SimpleNamespace(time_s=t, turn_rad=0.5 * t)).tolist()
    [0.5, 0.5, 0.5]
    """
    return differentiate(run.turn_rad, run.time_s)


def build_ellipse(run: EnvelopeRun) -> Ellipse:
    """The wave in moving axes, continuous in sign and angle.

    (mθ, φ) and (mθ + π, φ + π) are one wave: without a choice that goes on from row to row the
    derivatives would jump.

    Parameters
    ----------
    run
        Its envelopes, times and turn.

    Returns
    -------
    Ellipse
        a_A, a_B, mθ and their derivatives on the rows.

    Examples
    --------
    A line that decays at ν = 0.1 s⁻¹: ȧ/a is −ν.

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.equations import build_ellipse
    >>> t = np.linspace(0.0, 1.0, 101)
    >>> u = np.exp(-0.1 * t)[:, None] * np.array([np.cos(0.3), np.sin(0.3)]).astype(complex)
    >>> found = build_ellipse(SimpleNamespace(envelope=u, time_s=t, turn_rad=0 * t))
    >>> round(float((found.a_dot / found.a)[50]), 5), round(float(found.angle[50]), 9)
    (-0.1, 0.3)
    """
    a, b, angle, phase = ellipse.find_wave(run.envelope, 1)
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
        find_table_rate(run),
        ~find_gap_rows(t),
    )


def make_equations(
    run: EnvelopeRun,
    columns: list[Array],
    target: Array,
    keep: Array,
    scale: Array | float = 1.0,
    offset: Array | None = None,
) -> Equations:
    """The equations Σ columns·p + δ·offset = target of the rows to keep, with their weights.

    A central difference of noise σ has the standard deviation σ/(√2·step). The weight is step/σ:
    the factor that all rows share is left out.

    Parameters
    ----------
    run
        Its times and standard deviations.
    columns
        The seven columns, each (n,) or a number.
    target
        (n,).
    keep
        (n,), True on the rows that are taken.
    scale
        What the standard deviation is multiplied by, (n,) or a number.
    offset
        (n,): the column of the run's own frequency δ; None where it is not needed.

    Returns
    -------
    Equations
        One row for every row kept.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.equations import make_equations
    >>> run = SimpleNamespace(time_s=np.arange(4.0), std=0.1)
    >>> keep = np.array([False, True, True, False])
    >>> made = make_equations(run, [np.ones(4)], np.arange(4.0), keep)
    >>> made.target.tolist(), made.weight.tolist(), made.first.tolist()
    ([1.0, 2.0], [10.0, 10.0], [0, 1])
    """
    # A central difference of noise σ has the standard deviation σ/(√2·step): its weight is step/σ
    # but for a factor that all share.
    step = float(np.median(np.diff(run.time_s)))
    weight = np.broadcast_to(step / run.std / scale, target.shape)
    full = np.stack([np.broadcast_to(c, target.shape) for c in columns], axis=-1)
    off = np.zeros(len(target)) if offset is None else offset
    return Equations(full[keep], target[keep], off[keep], weight[keep], np.flatnonzero(keep) - 1)


def join_equations(parts: Sequence[Equations]) -> Equations:
    """Equations of one run, one kind after another.

    Parameters
    ----------
    parts
        Those of each kind.

    Returns
    -------
    Equations
        All rows.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.equations import join_equations, make_equations
    >>> run = SimpleNamespace(time_s=np.arange(3.0), std=0.1)
    >>> angle, amplitude = (
    ...     make_equations(run, [np.ones(3)], target * np.ones(3), np.ones(3, bool))
    ...     for target in (1.0, 2.0)
    ... )
    >>> join_equations([angle, amplitude]).target.tolist()
    [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]
    """
    columns, target, offset, weight, first = (
        np.concatenate([getattr(p, name) for p in parts])
        for name in ("columns", "target", "offset", "weight", "first")
    )
    return Equations(columns, target, offset, weight, first)


def integrate_equations(
    run: EnvelopeRun, equations: Sequence[tuple[list[Array], Array, Array]]
) -> Equations:
    """Increments of quantities from row to row against ∫columns dt.

    The trapezium rule with its end correction, h/2·(f₀ + f₁) − h²/12·(f₁' − f₀'), which is right to
    h⁴ (Euler and Maclaurin).

    Parameters
    ----------
    run
        Its times.
    equations
        (columns, quantity (n,), standard deviation a row) of each kind; the columns are those of
        the quantity's derivative.

    Returns
    -------
    Equations
        n − 1 rows a kind.

    Examples
    --------
    The integral of t² from 0 to 1 in one step is 1/3; the trapezium alone says 1/2. At the ends the
    derivatives are one-sided, so take a step inside:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.equations import integrate_equations
    >>> t = np.arange(6.0)
    >>> made = integrate_equations(SimpleNamespace(time_s=t), [([t**2], t**3 / 3, 0.1)])
    >>> np.allclose(made.columns[2, 0], (3**3 - 2**3) / 3), np.allclose(made.target[2], 19 / 3)
    (True, True)
    """
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
