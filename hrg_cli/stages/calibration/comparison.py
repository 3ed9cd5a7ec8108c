"""The variants that were tried beside each other, one row each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...fitting.tables.joint import Fitted
from .choice import TriedVariant
from .residual_errors import gather_cells, tabulate_model_figures

Array = np.ndarray


def compare_variants(
    fitted: Fitted,
    folds: Array,
    tried: Sequence[TriedVariant],
    scale_factor: float,
    draws: int,
    seed: int,
) -> list[dict[str, Any]]:
    """The variants that were tried beside each other.

    For (12) the demand on the mean frequency in numbers: `mean_frequency_needed_hz` is the error of
    it that alone makes the drift figure of the first variant, δD = 4πr·δf.

    Parameters
    ----------
    fitted
        The runs.
    folds
        Fold of each piece (R, S), from 0.
    tried
        The variants.
    scale_factor
        K₀, of which the scale-factor error is a part.
    draws
        Of the bootstrap over runs.
    seed
        Of its random numbers.

    Returns
    -------
    list of dict
        Held-out figures, coefficients, χ² of data left out per row, whether it fits and why not.

    Examples
    --------
    >>> from hrg_cli.stages.calibration.choice import solve_variants
    >>> from hrg_cli.stages.calibration.variant_solutions import Wanted
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.comparison import compare_variants
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> tried = solve_variants(fitted, folds, ["table", "parametric"], Wanted(1, 0, seed=0), None)
    >>> rows = compare_variants(fitted, folds, tried, 0.55, 99, 0)
    >>> [(row["stage"], row["coefficients"], row["passed"]) for row in rows]
    [('table', 4, True), ('parametric', 3, True)]
    """
    whole = np.stack([a.tried.solution.coefficients for a in tried], axis=1)
    held = np.stack(
        [np.stack([s.coefficients for s in a.tried.held], axis=1) for a in tried], axis=1
    )
    rows = tabulate_model_figures(
        [a.name for a in tried],
        *gather_cells(fitted, whole, held, folds),
        scale_factor,
        draws,
        seed,
    )
    ratio = float(np.sqrt(np.mean(np.concatenate([p.ratio for p in fitted.paths]) ** 2)))
    count = fitted.pieces.count
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
