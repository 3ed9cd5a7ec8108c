"""Residuals, sensitivities and the design on the rows that count: whitened, off what nobody
knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from ...effects.effect import Effect
from ..envelopes.coordinates import COUNT
from .coordinate_priors import CoordinatePriors
from .design_columns import FREQUENCY, FitColumns
from .designs import Design
from .fit_point import Point
from .measured_runs import MeasuredRuns
from .scales import list_steps
from .sensitivities import Propagation, Wanted, find_base_sensitivities, find_effect_sensitivities

Array = np.ndarray


def flatten_rows(series: MeasuredRuns, values: Array) -> Array:
    """Values of the rows with weight, one after the other, whitened and off what is unsettled.

    Parameters
    ----------
    series
        The runs, R of n rows.
    values
        (R, n, 4, …) over σ.

    Returns
    -------
    ndarray
        (N, …), four for each row with weight.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import Basis
    >>> from hrg_cli.fitting.causes.whitened_rows import flatten_rows
    >>> drift = Basis((), np.full((8, 1), 8**-0.5))
    >>> series = SimpleNamespace(weight=np.array([[5.0, 0.0, 5.0]]), scatter=None, unsettled=drift)
    >>> values = np.array([[[1.0] * 4, [9.0] * 4, [3.0] * 4]])
    >>> flatten_rows(series, values).round(9).tolist()
    [-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0]
    """
    rows = whiten_rows(series, values)
    return rows if series.unsettled is None else series.unsettled.project_out(rows)


def flatten_own(series: MeasuredRuns, values: Array) -> Array:
    """The same off what is unsettled in a run alone.

    What reaches over several runs would mix the runs' own columns, and is taken off where the
    design is used.

    Parameters
    ----------
    series
        The runs, R of n rows.
    values
        (R, n, 4, …) over σ.

    Returns
    -------
    ndarray
        (N, …), four for each row with weight.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import Basis
    >>> from hrg_cli.fitting.causes.whitened_rows import flatten_own
    >>> of_all, of_first = np.full((8, 1), 8**-0.5), (slice(0, 4), np.full((4, 1), 0.5))
    >>> weight, unsettled = np.ones((2, 1)), Basis((of_first,), of_all)
    >>> series = SimpleNamespace(weight=weight, scatter=None, unsettled=unsettled)
    >>> flatten_own(series, np.ones((2, 1, 4))).tolist()
    [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]
    """
    rows = whiten_rows(series, values)
    return rows if series.unsettled is None else series.unsettled.project_out_own(rows)


def split_rows(series: MeasuredRuns) -> list[slice]:
    """Which of the rows with weight, four values each, are whose.

    Parameters
    ----------
    series
        The runs, R of n rows.

    Returns
    -------
    list of slice
        R of them.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.whitened_rows import split_rows
    >>> split_rows(SimpleNamespace(weight=np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]])))
    [slice(0, 8, None), slice(8, 20, None)]
    """
    ends = np.cumsum([0, *4 * np.count_nonzero(series.weight > 0, axis=1)])
    return [slice(int(first), int(last)) for first, last in pairwise(ends)]


def whiten_rows(series: MeasuredRuns, values: Array) -> Array:
    """Values of the rows with weight, one after the other, whitened by what may scatter.

    Parameters
    ----------
    series
        The runs, R of n rows.
    values
        (R, n, 4, …) over σ.

    Returns
    -------
    ndarray
        (N, …), four for each row with weight.

    Examples
    --------
    Along a direction of variance 3 beside the noise's 1, a value counts half:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import Softened
    >>> from hrg_cli.fitting.causes.whitened_rows import whiten_rows
    >>> scatter = Softened(((slice(0, 4), np.eye(4)[:, :1], np.array([3.0])),))
    >>> series = SimpleNamespace(weight=np.ones((1, 1)), scatter=scatter)
    >>> whiten_rows(series, np.ones((1, 1, 4))).tolist()
    [0.5, 1.0, 1.0, 1.0]
    """
    keep = series.weight > 0
    if keep.all():  # a view instead of a copy: the design of long runs is most of the memory
        rows = values.reshape(-1, *values.shape[3:])
    else:
        rows = values[keep].reshape(-1, *values.shape[3:])
    return rows if series.scatter is None else series.scatter.whiten(rows)


def find_sensitivity(
    flow: Propagation, effect: Effect, values: Mapping[str, float], steps: Mapping[str, float]
) -> Array:
    """An effect's sensitivities over σ.

    Parameters
    ----------
    flow
        Along a prediction.
    effect
        Active or not.
    values
        Where it stands.
    steps
        Difference steps of the parameters asked for, K of them.

    Returns
    -------
    ndarray
        (N, K).

    Examples
    --------
    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.effects import EFFECTS
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.sensitivities import linearise_flow
    >>> from hrg_cli.fitting.causes.slow_prediction import predict
    >>> from hrg_cli.fitting.causes.whitened_rows import find_sensitivity
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, weight=none + 1e3, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> point = Point(np.array([0.1, 0, 0, 0, 0, 0.5, 0]), np.array([[1.0, 0.2j]]), np.zeros(1))
    >>> flow = linearise_flow(predict(series, point))
    >>> gain = next(one for one in EFFECTS if one.name == "gain_mismatch")
    >>> found = find_sensitivity(flow, gain, {"gain": 0.0}, {"gain": 1e-3})
    >>> found.shape, found[:4, 0].round(6).tolist()
    ((404, 1), [500.0, 0.0, 0.0, -100.0])
    """
    return find_sensitivities(flow, [(effect, values, steps)])[0]


def find_sensitivities(flow: Propagation, wanted: Sequence[Wanted]) -> list[Array]:
    """Many effects' sensitivities over σ, at the cost of one sweep over the rows.

    Parameters
    ----------
    flow
        Along a prediction.
    wanted
        Effects with the values where they stand and the difference steps of their parameters.

    Returns
    -------
    list of ndarray
        (N, K) of each, K its steps.

    Examples
    --------
    A step's size does not matter to a read-out that is linear in its gain:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.effects import EFFECTS
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.sensitivities import linearise_flow
    >>> from hrg_cli.fitting.causes.slow_prediction import predict
    >>> from hrg_cli.fitting.causes.whitened_rows import find_sensitivities
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, weight=none + 1e3, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> point = Point(np.array([0.1, 0, 0, 0, 0, 0.5, 0]), np.array([[1.0, 0.2j]]), np.zeros(1))
    >>> flow = linearise_flow(predict(series, point))
    >>> gain = next(one for one in EFFECTS if one.name == "gain_mismatch")
    >>> wanted = [(gain, {"gain": 0.0}, {"gain": step}) for step in (1e-3, 1e-2)]
    >>> fine, coarse = find_sensitivities(flow, wanted)
    >>> fine.shape, bool(np.allclose(fine, coarse))
    ((404, 1), True)
    """
    return [
        flatten_rows(flow.prediction.series, columns)
        for columns in find_effect_sensitivities(flow, wanted)
    ]


def build_layout(series: MeasuredRuns, point: Point, freedom: CoordinatePriors) -> FitColumns:
    """What a fit of this point moves.

    Parameters
    ----------
    series
        The runs.
    point
        With its effects, of which those with fitted parameters are moved.
    freedom
        Coordinates of a prior's deviation 0 are held.

    Returns
    -------
    FitColumns
        Names of all columns.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.coordinate_priors import CoordinatePriors
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.whitened_rows import build_layout
    >>> free = CoordinatePriors(np.zeros(7), np.array([np.inf, 0, 0, 0, 0, 0, 0]))
    >>> point, runs = Point(np.zeros(7), np.ones((2, 2)), np.zeros(2)), SimpleNamespace(names="ab")
    >>> build_layout(runs, point, free).count
    11
    """
    effects = tuple(
        (e.name, names) for e, _ in point.active if (names := tuple(p.name for p in e.fitted()))
    )
    return FitColumns(
        tuple(k for k in range(COUNT) if freedom.std[k] > 0), len(series.names), effects
    )


def compute_design(flow: Propagation, layout: FitColumns) -> Design:
    """Whitened design of coordinates, runs and active effects.

    Parameters
    ----------
    flow
        Along a prediction.
    layout
        Which column is which number.

    Returns
    -------
    Design
        (N, columns), each run's own numbers in a block.

    Examples
    --------
    The damping and a run's own start and frequency, over a σ of 1/1000:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.design_columns import FitColumns
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.sensitivities import linearise_flow
    >>> from hrg_cli.fitting.causes.slow_prediction import predict
    >>> from hrg_cli.fitting.causes.whitened_rows import compute_design
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, weight=none + 1e3, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> point = Point(np.array([0.1, 0, 0, 0, 0, 0.5, 0]), np.array([[1.0, 0.2j]]), np.zeros(1))
    >>> design = compute_design(linearise_flow(predict(series, point)), FitColumns((0,), 1))
    >>> design.shape, design.to_matrix()[0].round(6).tolist()
    ((404, 6), [0.0, 1000.0, 0.0, 0.0, 0.0, 0.0])
    """
    series, point = flow.prediction.series, flow.prediction.point
    of_all, of_each = find_base_sensitivities(flow)
    shared, own = flatten_own(series, of_all), flatten_own(series, of_each)
    if series.free_phase:
        # phases that are not judged tell no frequency; what the rule's steps leave of one is
        # rounding, along which a fit would run off without end
        own[:, FREQUENCY] = 0.0
    wanted = [
        (e, v, _fitted_steps(e, v, series)) for e, v in point.active if layout.parameters(e.name)
    ]
    beside = [flatten_own(series, one) for one in find_effect_sensitivities(flow, wanted)]
    blocks = tuple((one, layout.run(k), own[one]) for k, one in enumerate(split_rows(series)))
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
        for name, size in list_steps(effect, series).items()
    }
