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
from .drift_models import NEEDS, VARIANTS, WHOLE_DRIFT, build_variant, explain_missing
from .folds import choose_limits
from .frequency_split import find_in_frequency
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
    """Variants solved on the same runs and folds, and judged at one noise.

    Parameters
    ----------
    fitted
        The runs with everything free, whose noise it is.
    folds
        Fold of each piece (R, S), from 0.
    names
        Of variants that the runs allow.
    wanted
        What was fixed.
    coefficients
        Of the resonators, for "physical".

    Returns
    -------
    list of TriedVariant
        In the order of the names.

    Examples
    --------
    Runs without a constant drift pass with seed A (10) too:

    >>> from hrg_cli.stages.calibration.variant_solutions import Wanted
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.choice import solve_variants
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> tried = solve_variants(fitted, folds, ["table", "parametric"], Wanted(1, 0, seed=0), None)
    >>> [(answer.name, answer.fits) for answer in tried]
    [('table', True), ('parametric', True)]
    """
    limits: dict[str, tuple[int, int, dict[str, list[float]]]] = {}
    tries, used, stored = [], [], []
    in_frequency = find_in_frequency(fitted) if wanted.average else {}
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
        else:
            tries.append(solve_averaged(fitted, folds, model, wanted, (drift, scale), in_frequency))
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
    """An answer solved anew with another model or a penalty, and judged anew.

    Parameters
    ----------
    fitted
        The runs.
    folds
        Fold of each piece (R, S), from 0.
    answer
        That was chosen.
    model
        What of the coefficients is free now.
    wanted
        What was fixed.
    penalty
        (size, size), added to the information; None: none.

    Returns
    -------
    TriedVariant
        Of the same name.

    Examples
    --------
    >>> from hrg_cli.stages.calibration.choice import solve_variants
    >>> from hrg_cli.stages.calibration.variant_solutions import Wanted
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.choice import solve_again
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> wanted = Wanted(1, 0, seed=0)
    >>> (answer,) = solve_variants(fitted, folds, ["table"], wanted, None)
    >>> less = solve_again(
    ...     fitted, folds, answer, Model("table", np.eye(layout.size)[:, [0, 3]]), wanted
    ... )
    >>> answer.tried.model.free, less.tried.model.free, less.fits
    (4, 2, True)
    """
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
    """The variant that predicts data left out best, of those that pass every check.

    Of variants that predict as well, within 4 of χ², the one with the fewest coefficients.

    Parameters
    ----------
    tried
        At least one.

    Returns
    -------
    TriedVariant
        Where none passes, the best of those that were fitted to these runs.

    Examples
    --------
    Two coefficients fewer that cost 3 of χ² are taken; one that fails is not, however well it
    predicts:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.calibration.choice import choose_best
    >>> def tell(name, free, chi2, fits=True):
    ...     tried = Told(model=Told(free=free), foreign=False)
    ...     return Told(name=name, held_out_chi2=chi2, tried=tried, fits=fits)
    >>> tried = [
    ...     tell("table", 8, 1000.0),
    ...     tell("parametric", 6, 1003.0),
    ...     tell("phase", 5, 900.0, False),
    ... ]
    >>> choose_best(tried).name, choose_best(tried[2:]).name
    ('parametric', 'phase')
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
    """Why a variant was chosen, for JSON and screen.

    Parameters
    ----------
    fitted
        The runs, of which the number of rows counts.
    tried
        All variants.
    written
        The one whose tables are written.
    not_tried
        Name -> why it could not be tried.

    Returns
    -------
    dict
        Its name, why, which variants fit, and which were not tried; where another one was asked
        for, which `auto` would have taken.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.calibration.choice import explain_choice
    >>> solved = Told(model=Told(free=8), foreign=False)
    >>> table = Told(name="table", held_out_chi2=1000.0, tried=solved, fits=False)
    >>> fitted = Told(pieces=Told(count=1000))
    >>> explain_choice(fitted, [table], table, {})["why"]
    'no variant passes its checks; table predicts data left out best; held-out χ² per row: table 1'
    """
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
    """The variants that runs allow, and the others with the reason.

    Parameters
    ----------
    layout
        Of the tables, with the factors that the runs can carry.
    coefficients
        Of the resonators; None: none were given, or they cannot be used.
    why_not_physical
        Why the resonators' coefficients cannot be used; None: they can, or there are none.

    Returns
    -------
    tuple
        Names of those that can be tried, and name -> why not.

    Examples
    --------
    Runs without a quadrature leave the two models of the tables alone:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.choice import list_possible
    >>> list_possible(TableLayout(np.array([20.0]), "temperature", 2, 1, 0), None, None)[0]
    ['table', 'parametric']
    """
    reasons = {name: explain_missing(name, layout, coefficients) for name in VARIANTS}
    if why_not_physical is not None:
        reasons["physical"] = why_not_physical
    return [n for n, r in reasons.items() if r is None], {
        n: r for n, r in reasons.items() if r is not None
    }
