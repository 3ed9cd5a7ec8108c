"""Diagnosis, what the runs cannot tell apart: causes from the model, and causes from one
another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from ....effects import EFFECTS
from ....fitting.causes import designs, evidence
from ....fitting.causes.design_columns import FREQUENCY
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit
from ....physics import ellipse
from ..fits.variants import Variant
from ..thresholds import FAINT, INSEPARABLE
from .late_thermometers import list_late_thermometers
from .search_case import Case

Array = np.ndarray
NOTHING = 1e-5
"""σ of all rows together that a difference step, a hundredth of the typical size, makes where it is
more than rounding."""
WORTH_SAYING, SHARE_OF_LARGEST, MOST_NAMED = 0.1, 0.3, 3
"""Part of a cause that a fitted number takes upon itself from which it is named behind it, also
over the part of the one that takes most, and how many are."""
BASE = {
    "damping": "damping",
    "damping_cos": "damping split",
    "damping_sin": "damping split",
    "split_cos": "frequency split",
    "split_sin": "frequency split",
    "scale_factor": "scale factor",
    "second_order": "second order of the model",
}
"""The fitted coordinates in words."""


def list_not_separable(case: Case) -> list[dict[str, Any]]:
    """What the runs cannot tell apart beside what was found: causes from the model, causes from one
    another; the run that would.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    list of dict
        Effects, what of the base does the same, the next experiment.

    Examples
    --------
    Beside runs at rest and both ways a gain mismatch is told from everything asked:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.separability import list_not_separable
    >>> list_not_separable(draw_found_case())
    []
    """
    variants = {v.effect.name: v for v in case.inquiry.candidates}
    found = {one.variant.effect.name for one in case.search.found}
    scores = [score for score in case.search.last if score.name not in found]
    doubles = _find_doubles(case.search.final, scores, variants)
    out = [
        _entry([name], double.base, variants[name].effect.next_experiment)
        for name, double in doubles.items()
    ]
    out += _held_by_the_log(case.search.final)
    out += list_late_thermometers(case.search.final)
    pairs = _same_beside_the_base(scores, doubles) + _same_within_the_base(doubles, variants)
    groups = [[one.variant.effect.name, *one.rivals] for one in case.search.found if one.rivals]
    for group in groups + _join_pairs(pairs):
        experiments = dict.fromkeys(
            variants[name].effect.next_experiment for name in group if name in variants
        )
        out.append(_entry(group, None, "; ".join(e for e in experiments if e)))
    return out


def name_doubles(case: Case) -> Case:
    """The case where a cause that is a change of the base model, seen by a number that is known, is
    told from no other such cause: that number says how large the change is, and not whose.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    Case
        With the rivals of such causes.

    Examples
    --------
    A gain mismatch is none:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.separability import name_doubles
    >>> name_doubles(draw_found_case()).search.found[0].rivals
    ()
    """
    doubles = [effect.name for effect in EFFECTS if effect.same_as_base]

    found = tuple(
        one.add_rivals(doubles) if one.variant.effect.name in doubles else one
        for one in case.search.found
    )
    return replace(case, search=replace(case.search, found=found))


def _entry(effects: list[str], base: str | None, next_experiment: str) -> dict[str, Any]:
    """One group of the report: causes that do the same, and what of the base model does it too."""
    return {"effects": effects, "base": base, "next_experiment": next_experiment}


@dataclass(frozen=True)
class Double:
    """A cause that does what the base model does: what of it, and the orthonormal directions (N, k)
    of what the cause does."""

    base: str
    span: Array


def _find_doubles(
    fit: ExtendedFit, scores: Sequence[Score], variants: Mapping[str, Variant]
) -> dict[str, Double]:
    """The causes that only what no model is exact enough for tells from the base model."""
    doubles: dict[str, Double] = {}
    for score in scores:
        if score.visible and score.independence > FAINT:
            continue
        variant = variants[score.name]
        S = fit.find_sensitivities([variant.wanted])[0]
        # a parameter whose difference step moves no row is rounding, and its direction chance
        seen = np.linalg.norm(S, axis=0) * np.array(list(variant.steps.values())) > NOTHING
        base = variant.effect.same_as_base or _hidden_behind(fit, S[:, seen])
        if base and np.any(S):  # what does nothing in these runs is no double of anything
            doubles[score.name] = Double(base, designs.orthonormalise(S[:, seen], 1e-6))
    return doubles


def _held_by_the_log(fit: ExtendedFit) -> list[dict[str, Any]]:
    """Causes of the quadrature loop where its command is logged: the log is the force itself, so
    that whatever made the loop command it is in the model already."""
    if not np.any(fit.series.quadrature_drive):
        return []
    gain, std = _loop_gain(fit)
    base = (
        "the logged command of the quadrature loop, which holds all it does; by the log its gain is"
        f" {gain:.3g} ± {std:.1g} 1/s"
    )
    return [
        _entry([effect.name], base, effect.next_experiment)
        for effect in EFFECTS
        if effect.in_the_log == "quadrature_drive"
    ]


def _same_beside_the_base(
    scores: Sequence[Score], doubles: Mapping[str, Double]
) -> list[tuple[str, str]]:
    """Pairs of causes of which the parts that the base model leaves are parallel."""
    visible = [score for score in scores if score.visible and score.name not in doubles]
    return [
        (a.name, b.name)
        for a, b in combinations(visible, 2)
        if a.rank == b.rank and evidence.correlate_spaces(a, b) > INSEPARABLE
    ]


def _same_within_the_base(
    doubles: Mapping[str, Double], variants: Mapping[str, Variant]
) -> list[tuple[str, str]]:
    """Pairs of doubles that do the same: of these the base model leaves nothing to compare, so they
    are compared whole. What is the base model by definition is not listed with others as well."""
    compared = [name for name in doubles if not variants[name].effect.same_as_base]
    return [
        (a, b) for a, b in combinations(compared, 2) if _is_within(doubles[a].span, doubles[b].span)
    ]


def _is_within(a: Array, b: Array) -> bool:
    """Whether the smaller of two spans (orthonormal columns) lies in the other: nothing it does is
    beyond the other."""
    overlap = np.linalg.svd(a.T @ b, compute_uv=False)
    return bool(len(overlap) and overlap[-1] > INSEPARABLE)


def _join_pairs(pairs: Sequence[tuple[str, str]]) -> list[list[str]]:
    """Groups of names connected by pairs."""
    groups: list[list[str]] = []
    for pair in pairs:
        touched = [g for g in groups if set(g) & set(pair)]
        groups = [g for g in groups if g not in touched] + [
            list(dict.fromkeys([*(n for g in touched for n in g), *pair]))
        ]
    return groups


def _hidden_behind(fit: ExtendedFit, S: Array) -> str:
    """What in the fit does what the effect of sensitivities S would, largest first; empty where the
    effect does nothing in these runs."""
    size = np.linalg.norm(S, axis=0)
    if not np.all(np.isfinite(size)) or not len(size):
        return ""
    # (JᵀJ)⁻¹Jᵀs, the fitted numbers that swallow the effect, each times the length of its own
    # column: how much of s of length one it takes upon itself
    swallowed = (
        np.abs(fit.covariance @ fit.design.multiply_transposed(S / size))
        * fit.design.compute_lengths()[:, None]
    )
    part = np.max(swallowed, axis=1)
    shares: dict[str, float] = {}
    for kind, name, columns in fit.layout.groups():
        word = {
            "coordinate": BASE.get(name, ""),
            "run": "the runs' own frequencies",
            "effect": name,
        }[kind]
        # of a run's own numbers the start is nobody's cause: its frequency alone is named
        share = part[columns][FREQUENCY:] if kind == "run" else part[columns]
        shares[word] = max(shares.get(word, 0.0), float(share.max(initial=0.0)))
    least = max(WORTH_SAYING, SHARE_OF_LARGEST * max(shares.values(), default=0.0))
    ordered = sorted(shares.items(), key=lambda pair: -pair[1])
    return ", ".join([word for word, share in ordered if share > least][:MOST_NAMED])


def _loop_gain(fit: ExtendedFit) -> tuple[float, float]:
    """Gain k of the logged command −k a_B of the forced runs, and its σ, 1/s."""
    good = (fit.series.weight > 0) & (fit.series.forced > 0)
    quadrature, command = (
        ellipse.find_wave(fit.series.envelope[good], 1)[1],
        fit.series.quadrature_drive[good],
    )
    power = float(quadrature @ quadrature)
    gain = -float(quadrature @ command) / power
    return gain, float(np.sqrt(np.mean((command + gain * quadrature) ** 2) / power))
