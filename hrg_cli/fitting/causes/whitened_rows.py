"""Residuals, sensitivities and the design on the rows that count: whitened, off what nobody knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from ...effects.effect import Effect
from ..envelopes.coordinates import COUNT
from .coordinate_priors import CoordinatePriors
from .designs import Design
from .fit_point import Point
from .layout import FitColumns
from .measured_runs import MeasuredRuns
from .scales import steps_of
from .sensitivities import Propagation, Wanted, find_base_sensitivities, find_effect_sensitivities

Array = np.ndarray


def flatten_rows(series: MeasuredRuns, values: Array) -> Array:
    """(R, n, 4, …) -> rows with weight only, (N, …), whitened and off what is unsettled."""
    rows = whiten_rows(series, values)
    return rows if series.unsettled is None else series.unsettled.off(rows)


def flatten_own(series: MeasuredRuns, values: Array) -> Array:
    """The same off what is unsettled in a run alone: what reaches over several would mix the runs' own
    columns, and is taken off where the design is used."""
    rows = whiten_rows(series, values)
    return rows if series.unsettled is None else series.unsettled.off_own(rows)


def whiten_rows(series: MeasuredRuns, values: Array) -> Array:
    """(R, n, 4, …) -> rows with weight only, (N, …), whitened by what may scatter."""
    keep = series.weight > 0
    if keep.all():  # a view instead of a copy: the design of long runs is most of the memory
        rows = values.reshape(-1, *values.shape[3:])
    else:
        rows = values[np.broadcast_to(keep[..., None], values.shape[:3])]
    return rows if series.scatter is None else series.scatter.off(rows)


def find_sensitivity(
    flow: Propagation, effect: Effect, values: Mapping[str, float], steps: Mapping[str, float]
) -> Array:
    """An effect's sensitivities over σ, (N, K)."""
    return find_sensitivities(flow, [(effect, values, steps)])[0]


def find_sensitivities(flow: Propagation, wanted: Sequence[Wanted]) -> list[Array]:
    """Of many effects, (N, K) each."""
    return [
        flatten_rows(flow.prediction.series, columns)
        for columns in find_effect_sensitivities(flow, wanted)
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
    of_all, of_each = find_base_sensitivities(flow)
    shared, own = flatten_own(series, of_all), flatten_own(series, of_each)
    wanted = [
        (e, v, _fitted_steps(e, v, series)) for e, v in point.active if layout.parameters(e.name)
    ]
    beside = [flatten_own(series, one) for one in find_effect_sensitivities(flow, wanted)]
    ends = np.cumsum([0, *4 * np.count_nonzero(series.weight > 0, axis=1)])
    rows = [slice(int(first), int(last)) for first, last in pairwise(ends)]
    blocks = tuple((one, layout.run(k), own[one]) for k, one in enumerate(rows))
    return Design(
        np.concatenate([shared[:, list(layout.coordinates)], *beside], axis=1),
        layout.shared,
        blocks,
        series.unsettled,
    )


def _fitted_steps(
    effect: Effect, values: Mapping[str, float], series: MeasuredRuns
) -> dict[str, float]:
    """Difference steps sized by the value where the effect stands."""
    return {
        # a thousandth of the value, in which every term is as good as linear; its own size at 0
        name: 1e-3 * abs(values[name]) or size
        for name, size in steps_of(effect, series).items()
    }
