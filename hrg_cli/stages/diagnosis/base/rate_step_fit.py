"""Diagnosis, steps of the logged rate: a log knows the table's rate at its instants, not the angle
turned while the rate steps.

Where the rate jumps by ΔΩ between two rows h apart, the angle turned meanwhile is uncertain by up
to ΔΩ h/2, and so is when within h it was turned: on another way through the splits the wave gathers
another quadrature and amplitude. The angle is taken as the wave itself shows it, and no cause is
judged by what a step can do beside that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....fitting.causes import designs, extended_fit, whitened_rows
from ....fitting.causes.designs import Basis
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.causes.wave_frame import to_reals
from ....fitting.envelopes.coordinates import SCALE_FACTOR
from ....fitting.samples.rate_steps import find_steps

Array = np.ndarray
ROUNDS = 2
INDEPENDENT = 1e-6
"""Part of the strongest below which what a step does is what others do."""


def fit_rate_steps(fit: ExtendedFit) -> ExtendedFit:
    """The fit again with the table angle of every step of the rate as the waves show it, blind to
    what else a step can do.

    Parameters
    ----------
    fit
        The base model's.

    Returns
    -------
    ExtendedFit
        The same where there is no step.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.rate_step_fit import fit_rate_steps
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> fit_rate_steps(draw_fit()) is draw_fit()
    True
    """
    places = find_rate_steps(fit.series, float(fit.point.p[SCALE_FACTOR]))
    for _ in range(ROUNDS if places else 0):
        fit = extended_fit.fit(_correct_steps(fit, places), fit.point, fit.freedom)
    if places:
        fit = extended_fit.fit(
            replace(fit.series, unsettled=_doings(fit, places)), fit.point, fit.freedom
        )
    return fit


def find_rate_steps(series: MeasuredRuns, scale_factor: float) -> list[tuple[int, int, int]]:
    """Every step of the rate that matters.

    Parameters
    ----------
    series
        The runs' rows.
    scale_factor
        K.

    Returns
    -------
    list of tuple
        Run, first row before, last row before; none in a run whose rate always moves like that.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.rate_step_fit import find_rate_steps
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> find_rate_steps(draw_fit().series, 0.55)
    []
    """
    out = []
    for k, rate in enumerate(series.rate_rad_s):
        good = series.weight[k] > 0
        if not good.any():
            continue
        size = float(np.sqrt(np.mean(np.sum(np.abs(series.envelope[k][good]) ** 2, axis=-1))))
        per_rad = abs(scale_factor) * size * float(np.median(series.weight[k][good]))
        steps = find_steps(rate, good, per_rad * series.step_s[k] / 2)
        out += [(k, first, last) for first, last in steps]
    return out


def _correct_steps(fit: ExtendedFit, places: list[tuple[int, int, int]]) -> MeasuredRuns:
    """The series with the steps' angles that its residual asks for, each within its own
    uncertainty, rows beside the steps left out."""
    series, flow = fit.series, fit.flow
    columns = whitened_rows.flatten_rows(
        series,
        flow.whiten_read_out(np.stack([_kicks(fit, *place)[0] for place in places], axis=-1)),
    )
    spread = np.array(
        [
            abs(series.rate_rad_s[k, b + 1] - series.rate_rad_s[k, a])
            * series.step_s[k, a : b + 1].sum()
            / 2
            for k, a, b in places
        ]
    )
    columns, spread = fit.basis.project_out(columns), np.maximum(spread, 1e-9)
    angle = np.linalg.solve(columns.T @ columns + np.diag(1 / spread**2), columns.T @ fit.residual)
    table, weight = series.table_angle_rad.copy(), series.weight.copy()
    for (k, first, last), turned in zip(places, angle, strict=True):
        table[k, first + 1 : last + 2] += (
            turned * np.arange(1, last - first + 2) / (last - first + 1)
        )
        table[k, last + 2 :] += turned
        weight[k, first : last + 2] = 0.0
    return replace(series, table_angle_rad=table, weight=weight)


def _doings(fit: ExtendedFit, places: list[tuple[int, int, int]]) -> Basis:
    """Orthonormal basis, run by run, of all that the steps can do to the residual.

    Their sizes are bounded, but a prior would be dragged along by whatever goes on between the
    steps; so they are left free.
    """
    series = fit.series
    ends = np.cumsum([0, *4 * np.count_nonzero(series.weight > 0, axis=1)])
    own = []
    for run in sorted({k for k, _, _ in places}):
        kicks = [kick for place in places if place[0] == run for kick in _kicks(fit, *place)]
        rows = slice(int(ends[run]), int(ends[run + 1]))
        own.append(
            (
                rows,
                designs.orthonormalise(
                    whitened_rows.flatten_rows(
                        series, fit.flow.whiten_read_out(np.stack(kicks, axis=-1))
                    )[rows],
                    INDEPENDENT,
                ),
            )
        )
    return Basis(tuple(own), np.zeros((int(ends[-1]), 0)))


def _kicks(fit: ExtendedFit, k: int, first: int, last: int) -> list[Array]:
    """Motion (R, n, 4) after one radian of the table, and after a unit of amplitude, phase and
    quadrature, over the rows of a step."""
    series, flow, rows = fit.series, fit.flow, slice(first, last + 1)
    v, h = flow.middle[k, rows], series.step_s[k, rows, None]
    turned = np.stack([v[:, 1], -v[:, 0]], -1)
    out = []
    for change in (fit.point.p[SCALE_FACTOR] * turned, v, 1j * v, 1j * turned):
        impulse = np.zeros((*flow.middle.shape[:2], 4, 1))
        # one unit over all of them; Simpson's rule of the flow weighs the middle by 4h/6
        impulse[k, rows, :, 0] = to_reals(change * 6 / (4 * h * len(h)))
        out.append(flow.propagate(np.zeros((*series.weight.shape, 4, 1)), impulse)[..., 0])
    return out
