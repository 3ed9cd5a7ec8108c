"""Diagnosis, the sign of e^{jφ} in every run: (mθ, φ) and (mθ + π, φ + π) are the same wave.

A vector coherent with the phase (offset, feed-through, parasitic force) therefore stands with a
sign of its own in every run, whoever wrote it. The signs are chosen together where that clearly
explains what nothing else does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....fitting.causes import evidence, extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.own_columns import OwnColumns
from ....fitting.causes.sensitivities import find_effect_sensitivities
from ....fitting.least_squares import invert_information, square_over_covariance
from ..fits.refits import compute_bic, leave_out
from ..fits.scoring import compute_worth, score_effects
from ..fits.variants import Variant
from ..thresholds import SIGNS_TURNED, WORTH
from .inquiry import STATED
from .search_case import Case
from .selection import find_best_step

Array = np.ndarray
LARGER = 2
"""Larger causes beside which the signs are looked for, where nothing is plain without them."""
EVERY_CHOICE = 12
"""Runs up to which all 2^(R − 1) choices of signs are tried."""
CLIMBS = 4
"""Best of the choices tried from which single signs are turned."""


def orient_runs(
    base: ExtendedFit, candidates: Sequence[Variant], margin: float = 0.0
) -> ExtendedFit:
    """The fit with the phase of some runs turned by π, or as it was.

    Parameters
    ----------
    base
        The fit without causes.
    candidates
        Ways in which causes may stand.
    margin
        By how much the turned vector may promise less than another cause.

    Returns
    -------
    ExtendedFit
        Without causes.

    Examples
    --------
    No coherent vector is asked for:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_fit
    >>> from hrg_cli.stages.diagnosis.search.orientation import orient_runs
    >>> orient_runs(draw_fit(), draw_case().inquiry.candidates) is draw_fit()
    True
    """
    runs = len(base.series.names)
    coherent = [variant for variant in candidates if variant.effect.coherent]
    if runs < 2 or not coherent:
        return base
    beside, left = base, LARGER
    while True:
        signs, promised = _choose_signs(beside, coherent)
        if np.all(signs > 0):
            return base
        ranked = score_effects(beside, candidates)
        others = [compute_worth(s, v, beside) for s, v in ranked if s.visible]
        if promised + margin >= max(others, default=-np.inf):
            return _turn_phases(base, signs)
        # what is larger is taken in first: beside it the signs may be plain
        step = find_best_step(beside, ranked, STATED) if left else None
        if step is None or step[1].variant.effect.coherent:
            return base
        beside, left = step[0], left - 1


def _choose_signs(fit: ExtendedFit, coherent: Sequence[Variant]) -> tuple[Array, float]:
    """The signs (R,) of the coherent vector that promises most when turned, and what it promises
    (ΔBIC); all + where none clearly asks for others."""
    runs = len(fit.series.names)
    # 2 ln of the 2^(R − 1) ways to choose: what the best of so many makes of noise
    price = 2 * (runs - 1) * float(np.log(2))
    best, signs = -np.inf, np.ones(runs)
    columns = find_effect_sensitivities(fit.flow, [variant.wanted for variant in coherent])
    for values in columns:
        turned = _turn_signs(OwnColumns.from_values(fit.series, values), fit)
        promised = evidence.find_bic_gain(turned.gain, values.shape[-1], len(fit.residual)) - price
        # by what it promises with its price, so that of two coherent vectors the one with fewer
        # parameters gives the signs
        if turned.gain - turned.untouched > SIGNS_TURNED + price and promised > best:
            best, signs = promised, turned.signs
    return signs, best


def _turn_phases(fit: ExtendedFit, signs: Array) -> ExtendedFit:
    """The fit of the runs with those of sign − turned by π."""
    phase_rad = fit.series.phase_rad + np.pi * (signs < 0)[:, None]
    return extended_fit.fit(replace(fit.series, phase_rad=phase_rad), fit.point, fit.freedom)


def settle_signs(
    case: Case, start: ExtendedFit, explained: Callable[[ExtendedFit], Case]
) -> tuple[Case, ExtendedFit]:
    """The case, and the start of its search, with the signs that are best beside the causes found,
    which may have hidden a coherent vector or be one with the wrong signs.

    Where neither choice of signs is better by `WORTH`, the coherent causes of each stand in for
    those of the other.

    Parameters
    ----------
    case
        The causes and what they leave over.
    start
        The base fit that the search began from.
    explained
        The search from a start.

    Returns
    -------
    tuple
        The case and its start.

    Examples
    --------
    Without a coherent cause no sign is free:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.orientation import settle_signs
    >>> case, start = draw_found_case(), draw_mismatched_fit()
    >>> settle_signs(case, start, lambda base: case)[0] is case
    True
    """
    turned = _orient_beside(case.search.final, start, case.inquiry.candidates)
    if turned is None:
        return case, start
    (better, from_here), (other, _) = sorted(
        ((case, start), (explained(turned), turned)),
        key=lambda pair: compute_bic(pair[0].search.final),
    )
    if compute_bic(other.search.final) - compute_bic(better.search.final) < WORTH:
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
        one.add_rivals(more) if one.variant.effect.coherent else one for one in case.search.found
    )
    return replace(case, search=replace(case.search, found=found))


@dataclass(frozen=True)
class Turned:
    """The signs (R,) with which a coherent vector takes most of χ², what it then takes, and what it
    takes with every sign +."""

    gain: float
    untouched: float
    signs: Array


@dataclass(frozen=True)
class SignedNormal:
    """Normal equations of a vector of K parameters that stands with a sign of its own in each of R
    runs: A (R, K, R, K) and b (R, K) of the vector free in every run, beside the base fit.

    With signs s the vector's columns are Σ s_r X_r, so that sᵀAs and s·b are those of the K that
    all runs share: every choice of signs is judged without a look at the rows.
    """

    A: Array
    b: Array

    @classmethod
    def from_columns(cls, base: ExtendedFit, own: OwnColumns) -> SignedNormal:
        """Of every run's columns off what the base fit leaves free."""
        products = own.multiply_beside(base.basis, base.residual)
        size = np.sqrt(products.square.sum(axis=0))
        size[size == 0] = 1.0
        return cls(products.A / size[:, None, None] / size, products.b / size)

    def compute_gains(self, signs: Array) -> Array:
        """What the vector takes of χ² with each of several choices of signs (n, R), (n,)."""
        shared = np.einsum("nr,ricj,nc->nij", signs, self.A, signs, optimize=True)
        size = np.sqrt(np.einsum("nii->ni", shared))
        size[size == 0] = 1.0
        P = shared / size[:, :, None] / size[:, None, :]
        return evidence.compute_gains(P, signs @ self.b / size)[0]

    def compute_gain_of_each(self) -> float:
        """What a vector of its own in every run takes of χ²: no signs take more."""
        right = self.b.ravel()
        whole = self.A.reshape(len(right), -1)
        return square_over_covariance(right, whole, evidence.BLIND**2)

    def list_starts(self) -> Array:
        """Choices of signs (n, R) of which one is near the best: all of them where that is cheap,
        else all + and those by which the runs' own vectors point the way of one of theirs."""
        runs = len(self.b)
        if runs <= EVERY_CHOICE:
            bits = np.arange(2 ** (runs - 1))[:, None] >> np.arange(runs) & 1
            return 1.0 - 2.0 * bits
        alone = np.array(
            [invert_information(self.A[k, :, k], rcond=1e-6) @ self.b[k] for k in range(runs)]
        )
        return np.vstack([np.ones(runs), np.where(alone @ alone.T < 0, -1.0, 1.0)])

    def climb(self, start: Array) -> tuple[float, Array]:
        """(gain, signs) from a start on: the sign that gains most is turned while one does."""
        signs, gain = start, float(self.compute_gains(start[None])[0])
        while True:
            nearby = signs * (1 - 2 * np.eye(len(signs)))
            gains = self.compute_gains(nearby)
            best = int(np.argmax(gains))
            if not gains[best] > gain * (1 + 1e-12):
                return gain, signs
            signs, gain = nearby[best], float(gains[best])


def _turn_signs(own: OwnColumns, base: ExtendedFit) -> Turned:
    """The best signs found for columns of runs of which each may turn its sign.

    A climb from all + alone may end where two runs would have to turn together.
    """
    runs = len(own.parts)
    normal = SignedNormal.from_columns(base, own)
    untouched = float(normal.compute_gains(np.ones((1, runs)))[0])
    if normal.compute_gain_of_each() - untouched < SIGNS_TURNED:
        return Turned(untouched, untouched, np.ones(runs))
    starts = normal.list_starts()
    likely = starts[np.argsort(-normal.compute_gains(starts), kind="stable")[:CLIMBS]]
    gain, signs = max((normal.climb(start) for start in likely), key=lambda found: found[0])
    # the sign of all together is nobody's to know: the fewest runs are turned
    majority = np.sign(signs.sum()) or signs[0]
    return Turned(gain, untouched, signs * majority)
