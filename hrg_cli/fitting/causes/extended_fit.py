"""Gauss–Newton of the extended model over all runs: shared coordinates, each run's start and frequency, the effects' parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...effects.effect import Effect
from ...errors import HrgError
from ..envelopes.coordinates import COUNT
from . import evidence
from .evidence import Basis, Block, Factored
from .extended import OWN, Near, Point, Prediction, Series, predict
from .sensitivities import Propagation, Wanted, base_sensitivities, effect_sensitivities, propagation
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
        unknown = self.series.blind.shape[1] if self.series.blind is not None else 0
        return max(1, len(self.residual) - given_up - unknown - self.design.shape[1])

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

    def sensitivities(self, wanted: Sequence[Wanted]) -> list[Array]:
        """Of many effects at the optimum, (N, K) each; what was asked for once is remembered."""
        keys = [(effect, tuple(values.items()), tuple(steps.items())) for effect, values, steps in wanted]
        new = {key: one for key, one in zip(keys, wanted, strict=True) if key not in self._known}
        self._known.update(zip(new, sensitivities(self.flow, list(new.values())), strict=True))
        return [self._known[key] for key in keys]

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
    """(R, n, 4, …) -> rows with weight only, (N, …), off what is unsettled."""
    keep = series.weight > 0
    if keep.all():
        rows = values.reshape(-1, *values.shape[3:])
    else:
        rows = values[np.broadcast_to(keep[..., None], values.shape[:3])]
    return rows if series.blind is None else series.blind.off(rows)


def sensitivity(flow: Propagation, effect: Effect, values: Mapping[str, float], steps: Mapping[str, float]) -> Array:
    """An effect's sensitivities over σ, (N, K)."""
    return sensitivities(flow, [(effect, values, steps)])[0]


def sensitivities(flow: Propagation, wanted: Sequence[Wanted]) -> list[Array]:
    """Of many effects, (N, K) each."""
    return [flat(flow.prediction.series, columns) for columns in effect_sensitivities(flow, wanted)]


def design_of(flow: Propagation, free: Sequence[bool], amplitude: float) -> tuple[Array, tuple[str, ...], list[Block]]:
    """Whitened design (N, k) of coordinates, runs and active effects, the columns' names, and the blocks of the runs' own."""
    series, point = flow.prediction.series, flow.prediction.point
    shared, own = (flat(series, values) for values in base_sensitivities(flow))
    index = [k for k in range(COUNT) if free[k]]
    wanted = [(e, v, steps) for e, v in point.active if (steps := _fitted_steps(e, v, amplitude))]
    runs = len(series.names)
    names = [f"p{k}" for k in index] + [f"run{k}.{j}" for k in range(runs) for j in range(OWN)]
    names += [f"{effect.name}.{name}" for effect, _, steps in wanted for name in steps]
    design = np.zeros((len(shared), len(names)))
    design[:, : len(index)] = shared[:, index]
    ends = np.cumsum([0, *4 * np.count_nonzero(series.weight > 0, axis=1)])
    blocks = []
    for k in range(runs):
        block = slice(int(ends[k]), int(ends[k + 1])), slice(len(index) + k * OWN, len(index) + (k + 1) * OWN)
        design[block] = own[block[0]]
        blocks.append(block)
    if wanted:
        design[:, len(index) + runs * OWN :] = np.concatenate(sensitivities(flow, wanted), axis=1)
    return design, tuple(names), blocks


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


def fit(series: Series, point: Point, freedom: Freedom, most: int = MOST_STEPS, near: Near | None = None) -> Fit:
    """Gauss–Newton with step halving; stops when a step changes χ² by less than a thousandth of χ² a degree of freedom.

    `near`: a motion close to that of the point, which is found sooner from it.
    """
    amplitude = amplitude_of(series)
    free = [freedom.std[k] > 0 for k in range(COUNT)]

    def cost(prediction: Prediction) -> float:
        if not np.all(np.isfinite(prediction.seen)):
            return np.inf
        pull = prior_residual(freedom, prediction.point, series)
        return float(np.sum(flat(series, prediction.residual()) ** 2) + np.sum(pull**2))

    with np.errstate(over="ignore", invalid="ignore"):
        prediction = predict(series, point, near)
        value = cost(prediction)
        if not np.isfinite(value):
            taken = ", ".join(effect.name for effect, _ in point.active)
            raise DivergedError(
                f"{', '.join(series.names)}: the model{f' with {taken}' if taken else ''} finds no fit to these runs together; "
                "diagnose free and forced runs apart, or leave out the run that differs most"
            )
        settled = 1e-3 / max(1, 4 * int(np.count_nonzero(series.weight)))
        converged, steps = False, 0
        while True:
            flow = propagation(prediction)
            design, names, blocks = design_of(flow, free, amplitude)
            residual = flat(series, prediction.residual())
            factored = evidence.factored(design, blocks)
            rows, right = prior_rows(freedom, names, series), prior_residual(freedom, prediction.point, series)
            step, covariance = factored.solve(residual, rows, right)
            if converged or steps == most:
                break
            steps += 1
            expected = float(np.sum((design @ step) ** 2))
            size = 1.0
            while True:
                trial = predict(series, moved(prediction.point, names, size * step), flow.near)
                now = cost(trial)
                if now <= value + settled * value or size < 1e-2:
                    break
                size /= 2
            if not now <= value:
                # a step that neither lowers nor raises χ² by more than matters has nowhere to go
                converged = now <= value + settled * value
                break
            gained, value, prediction = value - now, now, trial
            converged = expected < settled * value or (gained < settled * value and size == 1.0)
    index = np.argwhere(np.broadcast_to((series.weight > 0)[..., None], (*series.weight.shape, 4)))
    return Fit(freedom, flow, design, residual, names, covariance, converged, index, factored)


def with_effect(point: Point, effect: Effect, values: Mapping[str, float]) -> Point:
    """The point with one more effect (or another value of it)."""
    others = tuple(pair for pair in point.active if pair[0].name != effect.name)
    return replace(point, active=(*others, (effect, dict(values))))


def without(point: Point, name: str) -> Point:
    """The point without an effect."""
    return replace(point, active=tuple(pair for pair in point.active if pair[0].name != name))
