"""One step of Gauss–Newton: the model linearised about a point, the step with its bound, and how
far down it leads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import HrgError, name_some
from .coordinate_priors import CoordinatePriors, build_prior_rows, compute_prior_residual
from .damping_bound import find_wall, restrict_damping
from .design_columns import FREQUENCY, FitColumns
from .designs import Design, Factored, factor_design
from .fit_point import Point
from .measured_runs import MeasuredRuns
from .motion_budget import spend_motion
from .sensitivities import Propagation, linearise_flow
from .slow_prediction import Prediction, predict
from .wave_frame import to_complex
from .whitened_rows import compute_design, flatten_rows

Array = np.ndarray
PARTS = (1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32, 1 / 64, 1 / 128)
"""Of a step, that are tried where all of it leads nowhere, before it is bent."""
DAMPED = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Lengths of the damping rows, over those of the columns, where a whole step leads nowhere."""


class DivergedError(HrgError, ArithmeticError):
    """The start is so far off that the model's motion has no end there."""


def compute_cost(prediction: Prediction, freedom: CoordinatePriors) -> float:
    """χ² with the priors' part.

    Parameters
    ----------
    prediction
        Of the runs.
    freedom
        The priors.

    Returns
    -------
    float
        Infinite where the motion has no end.

    Examples
    --------
    A prediction whose damping is 0.1 1/s too small, over 101 rows of σ = 1/1000, beside a prior
    that it is 2 σ away from:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors
    >>> from hrg_cli.fitting.causes.descent import compute_cost
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.slow_prediction import predict
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, envelope=np.exp(-0.2 * t)[..., None] * [1, 0],
    ...     weight=none + 1e3, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> prior = CoordinatePriors(np.full(7, 0.3), np.array([0.1, *[np.inf] * 6]))
    >>> point = Point(np.array([0.1, 0, 0, 0, 0, 0.5, 0]), np.array([[1.0, 0.0]]), np.zeros(1))
    >>> missed = 1e6 * np.sum((np.exp(-0.2 * t) - np.exp(-0.1 * t)) ** 2)
    >>> bool(np.isclose(compute_cost(predict(series, point), prior), missed + 4, rtol=1e-9))
    True
    """
    if not np.all(np.isfinite(prediction.seen)):
        return np.inf
    series = prediction.series
    pull = compute_prior_residual(freedom, prediction.point, series)
    return float(np.sum(flatten_rows(series, prediction.compute_residual()) ** 2) + np.sum(pull**2))


def tell_no_motion(series: MeasuredRuns, point: Point) -> DivergedError:
    """Why there is no fit at all.

    Parameters
    ----------
    series
        The runs, by their names.
    point
        Where the model has no motion, with its effects.

    Returns
    -------
    DivergedError
        To be raised.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.fitting.causes.descent import tell_no_motion
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> str(tell_no_motion(SimpleNamespace(names=("left",)), Point(None, None, None)))[:53]
    'left: the model finds no fit to these runs together; '
    """
    taken = ", ".join(effect.name for effect, _ in point.active)
    return DivergedError(
        f"{name_some(series.names)}: the model{f' with {taken}' if taken else ''} finds no fit to"
        " these runs together; diagnose free and forced runs apart, or leave out the run that"
        " differs most"
    )


@dataclass(frozen=True)
class LinearModel:
    """The model about a point: its flow, design and residual, the Gauss–Newton step, and what the
    damping's bound costs on its way."""

    flow: Propagation
    design: Design
    residual: Array
    layout: FitColumns
    factored: Factored
    priors: tuple[Array, Array]
    step: Array
    covariance: Array
    lost: float

    @property
    def expected(self) -> float:
        """Fall of χ² that the whole step promises."""
        return float(np.sum(self.design.multiply(self.step) ** 2))

    def damp(self, damping: float) -> Array:
        """The step with rows of this length, over those of the columns, that hold it back."""
        rows, right = self.priors
        # Marquardt's scaling: rows as long as the columns, so that units of the parameters do not
        # matter
        sizes = np.diag(
            np.sqrt(np.sum(self.factored.triangle**2, axis=0) + np.sum(rows**2, axis=0))
        )
        step, _ = self.factored.solve(
            self.residual,
            np.vstack([rows, damping * sizes]),
            np.concatenate([right, np.zeros(len(sizes))]),
        )
        return np.asarray(step)


def linearise(prediction: Prediction, layout: FitColumns, freedom: CoordinatePriors) -> LinearModel:
    """The model about a prediction, with the Gauss–Newton step from there.

    Parameters
    ----------
    prediction
        Of R runs.
    layout
        Which column is which number.
    freedom
        The priors.

    Returns
    -------
    LinearModel
        Where the step would leave the cone ν ≥ |νδμ| of a passive resonator it runs along it.

    Raises
    ------
    DivergedError
        Its slopes are no numbers.

    Examples
    --------
    From ν = 0.1 towards the 0.12 1/s of the data:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors
    >>> from hrg_cli.fitting.causes.descent import linearise
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.slow_prediction import predict
    >>> from hrg_cli.fitting.causes.whitened_rows import build_layout
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, envelope=np.exp(-0.12 * t)[..., None] * [1, 0.2j],
    ...     weight=none + 1e3, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> held = np.array([0.1, 0, 0, 0, 0, 0.5, 0])
    >>> free = CoordinatePriors(held, np.array([np.inf, 0, 0, 0, 0, 0, 0]))
    >>> prediction = predict(series, Point(held, np.array([[1, 0.2j]]), np.zeros(1)))
    >>> here = linearise(prediction, build_layout(series, prediction.point, free), free)
    >>> round(float(here.step[0]), 3), here.lost
    (0.018, 0.0)
    """
    series = prediction.series
    flow = linearise_flow(prediction)
    design = compute_design(flow, layout)
    residual = flatten_rows(series, prediction.compute_residual())
    try:
        factored = factor_design(design)
    except np.linalg.LinAlgError as error:
        raise tell_no_motion(series, prediction.point) from error
    # slopes that grow without end give a triangle that is no numbers, and not always an error
    with np.errstate(over="ignore"):
        size = float(np.sum(np.square(factored.triangle)))
    if not np.isfinite(size):
        raise tell_no_motion(series, prediction.point)
    priors = (
        build_prior_rows(freedom, layout, series),
        compute_prior_residual(freedom, prediction.point, series),
    )
    step, covariance = factored.solve(residual, *priors)
    wall = find_wall(prediction.point, layout, step) if freedom.passive else None
    lost = 0.0
    if wall is not None:
        # along the wall only; the covariance stays that without it, as the bound is no measurement
        free = step
        step, _ = factored.solve(residual, *priors, *wall)
        lost = _predict_fall(design, residual, free) - _predict_fall(design, residual, step)
    return LinearModel(flow, design, residual, layout, factored, priors, step, covariance, lost)


@dataclass(frozen=True)
class Descent:
    """A step that was taken: the prediction behind it, its cost, whether it was the whole one, and
    its damping (0: none)."""

    prediction: Prediction
    value: float
    whole: bool
    damping: float


def descend(
    here: LinearModel, freedom: CoordinatePriors, value: float, settled: float, damping: float = 0.0
) -> Descent:
    """The first part of the step that does not raise the cost.

    Parts are halved down to the last of `PARTS`; where none does, Levenberg's and Marquardt's path
    is taken. A bent valley that was entered on that path goes on: there the damping that led on is
    tried next to the whole step.

    Parameters
    ----------
    here
        The model about a point.
    freedom
        The priors.
    value
        The cost there.
    settled
        Part of the cost by which a step may raise it and still counts as level.
    damping
        Of the step that led there; 0: it had none.

    Returns
    -------
    Descent
        Where none lowers the cost, that of the most damped step.

    Examples
    --------
    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors
    >>> from hrg_cli.fitting.causes.descent import compute_cost, descend, linearise
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.slow_prediction import predict
    >>> from hrg_cli.fitting.causes.whitened_rows import build_layout
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, envelope=np.exp(-0.12 * t)[..., None] * [1, 0.2j],
    ...     weight=none + 1e3, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> held = np.array([0.1, 0, 0, 0, 0, 0.5, 0])
    >>> free = CoordinatePriors(held, np.array([np.inf, 0, 0, 0, 0, 0, 0]))
    >>> prediction = predict(series, Point(held, np.array([[1, 0.2j]]), np.zeros(1)))
    >>> here = linearise(prediction, build_layout(series, prediction.point, free), free)
    >>> before = compute_cost(prediction, free)
    >>> made = descend(here, free, before, 1e-6)
    >>> made.whole, bool(made.value < 1e-2 * before)
    (True, True)
    >>> round(float(made.prediction.point.p[0]), 3)
    0.118
    """
    led = [one for one in DAMPED if 0 < damping <= one]
    most_damped: Descent | None = None
    for part, damped in (
        (1.0, 0.0),
        *((1.0, one) for one in led),
        *((one, 0.0) for one in PARTS),
        *((1.0, one) for one in DAMPED if one not in led),
    ):
        step = part * (here.damp(damped) if damped else here.step)
        trial, now = _follow(here, freedom, step)
        taken = Descent(trial, now, part == 1.0 and not damped, damped)
        if now < value or (not damped and now <= value + settled * value):
            return taken
        most_damped = taken if damped == DAMPED[-1] else most_damped
    assert most_damped is not None
    return most_damped


def _follow(here: LinearModel, freedom: CoordinatePriors, step: Array) -> tuple[Prediction, float]:
    """The motion after a step, and its cost."""
    start = here.flow.prediction
    spend_motion()
    point = move_point(start.point, here.layout, step, freedom.passive)
    trial = predict(start.series, point, here.flow.near)
    return trial, compute_cost(trial, freedom)


def _predict_fall(design: Design, residual: Array, step: Array) -> float:
    """By how much a step lowers χ² in the linear model."""
    change = design.multiply(step)  # |r|² − |r − Js|²
    return float(2 * residual @ change - change @ change)


def move_point(point: Point, layout: FitColumns, step: Array, passive: bool = True) -> Point:
    """The point after a step in everything fitted.

    Parameters
    ----------
    point
        Before it.
    layout
        Which column is which number.
    step
        (columns,).
    passive
        Whether it is brought back into the cone ν ≥ |νδμ|.

    Returns
    -------
    Point
        What is held stays.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.descent import move_point
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.design_columns import FitColumns
    >>> point = Point(np.array([0.1, 0, 0, 0, 0, 0.5, 1]), np.array([[1, 0j]]), np.zeros(1))
    >>> found = move_point(point, FitColumns((0, 5), 1), np.array([-0.2, 0.1, 0, 0, 0, 0.5, 3.0]))
    >>> found.p[[0, 5]].round(9).tolist(), found.start.tolist(), found.offset_rad_s.tolist()
    ([0.0, 0.6], [[(1+0j), 0.5j]], [3.0])
    """
    p, start, offset = point.p.copy(), point.start.copy(), point.offset_rad_s.copy()
    p[list(layout.coordinates)] += step[: len(layout.coordinates)]
    for number in range(layout.runs):
        own = step[layout.run(number)]
        start[number] += to_complex(own[:FREQUENCY])
        offset[number] += own[FREQUENCY]
    active = []
    for effect, values in point.active:
        change = (
            dict(zip(layout.parameters(effect.name), step[layout.effect(effect.name)], strict=True))
            if effect.fitted()
            else {}
        )
        active.append(
            (effect, {name: value + float(change.get(name, 0.0)) for name, value in values.items()})
        )
    return Point(restrict_damping(p) if passive else p, start, offset, tuple(active))
