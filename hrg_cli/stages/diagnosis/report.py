"""Diagnosis, the JSON: verdict, values, effects with rivals and next experiments, gain, upper
limits, remainder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from ...effects import EFFECTS
from ...fitting.causes import evidence
from ...fitting.causes.evidence import Score
from ...fitting.causes.extended_fit import Fit, flat
from ...fitting.causes.layout import FREQUENCY
from ...fitting.envelopes.coordinates import COORDINATES, physical
from ...physics.resonator import PARAMETERS
from ...records import Resonator
from .gain import Gain, figures
from .held_shapes import one_sigma_off
from .remainder import Remainder, Term
from .search import Found, Search, Variant

Array = np.ndarray
ONE_SIDED = 1.645
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
TOLD = 0.7
"""Part of its prior's σ that a number keeps where the data tell nothing of it: they hold no more
than the prior does."""
WRONG = 4.0
"""σ from which a base value counts as wrong."""


def report(
    verdict: str,
    search: Search,
    sized: Sized,
    remainder: Remainder | None,
    gain: Gain,
    noise_factor: float,
    resonator: Resonator | None,
    candidates: Sequence[Variant],
    untouched: Fit,
) -> dict[str, Any]:
    """Everything the contract names, and the steps that led there; `sized`: the final fit with what
    widens its σ; `untouched`: the base fit before tones and steps were taken out."""
    by_name = {v.effect.name: v for v in candidates}
    return {
        "verdict": verdict,
        "mode_number": search.final.series.mode_number,
        "baseline": _figures(untouched),
        "values": values(sized, resonator),
        "effects": [_effect(one, sized, by_name) for one in search.found],
        "after": _figures(search.final),
        "gain": figures(gain),
        "tested": _tested(search, noise_factor, by_name, candidates),
        "not_separable": _not_separable(search, by_name),
        "noise_factor": noise_factor,
        "correlations": _correlations(search),
        "remainder": None if remainder is None else describe(remainder),
        "extended_model": None,
    }


def _figures(fit: Fit) -> dict[str, float]:
    """χ² a degree of freedom and the residual's rms in the signals' unit."""
    weight = fit.series.weight[fit.rows[:, 0], fit.rows[:, 1]]
    plain = flat(fit.series, fit.prediction.residual()) / weight
    return {"chi2_per_dof": fit.chi2 / fit.dof, "residual_rms": float(np.sqrt(np.mean(plain**2)))}


@dataclass(frozen=True)
class Sized:
    """The fit whose numbers are told, its variances times `factor`, and the fit beside the open
    terms where there are any.

    What the catalogue does not hold pulls at every number: what it leaves over widens the noise,
    and by how much a number moves once it is described as well as it can be counts as an error of
    its own.
    """

    fit: Fit
    beside: Fit
    factor: float
    off: Sequence[Fit] = ()
    """Refits with a held shape moved by one σ (`held_shapes`)."""

    @classmethod
    def of(cls, final: Fit, remainder: Remainder | None, noise_factor: float) -> Sized:
        """From the final fit of the catalogue's causes and what is left over."""
        factor = max(noise_factor, final.chi2 / final.dof, 1.0)
        beside = final if remainder is None else remainder.fit
        return cls(final, beside, factor, one_sigma_off(final, factor))

    def std(self, std: float, value: float, others: Sequence[float]) -> float:
        """Standard deviation of a number with σ `std` in the fit, which stands at `others` in each
        of the other fits."""
        return float(np.sqrt(self.factor * std**2 + sum((value - v) ** 2 for v in others)))

    @property
    def others(self) -> list[Fit]:
        """Fits in which a number stands elsewhere by what counts as an error of its own."""
        return [self.beside, *self.off]


def values(sized: Sized, resonator: Resonator | None) -> list[dict[str, Any]]:
    """Base parameters as fitted; beside the user's, how many σ they moved and whether that makes
    them wrong."""
    fit, noise_factor = sized.fit, sized.factor
    numbers, slopes = physical(fit.point.p, fit.series.mode_number)
    covariance = fit.coordinate_covariance()
    stds = np.sqrt(np.maximum(np.diag(slopes @ covariance @ slopes.T), 0) * noise_factor)
    period = np.pi / fit.series.mode_number
    for other in sized.others:
        moved = numbers - physical(other.point.p, fit.series.mode_number)[0]
        moved[[2, 4]] = (moved[[2, 4]] + period / 2) % period - period / 2
        stds = np.hypot(stds, moved)
    frequency = float(np.mean(fit.frequency_hz))
    own = [fit.std_at(fit.layout.frequency(k)) for k in range(len(fit.series.names))]
    spread = float(np.std(fit.point.offset_rad_s)) / np.sqrt(len(own))
    frequency_std = (
        max(float(np.sqrt(np.sum(np.square(own))) / len(own)), spread)
        / (2 * np.pi)
        * np.sqrt(noise_factor)
    )
    given = resonator.parameters() if resonator is not None else {}
    out = []
    for (name, units), value, std in zip(
        PARAMETERS, [frequency, *numbers], [frequency_std, *stds], strict=True
    ):
        row: dict[str, Any] = {
            "name": name,
            "value": float(value),
            "std": float(std),
            "units": units,
        }
        if name == "scale_factor" and _is_assumed(fit):
            row |= {"std": max(abs(float(value)), float(std)), "assumed": True}
        if name in given:
            believed, believed_std, _ = given[name]
            difference = float(value) - believed
            if name.endswith("axis_rad"):
                difference = float((difference + period / 2) % period - period / 2)
            sigma = float(np.hypot(std, believed_std if np.isfinite(believed_std) else 0.0))
            row |= {"believed": believed, "sigma": difference / sigma if sigma > 0 else 0.0}
            row["wrong"] = abs(row["sigma"]) > WRONG
        out.append(row)
    return out


def _is_assumed(fit: Fit) -> bool:
    """Whether the scale factor is what mode shapes of shells make it rather than what these runs
    show: no run turns, or all alike and by little."""
    freedom, column = fit.freedom.loose or fit.freedom, fit.layout.coordinate("scale_factor")
    prior = float(freedom.std[COORDINATES.index("scale_factor")])
    return prior > 0 and (column is None or fit.std_at(column) > TOLD * prior)


def _effect(one: Found, sized: Sized, by_name: dict[str, Variant]) -> dict[str, Any]:
    effect, fit = one.variant.effect, sized.fit
    active = fit.values(effect.name)
    score = _beside_the_others(one, fit, sized.factor)
    sentences = [effect.next_experiment] + [
        by_name[r].effect.next_experiment for r in one.rivals if r in by_name
    ]
    return {
        "name": effect.name,
        "z": score[0],
        "p_value": evidence.corrected(score[1], one.tried),
        "delta_bic": one.delta_bic,
        "parameters": {
            p.name: {
                "value": float(active[p.name]),
                "std": sized.std(
                    fit.parameter_std(effect.name, p.name),
                    active[p.name],
                    [other.values(effect.name)[p.name] for other in sized.others],
                ),
                "units": p.units,
            }
            for p in effect.fitted()
        },
        "held": {
            p.name: {"value": float(active[p.name]), "units": p.units}
            for p in effect.parameters
            if not p.fitted
        },
        "indistinguishable_from": list(one.rivals),
        "next_experiment": (
            "; ".join(dict.fromkeys(s for s in sentences if s))
            if one.rivals
            else effect.next_experiment
        ),
        "independence": one.score.independence,
    }


def _beside_the_others(one: Found, fit: Fit, noise_factor: float) -> tuple[float, float]:
    """z and p of an effect in the final fit, from its parameters' joint significance."""
    effect = one.variant.effect
    off, wald = fit.away(effect)
    bound = one.delta_bic + len(off) * float(np.log(len(fit.residual)))
    z, p = evidence.significance(min(wald / noise_factor, bound), max(1, one.score.rank))
    sign = np.sign(off[0]) if len(off) == 1 else 1.0
    return float(z * (sign or 1.0)), p


def _tested(
    search: Search, noise_factor: float, by_name: dict[str, Variant], candidates: Sequence[Variant]
) -> list[dict[str, Any]]:
    """Every candidate: score beside the base model, 95 % upper limit of its size beside what was
    found."""
    found = {one.variant.effect.name for one in search.found}
    last = {s.name: s for s in search.last}
    out = []
    for score in search.first:
        later = last.get(score.name, score)
        limit, units = _limit(later, noise_factor, by_name[score.name])
        if by_name[score.name].secants and score.name not in found:
            limit = _level_limit(
                search.final, noise_factor, [v for v in candidates if v.effect.name == score.name]
            )
        first = by_name[score.name].effect.fitted()[0]
        row = {
            "name": score.name,
            "z": (
                evidence.significance(score.gain / noise_factor, score.rank)[0]
                if score.visible
                else 0.0
            ),
            "upper_limit": None if score.name in found else limit,
            "units": units or first.units,
            "std": [
                float(s * np.sqrt(noise_factor)) if np.isfinite(s) else None for s in later.std
            ],
            "independence": score.independence,
            "visible": score.visible,
        }
        if not score.visible:
            same = by_name[score.name].effect.same_as_base
            row["why_not"] = (
                f"these runs cannot show it: it is {same}" if same else "these runs cannot show it"
            )
        out.append(row)
    return out


def _limit(score: Score, noise_factor: float, variant: Variant) -> tuple[float | None, str]:
    """Largest of the parameters' one-sided 95 % limits, in the unit of the parameter that has
    it."""
    if not score.visible:
        return None, ""
    names = list(variant.steps)
    units = {p.name: p.units for p in variant.effect.parameters}
    sizes = np.abs(score.estimate) + ONE_SIDED * score.std * np.sqrt(noise_factor)
    finite = [k for k in range(len(sizes)) if np.isfinite(sizes[k])]
    if not finite:
        return None, ""
    k = finite[0]
    same = [j for j in finite if units[names[j]] == units[names[k]]]
    return float(max(sizes[j] for j in same)), units[names[k]]


def _level_limit(fit: Fit, noise_factor: float, levels: Sequence[Variant]) -> float | None:
    """Least of the values tried at which the data exclude what sets in there, in its full strength;
    None where they exclude none.

    What sets in above a level has no small size that grows in proportion: a score at one level says
    which part of it is there.
    """
    (name,) = levels[0].secants
    for variant in sorted(levels, key=lambda v: v.steps[name]):
        S = fit.sensitivities([variant.wanted])[0]
        score = evidence.score(variant.effect.name, fit.residual, S, fit.basis)
        k = list(variant.steps).index(name)
        if (
            score.visible
            and score.estimate[k] + ONE_SIDED * score.std[k] * np.sqrt(noise_factor)
            < variant.steps[name]
        ):
            return variant.values[name] + variant.steps[name]
    return None


def _not_separable(search: Search, by_name: dict[str, Variant]) -> list[dict[str, Any]]:
    """What the runs cannot tell apart beside what was found: causes from the model, causes from one
    another; the run that would."""
    out: list[dict[str, Any]] = []
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
        if base and (score.name != "table_rate_error" or np.any(fit.series.rate_rad_s)):
            out.append(
                {
                    "effects": [score.name],
                    "base": base,
                    "next_experiment": variant.effect.next_experiment,
                }
            )
            hidden[score.name] = evidence.orthonormal(S[:, seen], 1e-6)
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
        if a.rank == b.rank and evidence.alike(a, b) > SAME
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


def _hidden_behind(fit: Fit, S: Array) -> str:
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


def _loop_gain(fit: Fit) -> tuple[float, float]:
    """Gain k of the logged command −k a_B of the forced runs, and its σ, 1/s."""
    from ...physics import ellipse

    good = (fit.series.weight > 0) & (fit.series.forced > 0)
    quadrature, command = (
        ellipse.wave(fit.series.envelope[good], 1)[1],
        fit.series.quadrature_drive[good],
    )
    power = float(quadrature @ quadrature)
    gain = -float(quadrature @ command) / power
    return gain, float(np.sqrt(np.mean((command + gain * quadrature) ** 2) / power))


def _correlations(search: Search) -> dict[str, Any]:
    visible = [s for s in search.first if s.visible]
    return {
        "names": [s.name for s in visible],
        "matrix": np.round(evidence.correlations(visible), 4).tolist(),
    }


def undescribed(description: str) -> dict[str, Any]:
    """A remainder of which there are words alone."""
    return {
        "description": description,
        "covariate": None,
        "harmonic": None,
        "formula": None,
        "terms": [],
    }


def describe(remainder: Remainder) -> dict[str, Any]:
    """The best open term in words and as a formula; further ones behind it."""
    if not remainder.terms:
        return undescribed("a residual that is neither white nor one of the terms looked for")
    rows = [_term(t) for t in remainder.terms]
    first = rows[0]
    return {
        "description": (
            f"{first['place']} that changes with {first['covariate']}"
            + (f", then {len(rows) - 1} smaller term(s)" if len(rows) > 1 else "")
        ),
        "covariate": first["covariate"],
        "harmonic": first["harmonic"],
        "formula": first["formula"],
        "terms": rows,
    }


def _term(term: Term) -> dict[str, Any]:
    size = term.size
    place, covariate = term.place, term.covariate
    return {
        "place": place.name,
        "covariate": covariate.name,
        "harmonic": covariate.harmonic or None,
        "formula": (
            f"{place.symbol} → {place.symbol} + {size:.4g} {place.units} · ({covariate.formula})"
        ),
        "size": size,
        "std": float(np.nanmax(np.where(np.isfinite(term.score.std), term.score.std, 0.0))),
        "units": place.units,
        "z": term.score.z,
    }
