"""Every variant of the drift model on the same runs and the same folds, held against each other:
which fits, which predicts best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...fitting.checks import Check
from ...fitting.tables.joint import Fitted
from ...fitting.tables.table_layout import Model, TableLayout
from .folds import choose_limits
from .guards import VariantSolution, judge_variants
from .resonators import ResonatorCoefficients
from .variant_solutions import (
    Wanted,
    add_doubt,
    find_widest_limits,
    score_held_out,
    solve_averaged,
    solve_foreign,
    solve_linear,
)
from .variants import NEEDS, VARIANTS, WHOLE_DRIFT, build_variant, explain_missing

Array = np.ndarray
AS_WELL = 4.0
"""Difference in χ² of data left out that tells nothing: what a few coefficients of the size of
their errors make."""


@dataclass(frozen=True)
class TriedVariant:
    """A variant tried: its solutions, the band limits used and stored, its checks, and χ² of the
    data left out."""

    name: str
    tried: VariantSolution
    limits: tuple[int, int]
    stored: tuple[int, int]
    checks: tuple[Check, ...]
    failed: tuple[str, ...]
    held_out_chi2: float

    @property
    def fits(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in self.checks)


def solve_variants(
    fitted: Fitted,
    folds: Array,
    names: Sequence[str],
    wanted: Wanted,
    coefficients: ResonatorCoefficients | None,
) -> list[TriedVariant]:
    """The named variants that these runs allow, solved and judged, in the order of the names."""
    limits: dict[str, tuple[int, int, dict[str, list[float]]]] = {}
    tries, used, stored = [], [], []
    for name in names:
        layout = fitted.layout
        # band limits are chosen once a family: with the measured parts beside the tables other
        # harmonics stand out than without them, and each choice is a fit of its own
        family = "combined" if name in NEEDS and "quadrature_course" in layout.factors else "table"
        if family not in limits:
            limits[family] = choose_limits(
                fitted, wanted.harmonics, wanted.scale_factor_harmonics, family
            )
        drift, scale = limits[family][:2]
        if name == "physical":
            drift, scale = 1, 0
        model = build_variant(
            name, layout, drift if name in WHOLE_DRIFT else 1, scale, coefficients
        )
        if name == "physical":
            assert coefficients is not None
            tries.append(solve_foreign(layout, model, coefficients, int(folds.max()) + 1))
        elif name in WHOLE_DRIFT and wanted.in_doubt:
            tries.append(solve_averaged(fitted, folds, model, wanted, (drift, scale)))
        else:
            tries.append(solve_linear(fitted, folds, model))
        own = (drift if name in WHOLE_DRIFT else 1, scale)
        used.append(own)
        stored.append(own if name == "physical" else find_widest_limits(layout, wanted, own))

    # all at one noise, that of the fit with everything free
    checks = judge_variants(fitted, folds, tries)
    return [
        TriedVariant(
            t.model.name,
            add_doubt(fitted, t, wanted, u),
            u,
            s,
            tuple(c),
            tuple(f),
            score_held_out(fitted, folds, t),
        )
        for t, u, s, (c, f) in zip(tries, used, stored, checks)
    ]


def solve_again(
    fitted: Fitted,
    folds: Array,
    answer: TriedVariant,
    model: Model,
    wanted: Wanted,
    penalty: Array | None = None,
) -> TriedVariant:
    """The answer solved anew with another model matrix or a penalty, and judged anew."""
    tried = solve_linear(fitted, folds, model, penalty)
    ((checks, failed),) = judge_variants(fitted, folds, [tried])
    return replace(
        answer,
        tried=add_doubt(fitted, tried, wanted, answer.limits),
        stored=answer.limits if answer.name in WHOLE_DRIFT else answer.stored,
        checks=tuple(checks),
        failed=tuple(failed),
        held_out_chi2=score_held_out(fitted, folds, tried),
    )


def choose_best(tried: Sequence[TriedVariant]) -> TriedVariant:
    """Of the variants that pass every check, the one that predicts data left out best; of all,
    where none passes.

    Of those that predict as well (within `AS_WELL` of χ²), the one with the fewest coefficients.
    """
    chosen = (
        [answer for answer in tried if answer.fits]
        or [answer for answer in tried if not answer.tried.foreign]
        or list(tried)
    )
    least = min(answer.held_out_chi2 for answer in chosen)
    return min(
        (a for a in chosen if a.held_out_chi2 <= least + AS_WELL),
        key=lambda a: (a.tried.model.free, a.held_out_chi2),
    )


def explain_choice(
    fitted: Fitted, tried: Sequence[TriedVariant], written: TriedVariant, not_tried: dict[str, str]
) -> dict[str, Any]:
    """Why a variant was chosen, for JSON and screen; where another was asked for, which `auto`
    would have taken."""
    rows = fitted.pieces.count
    words = ", ".join(f"{a.name} {a.held_out_chi2 / max(rows, 1):.4g}" for a in tried)
    fitting = [a.name for a in tried if a.fits]
    chosen = choose_best(tried)
    if chosen.fits:
        why = (
            f"{chosen.name} passes its checks and, of those that do ({', '.join(fitting)}),"
            " predicts data left out best, or as well with fewer coefficients"
        )
    else:
        why = f"no variant passes its checks; {chosen.name} predicts data left out best"
    if written.name != chosen.name:
        why = f"{written.name} is written as asked; --model auto: {why}"
    return {
        "model": chosen.name,
        "why": f"{why}; held-out χ² per row: {words}",
        "fitting": fitting,
        "not_tried": not_tried,
    }


def list_possible(
    layout: TableLayout, coefficients: ResonatorCoefficients | None, why_not_physical: str | None
) -> tuple[list[str], dict[str, str]]:
    """(variants these runs allow, the others with the reason)."""
    reasons = {name: explain_missing(name, layout, coefficients) for name in VARIANTS}
    if why_not_physical is not None:
        reasons["physical"] = why_not_physical
    return [n for n, r in reasons.items() if r is None], {
        n: r for n, r in reasons.items() if r is not None
    }
