"""Diagnosis, what causes that are neither named nor excluded may do to the base parameters.

A cause too small to be named may still move a coordinate by many of its σ: a friction of 4 σ that
falls with the amplitude is a constant damping of 14. Given the data, a cause m is there with
    P_m = o_m / (1 + Σ o),    o_m = exp((ΔBIC_m − q `FURTHER`)/2),
q = 1 for one cause and 2 for two together, ΔBIC_m what it would be worth; where it is, the
coordinates stand by δ_m = C Jᵀ S p̂_m elsewhere, with S its sensitivity and p̂_m its estimate beside
the model. Averaged over the models (Hoeting et al. 1999) the mean square of the coordinates' errors
is their covariance C and Σ P_m δ_m δ_mᵀ.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....fitting.causes.evidence import Score
from ....fitting.causes.moves import move_by_causes
from ..fits.scoring import compute_worth, is_gross, score_effects
from ..search.pairs import recall_pairs
from ..search.search_case import Case
from ..thresholds import FURTHER

Array = np.ndarray
CERTAIN = 100.0
"""Logarithm of odds beyond which more of them says no more."""
LIKELY = 1e-3
"""Odds against nothing at all from which a cause, or two, are looked at."""


def estimate_moves_of_unnamed(case: Case) -> dict[str, Array]:
    """By how much the base model's coordinates may be moved by each cause that is neither named nor
    excluded.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    dict
        By the cause's name, columns (7, k), whose squares add up to the mean square; none where the
        misfit is so gross that a score says nothing of a size.

    Examples
    --------
    Beside a gain mismatch that is named nothing is likely:

    >>> from hrg_cli.stages.diagnosis.closing.unnamed import estimate_moves_of_unnamed
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> estimate_moves_of_unnamed(draw_found_case())
    {}
    """
    fit = case.search.final
    if is_gross(fit):
        return {}
    likely = list(_list_likely(case))
    whole = 1 + sum(odds for odds, _ in likely)
    moves: dict[str, list[Array]] = {}
    for odds, scores in likely:
        moved = np.sqrt(odds / whole) * move_by_causes(fit, scores)
        for one in scores:
            moves.setdefault(one.name, []).append(moved / np.sqrt(len(scores)))
    return {name: np.stack(columns, axis=1) for name, columns in moves.items()}


def _list_likely(case: Case) -> Iterator[tuple[float, list[Score]]]:
    """Causes, and pairs of them, that may be there: their odds against nothing, and their scores.

    What happens at an instant moves what follows it alone, and is left out."""
    fit, slow = case.search.final, case.inquiry.noise.slow
    every = score_effects(fit, case.inquiry.candidates)
    ranked = [pair for pair in every if pair[0].visible and not pair[1].effect.of_one_run]
    alone = ((compute_worth(score, one, fit, slow), [score]) for score, one in ranked)
    together = (
        (pair.promise, [score for score, _ in pair.both]) for pair in recall_pairs(fit, every, slow)
    )
    for worth, scores in (*alone, *together):
        odds = float(np.exp(min((worth - len(scores) * FURTHER) / 2, CERTAIN)))
        if odds > LIKELY:
            yield odds, scores
