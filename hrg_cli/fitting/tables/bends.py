"""Tables whose interpolation follows their own values (monotone): descent to where the weights at
the coefficients are the weights that they were fitted with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..least_squares import StepTaken, descend
from ..noise.increment_noise import AngleNoise
from .increments import AnglePath
from .normal_pieces import accumulate, solve
from .table_design import predict_turn
from .table_layout import Model, TableLayout

Array = np.ndarray
MOST_STEPS = 30
SMALL_FALL = 0.01
"""Fall of χ² that a step still promises at which it is settled: a tenth of a standard deviation."""


def has_bends(layout: TableLayout) -> bool:
    """Whether the weights of the nodes depend on the coefficients.

    Between two nodes every interpolation is the same line.

    Parameters
    ----------
    layout
        Nodes and interpolation of the tables.

    Returns
    -------
    bool
        True for a monotone interpolation between three nodes or more.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.bends import has_bends
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> [has_bends(TableLayout(np.arange(n), "temperature", 2, 1, 0, "monotone")) for n in (2, 3)]
    [False, True]
    """
    return layout.interpolation == "monotone" and len(layout.nodes) > 2


def settle_bends(
    paths: Sequence[AnglePath],
    noises: Sequence[AngleNoise],
    layout: TableLayout,
    turns: Sequence[Array],
    model: Model,
    start: Array,
) -> Array:
    """Coefficients of least χ² where every node's weights are those of the coefficients themselves.

    The descent goes downhill from `start`. The interpolant has kinks where neighbouring slopes
    change sign; a descent that ends on one is at its least all the same, though a step of the
    linear form would promise more.

    Parameters
    ----------
    paths
        The runs.
    noises
        Noise of each.
    layout
        Of the tables, with monotone interpolation.
    turns
        m·Δθ [rad] of each run, (n,).
    model
        What of the layout is free.
    start
        Coefficients (size,): drift in rad/s, scale factor without unit.

    Returns
    -------
    ndarray
        (size,), as `start`.

    Examples
    --------
    A sweep through three nodes gives back the drifts that turned it, 1, 2 and 4 mrad/s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.bends import settle_bends
    >>> from hrg_cli.fitting.noise.increment_noise import AngleNoise
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.table_design import predict_turn
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> path = draw_path(blocks=41, temperature_degc=np.arange(41.0))
    >>> layout = TableLayout(np.array([0.0, 20.0, 40.0]), "temperature", 2, 0, 0, "monotone")
    >>> true = np.array([1e-3, 0, 2e-3, 0, 4e-3, 0])
    >>> turn, model = predict_turn(path, layout, true, true), Model("everything", np.eye(6))
    >>> found = settle_bends([path], [AngleNoise(0, 1e-8)], layout, [turn], model, 0 * true)
    >>> found[::2].round(6).tolist()
    [0.001, 0.002, 0.004]
    """
    problem = _Bending(list(paths), list(noises), layout, list(turns), model)
    return descend(problem, problem.evaluate(start), MOST_STEPS).point.coefficients


@dataclass(frozen=True)
class _Bent:
    """Coefficients, the normal matrix and vector of what they leave, and its χ²."""

    coefficients: Array
    information: Array
    vector: Array
    cost: float


@dataclass(frozen=True)
class _Bending:
    """`least_squares.Problem` of tables with the weights of their own values."""

    paths: list[AnglePath]
    noises: list[AngleNoise]
    layout: TableLayout
    turns: list[Array]
    model: Model

    def evaluate(self, coefficients: Array) -> _Bent:
        """What the coefficients leave of the turns: small, so that χ² keeps its digits."""
        rest = [
            turn - predict_turn(path, self.layout, coefficients, coefficients)
            for path, turn in zip(self.paths, self.turns)
        ]
        pieces = accumulate(self.paths, self.noises, self.layout, rest, coefficients)
        information, vector, _ = pieces.sum()
        return _Bent(coefficients, information, vector, float(pieces.square.sum()))

    def linearise(self, point: _Bent) -> tuple[Array, float]:
        """The step in the model's space and the fall of χ² that it promises."""
        free = Model(self.model.name, self.model.matrix)
        step = solve(point.information, point.vector, free).coefficients
        return step, float(step @ point.vector)

    def move(self, point: _Bent, step: tuple[Array, float], size: float) -> _Bent:
        """A part of the step further."""
        return self.evaluate(point.coefficients + size * step[0])

    def is_settled(self, step: tuple[Array, float], taken: StepTaken) -> bool:
        """Whether no more than a part of a standard deviation was promised, nor gained."""
        return max(step[1], taken.fall) < SMALL_FALL
