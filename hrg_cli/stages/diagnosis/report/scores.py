"""Diagnosis, the scores: what these runs say of the size of every cause, named or not, so that a
lot can pool it.

With s the whitened sensitivity of one parameter, r the residual of the final fit and Q a basis of
that fit's design, s⊥ = s − Q Qᵀ s. The one-step estimate beside the fit is s⊥ᵀ r/|s⊥|² with
σ = 1/|s⊥|, and ρ_kl = s⊥_kᵀ s⊥_l/(|s⊥_k| |s⊥_l|) tells how far two causes do the same: from these
three the estimate of a cause beside any others follows without the runs. A cause that was found is
in the fit; its value is the fitted one, and all others are beside it already (ρ = 0).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from ....effects.effect import Effect
from ..closing.sized import Sized
from ..fits.variants import Variant
from ..search.search_case import Case
from ..search.selection import Search
from ..thresholds import FAINT

DIGITS = 6
"""Digits that are kept; a correlation closer to one than that is no matter of the noise."""


def tabulate_scores(case: Case, sized: Sized) -> dict[str, list[Any]]:
    """The scores of the candidates that are open, as a lot pools them.

    Parameters
    ----------
    case
        The causes and what they leave over.
    sized
        The fit whose numbers are told.

    Returns
    -------
    dict
        `names` ("effect.parameter"), `units`, `value` (off neutral), `std`, and the lower triangle
        of `correlation`, row by row without the diagonal.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.sized import Sized
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case
    >>> from hrg_cli.stages.diagnosis.report.scores import tabulate_scores
    >>> found = tabulate_scores(draw_case(), Sized.from_case(draw_case()))
    >>> found["names"], bool(abs(found["value"][0]) < 4 * found["std"][0])
    (['gain_mismatch.gain'], True)
    """
    fit = sized.fit
    open_ones = _poolable(case.search, case.inquiry.candidates)
    names = [f"{v.effect.name}.{parameter}" for v in open_ones for parameter in v.steps]
    units = [_unit(v.effect, parameter) for v in open_ones for parameter in v.steps]
    value, std, correlation = np.zeros(0), np.zeros(0), np.zeros((0, 0))
    if open_ones:
        S = np.concatenate(fit.find_sensitivities([v.wanted for v in open_ones]), axis=1)
        with np.errstate(all="ignore"):
            size = np.linalg.norm(S, axis=0)
            usable = np.isfinite(size) & (size > 0)
            unit = np.where(usable, S / np.where(usable, size, 1.0), 0.0)
        own = fit.basis.project_out(fit.basis.project_out(unit))
        left = np.linalg.norm(own, axis=0)
        told = usable & (left > FAINT)
        own, beside = own[:, told] / left[told], left[told] * size[told]
        value, std = own.T @ fit.residual / beside, np.sqrt(sized.factor) / beside
        correlation = own.T @ own
        names = [name for name, there in zip(names, told, strict=True) if there]
        units = [name for name, there in zip(units, told, strict=True) if there]
    found = [
        (f"{effect.name}.{p.name}", _unit(effect, p.name), *_fitted(sized, effect, p.name))
        for effect, _ in fit.point.active
        if _has_a_sign(effect)
        for p in effect.fitted()
    ]
    known = [row for row in found if np.isfinite(row[3]) and row[3] > 0]
    rows = [correlation[k, :k] for k in range(len(names))]
    rows += [np.zeros(len(names) + k) for k in range(len(known))]
    return {
        "names": names + [row[0] for row in known],
        "units": units + [row[1] for row in known],
        "value": [_short(v) for v in value] + [_short(row[2]) for row in known],
        "std": [_short(v) for v in std] + [_short(row[3]) for row in known],
        "correlation": [[round(float(v), DIGITS) for v in row] for row in rows],
    }


def _poolable(search: Search, candidates: Sequence[Variant]) -> list[Variant]:
    """The candidates not in the fit that have one start, a slope at it, and a sign that means the
    same in every gyro."""
    taken = {effect.name for effect, _ in search.final.point.active}
    thinkable = {score.name for score in search.last}
    starts = Counter(v.effect.name for v in candidates)
    return [
        v
        for v in candidates
        if v.effect.name in thinkable - taken
        and starts[v.effect.name] == 1
        and not v.secants
        and _has_a_sign(v.effect)
    ]


def _has_a_sign(effect: Effect) -> bool:
    """Whether a value means the same in another gyro's runs: no instant of one run, no vector that
    stands with an unknown phase."""
    return not (effect.coherent or effect.of_one_run or effect.sets_in)


def _fitted(sized: Sized, effect: Effect, name: str) -> tuple[float, float]:
    """Value off neutral and σ of a parameter in the fit."""
    neutral = next(p.neutral for p in effect.parameters if p.name == name)
    value = sized.fit.values(effect.name)[name]
    others = [other.values(effect.name)[name] for other in sized.find_others(effect.name)]
    return value - neutral, sized.std(sized.fit.parameter_std(effect.name, name), value, others)


def _unit(effect: Effect, name: str) -> str:
    return next(p.units for p in effect.parameters if p.name == name)


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
