"""Diagnosis, steps of the logged rate: a log knows the table's rate at its instants, not the angle turned while the rate steps.

Where the rate jumps by ΔΩ between two rows h apart, the angle turned meanwhile is uncertain by up to ΔΩ h/2, and so is when within h it was
turned: on another way through the splits the wave gathers another quadrature and amplitude. What the wave itself says of all this is
taken out before anything is blamed on the resonator.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...fitting.causes import extended_fit
from ...fitting.causes.extended import Series
from ...fitting.causes.extended_fit import Fit
from ...fitting.causes.wave_frame import imaginary, real

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
WAY = 1 / 9
"""A step at an instant by chance within h, the angle over h known: ∫δθ dt scatters by ΔΩ h²/18, as a part of ΔΩ h/2 · h."""


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
    """The series with what its residual says of every step, within the step's own uncertainty, rows beside the steps left out.

    Four numbers a step: the angle turned, which the table's course takes, and the changes of amplitude, phase and quadrature that its
    unknown way through the splits makes, which the envelopes after it lose.
    """
    series, flow = fit.series, fit.flow
    splits = float(np.hypot(*fit.point.p[1:3]) + np.hypot(*fit.point.p[3:5]))
    columns, spread = [], []
    for k, first, last in places:
        length = float(series.step_s[k, first : last + 1].sum())
        unsure = abs(series.rate_rad_s[k, last + 1] - series.rate_rad_s[k, first]) * length / 2
        columns += _kicks(fit, k, first, last)
        spread += [unsure, *[abs(fit.point.p[5]) * unsure * splits * length * WAY] * 3]
    seen = flow.seen(np.stack(columns, axis=-1))
    wide = extended_fit.flat(series, seen)
    wide = fit.basis.off(wide)
    prior = np.diag(1 / np.maximum(spread, 1e-12) ** 2)
    size = np.linalg.solve(wide.T @ wide + prior, wide.T @ fit.residual)
    table, weight = series.table_angle_rad.copy(), series.weight.copy()
    for (k, first, last), angle in zip(places, size[::4], strict=True):
        table[k, first + 1 : last + 2] += angle * np.arange(1, last - first + 2) / (last - first + 1)
        table[k, last + 2 :] += angle
        weight[k, first : last + 2] = 0.0
    others = np.where(np.arange(len(size)) % 4 == 0, 0.0, size)
    lost = imaginary(np.stack(columns, axis=-1) @ others)
    return replace(series, table_angle_rad=table, weight=weight, envelope=series.envelope - lost)


def _kicks(fit: Fit, k: int, first: int, last: int) -> list[Array]:
    """Motion (R, n, 4) after one radian of the table, and after a unit of amplitude, phase and quadrature, over the rows of a step."""
    series, flow, rows = fit.series, fit.flow, slice(first, last + 1)
    v, h = flow.middle[k, rows], series.step_s[k, rows, None]
    turned = np.stack([v[:, 1], -v[:, 0]], -1)
    out = []
    for change in (fit.point.p[5] * turned, v, 1j * v, 1j * turned):
        impulse = np.zeros((*flow.middle.shape[:2], 4, 1))
        # one unit over all of them; Simpson's rule of the flow weighs the middle by 4h/6
        impulse[k, rows, :, 0] = real(change * 6 / (4 * h * len(h)))
        out.append(flow.carried(np.zeros((*series.weight.shape, 4, 1)), impulse)[..., 0])
    return out
