"""Diagnosis, the JSON: verdict, values, effects with rivals and next experiments, gain, upper
limits, remainder."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....fitting.causes import evidence
from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Resonator
from ..closing.loop_delay import estimate_moves_of_delay
from ..closing.sized import Sized
from ..closing.summed import estimate_moves_of_summed
from ..closing.unnamed import estimate_moves_of_unnamed
from ..fits.variants import Variant
from ..search.gain import Gain, list_gain_figures, measure_left
from ..search.remainder import Remainder, Term
from ..search.search_case import Case
from ..search.selection import Found, Search
from ..search.separability import list_not_separable
from .base_values import list_base_values
from .tested import test_candidates


def report(
    verdict: str,
    case: Case,
    sized: Sized,
    gain: Gain,
    resonator: Resonator | None,
    untouched: ExtendedFit,
) -> dict[str, Any]:
    """What the contract names of a case and the steps that led there.

    Parameters
    ----------
    verdict
        The word.
    case
        The causes and what they leave over.
    sized
        The final fit with what widens its σ.
    gain
        On data left out.
    resonator
        The user's; None: there is none.
    untouched
        The base fit before tones and steps were taken out.

    Returns
    -------
    dict
        As JSON has it.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.sized import Sized
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_fit
    >>> from hrg_cli.stages.diagnosis.report.report import report
    >>> from hrg_cli.stages.diagnosis.search.gain import predict_held_out
    >>> gain = predict_held_out(draw_fit(), draw_fit())
    >>> told = report("adequate", draw_case(), Sized.from_case(draw_case()), gain, None, draw_fit())
    >>> told["verdict"], told["mode_number"], told["effects"]
    ('adequate', 2, [])
    """
    search = case.search
    by_name = {v.effect.name: v for v in case.inquiry.candidates}
    of_summed = estimate_moves_of_summed(case) | estimate_moves_of_delay(search.final)
    return {
        "verdict": verdict,
        "mode_number": search.final.series.mode_number,
        "baseline": _figures(untouched),
        "values": list_base_values(
            sized,
            resonator,
            of_summed,
            {
                k: moves
                for k, moves in estimate_moves_of_unnamed(case).items()
                if k not in of_summed
            },
        ),
        "effects": [_effect(one, sized, by_name) for one in search.found],
        "after": _figures(search.final),
        "gain": list_gain_figures(gain),
        "tested": test_candidates(case),
        "not_separable": list_not_separable(case),
        "noise_factor": case.inquiry.noise.slow,
        "correlations": _correlations(search),
        "remainder": None if case.remainder is None else describe(case.remainder),
        "extended_model": None,
    }


def _figures(fit: ExtendedFit) -> dict[str, float]:
    """χ² per degree of freedom and the residual's rms in the signals' unit."""
    return {"chi2_per_dof": fit.chi2 / fit.dof, "residual_rms": measure_left(fit)}


def _effect(one: Found, sized: Sized, by_name: Mapping[str, Variant]) -> dict[str, Any]:
    effect, fit = one.variant.effect, sized.fit
    active = fit.values(effect.name)
    higher = [p for p in effect.parameters if p.higher_order and fit.frees(effect.name, p.name)]
    score = _test_beside_others(one, fit, sized.factor)
    stds = {name: std for name, (_, std) in (one.sizes or {}).items()}
    sentences = [effect.next_experiment] + [
        by_name[r].effect.next_experiment for r in one.rivals if r in by_name
    ]
    return {
        "name": effect.name,
        "z": score[0],
        "p_value": evidence.correct_for_tries(score[1], one.tried),
        "delta_bic": one.delta_bic,
        "parameters": {
            p.name: {
                "value": float(active[p.name]),
                "std": stds[p.name]
                if p.name in stds
                else sized.std(
                    fit.parameter_std(effect.name, p.name),
                    active[p.name],
                    [other.values(effect.name)[p.name] for other in sized.find_others(effect.name)],
                ),
                "units": p.units,
            }
            for p in effect.parameters
            if p.fitted or p in higher
        },
        "held": {
            p.name: {"value": float(active[p.name]), "units": p.units}
            for p in effect.parameters
            if not (p.fitted or p.higher_order)
        },
        "indistinguishable_from": list(one.rivals),
        "next_experiment": (
            "; ".join(dict.fromkeys(s for s in sentences if s))
            if one.rivals
            else effect.next_experiment
        ),
        "independence": one.score.independence,
    }


def _test_beside_others(one: Found, fit: ExtendedFit, inflation: float) -> tuple[float, float]:
    """z and p of an effect in the final fit, from its parameters' joint significance."""
    effect = one.variant.effect
    if one.sizes is not None:
        return evidence.find_significance(one.delta_bic, max(1, one.score.rank))
    off, wald = fit.measure_distance(effect)
    bound = one.delta_bic + len(off) * float(np.log(len(fit.residual)))
    z, p = evidence.find_significance(min(wald / inflation, bound), max(1, one.score.rank))
    sign = np.sign(off[0]) if len(off) == 1 else 1.0
    return float(z * (sign or 1.0)), p


def _correlations(search: Search) -> dict[str, Any]:
    visible = [s for s in search.first if s.visible]
    return {
        "names": [s.name for s in visible],
        "matrix": np.round(evidence.correlate_all_spaces(visible), 4).tolist(),
    }


def describe_in_words(description: str) -> dict[str, Any]:
    """A remainder of which there are words alone.

    Parameters
    ----------
    description
        A sentence.

    Returns
    -------
    dict
        As JSON has it.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.report.report import describe_in_words
    >>> describe_in_words("the residual is not white")["covariate"] is None
    True
    """
    return {
        "description": description,
        "covariate": None,
        "harmonic": None,
        "formula": None,
        "terms": [],
    }


def describe(remainder: Remainder) -> dict[str, Any]:
    """The best open term in words and as a formula; further ones behind it.

    Parameters
    ----------
    remainder
        What the causes leave over.

    Returns
    -------
    dict
        `remainder` of the report.

    Examples
    --------
    >>> from types import SimpleNamespace as Remainder
    >>> from hrg_cli.stages.diagnosis.report.report import describe
    >>> describe(Remainder(terms=[]))["description"]
    'a residual that is neither white nor one of the terms looked for'
    """
    if not remainder.terms:
        return describe_in_words("a residual that is neither white nor one of the terms looked for")
    rows = [_term(t) for t in remainder.terms]
    first, series = rows[0], remainder.fit.series
    number = remainder.terms[0].find_run_apart()
    apart = (
        ""
        if number is None
        else f", most in run {series.names[list(series.numbers).index(number)]}"
    )
    return {
        "description": (
            f"{first['place']} that changes with {first['covariate']}{apart}"
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
