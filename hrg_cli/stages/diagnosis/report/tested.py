"""Diagnosis, every cause that was looked for: its score, and how large it may be at most."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....effects.effect import IN_FREE_RUNS
from ....fitting.causes import evidence
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.variants import Variant
from ..search.inquiry import NoiseLevel
from ..search.search_case import Case

ONE_SIDED = 1.645
"""σ of a one-sided 95 % limit."""


def test_candidates(case: Case) -> list[dict[str, Any]]:
    """Every candidate: score beside the base model and beside what was found, 95 % upper limit of
    its size beside what was found.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    list of dict
        `tested` of the report.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case
    >>> from hrg_cli.stages.diagnosis.report.tested import test_candidates
    >>> [row["name"] for row in test_candidates(draw_case())]
    ['gain_mismatch']
    """
    search, noise, candidates = case.search, case.inquiry.noise, case.inquiry.candidates
    by_name = {v.effect.name: v for v in candidates}
    found = {one.variant.effect.name for one in search.found}
    last = {s.name: s for s in search.last}
    driven = bool(np.any(search.final.series.forced))
    out = []
    for score in search.first:
        later = last.get(score.name, score)
        limit, units = _limit(later, noise, by_name[score.name])
        if by_name[score.name].secants and score.name not in found:
            limit = _level_limit(
                search.final, noise, [v for v in candidates if v.effect.name == score.name]
            )
        first = by_name[score.name].effect.fitted()[0]
        row = {
            "name": score.name,
            "z": _significance(score, noise),
            "z_left": _significance(later, noise),
            "upper_limit": None if score.name in found else limit,
            "units": units or first.units,
            "std": [float(s * np.sqrt(noise.slow)) if np.isfinite(s) else None for s in later.std],
            "independence": score.independence,
            "visible": score.visible,
        }
        if score.visible and not driven and IN_FREE_RUNS in by_name[score.name].values:
            row["held"] = {IN_FREE_RUNS: 1.0}
        if not score.visible:
            same = by_name[score.name].effect.same_as_base
            row["why_not"] = (
                f"these runs cannot show it: it is {same}" if same else "these runs cannot show it"
            )
        out.append(row)
    return out


def _significance(score: Score, noise: NoiseLevel) -> float:
    if not score.visible:
        return 0.0
    return float(evidence.find_significance(score.gain / noise.slow, score.rank)[0])


def _limit(score: Score, noise: NoiseLevel, variant: Variant) -> tuple[float | None, str]:
    """Largest of the parameters' one-sided 95 % limits, in the unit of the parameter that has
    it."""
    if not score.visible:
        return None, ""
    names = list(variant.steps)
    units = {p.name: p.units for p in variant.effect.parameters}
    sizes = np.abs(score.estimate) + ONE_SIDED * score.std * np.sqrt(noise.slow)
    finite = [k for k in range(len(sizes)) if np.isfinite(sizes[k])]
    if not finite:
        return None, ""
    k = finite[0]
    same = [j for j in finite if units[names[j]] == units[names[k]]]
    return float(max(sizes[j] for j in same)), units[names[k]]


def _level_limit(fit: ExtendedFit, noise: NoiseLevel, levels: Sequence[Variant]) -> float | None:
    """Least of the values tried at which the data exclude what sets in there, in its full strength;
    None where they exclude none.

    What sets in above a level has no small size that grows in proportion: a score at one level says
    which part of it is there.
    """
    (name,) = levels[0].secants
    for variant in sorted(levels, key=lambda v: v.steps[name]):
        S = fit.find_sensitivities([variant.wanted])[0]
        score = evidence.score(variant.effect.name, fit.residual, S, fit.basis)
        k = list(variant.steps).index(name)
        if (
            score.visible
            and score.estimate[k] + ONE_SIDED * score.std[k] * np.sqrt(noise.slow)
            < variant.steps[name]
        ):
            return variant.values[name] + variant.steps[name]
    return None
