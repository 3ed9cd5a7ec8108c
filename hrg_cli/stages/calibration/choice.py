"""Every variant of the drift model on the same runs and the same folds, held against each other:
which fits, which predicts best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...fitting.checks import Check
from ...fitting.tables.joint import Fitted, Model, TableLayout, TableSolution, chi_square, solve
from ...fitting.tables.shrinkage import (
    FEWER_SWEEPS,
    SWEEPS,
    Doubtful,
    average_over_doubt,
    doubtful_harmonics,
)
from .figures import cells, figure_rows
from .folds import choose_limits
from .guards import VariantSolution, judge_variants
from .resonators import ResonatorCoefficients
from .variants import NEEDS, VARIANTS, WHOLE_DRIFT, missing, tie_course, variant

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


@dataclass(frozen=True)
class Wanted:
    """What the user fixed: band limits (None: by data left out), and the seed of the average over
    harmonics in doubt."""

    harmonics: int | None
    scale_factor_harmonics: int | None
    seed: int
    average: bool = True
    """Whether harmonics in doubt are averaged over; a programme that gives no table has nothing to
    average."""

    @property
    def in_doubt(self) -> list[str]:
        """Tables whose band limit is open."""
        if not self.average:
            return []
        return [
            kind
            for kind, given in (("drift", self.harmonics), ("scale", self.scale_factor_harmonics))
            if given is None
        ]


def answers(
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
        family = "combined" if name in NEEDS and "quadrature_course" in layout.factors else "table"
        if family not in limits:
            limits[family] = choose_limits(
                fitted, wanted.harmonics, wanted.scale_factor_harmonics, family
            )
        drift, scale = limits[family][:2]
        if name == "physical":
            drift, scale = 1, 0
        model = variant(name, layout, drift if name in WHOLE_DRIFT else 1, scale, coefficients)
        if name == "physical":
            assert coefficients is not None
            tries.append(_foreign(layout, model, coefficients, int(folds.max()) + 1))
        elif name in WHOLE_DRIFT and wanted.in_doubt:
            tries.append(_average_doubtful(fitted, folds, model, wanted, (drift, scale)))
        else:
            tries.append(solve_linear(fitted, folds, model))
        own = (drift if name in WHOLE_DRIFT else 1, scale)
        used.append(own)
        stored.append(own if name == "physical" else widest_limits(layout, wanted, own))
    checks = judge_variants(fitted, folds, tries)
    return [
        TriedVariant(
            t.model.name,
            _with_doubt(fitted, t, wanted, u),
            u,
            s,
            tuple(c),
            tuple(f),
            held_out(fitted, folds, t),
        )
        for t, u, s, (c, f) in zip(tries, used, stored, checks)
    ]


def _with_doubt(
    fitted: Fitted, tried: VariantSolution, wanted: Wanted, limits: tuple[int, int]
) -> VariantSolution:
    """The solution of a model that holds the first harmonic alone, with the error that what it
    leaves out may make: no 0 ± 0.

    Of a constant drift, the error to which it was seen to be absent; of the harmonics in doubt
    beyond the model's own, what they may be as `average_over_doubt` tells, and what that does to the others.
    """
    layout = fitted.layout
    constant = layout.part("drift", 0)
    if tried.model.name in WHOLE_DRIFT:
        return tried
    if not tried.foreign:
        tried = _with_harmonics_in_doubt(fitted, tried, wanted, limits)
    A, b, _, _ = fitted.pieces.sum()
    beside = Model("", np.concatenate([tried.model.matrix, constant], axis=1), tried.model.start)
    places = np.flatnonzero(constant.any(axis=1))
    covariance = tried.solution.covariance.copy()
    covariance[np.ix_(places, places)] += solve(A, b, beside).covariance[np.ix_(places, places)]
    return replace(tried, solution=replace(tried.solution, covariance=covariance))


def _with_harmonics_in_doubt(
    fitted: Fitted, tried: VariantSolution, wanted: Wanted, limits: tuple[int, int]
) -> VariantSolution:
    """The solution with what harmonics c above the limits add to its error, E[(Gc)(Gc)ᵀ].

    Least squares without them gives C A P c too much, C its covariance, A the normal matrix, P
    their places, and lacks P c itself: G = C A P − P. E[c cᵀ] is that of c averaged over how large
    each may be, beside the model's own coefficients.
    """
    layout, model = fitted.layout, tried.model
    C, found = tried.solution.covariance, tried.solution.coefficients
    scale_factor = layout.mean_scale_factor(found)
    beyond = dict(zip(("drift", "scale"), limits))
    left_out = doubtful_harmonics(layout, wanted.in_doubt, scale_factor, beyond)
    if not left_out:
        return tried
    A, b, _, _ = fitted.pieces.sum()
    places = np.concatenate([harmonic.places.ravel() for harmonic in left_out])
    P = np.eye(layout.size)[:, places]
    both = np.concatenate([model.matrix, P], axis=1)
    number = {int(place): model.free + i for i, place in enumerate(places)}
    in_doubt = [
        replace(harmonic, places=np.vectorize(number.__getitem__)(harmonic.places))
        for harmonic in left_out
    ]
    rest = b if model.start is None else b - A @ model.start
    size = average_over_doubt(
        both.T @ A @ both, both.T @ rest, np.eye(both.shape[1]), in_doubt, wanted.seed, FEWER_SWEEPS
    )
    c, spread = size.coefficients[model.free :], size.covariance[model.free :, model.free :]
    G = C @ A @ P - P
    more = G @ (spread + np.outer(c, c)) @ G.T
    return replace(tried, solution=replace(tried.solution, covariance=C + more))


def widest_limits(layout: TableLayout, wanted: Wanted, limits: tuple[int, int]) -> tuple[int, int]:
    """Band limits of the tables that are stored: all harmonics where their number was left open."""
    return (
        layout.drift_harmonics if "drift" in wanted.in_doubt else limits[0],
        layout.scale_harmonics if "scale" in wanted.in_doubt else limits[1],
    )


def solve_linear(
    fitted: Fitted, folds: Array, model: Model, penalty: Array | None = None
) -> VariantSolution:
    """Least squares on all runs, and without each fold."""
    A, b, _, _ = fitted.pieces.sum()
    held = []
    for f in range(int(folds.max()) + 1):
        A_f, b_f, _, _ = fitted.pieces.sum(folds == f)
        held.append(solve(A - A_f, b - b_f, model, penalty))
    return VariantSolution(model, solve(A, b, model, penalty), tuple(held))


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
        tried=_with_doubt(fitted, tried, wanted, answer.limits),
        stored=answer.limits if answer.name in WHOLE_DRIFT else answer.stored,
        checks=tuple(checks),
        failed=tuple(failed),
        held_out_chi2=held_out(fitted, folds, tried),
    )


def _average_doubtful(
    fitted: Fitted, folds: Array, model: Model, wanted: Wanted, limits: tuple[int, int]
) -> VariantSolution:
    """The same with the harmonics in doubt averaged over how large each may be."""
    layout = fitted.layout
    A, b, _, _ = fitted.pieces.sum()
    first = solve(A, b, model)
    in_doubt = doubtful_harmonics(
        layout, wanted.in_doubt, layout.mean_scale_factor(first.coefficients)
    )
    stored = widest_limits(layout, wanted, limits)
    seen = variant("table", layout, *stored).matrix[: layout.table_size]
    to_full = np.eye(layout.size)[:, : layout.table_size]
    if model.name == "combined":
        measured = layout.of_factors("quadrature_course")
        to_full = np.concatenate(
            [tie_course(layout, "ellipticity_course") @ to_full, measured], axis=1
        )
        width = measured.shape[1]
        seen = np.block(
            [
                [seen, np.zeros((len(seen), width))],
                [np.zeros((width, seen.shape[1])), np.eye(width)],
            ]
        )

    def once(information: Array, vector: Array, sweeps: int) -> TableSolution:
        return _reduced(information, vector, to_full, seen, in_doubt, wanted.seed, sweeps)

    held = []
    for f in range(int(folds.max()) + 1):
        A_f, b_f, _, _ = fitted.pieces.sum(folds == f)
        held.append(once(A - A_f, b - b_f, FEWER_SWEEPS))
    return VariantSolution(model, once(A, b, SWEEPS), tuple(held))


def _reduced(
    A: Array,
    b: Array,
    to_full: Array,
    seen: Array,
    in_doubt: Sequence[Doubtful],
    seed: int,
    sweeps: int,
) -> TableSolution:
    found = average_over_doubt(to_full.T @ A @ to_full, to_full.T @ b, seen, in_doubt, seed, sweeps)
    return TableSolution(
        to_full @ found.coefficients, to_full @ found.covariance @ to_full.T, found.degrees
    )


def _foreign(
    layout: TableLayout, model: Model, coefficients: ResonatorCoefficients, folds: int
) -> VariantSolution:
    """The resonators' coefficients, with their covariance; nothing is fitted to the runs."""
    assert model.start is not None
    spread = coefficients.spread(layout)
    solution = TableSolution(model.start, spread @ coefficients.at_nodes(layout)[1] @ spread.T, 0.0)
    return VariantSolution(model, solution, (solution,) * folds, foreign=True)


def held_out(fitted: Fitted, folds: Array, tried: VariantSolution) -> float:
    """Σ over folds of the whitened residuals squared, each fold predicted without itself."""
    return sum(
        chi_square(*fitted.pieces.sum(folds == f)[:3], solution.coefficients)
        for f, solution in enumerate(tried.held)
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
    rows = fitted.pieces.sum()[3]
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
        why = f"{written.name} is written as asked, --model auto would take another: {why}"
    return {
        "model": chosen.name,
        "why": f"{why}; held-out χ² per row: {words}",
        "fitting": fitting,
        "not_tried": not_tried,
    }


def compare_variants(
    fitted: Fitted,
    folds: Array,
    tried: Sequence[TriedVariant],
    scale_factor: float,
    draws: int,
    seed: int,
) -> list[dict[str, Any]]:
    """One row a variant: held-out figures, coefficients, χ² of data left out, whether it fits and
    why not.

    For (12) the demand on the mean frequency in numbers: `mean_frequency_needed_hz` is the error of
    it that alone makes the drift figure of the first variant, δD = 4πr·δf.
    """
    whole = np.stack([a.tried.solution.coefficients for a in tried], axis=1)
    held = np.stack(
        [np.stack([s.coefficients for s in a.tried.held], axis=1) for a in tried], axis=1
    )
    rows = figure_rows(
        [a.name for a in tried], *cells(fitted, whole, held, folds), scale_factor, draws, seed
    )
    ratio = float(np.sqrt(np.mean(np.concatenate([p.ratio for p in fitted.paths]) ** 2)))
    count = fitted.pieces.sum()[3]
    for row, a in zip(rows, tried):
        row |= {
            "coefficients": a.tried.model.free,
            "held_out_chi2_per_row": a.held_out_chi2 / max(count, 1),
            "passed": a.fits,
            "why_not": list(a.failed),
        }
        if a.name == "phase":
            row["quadrature_ratio_rms"] = ratio
            target = rows[0]["drift"]["value"]
            row["mean_frequency_needed_hz"] = (
                target / (4 * np.pi * ratio) if ratio > 0 and target is not None else None
            )
    return rows


def list_possible(
    layout: TableLayout, coefficients: ResonatorCoefficients | None, why_not_physical: str | None
) -> tuple[list[str], dict[str, str]]:
    """(variants these runs allow, the others with the reason)."""
    reasons = {name: missing(name, layout, coefficients) for name in VARIANTS}
    if why_not_physical is not None:
        reasons["physical"] = why_not_physical
    return [n for n, r in reasons.items() if r is None], {
        n: r for n, r in reasons.items() if r is not None
    }
