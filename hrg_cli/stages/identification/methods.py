"""Seed A's methods: each one's answer on rows of the first order, and the parameters it tells.

Each solves u' = L u for the generator's coordinates (PHYSICS §4), by differences, integrals or moving
axes; `fitting/envelopes/regressions.py` and its neighbours hold the equations.
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
    """One method's answer; how far the scale of the second order is unknown is in its
    covariance."""
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
    """Parameters by name, standard deviations, covariance (7, 7) in ORDER; what the method does not
    give is left out."""
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
