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
    step = one.tried.solution.coefficients - widest.tried.solution.coefficients
    apart = []
    for rows in _list_rows(layout):
        variances = [
            np.sum((rows @ t.tried.solution.covariance) * rows, axis=1) for t in (one, widest)
        ]
        square = (rows @ step) ** 2 / np.maximum(np.maximum(*variances), np.finfo(float).tiny)
        apart.append(float(np.sqrt(np.mean(square))))
    sentence = (
        f"the tables of model {one.name} differ from those of the wider model {WIDEST} by"
        f" {max(apart):.2g} times the error stated: harmonics may have taken up what it leaves out;"
        f" use --model {WIDEST} or auto"
    )
    return check_at_most("wider_model", max(apart), OWN_SIGMA, sentence)


def _list_rows(layout: TableLayout) -> list[Array]:
    """Derivatives of D and of K (nodes · angles, size) at the nodes by all coefficients."""
    angles = np.linspace(0, np.pi / layout.mode_number, ANGLES, endpoint=False)
    places = np.arange(layout.size)
    out = []
    for limit, part in (
        (layout.drift_harmonics, layout.drift),
        (layout.scale_harmonics, layout.scale),
    ):
        basis = build_harmonic_basis(angles, limit, layout.mode_number)
        rows = np.zeros((len(layout.nodes), ANGLES, layout.size))
        for j in range(len(layout.nodes)):
            rows[j][:, places[part(j)]] = basis
        out.append(rows.reshape(-1, layout.size))
    return out
