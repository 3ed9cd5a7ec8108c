"""Whether the tables of a variant are those of the widest one, as far as both state their errors.

The checks of a variant ask what the data show beside it. Harmonics may take up what it leaves out,
where few rates tell them apart: then nothing is left to show, and the tables move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...fitting.checks import Check, check_at_most
from ...fitting.tables.table_layout import TableLayout
from ...fourier import build_harmonic_basis
from ..diagnosis.thresholds import OWN_SIGMA
from .choice import TriedVariant
from .record import compute_table_std

Array = np.ndarray
WIDEST = "combined"
ANGLES = 24


def hold_against_widest(layout: TableLayout, tried: Sequence[TriedVariant]) -> list[TriedVariant]:
    """Variants with the check that their tables are those of the widest one.

    Parameters
    ----------
    layout
        Of the tables.
    tried
        Variants of the same runs.

    Returns
    -------
    list of TriedVariant
        As they are where the widest is not among them or does not fit, or their coefficients come
        from elsewhere.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.wider_model import hold_against_widest
    >>> hold_against_widest(TableLayout(np.array([20.0]), "temperature", 2, 1, 0), [])
    []
    """
    widest = next((one for one in tried if one.name == WIDEST and one.fits), None)
    if widest is None:
        return list(tried)
    return [
        one if one is widest or one.tried.foreign else _with_check(layout, one, widest)
        for one in tried
    ]


def _with_check(layout: TableLayout, one: TriedVariant, widest: TriedVariant) -> TriedVariant:
    check = _compare(layout, one, widest)
    said = () if check.passed else (check.sentence,)
    return replace(one, checks=(*one.checks, check), failed=(*one.failed, *said))


def _compare(layout: TableLayout, one: TriedVariant, widest: TriedVariant) -> Check:
    """The rms over nodes and angles of how far the tables differ, in the larger of both errors."""
    angles = np.linspace(0, np.pi / layout.mode_number, ANGLES, endpoint=False)
    parts = zip(
        *(layout.split_tables(t.tried.solution.coefficients) for t in (one, widest)),
        (layout.drift_harmonics, layout.scale_harmonics),
        (0, layout.drift_size),
        strict=True,
    )
    apart = []
    for own, wide, limit, first in parts:
        basis = build_harmonic_basis(angles, limit, layout.mode_number)
        std = np.maximum(*(_table_std(layout, t, basis, first) for t in (one, widest)))
        step = (own - wide) @ basis.T / np.maximum(std, np.finfo(float).tiny)
        apart.append(float(np.sqrt(np.mean(step**2))))
    sentence = (
        f"the tables of model {one.name} differ from those of the wider model {WIDEST} by"
        f" {max(apart):.2g} times the error stated: harmonics may have taken up what it leaves out;"
        f" use --model {WIDEST} or auto"
    )
    return check_at_most("wider_model", max(apart), OWN_SIGMA, sentence)


def _table_std(layout: TableLayout, variant: TriedVariant, basis: Array, first: int) -> Array:
    """σ (nodes, angles) of the table whose coefficients stand there among those of a node."""
    tables = slice(layout.table_size)
    covariance = variant.tried.solution.covariance[tables, tables]
    return compute_table_std(basis, covariance, len(layout.nodes), first)
