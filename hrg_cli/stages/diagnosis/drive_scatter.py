"""Diagnosis, the scatter of a drive's log: a log of single values of a noisy or rippling command
does not hold what the drive did between its rows, one of means does, and nobody says which it is.

What is missed of the command is at most its scatter from row to row, s. A part q s of it is allowed
for, white in time, with the q ≤ 1 that makes the residual most probable: the wave then walks beside
its prediction, with the covariance C = 1 + q² S Sᵀ over σ (S: what s in one piece of time does), and
residual and sensitivities are whitened by C^{−1/2}.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...effects.effect import frame
from ...fitting.causes import extended_fit
from ...fitting.causes.evidence import Softened
from ...fitting.causes.extended import Series
from ...fitting.causes.extended_fit import Fit
from ...fitting.causes.wave_frame import real

Array = np.ndarray
PIECES = 120
"""Pieces of a run over which the missed command is one value: what is quicker moves the wave too
little."""
FEWEST = 20
"""Rows from which a scatter is looked for."""
LEAST = 0.1
"""σ by which the scatter must move the wave within a run to count."""
TOLD = 1.0
"""The same from which what is allowed for is told."""
WORTH = 4.0
"""2 ln of the likelihood ratio from which a part of the scatter is allowed for."""
PARTS = np.concatenate([[0.0], np.geomspace(0.02, 1.0, 24)])
"""Values of q that are tried."""
EXPLAINED = 2.0
"""χ² a degree of freedom from which it is not the scatter that the fit misses, and is not allowed
for: a cause would hide behind it."""
WEAKEST = 1e-4
"""Variance over that of the windows below which a direction is left alone."""
OF_FOURTH_DIFFERENCES = 0.6745 * 70**0.5
"""Median of |fourth differences| of white scatter, over its standard deviation."""


def allowed_for(fit: Fit) -> Fit:
    """The fit again beside as much of the log's scatter as the waves show; the same where that is
    none, or where it is not what the fit misses."""
    series = fit.series
    scatter, walks = scatters(series)
    if not np.any(walks > LEAST):
        return fit
    doings = extended_fit.flat(series, _doings(fit, scatter))
    ends = np.cumsum([0, *4 * np.count_nonzero(series.weight > 0, axis=1)])
    own = []
    for k, walk in enumerate(walks):
        rows = slice(int(ends[k]), int(ends[k + 1]))
        if walk > LEAST:
            Q, size, _ = np.linalg.svd(doings[rows], full_matrices=False)
            keep = size**2 > WEAKEST
            own.append((rows, Q[:, keep], size[keep] ** 2))
    q2 = _part(fit.residual, own) ** 2
    if q2 == 0:
        return fit
    soft = Softened(tuple((rows, Q, 1 - 1 / np.sqrt(1 + q2 * power)) for rows, Q, power in own))
    beside = extended_fit.fit(replace(series, scatter=soft), fit.point, fit.freedom)
    return beside if beside.chi2 < EXPLAINED * beside.dof else fit


def sentence(fit: Fit) -> str:
    """What is to be said of a log that scatters; empty where it hardly moves the wave."""
    scatter, walks = scatters(fit.series)
    worst = int(np.argmax(walks))
    if walks[worst] < TOLD:
        return ""
    return (
        f"the drive's log scatters by {np.max(scatter[worst]):.2g} amplitude/s from row to row,"
        f" which alone moves the wave by {walks[worst]:.2g} σ within a run: what the drive did"
        " between the log's rows is not known; log its means, or every value that the loops set"
    )


def scatters(series: Series) -> tuple[Array, Array]:
    """White scatter of the two commands (R, 2) from row to row, and the walk s h √n that it makes
    of the wave in a run, over σ (R,)."""
    scatter, walk = np.zeros((len(series.names), 2)), np.zeros(len(series.names))
    for k, weight in enumerate(series.weight):
        good = weight > 0
        rows = int(np.count_nonzero(good))
        if rows < FEWEST or not series.forced[k].any():
            continue
        commands = np.stack([series.main_drive[k][good], series.quadrature_drive[k][good]])
        rough = np.abs(np.diff(commands, n=4, axis=1))
        scatter[k] = np.median(rough, axis=1) / OF_FOURTH_DIFFERENCES
        step = float(np.median(np.diff(series.time_s[k][good])))
        walk[k] = scatter[k].max() * step * np.sqrt(rows) * float(np.median(weight[good]))
    return scatter, walk


def _doings(fit: Fit, scatter: Array) -> Array:
    """What the missed command does in every piece of time, over σ, (R, n, 4, 2 · pieces)."""
    series, flow, v = fit.series, fit.flow, fit.flow.middle
    runs, steps = v.shape[:2]
    turn, e_A, e_B, _ = frame(v, flow.centre.phase_rad)
    count = min(PIECES, steps)
    piece = np.arange(steps) * count // steps
    many = np.sqrt(np.bincount(piece))
    kicks = np.zeros((runs, steps, 4, 2 * count))
    for n, direction in enumerate((e_A, -1j * e_B)):
        force = real(turn[..., None] * direction) * (series.step_s * scatter[:, n, None])[..., None]
        kicks[:, np.arange(steps), :, 2 * piece + n] = np.moveaxis(
            force / many[piece][None, :, None], 1, 0
        )
    nothing = np.zeros((runs, steps + 1, 4, 2 * count))
    return flow.seen(flow.carried(nothing, nothing[:, 1:], in_steps=kicks))


def _part(residual: Array, own: list[tuple[slice, Array, Array]]) -> float:
    """The part q of the scatter with which the residual is most probable; 0 where it is little more
    so than without."""
    power = np.concatenate([one for _, _, one in own])
    along2 = np.concatenate([(Q.T @ residual[rows]) ** 2 for rows, Q, _ in own])
    spread = 1 + PARTS[:, None] ** 2 * power
    score = np.sum(np.log(spread) + along2 / spread, axis=1)
    best = int(np.argmin(score))
    return float(PARTS[best]) if score[best] < score[0] - WORTH else 0.0
