"""Diagnosis, what the runs cannot tell apart: causes from the model, and causes from one another."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np

from ....effects import EFFECTS
from ....fitting.causes import designs, evidence
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.layout import FREQUENCY
from ....physics import ellipse
from .case import Case

Array = np.ndarray
FAINT = 0.02
"""Independence beside the base model below which a cause is told from it only by what no model is
exact enough for."""
SAME = 0.999
"""Cosine from which two causes, or one and a part of the other, do the same in these runs."""
NOTHING = 1e-5
"""σ of all rows together that a difference step, a hundredth of the typical size, makes where it is
more than rounding."""
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


def not_separable(case: Case) -> list[dict[str, Any]]:
    """What the runs cannot tell apart beside what was found: causes from the model, causes from one
    another; the run that would."""
    search, out = case.search, list[dict[str, Any]]()
    by_name = {v.effect.name: v for v in case.inquiry.candidates}
    fit, found = search.final, {one.variant.effect.name for one in search.found}
    open_ones = [s for s in search.last if s.name not in found]
    hidden: dict[str, Array] = {}
    for score in open_ones:
        if score.visible and score.independence > FAINT:
            continue
        variant = by_name[score.name]
        S = fit.sensitivities([variant.wanted])[0]
        seen = np.linalg.norm(S, axis=0) * np.array(list(variant.steps.values())) > NOTHING
        base = variant.effect.same_as_base or _hidden_behind(fit, S[:, seen])
        if base and np.any(S):  # what does nothing in these runs is no double of anything
            out.append(
                {
                    "effects": [score.name],
                    "base": base,
                    "next_experiment": variant.effect.next_experiment,
                }
            )
            hidden[score.name] = designs.orthonormal(S[:, seen], 1e-6)
    if np.any(fit.series.quadrature_drive):
        gain, std = _loop_gain(fit)
        base = (
            "the logged command of the quadrature loop, which holds all it does; by the log its"
            f" gain is {gain:.3g} ± {std:.1g} 1/s"
        )
        out += [
            {"effects": [e.name], "base": base, "next_experiment": e.next_experiment}
            for e in EFFECTS
            if e.in_the_log == "quadrature_drive"
        ]
    visible = [s for s in open_ones if s.visible and s.name not in hidden]
    pairs = [
        (a.name, b.name)
        for a, b in combinations(visible, 2)
        if a.rank == b.rank and evidence.correlate_spaces(a, b) > SAME
    ]
    pairs += [
        (a, b)
        for a, b in combinations((n for n in hidden if not by_name[n].effect.same_as_base), 2)
        if _within(hidden[a], hidden[b])
    ]
    groups = [[one.variant.effect.name, *one.rivals] for one in search.found if one.rivals]
    for group in groups + _joined(pairs):
        sentences = dict.fromkeys(
            by_name[name].effect.next_experiment for name in group if name in by_name
        )
        out.append(
            {
                "effects": group,
                "base": None,
                "next_experiment": "; ".join(s for s in sentences if s),
            }
        )
    return out


def _within(a: Array, b: Array) -> bool:
    """Whether the smaller of two spans (orthonormal columns) lies in the other: nothing it does is
    beyond the other."""
    overlap = np.linalg.svd(a.T @ b, compute_uv=False)
    return bool(len(overlap) and overlap[-1] > SAME)


def _joined(pairs: Sequence[tuple[str, str]]) -> list[list[str]]:
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
    part = np.max(
        np.abs(fit.covariance @ fit.design.along(S / size)) * fit.design.sizes()[:, None], axis=1
    )
    shares: dict[str, float] = {}
    for kind, name, columns in fit.layout.groups():
        word = {
            "coordinate": BASE.get(name, ""),
            "run": "the runs' own frequencies",
            "effect": name,
        }[kind]
        share = part[columns][FREQUENCY:] if kind == "run" else part[columns]
        shares[word] = max(shares.get(word, 0.0), float(share.max(initial=0.0)))
    largest = max(shares.values(), default=0.0)
    named = [
        word
        for word, share in sorted(shares.items(), key=lambda pair: -pair[1])
        if share > 0.3 * largest and share > 0.1
    ]
    return ", ".join(named[:3])


def _loop_gain(fit: ExtendedFit) -> tuple[float, float]:
    """Gain k of the logged command −k a_B of the forced runs, and its σ, 1/s."""
    good = (fit.series.weight > 0) & (fit.series.forced > 0)
    quadrature, command = (
        ellipse.wave(fit.series.envelope[good], 1)[1],
        fit.series.quadrature_drive[good],
    )
    power = float(quadrature @ quadrature)
    gain = -float(quadrature @ command) / power
    return gain, float(np.sqrt(np.mean((command + gain * quadrature) ** 2) / power))
