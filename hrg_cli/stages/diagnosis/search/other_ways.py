"""Diagnosis between the runs, the ways of one cause: what ages from the programme's first run on
does in the rows of the runs what ages from every run's own start on does, and to their frequencies
something else."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ....effects.effect import INSTANT, RUN
from ....fitting.causes import extended_fit, fit_point
from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.refits import hold_unseen
from ..fits.variants import Variant
from ..thresholds import WORTH
from .inquiry import NoiseLevel
from .offsets import read_offsets
from .selection import Found


def choose_ways(
    fit: ExtendedFit, found: Sequence[Found], candidates: Sequence[Variant], noise: NoiseLevel
) -> tuple[ExtendedFit, tuple[Found, ...]]:
    """The fit with each cause in that of its ways which brings the runs' frequencies together,
    where the rows of the runs fit it no worse.

    Parameters
    ----------
    fit
        With the causes.
    found
        The causes.
    candidates
        Ways in which causes may stand.
    noise
        That χ² is judged by.

    Returns
    -------
    tuple
        The fit and the causes.

    Examples
    --------
    A gain mismatch stands in one way alone:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.other_ways import choose_ways
    >>> case = draw_found_case()
    >>> fit, search = case.search.final, case.search
    >>> choose_ways(fit, search.found, case.inquiry.candidates, case.inquiry.noise)[0] is fit
    True
    """
    out = []
    for cause in found:
        for other in _list_other_ways(fit, cause, candidates):
            trial = _fit_way(fit, other)
            if trial is None:
                continue
            if _measure_apart(trial, noise) < _measure_apart(fit, noise) - WORTH:
                fit, cause = trial, replace(cause, variant=hold_unseen(other, trial))
        out.append(cause)
    return fit, tuple(out)


def _list_other_ways(
    fit: ExtendedFit, cause: Found, candidates: Sequence[Variant]
) -> Iterator[Variant]:
    """The cause as it is fitted, in ways that differ in what no fit moves; what happens in one run
    or at one instant does so in one way."""
    values = fit.values(cause.name)
    if RUN in values or INSTANT in values:
        return
    for other in candidates:
        if other.effect.name != cause.name or other.secants or other.anywhere:
            continue
        # by the catalogue: what the fit holds besides, since its rows do not show it, is no way
        held = [p.name for p in other.effect.parameters if not p.fitted]
        asked = {name: other.values[name] for name in held}
        if any(asked[name] != values[name] for name in held):
            yield replace(other, effect=fit.effect(cause.name), values={**values, **asked})


def _fit_way(fit: ExtendedFit, way: Variant) -> ExtendedFit | None:
    """The fit with a cause in another way, begun where what both do to the frequencies differs;
    None where there is none."""
    fitted = [p.name for p in way.effect.fitted() if p.name in way.steps]
    steps = {n: way.steps[n] for n in fitted}
    ours, others = fit.find_sensitivities(
        [(way.effect, fit.values(way.effect.name), steps), (way.effect, way.values, steps)]
    )
    size = np.array([way.values[n] for n in fitted])
    moved = fit.covariance @ fit.design.multiply_transposed(others - ours) @ size
    index = [fit.layout.frequency(k) for k in range(len(fit.series.names))]
    point = replace(fit.point, offset_rad_s=fit.point.offset_rad_s - moved[index])
    point = fit_point.add_effect(point, way.effect, way.values)
    with contextlib.suppress(extended_fit.DivergedError, np.linalg.LinAlgError):
        return extended_fit.fit(fit.series, point, fit.freedom)
    return None


def _measure_apart(fit: ExtendedFit, noise: NoiseLevel) -> float:
    """χ² of the rows, and that of the runs' frequencies about one."""
    return fit.chi2 / noise.slow + read_offsets(fit, noise)[0].compute_misfit(0.0)[0]
