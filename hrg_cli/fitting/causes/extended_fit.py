"""The extended model fitted to all runs: shared coordinates, each run's start and frequency, the
effects' parameters; its optimum, and what of it others ask for."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...effects.effect import Effect
from ..checks import check_goodness
from ..envelopes.coordinates import COORDINATES, COUNT
from ..least_squares import square_over_covariance
from ..noise import channel_noise
from .coordinate_priors import CoordinatePriors
from .damping_bound import restrict_damping
from .descent import DivergedError, compute_cost, descend, linearise, tell_no_motion
from .design_columns import FitColumns
from .designs import Basis, Design, Factored
from .fit_point import Point
from .measured_runs import MeasuredRuns
from .motion_budget import spend_motion
from .remembered import Remembered
from .sensitivities import Propagation, Wanted, linearise_flow
from .slow_prediction import Near, Prediction, predict
from .wave_frame import find_directions, to_complex, to_reals
from .whitened_rows import build_layout, find_sensitivities

__all__ = [
    "DivergedError",
    "ExtendedFit",
    "compute_unsettled_part",
    "fit",
    "place_on_rows",
    "resolve_along_wave",
]

Array = np.ndarray
MOST_STEPS = 15
EARLY_STEPS = 6
"""Steps after which a fit that stands far above what is known to be reached is given up."""


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
    promised: float = 0.0
    """Fall of χ² that one more step promises."""

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
        # a phase that is free in every row costs one of the row's four reals
        given_up = int(np.sum(self.series.weight > 0)) if self.series.free_phase else 0
        unknown = self.series.unsettled.free if self.series.unsettled is not None else 0
        return max(1, len(self.residual) - given_up - unknown - self.layout.count)

    @property
    def is_adequate(self) -> bool:
        """Whether χ² agrees with the noise that the windows state."""
        return check_goodness(self.chi2, self.dof).passed

    @property
    def frequency_hz(self) -> Array:
        """Frequency of every run beside its effects, (R,)."""
        return self.series.reference_frequency_hz + self.point.offset_rad_s / (2 * np.pi)

    @property
    def basis(self) -> Basis:
        """Orthonormal basis of the design, the priors' rows left out."""
        return self.factored.basis

    @cached_property
    def _known(self) -> Remembered:
        return Remembered()

    @property
    def numbers(self) -> int:
        """How many numbers it holds, about: the basis has as many as the design, the flow as many
        as both."""
        own = sum(values.size for _, _, values in self.design.own)
        return 4 * (self.design.shared.size + own)

    def recall(self, key: Hashable, made: Callable[[], Any]) -> Any:
        """What is made beside this fit, the same for the same key."""
        return self._known.recall(key, made)

    def find_sensitivities(self, wanted: Sequence[Wanted]) -> list[Array]:
        """Of many effects at the optimum, (N, K) each; what was asked for once is remembered."""
        keys = [
            (effect, tuple(values.items()), tuple(steps.items()))
            for effect, values, steps in wanted
        ]
        held = {key: self._known[key] for key in keys if key in self._known}
        new = {key: one for key, one in zip(keys, wanted, strict=True) if key not in held}
        for key, made in zip(new, find_sensitivities(self.flow, list(new.values())), strict=True):
            self._known[key] = held[key] = made
        return [held[key] for key in keys]

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

    def measure_distance(self, effect: Effect) -> tuple[Array, float]:
        """How far an active effect's fitted parameters (k,) stand from neutral, and that as χ²: aᵀ
        C⁻¹ a (Wald)."""
        columns, now = self.layout.effect(effect.name), self.values(effect.name)
        neutral = {p.name: p.neutral for p in effect.parameters}
        off = np.array([now[name] - neutral[name] for name in self.layout.parameters(effect.name)])
        return off, square_over_covariance(off, self.covariance[columns, columns])

    def stand_along(self, series: MeasuredRuns, point: Point | None = None) -> ExtendedFit:
        """The same point, or another, on runs that hold another motion; not fitted again."""
        at = self.point if point is None else point
        return fit(series, at, self.freedom, most=0, near=self.flow.near)

    def frees(self, effect: str, name: str) -> bool:
        """Whether an effect's parameter is fitted."""
        return name in self.layout.parameters(effect)

    def parameter_std(self, effect: str, name: str) -> float:
        """Standard deviation of an effect's parameter, 0 where it is not fitted."""
        if not self.frees(effect, name):
            return 0.0
        return self.std_at(self.layout.parameter(effect, name))


def place_on_rows(fit: ExtendedFit, values: Array) -> Array:
    """Values of a fit's residual rows where they stand.

    Parameters
    ----------
    fit
        Of R runs of n rows.
    values
        (N, ...).

    Returns
    -------
    ndarray
        (R, n, 4, ...); 0 where a row has no weight.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.extended_fit import place_on_rows
    >>> weight = np.array([[1.0, 0.0]])
    >>> rows = np.argwhere(np.broadcast_to((weight > 0)[..., None], (1, 2, 4)))
    >>> fit = SimpleNamespace(series=SimpleNamespace(weight=weight), rows=rows)
    >>> place_on_rows(fit, np.array([1.0, 2.0, 3.0, 4.0])).tolist()
    [[[1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 0.0, 0.0]]]
    """
    out = np.zeros((*fit.series.weight.shape, 4, *values.shape[1:]))
    out[tuple(fit.rows.T)] = values
    return out


def compute_unsettled_part(fit: ExtendedFit) -> Array:
    """What of the envelopes most likely stands beside the prediction, neither misfit nor noise.

    It lies along what nobody knows of the runs or what may have scattered. Of a residual r = noise
    + that, both of known covariance, W r being white, the noise is Wᵀ W r.

    Parameters
    ----------
    fit
        Of R runs of n rows.

    Returns
    -------
    ndarray
        (R, n, 2) complex, in the envelopes' unit; 0 where nothing is unsettled.

    Examples
    --------
    Of 4 σ along a direction that may be off by √3 σ, three are most likely that and one is noise:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import Softened
    >>> from hrg_cli.fitting.causes.extended_fit import compute_unsettled_part
    >>> scatter = Softened(((slice(0, 4), np.eye(4)[:, :1], np.array([3.0])),))
    >>> residual, weight = np.array([[[4.0, 0.0, 0.0, 0.0]]]), np.ones((1, 1))
    >>> known = dict(unsettled=None, scatter=scatter, weight=weight, to_units=lambda u: u)
    >>> series = SimpleNamespace(**known)
    >>> prediction = SimpleNamespace(compute_residual=lambda: residual)
    >>> whitened, rows = scatter.whiten(residual.ravel()), np.argwhere(np.ones((1, 1, 4)))
    >>> fit = SimpleNamespace(series=series, prediction=prediction, residual=whitened, rows=rows)
    >>> compute_unsettled_part(fit).tolist()
    [[[(3+0j), 0j]]]
    """
    series = fit.series
    if series.unsettled is None and series.scatter is None:
        return np.zeros_like(fit.prediction.seen)
    noise = fit.residual
    if series.unsettled is not None:
        noise = series.unsettled.project_out(noise)
    if series.scatter is not None:
        noise = series.scatter.whiten_transposed(noise)
    beside = fit.prediction.compute_residual() - place_on_rows(fit, noise)
    return series.to_units(to_complex(beside))


def resolve_along_wave(fit: ExtendedFit, values: Array) -> Array:
    """Values of a fit's residual rows along the directions of the wave as its noise weighs it.

    Parameters
    ----------
    fit
        Of R runs of n rows.
    values
        (N, ...).

    Returns
    -------
    ndarray
        (R, n, 4, ...): amplitude, phase, angle, ellipticity.

    Examples
    --------
    A change of S of a wave along C is one of its angle:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.extended_fit import resolve_along_wave
    >>> series = SimpleNamespace(weight=np.ones((1, 1)), whitening=None)
    >>> seen, rows = np.array([[[1.0, 0j]]]), np.argwhere(np.ones((1, 1, 4)))
    >>> fit = SimpleNamespace(series=series, prediction=SimpleNamespace(seen=seen), rows=rows)
    >>> resolve_along_wave(fit, np.array([0.0, 2.0, 0.0, 0.0])).tolist()
    [[[0.0, 0.0, 2.0, 0.0]]]
    """
    own = to_reals(find_directions(channel_noise.whiten(fit.series.whitening, fit.prediction.seen)))
    return np.asarray(np.einsum("rnki,rni...->rnk...", own, place_on_rows(fit, values)))


def fit(
    series: MeasuredRuns,
    point: Point,
    freedom: CoordinatePriors,
    most: int = MOST_STEPS,
    near: Near | None = None,
    worst: float = np.inf,
) -> ExtendedFit:
    """The extended model's optimum over all runs, by Gauss–Newton with step halving.

    It stops when a step changes χ² by less than a thousandth of χ² per degree of freedom. Where the
    damping would become negative along an axis the step runs along that bound, which is part of the
    fit (`CoordinatePriors.passive`); the covariance is that without the bound.

    Parameters
    ----------
    series
        The runs, R of n rows.
    point
        Where it starts, with the effects that are fitted.
    freedom
        The priors, and which coordinates are held.
    most
        Steps at most.
    near
        A motion close to that of the point, which is found sooner from it.
    worst
        χ² above which it is given up after `EARLY_STEPS`: it began too far from any that is known.

    Returns
    -------
    ExtendedFit
        The optimum.

    Raises
    ------
    DivergedError
        The model has no motion at the start.

    Examples
    --------
    A damping of 0.12 1/s from a start at 0.1, in noise of the stated size:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors
    >>> from hrg_cli.fitting.causes.extended_fit import fit
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> random = np.random.default_rng(0)
    >>> noise = 1e-3 * random.standard_normal((1, 101, 4)).view(complex)
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, envelope=np.exp(-0.12 * t)[..., None] * [1, 0.2j] + noise,
    ...     weight=none + 1e3, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> held = np.array([0.1, 0, 0, 0, 0, 0.5, 0])
    >>> free = CoordinatePriors(held, np.array([np.inf, 0, 0, 0, 0, 0, 0]))
    >>> found = fit(series, Point(held, np.array([[1, 0.2j]]), np.zeros(1)), free)
    >>> found.converged, round(found.coordinate("damping"), 3), found.dof
    (True, 0.12, 398)
    """
    layout = build_layout(series, point, freedom)
    p = restrict_damping(point.p) if freedom.passive else point.p
    point = replace(point, p=np.where(freedom.std == 0, freedom.mean, p))
    # as a part of χ²: four reals a row, so that χ² is about as large as their number
    settled = 1e-3 / max(1, 4 * int(np.count_nonzero(series.weight)))
    with np.errstate(over="ignore", invalid="ignore"):
        spend_motion()
        prediction = predict(
            series, point, _measured_motion(series, point) if near is None else near
        )
        value = compute_cost(prediction, freedom)
        if not np.isfinite(value):
            raise tell_no_motion(series, point)
        converged, steps, damping = False, 0, 0.0
        while True:
            here = linearise(prediction, layout, freedom)
            if converged or steps == most or (steps >= EARLY_STEPS and value > worst):
                break
            steps += 1
            made = descend(here, freedom, value, settled, damping)
            if not made.value <= value:  # written so that a χ² that is no number ends here, too
                # a step that neither lowers nor raises χ² by more than matters has nowhere to go
                converged = made.value <= value + settled * value
                break
            gained, value, damping = value - made.value, made.value, made.damping
            prediction = made.prediction
            # a shortened step may gain little far from the optimum: that alone settles nothing
            converged = here.expected < settled * value or (gained < settled * value and made.whole)
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
        here.expected,
    )


def _measured_motion(series: MeasuredRuns, point: Point) -> Near | None:
    """Near which driven runs move: as they were measured. None for free ones, which need no
    guess."""
    if not series.forced.any():
        return None
    return linearise_flow(Prediction(series, point, series.envelope, series.envelope)).near
