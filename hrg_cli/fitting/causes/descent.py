"""One step of Gauss–Newton: the model linearised about a point, the step with its bound, and how far
down it leads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import HrgError, name_some
from .coordinate_priors import CoordinatePriors, prior_residual, prior_rows
from .damping_bound import find_wall, restrict_damping
from .designs import Design, Factored, factor_design
from .fit_point import Point
from .layout import FREQUENCY, FitColumns
from .measured_runs import MeasuredRuns
from .motion_budget import spend_motion
from .sensitivities import Propagation, linearise_flow
from .slow_prediction import Prediction, predict
from .wave_frame import to_complex
from .whitened_rows import design_of, flatten_rows

Array = np.ndarray
SHORTEST = 1 / 128
"""Part of a step that is tried last before the step is bent."""
DAMPED = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Lengths of the damping rows, over those of the columns, where a whole step leads nowhere."""


class DivergedError(HrgError, ArithmeticError):
    """The start is so far off that the model's motion has no end there."""


def cost_of(prediction: Prediction, freedom: CoordinatePriors) -> float:
    """χ² with the priors' part; infinite where the motion has no end."""
    if not np.all(np.isfinite(prediction.seen)):
        return np.inf
    series = prediction.series
    pull = prior_residual(freedom, prediction.point, series)
    return float(np.sum(flatten_rows(series, prediction.residual()) ** 2) + np.sum(pull**2))


def no_motion(series: MeasuredRuns, point: Point) -> DivergedError:
    """Why there is no fit at all."""
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
        return float(np.sum(self.design.times(self.step) ** 2))


def linearise(prediction: Prediction, layout: FitColumns, freedom: CoordinatePriors) -> LinearModel:
    """The model about a prediction. DivergedError: its slopes are no numbers."""
    series = prediction.series
    flow = linearise_flow(prediction)
    design = design_of(flow, layout)
    residual = flatten_rows(series, prediction.residual())
    try:
        factored = factor_design(design)
    except np.linalg.LinAlgError as error:
        raise no_motion(series, prediction.point) from error
    # slopes that grow without end give a triangle that is no numbers, and not always an error
    with np.errstate(over="ignore"):
        size = float(np.sum(np.square(factored.triangle)))
    if not np.isfinite(size):
        raise no_motion(series, prediction.point)
    priors = (
        prior_rows(freedom, layout, series),
        prior_residual(freedom, prediction.point, series),
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


def descend(
    here: LinearModel, freedom: CoordinatePriors, value: float, settled: float
) -> tuple[Prediction, float, bool]:
    """(prediction, cost, whether the whole step was taken) of the first part of the step that does
    not raise the cost; where none does, of Levenberg's and Marquardt's path."""
    start = here.flow.prediction

    def after(step: Array) -> tuple[Prediction, float]:
        spend_motion()
        trial = predict(
            start.series,
            move_point(start.point, here.layout, step, freedom.passive),
            here.flow.near,
        )
        return trial, cost_of(trial, freedom)

    size = 1.0
    while size >= SHORTEST:
        trial, now = after(size * here.step)
        if now <= value + settled * value:
            return trial, now, size == 1.0
        size /= 2
    rows, right = here.priors
    # Marquardt's scaling: rows as long as the columns, so that units of the parameters do not matter
    sizes = np.diag(np.sqrt(np.sum(here.factored.triangle**2, axis=0) + np.sum(rows**2, axis=0)))
    for damping in DAMPED:
        step, _ = here.factored.solve(
            here.residual,
            np.vstack([rows, damping * sizes]),
            np.concatenate([right, np.zeros(len(sizes))]),
        )
        trial, now = after(step)
        if now < value:
            break
    return trial, now, False


def _predict_fall(design: Design, residual: Array, step: Array) -> float:
    """By how much a step lowers χ² in the linear model."""
    change = design.times(step)  # |r|² − |r − Js|²
    return float(2 * residual @ change - change @ change)


def move_point(point: Point, layout: FitColumns, step: Array, passive: bool = True) -> Point:
    """The point after a step (k,) in everything fitted; `passive`: brought back into the damping's
    cone."""
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
