"""Gauss–Newton of the extended model over all runs: shared coordinates, each run's start and frequency, the effects' parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...effects.effect import Effect
from ...errors import HrgError
from ..envelopes.coordinates import COUNT
from . import evidence
from .extended import OWN, Point, Prediction, Propagation, Series, base_sensitivities, effect_sensitivity, predict, propagation
from .wave_frame import imaginary

Array = np.ndarray
MOST_STEPS = 15


class DivergedError(HrgError, ArithmeticError):
    """The start is so far off that the model's motion has no end there."""


@dataclass(frozen=True)
class Freedom:
    """Gaussian priors on the coordinates: mean (7,), std (7,); inf: none, 0: held."""

    mean: Array
    std: Array
    offset_std: float = np.inf
    """Wander of the runs' frequencies about the mean of their kind (free, forced), rad/s; inf: every run has a frequency of its own."""

    def strays(self, series: Series) -> Array:
        """Rows (R, R) of the runs' offsets that this prior pulls to zero; none where they are free."""
        if not np.isfinite(self.offset_std):
            return np.zeros((0, len(series.names)))
        forced = series.forced[:, 0] > 0
        alike = forced[:, None] == forced
        return (np.eye(len(forced)) - alike / alike.sum(axis=1)) / self.offset_std


@dataclass(frozen=True)
class Fit:
    """The optimum: prediction, its linearised flow, design (N, k) and residual (N,) over σ of the rows with weight, covariance, χ²."""

    freedom: Freedom
    flow: Propagation
    design: Array
    residual: Array
    names: tuple[str, ...]
    covariance: Array
    converged: bool
    rows: Array = field(repr=False)

    @property
    def prediction(self) -> Prediction:
        """Where the model stands."""
        return self.flow.prediction

    @property
    def point(self) -> Point:
        """Coordinates, starts, offsets, effects."""
        return self.prediction.point

    @property
    def series(self) -> Series:
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
        return max(1, len(self.residual) - given_up - self.design.shape[1])

    @property
    def frequency_hz(self) -> Array:
        """Frequency of every run beside its effects, (R,)."""
        return self.series.reference_frequency_hz + self.point.offset_rad_s / (2 * np.pi)

    @cached_property
    def basis(self) -> Array:
        """Orthonormal basis of the design, the priors' rows left out."""
        return evidence.orthonormal(self.design)

    def std(self, name: str) -> float:
        """Standard deviation of one fitted number."""
        k = self.names.index(name)
        return float(np.sqrt(self.covariance[k, k]))


def steps_of(effect: Effect, amplitude: float) -> dict[str, float]:
    """Difference steps of an effect's fitted parameters for the data's amplitude."""
    return {p.name: 1e-2 * p.typical * amplitude**p.amplitude_power for p in effect.fitted()}


def amplitude_of(series: Series) -> float:
    """Root mean square amplitude of the data."""
    power = np.sum(np.abs(series.envelope) ** 2, axis=-1)
    return float(np.sqrt(power[series.weight > 0].mean()))


def flat(series: Series, values: Array) -> Array:
    """(R, n, 4, …) -> rows with weight only, (N, …)."""
    keep = np.broadcast_to((series.weight > 0)[..., None], values.shape[:3])
    return values[keep]


def sensitivity(flow: Propagation, effect: Effect, values: Mapping[str, float], steps: Mapping[str, float]) -> Array:
    """An effect's sensitivities over σ, (N, K)."""
    return flat(flow.prediction.series, effect_sensitivity(flow, effect, values, steps))


def design_of(flow: Propagation, free: Sequence[bool], amplitude: float) -> tuple[Array, tuple[str, ...]]:
    """Whitened design (N, k) of coordinates, runs and active effects, with the columns' names."""
    series, point = flow.prediction.series, flow.prediction.point
    shared, own = base_sensitivities(flow)
    runs, n = series.weight.shape
    wide = np.zeros((runs, n, 4, runs * OWN))
    for k in range(runs):
        wide[k, :, :, k * OWN : (k + 1) * OWN] = own[k]
    index = [k for k in range(COUNT) if free[k]]
    columns = [flat(series, shared[..., index]), flat(series, wide)]
    names = [f"p{k}" for k in index] + [f"run{k}.{j}" for k in range(runs) for j in range(OWN)]
    for effect, values in point.active:
        steps = _fitted_steps(effect, values, amplitude)
        if steps:
            columns.append(sensitivity(flow, effect, values, steps))
            names += [f"{effect.name}.{name}" for name in steps]
    return np.concatenate(columns, axis=1), tuple(names)


def _fitted_steps(effect: Effect, values: Mapping[str, float], amplitude: float) -> dict[str, float]:
    """Difference steps sized by the value where the effect stands."""
    return {name: (1e-3 * abs(values[name]) or size) for name, size in steps_of(effect, amplitude).items()}


def moved(point: Point, names: Sequence[str], step: Array) -> Point:
    """The point after a step in the named numbers."""
    p, start, offset = point.p.copy(), point.start.copy(), point.offset_rad_s.copy()
    active = {effect.name: (effect, dict(values)) for effect, values in point.active}
    own: dict[int, Array] = {}
    for name, change in zip(names, step, strict=True):
        if name.startswith("p") and name[1:].isdigit():
            p[int(name[1:])] += change
        elif name.startswith("run") and "." in name and name[3].isdigit():
            number, j = name[3:].split(".")
            own.setdefault(int(number), np.zeros(OWN))[int(j)] = change
        else:
            effect, parameter = name.split(".")
            active[effect][1][parameter] += change
    for run, changes in own.items():
        start[run] += imaginary(changes[:4])
        offset[run] += changes[4]
    return Point(p, start, offset, tuple(active.values()))


def pulled(freedom: Freedom) -> Array:
    """Coordinates with a prior that is neither absent nor a value held."""
    return np.flatnonzero(np.isfinite(freedom.std) & (freedom.std > 0))


def coordinate_rows(freedom: Freedom, names: Sequence[str]) -> Array:
    """Rows (m, k) of the coordinates' priors over the named columns."""
    rows = np.zeros((len(pulled(freedom)), len(names)))
    for row, k in zip(rows, pulled(freedom), strict=True):
        row[list(names).index(f"p{k}")] = 1 / freedom.std[k]
    return rows


def prior_rows(freedom: Freedom, names: Sequence[str], series: Series) -> Array:
    """Rows (m, k) that pull the coordinates and the runs' offsets to their priors."""
    strays = freedom.strays(series)
    rows = np.zeros((len(strays), len(names)))
    rows[:, [list(names).index(f"run{k}.{OWN - 1}") for k in range(len(series.names))]] = strays
    return np.concatenate([coordinate_rows(freedom, names), rows])


def prior_residual(freedom: Freedom, point: Point, series: Series) -> Array:
    """How far the point is from the priors, (m,) in the order of `prior_rows`."""
    k = pulled(freedom)
    return np.concatenate([(freedom.mean[k] - point.p[k]) / freedom.std[k], -(freedom.strays(series) @ point.offset_rad_s)])


def fit(series: Series, point: Point, freedom: Freedom, most: int = MOST_STEPS) -> Fit:
    """Gauss–Newton with step halving; stops when a step changes χ² by less than a thousandth of χ² a degree of freedom."""
    amplitude = amplitude_of(series)
    free = [freedom.std[k] > 0 for k in range(COUNT)]

    def cost(prediction: Prediction) -> float:
        if not np.all(np.isfinite(prediction.seen)):
            return np.inf
        pull = prior_residual(freedom, prediction.point, series)
        return float(np.sum(flat(series, prediction.residual()) ** 2) + np.sum(pull**2))

    with np.errstate(over="ignore", invalid="ignore"):
        prediction = predict(series, point)
        value = cost(prediction)
        if not np.isfinite(value):
            taken = ", ".join(effect.name for effect, _ in point.active)
            raise DivergedError(
                f"{', '.join(series.names)}: the model{f' with {taken}' if taken else ''} finds no fit to these runs together; "
                "diagnose free and forced runs apart, or leave out the run that differs most"
            )
        settled = 1e-3 / max(1, 4 * int(np.count_nonzero(series.weight)))
        converged = False
        for _ in range(most):
            flow = propagation(prediction)
            design, names = design_of(flow, free, amplitude)
            residual = flat(series, prediction.residual())
            rows, right = prior_rows(freedom, names, series), prior_residual(freedom, prediction.point, series)
            step, _ = evidence.solve(design, residual, rows, right)
            expected = float(np.sum((design @ step) ** 2))
            size = 1.0
            while True:
                trial = predict(series, moved(prediction.point, names, size * step))
                now = cost(trial)
                if now <= value + 1e-9 * abs(value) or size < 1e-2:
                    break
                size /= 2
            if not np.isfinite(now) or now > value + 1e-6 * abs(value):
                break
            gained, value, prediction = value - now, now, trial
            if expected < settled * value or (gained < settled * value and size == 1.0):
                converged = True
                break
        flow = propagation(prediction)
        design, names = design_of(flow, free, amplitude)
    residual = flat(series, prediction.residual())
    rows, right = prior_rows(freedom, names, series), prior_residual(freedom, prediction.point, series)
    _, covariance = evidence.solve(design, residual, rows, right)
    index = np.argwhere(np.broadcast_to((series.weight > 0)[..., None], (*series.weight.shape, 4)))
    return Fit(freedom, flow, design, residual, names, covariance, converged, index)


def with_effect(point: Point, effect: Effect, values: Mapping[str, float]) -> Point:
    """The point with one more effect (or another value of it)."""
    others = tuple(pair for pair in point.active if pair[0].name != effect.name)
    return replace(point, active=(*others, (effect, dict(values))))


def without(point: Point, name: str) -> Point:
    """The point without an effect."""
    return replace(point, active=tuple(pair for pair in point.active if pair[0].name != name))
