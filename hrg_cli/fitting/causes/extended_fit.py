"""Gauss–Newton of the extended model over all runs: shared coordinates, each run's start and
frequency, the effects' parameters."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ...effects.effect import Effect
from ...errors import HrgError
from ..envelopes.coordinates import COORDINATES, COUNT
from . import evidence
from .evidence import Basis, Design, Factored
from .extended import MeasuredRuns, Near, Point, Prediction, predict
from .layout import FREQUENCY, FitColumns
from .scales import amplitude_of, steps_of
from .sensitivities import (
    Propagation,
    Wanted,
    base_sensitivities,
    effect_sensitivities,
    propagation,
)
from .wave_frame import directions, imaginary, real

__all__ = [
    "CoordinatePriors",
    "DivergedError",
    "ExtendedFit",
    "WorkSpentError",
    "add_effect",
    "amplitude_of",
    "fit",
    "limit_motions",
    "remove_effect",
    "steps_of",
]

Array = np.ndarray
MOST_STEPS = 15
SHORTEST = 1 / 128
"""Part of a step that is tried last before the step is bent."""
DAMPED = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Lengths of the damping rows, over those of the columns, where a whole step leads nowhere."""
DAMPING = ("damping", "damping_cos", "damping_sin")
"""Coordinates whose cone ν ≥ |νδμ| a passive resonator stays in."""


class DivergedError(HrgError, ArithmeticError):
    """The start is so far off that the model's motion has no end there."""


class WorkSpentError(Exception):
    """All motions that a search may compute are computed; no `HrgError`, which fits are given up
    for one by one."""


_left: ContextVar[list[int] | None] = ContextVar("motions left", default=None)


@contextmanager
def limit_motions(motions: int) -> Iterator[None]:
    """Fits within may compute so many motions together: the work of a search that leads nowhere
    ends, at the same place on every machine.

    WorkSpentError: from the fit that asks for one more.
    """
    token = _left.set([motions, motions])
    try:
        yield
    finally:
        _left.reset(token)


def _spend_motion() -> None:
    left = _left.get()
    if left is None:
        return
    left[0] -= 1
    if left[0] < 0:
        raise WorkSpentError(f"the search for causes was stopped after {left[1]} fitted motions")


@dataclass(frozen=True)
class CoordinatePriors:
    """Gaussian priors on the coordinates: mean (7,), std (7,); inf: none, 0: held."""

    mean: Array
    std: Array
    offset_std: float = np.inf
    """Wander of the runs' frequencies about the mean of their kind (free, forced), rad/s; inf:
    every run has a frequency of its own."""
    passive: bool = True
    """The fit stays where a resonator without a supply can be: the damping is nowhere negative, ν ≥
    |νδμ|."""
    loose: CoordinatePriors | None = None
    """What takes its place once the misfit is no longer gross enough to bend what is weakly known;
    None: the same."""

    def holding(self, name: str, value: float) -> CoordinatePriors:
        """The same with one coordinate held at a value."""
        mean, std = self.mean.copy(), self.std.copy()
        mean[COORDINATES.index(name)], std[COORDINATES.index(name)] = value, 0.0
        return replace(self, mean=mean, std=std)

    def strays(self, series: MeasuredRuns) -> Array:
        """Rows (R, R) of the runs' offsets that this prior pulls to zero; none where they are
        free."""
        if not np.isfinite(self.offset_std):
            return np.zeros((0, len(series.names)))
        forced = series.forced[:, 0] > 0
        alike = forced[:, None] == forced
        return (np.eye(len(forced)) - alike / alike.sum(axis=1)) / self.offset_std


@dataclass(frozen=True)
class ExtendedFit:
    """The optimum: prediction, its linearised flow, design (N, k) and residual (N,) over σ of the
    rows with weight, covariance, χ²."""

    freedom: CoordinatePriors
    flow: Propagation
    design: Design
    residual: Array
    layout: FitColumns
    covariance: Array
    converged: bool
    bound_cost: float
    """χ² that the passive resonator's bound costs; 0 where the optimum lies inside."""
    rows: Array = field(repr=False)
    factored: Factored = field(repr=False)

    @property
    def prediction(self) -> Prediction:
        """Where the model stands."""
        return self.flow.prediction

    @property
    def point(self) -> Point:
        """Coordinates, starts, offsets, effects."""
        return self.prediction.point

    @property
    def series(self) -> MeasuredRuns:
        """The data."""
        return self.prediction.series

    @property
    def chi2(self) -> float:
        """Σ of squared whitened residuals."""
        return float(self.residual @ self.residual)

    @property
    def dof(self) -> int:
        """Degrees of freedom."""
        given_up = int(np.sum(self.series.weight > 0)) if self.series.free_phase else 0
        unknown = self.series.unsettled.shape[1] if self.series.unsettled is not None else 0
        return max(1, len(self.residual) - given_up - unknown - self.layout.count)

    @property
    def frequency_hz(self) -> Array:
        """Frequency of every run beside its effects, (R,)."""
        return self.series.reference_frequency_hz + self.point.offset_rad_s / (2 * np.pi)

    @property
    def basis(self) -> Basis:
        """Orthonormal basis of the design, the priors' rows left out."""
        return self.factored.basis

    @cached_property
    def _known(self) -> dict[Any, Array]:
        return {}

    def remembered(self, key: Hashable, made: Callable[[], Any]) -> Any:
        """What is made beside this fit, the same for the same key."""
        if key not in self._known:
            self._known[key] = made()
        return self._known[key]

    def sensitivities(self, wanted: Sequence[Wanted]) -> list[Array]:
        """Of many effects at the optimum, (N, K) each; what was asked for once is remembered."""
        keys = [
            (effect, tuple(values.items()), tuple(steps.items()))
            for effect, values, steps in wanted
        ]
        new = {key: one for key, one in zip(keys, wanted, strict=True) if key not in self._known}
        self._known.update(zip(new, sensitivities(self.flow, list(new.values())), strict=True))
        return [self._known[key] for key in keys]

    def coordinate(self, name: str) -> float:
        """Value of a coordinate."""
        return float(self.point.p[COORDINATES.index(name)])

    def effect(self, name: str) -> Effect:
        """An active effect as it stands in the fit. KeyError: it is not in it."""
        return {one.name: one for one, _ in self.point.active}[name]

    def values(self, effect: str) -> dict[str, float]:
        """All parameters' values of an active effect. KeyError: it is not in the fit."""
        return dict({one.name: values for one, values in self.point.active}[effect])

    def std_at(self, column: int) -> float:
        """Standard deviation of one column's number."""
        return float(np.sqrt(max(self.covariance[column, column], 0.0)))

    def coordinate_std(self, name: str) -> float:
        """Standard deviation of a coordinate, 0 where it is held."""
        column = self.layout.coordinate(name)
        return 0.0 if column is None else self.std_at(column)

    def coordinate_covariance(self) -> Array:
        """Covariance (7, 7) of the coordinates, 0 for those that are held."""
        out = np.zeros((COUNT, COUNT))
        there, columns = list(self.layout.coordinates), range(len(self.layout.coordinates))
        out[np.ix_(there, there)] = self.covariance[np.ix_(columns, columns)]
        return out

    def away(self, effect: Effect) -> tuple[Array, float]:
        """How far an active effect's fitted parameters (k,) stand from neutral, and that as χ²: aᵀ
        C⁻¹ a (Wald)."""
        columns, now = self.layout.effect(effect.name), self.values(effect.name)
        neutral = {p.name: p.neutral for p in effect.parameters}
        off = np.array([now[name] - neutral[name] for name in self.layout.parameters(effect.name)])
        return off, float(off @ np.linalg.pinv(self.covariance[columns, columns]) @ off)

    def parameter_std(self, effect: str, name: str) -> float:
        """Standard deviation of an effect's parameter, 0 where it is not fitted."""
        return (
            self.std_at(self.layout.parameter(effect, name))
            if name in self.layout.parameters(effect)
            else 0.0
        )


def on_rows(fit: ExtendedFit, values: Array) -> Array:
    """Values (N, ...) of a fit's residual rows where they stand, (R, n, 4, ...); 0 elsewhere."""
    out = np.zeros((*fit.series.weight.shape, 4, *values.shape[1:]))
    out[tuple(fit.rows.T)] = values
    return out


def unsettled_part(fit: ExtendedFit) -> Array:
    """What of the measured envelopes stands beside the prediction along what nobody knows of the
    runs, and is no misfit, (R, n, 2)."""
    series = fit.series
    if series.unsettled is None:
        return np.zeros_like(fit.prediction.seen)
    whole = _whitened_rows(series, fit.prediction.residual())
    scale = np.where(series.weight > 0, series.weight, 1.0)
    return np.asarray(imaginary(on_rows(fit, whole - fit.residual)) / scale[..., None])


def along_wave(fit: ExtendedFit, values: Array) -> Array:
    """The same along the wave's own directions: amplitude, phase, angle, ellipticity."""
    own = real(directions(fit.prediction.seen))
    return np.asarray(np.einsum("rnki,rni...->rnk...", own, on_rows(fit, values)))


def flatten_rows(series: MeasuredRuns, values: Array) -> Array:
    """(R, n, 4, …) -> rows with weight only, (N, …), whitened and off what is unsettled."""
    rows = _whitened_rows(series, values)
    return rows if series.unsettled is None else series.unsettled.off(rows)


def flatten_own(series: MeasuredRuns, values: Array) -> Array:
    """The same of columns of every run's own, side by side in one array: off what is unsettled in a
    run alone, for what reaches over several would mix their columns."""
    rows = _whitened_rows(series, values)
    return rows if series.unsettled is None else series.unsettled.off_own(rows)


def _whitened_rows(series: MeasuredRuns, values: Array) -> Array:
    keep = series.weight > 0
    if keep.all():
        rows = values.reshape(-1, *values.shape[3:])
    else:
        rows = values[np.broadcast_to(keep[..., None], values.shape[:3])]
    return rows if series.scatter is None else series.scatter.off(rows)


def sensitivity(
    flow: Propagation, effect: Effect, values: Mapping[str, float], steps: Mapping[str, float]
) -> Array:
    """An effect's sensitivities over σ, (N, K)."""
    return sensitivities(flow, [(effect, values, steps)])[0]


def sensitivities(flow: Propagation, wanted: Sequence[Wanted]) -> list[Array]:
    """Of many effects, (N, K) each."""
    return [
        flatten_rows(flow.prediction.series, columns)
        for columns in effect_sensitivities(flow, wanted)
    ]


def layout_of(series: MeasuredRuns, point: Point, freedom: CoordinatePriors) -> FitColumns:
    """What a fit of this point moves."""
    effects = tuple(
        (e.name, names) for e, _ in point.active if (names := tuple(p.name for p in e.fitted()))
    )
    return FitColumns(
        tuple(k for k in range(COUNT) if freedom.std[k] > 0), len(series.names), effects
    )


def design_of(flow: Propagation, layout: FitColumns) -> Design:
    """Whitened design of coordinates, runs and active effects."""
    series, point = flow.prediction.series, flow.prediction.point
    of_all, of_each = base_sensitivities(flow)
    shared, own = flatten_rows(series, of_all), flatten_own(series, of_each)
    wanted = [
        (e, v, _fitted_steps(e, v, series)) for e, v in point.active if layout.parameters(e.name)
    ]
    beside = sensitivities(flow, wanted) if wanted else []
    ends = np.cumsum([0, *4 * np.count_nonzero(series.weight > 0, axis=1)])
    rows = [slice(int(first), int(last)) for first, last in pairwise(ends)]
    blocks = tuple((one, layout.run(k), own[one]) for k, one in enumerate(rows))
    return Design(
        np.concatenate([shared[:, list(layout.coordinates)], *beside], axis=1),
        layout.shared,
        blocks,
        None if series.unsettled is None else series.unsettled.shared,
    )


def _fitted_steps(
    effect: Effect, values: Mapping[str, float], series: MeasuredRuns
) -> dict[str, float]:
    """Difference steps sized by the value where the effect stands."""
    return {
        name: 1e-3 * abs(values[name]) or size for name, size in steps_of(effect, series).items()
    }


def move_point(point: Point, layout: FitColumns, step: Array, passive: bool = True) -> Point:
    """The point after a step (k,) in everything fitted; `passive`: brought back into the damping's
    cone."""
    p, start, offset = point.p.copy(), point.start.copy(), point.offset_rad_s.copy()
    p[list(layout.coordinates)] += step[: len(layout.coordinates)]
    for number in range(layout.runs):
        own = step[layout.run(number)]
        start[number] += imaginary(own[:FREQUENCY])
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
    return Point(passive_damping(p) if passive else p, start, offset, tuple(active))


def passive_damping(p: Array) -> Array:
    """Coordinates whose damping is the nearest one that is nowhere negative: ν ≥ |νδμ|."""
    out, split = p.copy(), float(np.hypot(p[1], p[2]))
    if p[0] >= split:
        return out
    least = max(0.0, (float(p[0]) + split) / 2)
    out[0] = least
    out[1:3] *= least / split if split > 0 else 0.0
    return out


def wall_ahead(point: Point, layout: FitColumns, step: Array) -> tuple[Array, float] | None:
    """The damping's bound that a step would cross, as wall·step = distance; None where the step
    stays inside.

    Of the cone ν = |νδμ| the tangent at the direction of the split behind the step.
    """
    p = point.p.copy()
    p[list(layout.coordinates)] += step[: len(layout.coordinates)]
    split = float(np.hypot(p[1], p[2]))
    if p[0] >= split * (1 - 1e-12):
        return None
    normal = np.array([1.0, *(-p[1:3] / split if split > 0 else (0.0, 0.0))])
    wall = np.zeros(layout.count)
    for name, part in zip(DAMPING, normal, strict=True):
        if (column := layout.coordinate(name)) is not None:
            wall[column] = part
    return (wall, -float(normal @ point.p[:3])) if wall.any() else None


def list_pulled(freedom: CoordinatePriors) -> Array:
    """Coordinates with a prior that is neither absent nor a value held."""
    return np.flatnonzero(np.isfinite(freedom.std) & (freedom.std > 0))


def coordinate_rows(freedom: CoordinatePriors, layout: FitColumns) -> Array:
    """Rows (m, k) of the coordinates' priors over all columns."""
    own = list_pulled(freedom)
    return layout.beside([layout.coordinates.index(k) for k in own], np.diag(1 / freedom.std[own]))


def prior_rows(freedom: CoordinatePriors, layout: FitColumns, series: MeasuredRuns) -> Array:
    """Rows (m, k) that pull the coordinates and the runs' offsets to their priors."""
    strays = freedom.strays(series)
    offsets = layout.beside([layout.frequency(k) for k in range(layout.runs)], strays)
    return np.concatenate([coordinate_rows(freedom, layout), offsets])


def prior_residual(freedom: CoordinatePriors, point: Point, series: MeasuredRuns) -> Array:
    """How far the point is from the priors, (m,) in the order of `prior_rows`."""
    k = list_pulled(freedom)
    return np.concatenate(
        [
            (freedom.mean[k] - point.p[k]) / freedom.std[k],
            -(freedom.strays(series) @ point.offset_rad_s),
        ]
    )


def fit(
    series: MeasuredRuns,
    point: Point,
    freedom: CoordinatePriors,
    most: int = MOST_STEPS,
    near: Near | None = None,
) -> ExtendedFit:
    """Gauss–Newton with step halving; stops when a step changes χ² by less than a thousandth of χ²
    a degree of freedom.

    Where the damping would become negative along an axis the step runs along that bound, which is
    part of the fit (`Freedom.passive`); the covariance is that without the bound. `near`: a motion
    close to that of the point, which is found sooner from it. DivergedError: the model has no
    motion at the start.
    """
    layout = layout_of(series, point, freedom)
    p = passive_damping(point.p) if freedom.passive else point.p
    point = replace(point, p=np.where(freedom.std == 0, freedom.mean, p))
    settled = 1e-3 / max(1, 4 * int(np.count_nonzero(series.weight)))
    with np.errstate(over="ignore", invalid="ignore"):
        _spend_motion()
        prediction = predict(
            series, point, _measured_motion(series, point) if near is None else near
        )
        value = _cost(prediction, freedom)
        if not np.isfinite(value):
            raise _no_motion(series, point)
        converged, steps = False, 0
        while True:
            here = _linearise(prediction, layout, freedom)
            if converged or steps == most:
                break
            steps += 1
            trial, now, whole = _descend(here, freedom, value, settled)
            if not now <= value:
                # a step that neither lowers nor raises χ² by more than matters has nowhere to go
                converged = now <= value + settled * value
                break
            gained, value, prediction = value - now, now, trial
            converged = here.expected < settled * value or (gained < settled * value and whole)
    index = np.argwhere(np.broadcast_to((series.weight > 0)[..., None], (*series.weight.shape, 4)))
    return ExtendedFit(
        freedom,
        here.flow,
        here.design,
        here.residual,
        layout,
        here.covariance,
        converged,
        max(here.lost, 0.0),
        index,
        here.factored,
    )


def _measured_motion(series: MeasuredRuns, point: Point) -> Near | None:
    """Near which driven runs move: as they were measured. None for free ones, which need no guess."""
    if not series.forced.any():
        return None
    return propagation(Prediction(series, point, series.envelope, series.envelope)).near


def _cost(prediction: Prediction, freedom: CoordinatePriors) -> float:
    """χ² with the priors' part; infinite where the motion has no end."""
    if not np.all(np.isfinite(prediction.seen)):
        return np.inf
    series = prediction.series
    pull = prior_residual(freedom, prediction.point, series)
    return float(np.sum(flatten_rows(series, prediction.residual()) ** 2) + np.sum(pull**2))


def _no_motion(series: MeasuredRuns, point: Point) -> DivergedError:
    taken = ", ".join(effect.name for effect, _ in point.active)
    return DivergedError(
        f"{', '.join(series.names)}: the model{f' with {taken}' if taken else ''} finds no fit to"
        " these runs together; diagnose free and forced runs apart, or leave out the run that"
        " differs most"
    )


@dataclass(frozen=True)
class _Linear:
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


def _linearise(prediction: Prediction, layout: FitColumns, freedom: CoordinatePriors) -> _Linear:
    """The model about a prediction. DivergedError: its slopes are no numbers."""
    series = prediction.series
    flow = propagation(prediction)
    design = design_of(flow, layout)
    residual = flatten_rows(series, prediction.residual())
    factored = evidence.factor_design(design)
    if not np.all(np.isfinite(factored.triangle)):
        raise _no_motion(series, prediction.point)
    priors = (
        prior_rows(freedom, layout, series),
        prior_residual(freedom, prediction.point, series),
    )
    step, covariance = factored.solve(residual, *priors)
    wall = wall_ahead(prediction.point, layout, step) if freedom.passive else None
    lost = 0.0
    if wall is not None:
        free = step
        step, _ = factored.solve(residual, *priors, *wall)
        lost = _fall(design, residual, free) - _fall(design, residual, step)
    return _Linear(flow, design, residual, layout, factored, priors, step, covariance, lost)


def _descend(
    here: _Linear, freedom: CoordinatePriors, value: float, settled: float
) -> tuple[Prediction, float, bool]:
    """(prediction, cost, whether the whole step was taken) of the first part of the step that does
    not raise the cost; where none does, of Levenberg's and Marquardt's path."""
    start = here.flow.prediction

    def after(step: Array) -> tuple[Prediction, float]:
        _spend_motion()
        trial = predict(
            start.series,
            move_point(start.point, here.layout, step, freedom.passive),
            here.flow.near,
        )
        return trial, _cost(trial, freedom)

    size = 1.0
    while size >= SHORTEST:
        trial, now = after(size * here.step)
        if now <= value + settled * value:
            return trial, now, size == 1.0
        size /= 2
    rows, right = here.priors
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


def _fall(design: Design, residual: Array, step: Array) -> float:
    """By how much a step lowers χ² in the linear model."""
    change = design.times(step)
    return float(2 * residual @ change - change @ change)


def add_effect(point: Point, effect: Effect, values: Mapping[str, float]) -> Point:
    """The point with one more effect (or another value of it)."""
    others = tuple(pair for pair in point.active if pair[0].name != effect.name)
    return replace(point, active=(*others, (effect, dict(values))))


def remove_effect(point: Point, name: str) -> Point:
    """The point without an effect."""
    return replace(point, active=tuple(pair for pair in point.active if pair[0].name != name))
