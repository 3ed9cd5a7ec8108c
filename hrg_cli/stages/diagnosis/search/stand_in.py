"""Diagnosis, whether any other cause could stand in the place of one without which the misfit would
be gross: asked of the linear model first, since a fit without it takes long to find out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....fitting.causes import designs
from ....fitting.causes.designs import Basis, Design
from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.refits import HOPELESS
from ..fits.scoring import is_gross
from ..fits.variants import Variant
from ..thresholds import GROSS, NEARLY_ALL


def is_beyond_question(fit: ExtendedFit, name: str) -> bool:
    """Whether an active effect takes a gross misfit away from driven runs; free ones are fitted
    without it soon enough.

    Parameters
    ----------
    fit
        With the effect.
    name
        Of the effect.

    Returns
    -------
    bool
        Of driven runs alone.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.stand_in import is_beyond_question
    >>> is_beyond_question(draw_found_case().search.final, "gain_mismatch")
    False
    """
    return _driven(fit) and fit.measure_distance(fit.effect(name))[1] > GROSS * fit.dof


def takes_nearly_all(before: ExtendedFit, after: ExtendedFit) -> bool:
    """Whether one cause more takes nearly all of a gross misfit: it is then not given up for open
    terms, which follow whatever it leaves over and could take as much only one for each run.

    Parameters
    ----------
    before
        The fit without the cause.
    after
        With it.

    Returns
    -------
    bool
        False where the misfit was not gross.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.stand_in import takes_nearly_all
    >>> takes_nearly_all(draw_mismatched_fit(), draw_found_case().search.final)
    False
    """
    return is_gross(before) and after.chi2 < before.chi2 / NEARLY_ALL


def _driven(fit: ExtendedFit) -> bool:
    return bool(fit.series.forced.any())


def has_none(fit: ExtendedFit, name: str, candidates: Sequence[Variant]) -> bool:
    """Whether an active effect is beyond question and nothing of the catalogue comes near what it
    takes away.

    Parameters
    ----------
    fit
        With the effect.
    name
        Of the effect.
    candidates
        Ways in which causes may stand.

    Returns
    -------
    bool
        It stays unasked.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.stand_in import has_none
    >>> case = draw_found_case()
    >>> has_none(case.search.final, "gain_mismatch", case.inquiry.candidates)
    False
    """
    if not is_beyond_question(fit, name):
        return False
    size, _ = fit.measure_distance(fit.effect(name))
    columns = np.arange(fit.layout.count)[fit.layout.effect(name)]
    beside = _orthonormalise_without(fit.design, columns)
    own = fit.design.shared[:, np.isin(fit.design.places, columns)]
    done = beside.project_out(own @ size)
    active = {one.name for one, _ in fit.point.active}
    others = [
        one.wanted for one in candidates if one.effect.name not in active and not one.anywhere
    ]
    for sensitivity in fit.find_sensitivities(others):
        Q = designs.orthonormalise(beside.project_out(sensitivity))
        left = done - Q @ (Q.T @ done)
        if float(left @ left) < HOPELESS * fit.chi2:
            return False
    return True


def _orthonormalise_without(design: Design, columns: np.ndarray) -> Basis:
    """Orthonormal basis of a design without some of its shared columns."""
    kept = ~np.isin(design.places, columns)
    rest = np.flatnonzero(~np.isin(np.arange(design.shape[1]), columns))
    renumbered = tuple(
        (rows, slice(*(np.searchsorted(rest, (at.start, at.stop)))), values)
        for rows, at, values in design.own
    )
    less = replace(
        design,
        shared=design.shared[:, kept],
        places=np.searchsorted(rest, design.places[kept]),
        own=renumbered,
    )
    return designs.factor_design(less).basis
