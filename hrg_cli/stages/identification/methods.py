"""Seed A's methods: each one's answer on rows of the first order, and the parameters it tells.

Each solves u' = L u for the generator's coordinates (PHYSICS §4), by differences, integrals or
moving axes; `fitting/envelopes/regressions.py` and its neighbours hold the equations.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from ...fitting.envelopes import (
    axis_crossings,
    coordinates,
    inference,
    method_ranges,
    regressions,
    rotation_integrals,
)
from ...fitting.envelopes.base_freedom import Known
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...fitting.envelopes.likelihood import Fit
from ...fitting.envelopes.regressions import Regression
from .first_order_rows import PreparedRows
from .verdict import ORDER

Array = np.ndarray
RegressionMethod = Literal[
    "propagator",
    "stokes",
    "products",
    "increments",
    "moving-axes",
    "moving-axes-small-quadrature",
    "fixed-axes",
    "fixed-axes-weighted",
    "fixed-axes-groups",
    "frozen-axes",
    "rotation-integrals",
    "axis-crossings",
]
ALL: tuple[RegressionMethod, ...] = get_args(RegressionMethod)


def solve_method(method: str, ready: PreparedRows, best: Fit, eliminate_rate: bool) -> Regression:
    """One method's answer; how far the scale of the second order is unknown is in its covariance.

    Parameters
    ----------
    method
        One of `ALL`.
    ready
        The rows of the first order.
    best
        The likelihood's optimum.
    eliminate_rate
        Of fixed-axes: the published elimination of the rate.

    Returns
    -------
    Regression
        Coordinates (7,) with covariance (7, 7), NaN what the method does not give; `refused` says
        why there are none.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.base_fit import fit_base_model
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.first_order_rows import prepare_rows
    >>> from hrg_cli.stages.identification.methods import solve_method
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> best = fit_base_model(runs, blocks=100)
    >>> answer = solve_method("stokes", prepare_rows(runs, Known(), best), best, False)
    >>> answer.p[[0, 5]].round(3).tolist()
    [0.1, 0.55]
    """
    answer = _solve_on_rows(method, ready, best, eliminate_rate)
    if answer.refused or ready.beside is None:
        return answer
    moved = _solve_on_rows(method, ready.beside, best, eliminate_rate, answer.spread)
    if moved.refused:
        return moved
    change = moved.p - answer.p
    return dataclasses.replace(answer, covariance=answer.covariance + np.outer(change, change))


def _solve_on_rows(
    method: str,
    ready: PreparedRows,
    best: Fit,
    eliminate_rate: bool,
    spread: regressions.NoiseSpread | None = None,
) -> Regression:
    """One method's answer on rows of the first order; what noise does to it may be known
    (`spread`)."""
    if method == "propagator":
        space = ready.space
        return Regression(
            ready.p,
            space.directions @ ready.covariance @ space.directions.T,
            method_ranges.list_warnings(ready.rows, method, False),
        )
    start = np.append(best.p[:6], 0.0)
    if method == "rotation-integrals":
        return rotation_integrals.solve(ready.rows, ready.simulate, start)
    if method == axis_crossings.METHOD:
        return axis_crossings.solve(ready.rows, ready.simulate, start)
    return regressions.solve(
        ready.rows, ready.space, method, eliminate_rate, ready.simulate, start, spread
    )


def name_parameters(
    answer: Regression, mode: int, method: str, thin: Sequence[EnvelopeRun], known: Known
) -> tuple[dict[str, float], dict[str, float], Array]:
    """Parameters by name with their errors; what the method does not give is left out.

    Parameters
    ----------
    answer
        Of a method, in coordinates.
    mode
        m.
    method
        Its name.
    thin
        The runs it was solved on.
    known
        What was held.

    Returns
    -------
    tuple
        Values by name (the frequency 0: no method gives it), standard deviations by name, and the
        covariance (7, 7) in `ORDER`, in the parameters' own units.

    Examples
    --------
    A damping split of 0.02 1/s along the electrodes; K is nobody's where no run turns:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.fitting.envelopes.regressions import Regression
    >>> from hrg_cli.stages.identification.methods import name_parameters
    >>> answer = Regression(np.array([0.1, 0.02, 0, 0, 0.3, 0.55, 0]), 1e-8 * np.eye(7))
    >>> values, std, _ = name_parameters(answer, 2, "stokes", [draw_run_down(0.0)], Known())
    >>> values["damping_split_1_s"], round(std["damping_split_1_s"], 9), "scale_factor" in values
    (0.02, 0.0001, False)
    """
    numbers, slopes = coordinates.to_parameters(np.nan_to_num(answer.p), mode)
    covariance = np.zeros((7, 7))
    own = np.nan_to_num(answer.covariance)
    covariance[1:, 1:] = slopes @ own @ slopes.T
    held = np.diag(covariance)[1:] < 1e-20 * np.einsum(
        "ij,jk,ik->i", np.abs(slopes), np.abs(own), np.abs(slopes)
    )
    covariance[1:, 1:][held] = covariance[1:, 1:][:, held] = (
        0.0  # what is held moves with nothing, not even by rounding
    )
    inference.widen_axes(covariance[1:, 1:], own, np.nan_to_num(answer.p), mode)
    present = {"frequency_hz"}
    for row, name in enumerate(ORDER[1:]):
        index = {0: [0], 1: [1, 2], 2: [1, 2], 3: [3, 4], 4: [3, 4], 5: [5]}[row]
        if np.all(np.isfinite(answer.p[index])):
            present.add(name)
    if known.scale_factor is None and max(float(np.ptp(r.turn_rad)) for r in thin) == 0:
        present.discard("scale_factor")
    if method in method_ranges.USES_AXES and any(
        "frequency split is skipped" in w for w in answer.warnings
    ):
        present -= {"frequency_split_rad_s", "stiffness_axis_rad"}
    values = {n: float(v) for n, v in zip(ORDER, [0.0, *numbers]) if n in present}
    std = dict(zip(ORDER, map(float, np.sqrt(np.maximum(0.0, np.diag(covariance))))))
    return values, std, covariance
