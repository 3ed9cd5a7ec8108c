"""Diagnosis, the sign of e^{jφ} in every run: (mθ, φ) and (mθ + π, φ + π) are the same wave.

A vector coherent with the phase (offset, feed-through, parasitic force) therefore stands with a
sign of its own in every run, whoever wrote it. The signs are chosen together where that clearly
explains what nothing else does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ....fitting.causes import evidence, extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.refits import bic, leave_out
from ..fits.scoring import score_effects, worth
from ..fits.variants import Variant
from ..thresholds import WORTH
from .case import Case

Array = np.ndarray
CLEARLY = 30.0
"""χ² that turned signs must gain, beyond the choice among 2^(R − 1) of them."""


def orient_runs(
    base: ExtendedFit, candidates: Sequence[Variant], margin: float = 0.0
) -> ExtendedFit:
    """The fit with the phase of some runs turned by π, or as it was; margin: by how much the turned
    vector may promise less than another cause."""
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
    if best + margin < max(others, default=-np.inf):
        return base
    turned = base.series.phase_rad + np.pi * (signs < 0)[:, None]
    return extended_fit.fit(replace(base.series, phase_rad=turned), base.point, base.freedom)


def settle_signs(
    case: Case, start: ExtendedFit, explained: Callable[[ExtendedFit], Case]
) -> tuple[Case, ExtendedFit]:
    """The case, and the start of its search, with the signs that are best beside the causes found,
    which may have hidden a coherent vector or be one with the wrong signs.

    explained: the search from a start. Where neither choice of signs is better by `WORTH`, the
    coherent causes of each stand in for those of the other.
    """
    turned = _orient_beside(case.search.final, start, case.inquiry.candidates)
    if turned is None:
        return case, start
    (better, from_here), (other, _) = sorted(
        ((case, start), (explained(turned), turned)), key=lambda pair: bic(pair[0].search.final)
    )
    if bic(other.search.final) - bic(better.search.final) < WORTH:
        better = _with_rivals_of(better, other)
    return better, from_here


def _orient_beside(
    final: ExtendedFit, start: ExtendedFit, candidates: Sequence[Variant]
) -> ExtendedFit | None:
    """The start with the phases as they may stand as well beside all causes but the coherent ones;
    None where there is no other way."""
    if not final.point.active:
        return None
    coherent = [effect.name for effect, _ in final.point.active if effect.coherent]
    beside = leave_out(final, *coherent, base=start) if coherent else final
    if beside is None:
        return None
    turned = orient_runs(beside, candidates, margin=WORTH)
    if turned is beside:
        return None
    series = replace(start.series, phase_rad=turned.series.phase_rad)
    return extended_fit.fit(series, start.point, start.freedom)


def _with_rivals_of(case: Case, other: Case) -> Case:
    """The case whose coherent causes are not told from those of another."""
    named = {one.variant.effect.name for one in case.search.found}
    others = [one.variant.effect.name for one in other.search.found if one.variant.effect.coherent]
    more = [name for name in others if name not in named]
    found = tuple(
        replace(one, rivals=tuple(dict.fromkeys([*one.rivals, *more])))
        if one.variant.effect.coherent
        else one
        for one in case.search.found
    )
    return replace(case, search=replace(case.search, found=found))


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
