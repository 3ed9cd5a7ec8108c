"""Diagnosis, two causes at once: what both would take of the residual, and the refit of the best.

One at a time, the first cause taken may be one whose shape lies between two others (a gain that
drifts, where the damping follows temperature and amplitude): each of the two is then worse than it,
beside it neither is worth its price, and no exchange of one leads there.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....fitting.causes import evidence
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.refits import compute_bic, leave_out, refit
from ..fits.scoring import is_gross, score_effects
from ..fits.variants import Variant
from ..thresholds import FURTHER, WORTH
from .gain import predicts_better

TRIED = 3
"""Pairs refitted, those that promise most."""
ONE_CAUSE = 1e-6
"""Part of a cause's direction beside another below which both are one to these data."""

Array = np.ndarray
Scored = tuple[Score, Variant]


@dataclass(frozen=True)
class Pair:
    """Two causes, the stronger first, and the criterion (ΔBIC) that both together promise."""

    promise: float
    both: tuple[Scored, Scored]

    def is_of(self, names: set[str]) -> bool:
        """Whether they are those of these names."""
        return {score.name for score, _ in self.both} == names


def list_promising_pairs(
    fit: ExtendedFit, ranked: Sequence[Scored], slow: float = 1.0
) -> list[Pair]:
    """All pairs of visible causes beside a fit, what promises most first.

    With Q_a, Q_b orthonormal beside the fit, a = Q_aᵀ r, b = Q_bᵀ r and W = Q_aᵀ Q_b, both take
    |a|² + |R⁻ᵀ (b − Wᵀ a)|² of χ², RᵀR = 1 − WᵀW. What happens at an instant is left out: its place
    is chosen beside what is known.

    Parameters
    ----------
    fit
        Of the runs.
    ranked
        Scores and variants of causes beside it.
    slow
        Variance of the noise over the stated one.

    Returns
    -------
    list of Pair
        Of each two visible causes.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits import scoring, variants
    >>> from hrg_cli.stages.diagnosis.search.pairs import list_promising_pairs
    >>> fit, effects = (
    ...     draw_mismatched_fit(),
    ...     map(find, ("gain_mismatch", "electrode_nonorthogonality")),
    ... )
    >>> ranked = scoring.score_effects(fit, variants.list_variants([*effects], fit))
    >>> [[score.name for score, _ in pair.both] for pair in list_promising_pairs(fit, ranked)]
    [['gain_mismatch', 'electrode_nonorthogonality']]
    """
    seen = [(score, one) for score, one in ranked if score.visible and not one.effect.of_one_run]
    if len(seen) < 2:
        return []
    products, along = _multiply_spaces([score for score, _ in seen], fit.residual)
    ends = np.cumsum([0, *(score.rank for score, _ in seen)])
    own = [slice(start, end) for start, end in itertools.pairwise(ends.tolist())]
    found = []
    for i, k in itertools.combinations(range(len(seen)), 2):
        W, a = products[own[i], own[k]], along[own[i]]
        beside, rank = _find_fall(products[own[k], own[k]] - W.T @ W, along[own[k]] - W.T @ a)
        rows, gains = len(fit.residual), ((float(a @ a), seen[i][0].rank), (beside, rank))
        promise = sum(evidence.find_bic_gain(gain / slow, count, rows) for gain, count in gains)
        both = sorted((seen[i], seen[k]), key=lambda pair: -pair[0].gain)
        found.append(Pair(promise, (both[0], both[1])))
    return sorted(found, key=lambda pair: -pair.promise)


def recall_pairs(fit: ExtendedFit, ranked: Sequence[Scored], slow: float) -> list[Pair]:
    """`list_promising_pairs`, remembered beside the fit.

    Parameters
    ----------
    fit
        Of the runs.
    ranked
        Scores and variants of causes beside it.
    slow
        Variance of the noise over the stated one.

    Returns
    -------
    list of Pair
        Of each two visible causes.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> from hrg_cli.stages.diagnosis.search.pairs import recall_pairs
    >>> ranked = score_effects(draw_mismatched_fit(), draw_found_case().inquiry.candidates)
    >>> recall_pairs(draw_mismatched_fit(), ranked, 1.0)
    []
    """
    names = frozenset(score.name for score, _ in ranked)
    pairs: list[Pair] = fit.recall(
        ("pairs", slow, names), lambda: list_promising_pairs(fit, ranked, slow)
    )
    return pairs


def _multiply_spaces(scores: Sequence[Score], residual: Array) -> tuple[Array, Array]:
    """QᵀQ and Qᵀr of the scores' spaces Q (N, k) side by side: with S their columns before the part
    along the basis is taken off and B that part, SᵀS − BᵀB."""
    basis = scores[0].basis
    S = np.concatenate([one.columns @ one.directions for one in scores], axis=1)
    B = basis.project(S)
    return S.T @ S - B.T @ B, S.T @ residual - B.T @ basis.project(residual)


def find_hidden_pair(
    fit: ExtendedFit, ranked: Sequence[Scored], slow: float = 1.0
) -> tuple[ExtendedFit, tuple[Scored, Scored], tuple[str, ...]] | None:
    """Two causes that are worth their price together where neither is alone: what one does away
    from the other is then little beside what it does against it (a damping that grows with the
    amplitude, and a friction that falls with it).

    The second cause of two owes `FURTHER` besides, as does every one after the first.

    Parameters
    ----------
    fit
        Of the runs.
    ranked
        Scores and variants of causes beside it.
    slow
        Variance of the noise over the stated one.

    Returns
    -------
    tuple or None
        The fit with both, their scores with their variants, and the causes of pairs that do as
        well. None where no two are worth as much, or these predict what they have not seen no
        better.

    Examples
    --------
    One cause makes no pair:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> from hrg_cli.stages.diagnosis.search.pairs import find_hidden_pair
    >>> ranked = score_effects(draw_mismatched_fit(), draw_found_case().inquiry.candidates)
    >>> find_hidden_pair(draw_mismatched_fit(), ranked) is None
    True
    """
    least = WORTH + FURTHER
    trials = []
    for pair in recall_pairs(fit, ranked, slow)[:TRIED]:
        if pair.promise < least:
            break
        both = fit_pair(fit, pair)
        if both is not None:
            trials.append((compute_bic(both[0]), *both))
    trials.sort(key=lambda trial: trial[0])
    if not trials or (compute_bic(fit) - trials[0][0]) / slow < least:
        return None
    level, best, chosen = trials[0]
    if not predicts_better(fit, best):
        return None
    names = {score.name for score, _ in chosen}
    close = [pair for other, _, pair in trials if other < level + WORTH * slow]
    others = [score.name for pair in close for score, _ in pair if score.name not in names]
    return best, chosen, tuple(dict.fromkeys(others))


def _find_fall(power: Array, along: Array) -> tuple[float, int]:
    """The fall of χ² by directions of a Gram matrix (n, n), and their number."""
    size, turned = np.linalg.eigh(power)
    kept = size > ONE_CAUSE
    return float(np.sum((turned.T @ along)[kept] ** 2 / size[kept])), int(kept.sum())


def fit_pair(fit: ExtendedFit, pair: Pair) -> tuple[ExtendedFit, tuple[Scored, Scored]] | None:
    """The fit with both causes, and the score of each beside the other; None where they do not come
    out as such causes can be.

    Parameters
    ----------
    fit
        Of the runs.
    pair
        Two causes.

    Returns
    -------
    tuple or None
        The fit, and the two scores with their variants.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits import scoring, variants
    >>> from hrg_cli.stages.diagnosis.search.pairs import fit_pair, list_promising_pairs
    >>> fit, effects = (
    ...     draw_mismatched_fit(),
    ...     map(find, ("gain_mismatch", "electrode_nonorthogonality")),
    ... )
    >>> ranked = scoring.score_effects(fit, variants.list_variants([*effects], fit))
    >>> both, _ = fit_pair(fit, list_promising_pairs(fit, ranked)[0])
    >>> round(both.values("gain_mismatch")["gain"], 2)
    0.02
    """
    (_, first), (_, second) = pair.both
    trial: ExtendedFit | None = fit
    for one in (first, second):
        trial = _fit_with(trial, one) if trial is not None else None
    if trial is None:
        return None
    scored = []
    for one in (first, second):
        without = leave_out(trial, one.effect.name)
        # a lag is none of anything without the cause that lags
        alone = [] if without is None else score_effects(without, [one])
        if not alone:
            return None
        scored.append(alone[0])
    return trial, (scored[0], scored[1])


def _fit_with(fit: ExtendedFit, variant: Variant) -> ExtendedFit | None:
    """The fit with one cause more, None where it fails."""
    scored = [pair for pair in score_effects(fit, [variant]) if pair[0].visible]
    trials = refit(fit, scored, scored)
    return trials[0][1] if trials else None


def find_better_pair(
    fit: ExtendedFit, names: set[str], candidates: Sequence[Variant], slow: float
) -> tuple[ExtendedFit, tuple[Scored, Scored]] | None:
    """What is clearly better than two of a fit's causes, beside the others; None where nothing is,
    or where without them the misfit is so gross that scores say little.

    Parameters
    ----------
    fit
        With the causes.
    names
        Of the two.
    candidates
        Ways in which causes may stand.
    slow
        Variance of the noise over the stated one.

    Returns
    -------
    tuple or None
        The fit, and the two scores with their variants.

    Examples
    --------
    One candidate makes no pair:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.pairs import find_better_pair
    >>> case = draw_found_case()
    >>> find_better_pair(case.search.final, {"gain_mismatch"}, case.inquiry.candidates, 1.0) is None
    True
    """
    without = leave_out(fit, *names)
    if without is None or is_gross(without):
        return None
    needed = (compute_bic(without) - compute_bic(fit)) / slow
    best, level = None, compute_bic(fit) - WORTH * slow
    pairs = list_promising_pairs(without, score_effects(without, candidates), slow)
    for pair in itertools.islice((one for one in pairs if not one.is_of(names)), TRIED):
        # a linear model keeps what is promised and no more; the pairs behind this one promise less
        if pair.promise <= needed:
            break
        trial = fit_pair(without, pair)
        if trial is not None and compute_bic(trial[0]) < level:
            best, level = trial, compute_bic(trial[0])
    return best
