"""Diagnosis, steps of the logged rate: a log knows the table's rate at its instants, not the angle turned while the rate steps.

Where the rate jumps by ΔΩ between two rows h apart, the angle turned meanwhile is uncertain by up to ΔΩ h/2. What the wave itself says of
that angle is taken into the table's course before anything is blamed on the resonator.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...fitting.causes import extended_fit
from ...fitting.causes.extended import Series
from ...fitting.causes.extended_fit import Fit
from ...fitting.causes.wave_frame import real

Array = np.ndarray
ABOVE = 10.0
"""Times the usual change from row to row that makes a step."""
MATTERS = 0.3
"""Uncertain angle times amplitude over σ from which it is worth correcting."""
MOST_A_RUN = 12
LONGEST = 8
"""Rows a step may take, where the log is coarser than the rows."""
SHARE = 0.25
"""Part of a run's rows that steps may take."""
ROUNDS = 2


def settled(fit: Fit) -> Fit:
    """The fit again with the table angle of every step as the waves show it; the same fit where no rate steps."""
    places = steps(fit.series, float(fit.point.p[5]))
    for _ in range(ROUNDS if places else 0):
        fit = extended_fit.fit(_corrected(fit, places), fit.point, fit.freedom)
    return fit


def steps(series: Series, scale_factor: float) -> list[tuple[int, int, int]]:
    """(run, first row before, last row before) of every step of the rate that matters; none in a run whose rate always moves like that."""
    out = []
    for k, rate in enumerate(series.rate_rad_s):
        good = series.weight[k] > 0
        jump = np.abs(np.diff(rate)) * good[1:]
        if len(jump) < 8 or not jump.any():
            continue
        size = float(np.sqrt(np.mean(np.sum(np.abs(series.envelope[k][good]) ** 2, axis=-1))))
        unsure = abs(scale_factor) * jump * series.step_s[k] / 2 * size * float(np.median(series.weight[k][good]))
        big = np.flatnonzero((jump > ABOVE * np.median(jump[good[1:]])) & (jump > 1e-3 * np.abs(rate).max()) & (unsure > MATTERS))
        groups = np.split(big, np.flatnonzero(np.diff(big) > 1) + 1) if len(big) else []
        if 0 < len(groups) <= MOST_A_RUN and max(map(len, groups)) <= LONGEST and len(big) < SHARE * good.sum():
            out += [(k, int(group[0]), int(group[-1])) for group in groups]
    return out


def _corrected(fit: Fit, places: list[tuple[int, int, int]]) -> Series:
    """The series with the steps' angles that its residual asks for, each within its own uncertainty, rows beside the steps left out."""
    series, flow = fit.series, fit.flow
    impulse = np.zeros((*flow.middle.shape[:2], 4, len(places)))
    spread = np.empty(len(places))
    for j, (k, first, last) in enumerate(places):
        rows = slice(first, last + 1)
        v, h = flow.middle[k, rows], series.step_s[k, rows]
        # one radian over all of them; Simpson's rule of the flow weighs the middle by 4h/6
        rate = 6 / (4 * h * len(h))
        impulse[k, rows, :, j] = real(fit.point.p[5] * rate[:, None] * np.stack([v[:, 1], -v[:, 0]], -1))
        spread[j] = abs(series.rate_rad_s[k, last + 1] - series.rate_rad_s[k, first]) * h.sum() / 2
    columns = extended_fit.flat(series, flow.seen(flow.carried(np.zeros((*series.weight.shape, 4, len(places))), impulse)))
    columns = fit.basis.off(columns)
    spread = np.maximum(spread, 1e-9)
    angle = np.linalg.solve(columns.T @ columns + np.diag(1 / spread**2), columns.T @ fit.residual)
    turned, weight = series.table_angle_rad.copy(), series.weight.copy()
    for (k, first, last), c in zip(places, angle, strict=True):
        turned[k, first + 1 : last + 2] += c * np.arange(1, last - first + 2) / (last - first + 1)
        turned[k, last + 2 :] += c
        weight[k, first : last + 2] = 0.0
    return replace(series, table_angle_rad=turned, weight=weight)
