"""Diagnosis, the sign of e^{jφ} in every run: (mθ, φ) and (mθ + π, φ + π) are the same wave.

A vector coherent with the phase (offset, feed-through, parasitic force) therefore stands with a
sign of its own in every run, whoever wrote it. The signs are chosen together where that clearly
explains what nothing else does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...fitting.causes import evidence, extended_fit
from ...fitting.causes.extended_fit import ExtendedFit
from .scoring import score_effects, worth
from .variants import Variant

Array = np.ndarray
CLEARLY = 30.0
"""χ² that turned signs must gain, beyond the choice among 2^(R − 1) of them."""


def orient_runs(base: ExtendedFit, candidates: Sequence[Variant]) -> ExtendedFit:
    """The fit with the phase of some runs turned by π, or as it was."""
    runs = len(base.series.names)
    own = [variant for variant in candidates if variant.effect.coherent]
    if runs < 2 or not own:
        return base
    price = 2 * (runs - 1) * float(np.log(2))
    best, signs = -np.inf, np.ones(runs)
    for columns in base.sensitivities([variant.wanted for variant in own]):
        gain, plain, trial, rank = _turned(columns, base, runs)
        promised = evidence.criterion(gain, rank, len(base.residual)) - price
        if gain - plain > CLEARLY + price and promised > best:
            best, signs = promised, trial
    if np.all(signs > 0):
        return base
    others = (worth(s, v, base) for s, v in score_effects(base, candidates) if s.visible)
    if best < max(others, default=-np.inf):
        return base
    turned = base.series.phase_rad + np.pi * (signs < 0)[:, None]
    return extended_fit.fit(replace(base.series, phase_rad=turned), base.point, base.freedom)


def _turned(columns: Array, base: ExtendedFit, runs: int) -> tuple[float, float, Array, int]:
    """(fall of χ² with the best signs found, with all +, those signs (R,), parameters) of columns
    (N, K) whose sign each run may turn."""
    count = columns.shape[1]
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    wide = np.zeros((len(columns), runs * count))
    for k in range(runs):
        mine = base.rows[:, 0] == k
        wide[mine, k * count : (k + 1) * count] = columns[mine] / size
    wide = base.basis.off(wide)
    A = (wide.T @ wide).reshape(runs, count, runs, count)
    b = (wide.T @ base.residual).reshape(runs, count)

    def gain(s: Array) -> float:
        right = s @ b
        return float(
            right
            @ np.linalg.pinv(
                np.einsum("r,ricj,c->ij", s, A, s), rcond=evidence.BLIND**2, hermitian=True
            )
            @ right
        )

    plain = gain(np.ones(runs))
    most = float(
        b.ravel()
        @ np.linalg.pinv(A.reshape(runs * count, -1), rcond=evidence.BLIND**2, hermitian=True)
        @ b.ravel()
    )
    if most - plain < CLEARLY:  # a vector of its own in every run would not earn it
        return plain, plain, np.ones(runs), count
    alone = np.array(
        [np.linalg.pinv(A[k, :, k], rcond=1e-6, hermitian=True) @ b[k] for k in range(runs)]
    )
    clearest = int(np.argmax(np.sum(alone * b, axis=1)))
    best, signs = -np.inf, np.ones(runs)
    for start in (np.ones(runs), np.where(alone @ alone[clearest] < 0, -1.0, 1.0)):
        s, value = start.copy(), gain(start)
        improved = True
        while improved:
            improved = False
            for k in range(runs):
                s[k] = -s[k]
                trial = gain(s)
                if trial > value * (1 + 1e-12):
                    value, improved = trial, True
                else:
                    s[k] = -s[k]
        if value > best:
            best, signs = value, s.copy()
    majority = (
        np.sign(signs.sum()) or signs[0]
    )  # the sign of all together is nobody's to know: the fewest turned
    return best, plain, signs * majority, count
