"""The variants that were tried beside each other, one row each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...fitting.tables.joint import Fitted
from .choice import TriedVariant
from .figures import gather_cells, tabulate_model_figures

Array = np.ndarray


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
